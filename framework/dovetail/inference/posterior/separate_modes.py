"""Separate modes of a posterior, by the Gaussian about each."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dovetail.inference.posterior.randomize_then_optimize import LinearisedPoints

_LEAST_MASS = 1e-3
"""Probability about a mode, over the largest about any, below which it is left out."""
_APART = 3.0
"""Standard deviations from which two modes are separate."""


def separate_modes(modes: LinearisedPoints) -> LinearisedPoints:
    """Return the modes that are not within one another's Gaussians, except those of hardly any probability."""
    precision = modes.jacobian @ modes.jacobian.transpose(0, 2, 1)
    log_mass = modes.log_posterior - np.linalg.slogdet(precision)[1] / 2.0
    kept: list[int] = []
    for number in np.argsort(-log_mass).tolist():
        likely = log_mass[number] > log_mass.max() + np.log(_LEAST_MASS)
        others = modes.at_rows(np.array(kept, dtype=np.intp))
        if likely and (_distances(others, modes.z[[number]]) > _APART**2).all():
            kept.append(number)
    return modes.at_rows(np.array(kept, dtype=np.intp))


def _distances(modes: LinearisedPoints, z: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the squared distances (n, n_modes) of points from modes, in standard deviations of each."""
    moved = np.einsum("pkd,kdm->pkm", z[:, np.newaxis] - modes.z, modes.jacobian)
    return np.asarray(np.einsum("pkm,pkm->pk", moved, moved))


def nearest_modes(modes: LinearisedPoints, z: NDArray[np.float64]) -> NDArray[np.intp]:
    """Return the numbers (n,) of the modes to which points are nearest."""
    return np.asarray(np.argmin(_distances(modes, z), axis=1))
