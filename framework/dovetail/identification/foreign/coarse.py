"""How near an assembly comes to a measurement with any joint at all: rough, and quick."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from dovetail.assembly import Assembly
from dovetail.frf import Frf
from dovetail.identification.fitting.variance import estimated_variance, known_variance

__all__ = ["distance", "furthest", "samples"]

_SAMPLES = 64
_CLEAR = 4.0
"""Standard deviations of noise above which an amplitude is compared."""
_MOST = 1.0
"""Difference of logarithms that counts as much as any larger one, as beside a resonance that is elsewhere."""


def samples(assembly: Assembly) -> NDArray[np.float64]:
    """Return FRFs (n, n_freq) of joints from all over the ranges."""
    points = qmc.LatinHypercube(len(assembly.parameters), rng=np.random.default_rng(0)).random(_SAMPLES)
    return np.asarray(np.abs(assembly.frf(assembly.from_unit(points))))


def distance(assembly: Assembly, target: Frf) -> float:
    """Return the mean difference of logarithms of the amplitudes, where they are clear, for the nearest joint tried."""
    known = known_variance(target)
    variance = estimated_variance(target) if known is None else known
    clear = target.amplitude > _CLEAR * np.sqrt(variance)
    if not clear.any():
        return _MOST
    apart = np.minimum(np.abs(np.log(samples(assembly)[:, clear]) - np.log(target.amplitude[clear])), _MOST)
    return float(apart.mean(axis=1).min())


def furthest(assembly: Assembly) -> float:
    """Return the distance of the joint, of those tried, that is the furthest from all others."""
    logarithms = np.log(samples(assembly))
    apart = [
        np.sort(np.minimum(np.abs(logarithms - one), _MOST).mean(axis=1))[1]  # the nearest is the joint itself
        for one in logarithms
    ]
    return float(max(apart))
