"""Separate modes of a posterior, by the Gaussian about each."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dovetail.inference.fitting.searches import distinct
from dovetail.inference.posterior.randomize_then_optimize import LinearisedPoints

_LEAST_MASS = 1e-3
"""Probability about a mode, over the largest about any, below which it is left out."""
_APART = 3.0
"""Standard deviations from which two modes are separate."""


def separate_modes(modes: LinearisedPoints) -> LinearisedPoints:
    """Return the modes that are not within one another's Gaussians, except those of hardly any probability."""
    precision = modes.jacobian @ modes.jacobian.transpose(0, 2, 1)
    log_mass = modes.log_posterior - np.linalg.slogdet(precision)[1] / 2.0
    likely = log_mass > log_mass.max(initial=-np.inf) + np.log(_LEAST_MASS)
    order = [number for number in np.argsort(-log_mass).tolist() if likely[number]]
    return modes.at_rows(np.array(distinct(modes.z, precision, order, _APART), dtype=np.intp))


def nearest_modes(modes: LinearisedPoints, z: NDArray[np.float64]) -> NDArray[np.intp]:
    """Return the numbers (n,) of the modes to which points (n, p) are nearest, in standard deviations of each."""
    if len(modes.z) == 1:
        return np.zeros(len(z), dtype=np.intp)
    moved = np.einsum("pkd,kdm->pkm", z[:, np.newaxis] - modes.z, modes.jacobian)
    return np.asarray(np.argmin(np.einsum("pkm,pkm->pk", moved, moved), axis=1))
