"""A resonance that nearly every joint has and the measurement has not."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d
from scipy.signal import find_peaks

from dovetail.assembly import Assembly
from dovetail.frf import Frf
from dovetail.identification.fitting.variance import estimated_variance, known_variance
from dovetail.identification.foreign.coarse import samples

__all__ = ["missing_resonance"]

_SMOOTHED = 9
"""Lines over which a measured amplitude is averaged, so that noise makes no resonance."""
_FAINT, _CLEAR = 1.0, 3.0
"""Decibels by which a resonance of a joint stands out at least, and one of the measurement."""
_ABOVE_NOISE = 4.0
"""Standard deviations of the noise that a measured resonance is at least high."""
_MIDDLE = (0.05, 0.95)
"""Quantiles of the joints between which a resonance lies."""
_BESIDE = 0.05
"""Part of a frequency by which it may lie beside that."""


def missing_resonance(assembly: Assembly, target: Frf) -> tuple[float, float] | None:
    """Return between which frequencies [Hz] the one resonance lies that a measurement lacks.

    Parameters
    ----------
    assembly : Assembly
    target : Frf
        In the quantity of the assembly's response, on its frequencies.

    Returns
    -------
    (float, float) or None
        None if it lacks none or several, or if the joints have no more than one in common.
    """
    found = _measured(target)
    ranges = _ranges([target.frequency[_peaks(one, _FAINT)] for one in 20.0 * np.log10(samples(assembly))])
    absent = [(low, high) for low, high in ranges if not np.any((found > low) & (found < high))]
    return absent[0] if len(absent) == 1 < len(ranges) else None


def _measured(target: Frf) -> NDArray[np.float64]:
    """Return the frequencies of the resonances that are clear in a measurement."""
    known = known_variance(target)
    noise = float(np.sqrt(np.median(estimated_variance(target) if known is None else known)))
    smooth = uniform_filter1d(target.amplitude, _SMOOTHED, mode="nearest")
    floor = np.maximum(smooth, max(_ABOVE_NOISE * noise, np.finfo(float).tiny))
    return target.frequency[_peaks(20.0 * np.log10(floor), _CLEAR)]


def _peaks(decibels: NDArray[np.float64], prominence: float) -> NDArray[np.intp]:
    return np.asarray(find_peaks(decibels, prominence=prominence)[0])


def _ranges(of_joints: list[NDArray[np.float64]]) -> list[tuple[float, float]]:
    """Return between which frequencies the first, second, ... resonance of the joints lies, as far as all have one."""
    common = min(len(one) for one in of_joints)
    ordered = np.array([one[:common] for one in of_joints]).reshape(len(of_joints), common)
    lowest, highest = np.quantile(ordered, _MIDDLE, axis=0)
    return list(zip((lowest * (1.0 - _BESIDE)).tolist(), (highest * (1.0 + _BESIDE)).tolist(), strict=True))
