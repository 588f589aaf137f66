"""Whether an assembly still gives the FRFs that it gave before: a plugin's code may have changed since."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dovetail.assembly.assembly import Assembly

__all__ = ["SAME", "largest_difference"]

SAME = 1e-6
"""Relative difference up to which amplitudes, kept in single precision, count as the same."""

_FLOOR = 1e-3
"""Part of an FRF's median amplitude below which differences are told by that amplitude: rounding in antiresonances."""


def largest_difference(assembly: Assembly, theta: NDArray[np.float64], amplitude: ArrayLike) -> float:
    """Return by how much an assembly's FRFs differ from those that were kept.

    Parameters
    ----------
    assembly : Assembly
    theta : (n, n_params) array
        SI.
    amplitude : (n, n_responses n_freq) array
        Of the accelerance for each of `theta`, as it was computed before, in m/(N s^2).

    Returns
    -------
    float
        The greatest difference over all lines, relative to what was kept; infinite where something is not finite.
    """
    kept = np.asarray(amplitude, dtype=np.float64)
    if not len(kept):
        return 0.0
    difference = np.abs(assembly.accelerance_amplitude(theta) - kept)
    scale = np.maximum(kept, _FLOOR * np.median(kept, axis=1, keepdims=True))
    relative = difference / np.maximum(scale, np.finfo(np.float64).tiny)
    return float(np.max(relative)) if np.isfinite(relative).all() else float("inf")
