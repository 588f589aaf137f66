"""Comparison of an assembly's FRFs with stored ones, to notice that the code of a plugin has changed."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dovetail.assembly.model import Assembly

FRF_TOLERANCE = 1e-6
"""Relative difference up to which amplitudes are the same; they are stored in single precision."""

_FLOOR = 1e-3
"""Fraction of an FRF's median amplitude. Smaller amplitudes, in antiresonances, are compared relative to it."""


def largest_frf_difference(assembly: Assembly, theta: NDArray[np.float64], amplitude: ArrayLike) -> float:
    """Return the largest relative difference between an assembly's FRFs and stored ones.

    Parameters
    ----------
    assembly : Assembly
    theta : (n, n_params) array
        SI.
    amplitude : (n, n_responses n_freq) array
        Stored amplitude of the accelerance for each vector of `theta`, in m/(N s^2).

    Returns
    -------
    float
        Over all lines, relative to the stored amplitude; infinite if any amplitude is not finite.
    """
    stored = np.asarray(amplitude, dtype=np.float64)
    if not len(stored):
        return 0.0
    difference = np.abs(assembly.accelerance_amplitude(theta) - stored)
    scale = np.maximum(stored, _FLOOR * np.median(stored, axis=1, keepdims=True))
    relative = difference / np.maximum(scale, np.finfo(np.float64).tiny)
    return float(np.max(relative)) if np.isfinite(relative).all() else float("inf")
