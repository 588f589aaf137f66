"""What a model that is a little wrong can do to an FRF: resonances misplaced, magnitudes and phases off, smoothly."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["MODEL_ERROR", "correlation_length", "joint_model_errors", "model_errors"]

MODEL_ERROR = 5e-4
"""Standard deviation of the relative error of natural frequencies that a model is allowed by default."""

_UNCORRELATED = 0.05
_KNOTS = 6
_OF_THE_STRUCTURE = _KNOTS
"""How many of the errors, the first ones, are the structure's own: those of natural frequencies."""
_MAGNITUDE = 2.0
"""Relative error of magnitude and phase over that of natural frequencies."""


def model_errors(
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
        The frequency axis stretched, the magnitude and the phase changed, each by a hat function around one of
        six equally spaced frequencies: neighbouring resonances err alike, distant ones on their own.
    """
    if level == 0.0 or len(frequency) < 2:
        return np.zeros((0, len(frequency)), dtype=np.complex128)
    knots = np.linspace(frequency[0], frequency[-1], _KNOTS)
    hats = np.stack([np.interp(frequency, knots, one) for one in np.eye(_KNOTS)])
    stretched = level * frequency * np.gradient(values, frequency)
    return np.concatenate(
        [hats * stretched, hats * (_MAGNITUDE * level) * values, hats * (1j * _MAGNITUDE * level) * values]
    )


def joint_model_errors(
    frequency: NDArray[np.float64], values: Sequence[NDArray[np.complex128]], level: float
) -> NDArray[np.complex128]:
    """Return what one standard deviation of each error adds to the FRFs of several responses.

    Parameters
    ----------
    frequency : (n_freq,) array
        Hz.
    values : sequence of (n_freq,) complex arrays
        The FRF of each response.
    level : float
        As in `model_errors`.

    Returns
    -------
    (n_errors, n_responses n_freq) complex array
        The lines of each response behind those of the one before. Natural frequencies are those of the structure, so
        that all responses are stretched alike; magnitude and phase err in each response on their own.
    """
    each = [model_errors(frequency, own, level) for own in values]
    if len(each) == 1:
        return each[0]
    shared = np.concatenate([one[:_OF_THE_STRUCTURE] for one in each], axis=1)
    own = [one[_OF_THE_STRUCTURE:] for one in each]
    rows = [
        np.concatenate([one if k == at else 0.0 * one for k in range(len(each))], axis=1) for at, one in enumerate(own)
    ]
    return np.concatenate([shared, *rows])


def correlation_length(residuals: NDArray[Any]) -> float:
    """Return how many neighbouring lines are off alike: 1 for noise.

    Parameters
    ----------
    residuals : (n_freq,) array
        Complex, or real where there is no phase, over their standard deviation.

    Returns
    -------
    float
        Integrated correlation, 1 + 2 sum of the autocorrelation up to where it has died away.
    """
    padded = np.fft.fft(residuals, 2 * len(residuals))
    correlation = np.fft.ifft(np.abs(padded) ** 2).real[: len(residuals)]
    correlation /= max(correlation[0], np.finfo(float).tiny)
    gone = np.flatnonzero(correlation < _UNCORRELATED)
    last = int(gone[0]) if len(gone) else len(correlation)
    return float(1.0 + 2.0 * np.sum(correlation[1:last]))
