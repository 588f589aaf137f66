"""What a model that is a little wrong does to an FRF: resonances misplaced, magnitudes and phases off, smoothly."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dovetail.identification.posterior.hats import hats

__all__ = ["small_errors"]

_MAGNITUDE = 2.0
"""Relative error of magnitude and phase over that of natural frequencies."""


def small_errors(
    frequency: NDArray[np.float64], values: NDArray[np.complex128], level: float
) -> NDArray[np.complex128]:
    """Return what one standard deviation of each error adds to an FRF.

    Parameters
    ----------
    frequency : (n_freq,) array
        Hz.
    values : (n_freq,) complex array
        The FRF.
    level : float
        Relative error of natural frequencies; twice as much for magnitude and phase.

    Returns
    -------
    (n_errors, n_freq) complex array
        The frequency axis stretched, the magnitude and the phase changed, each by a hat function around one of six
        equally spaced frequencies: neighbouring resonances err alike, distant ones on their own.

    Notes
    -----
    The posterior allows a model more than that, and each resonance on its own, since its intervals must hold all that a
    joint can be mistaken for; here what a joint cannot follow is looked for, and such errors would hide it.
    """
    if level == 0.0 or len(frequency) < 2:
        return np.zeros((0, len(frequency)), dtype=np.complex128)
    stretched = level * frequency * np.gradient(values, frequency)
    off = _MAGNITUDE * level * values
    return np.concatenate([hats(frequency) * size for size in (stretched, off, 1j * off)])
