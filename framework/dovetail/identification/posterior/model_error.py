"""What a model that is a little wrong can do to an FRF: resonances misplaced, magnitudes and phases off, smoothly."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["MODEL_ERROR", "correlation_length", "joint_model_errors", "model_errors", "place_by_place"]

MODEL_ERROR = 5e-4
"""Standard deviation of the relative error of natural frequencies that a model is allowed by default."""

_UNCORRELATED = 0.05
_KNOTS = 6
_OF_POLES = 2 * _KNOTS
"""Errors of the poles, which all responses share: natural frequencies and damping ratios."""
_DAMPING, _MAGNITUDE, _PHASE = 0.3, 20.0, 2.0
"""Errors over the relative error of natural frequencies: of damping ratios, of magnitudes (relative), of phases [rad].

Natural frequencies are stationary in the mode shapes, modal constants and damping are not. These are the largest ratios
that a mesh twice as fine shows among the assemblies that ship (docs/uncertainty.md).
"""


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
        Relative error of natural frequencies; the others are in proportion.

    Returns
    -------
    (n_errors, n_freq) complex array
        Natural frequencies, damping ratios, magnitude and phase changed, each by a hat function around one of six
        equally spaced frequencies: neighbouring resonances err alike, distant ones on their own.

    Notes
    -----
    A pole moves by as much as the frequency axis is stretched; damping is its imaginary part.
    """
    if level == 0.0 or len(frequency) < 2:
        return np.zeros((0, len(frequency)), dtype=np.complex128)
    stretched = level * frequency * np.gradient(values, frequency)
    sizes = (stretched, 1j * _DAMPING * stretched, _MAGNITUDE * level * values, 1j * _PHASE * level * values)
    return place_by_place(frequency, sizes)


def place_by_place(frequency: NDArray[np.float64], sizes: Sequence[NDArray[np.complex128]]) -> NDArray[np.complex128]:
    """Return each error (n_freq,) in parts (n_errors, n_freq), by hat functions around six equally spaced places."""
    knots = np.linspace(frequency[0], frequency[-1], _KNOTS)
    hats = np.stack([np.interp(frequency, knots, one) for one in np.eye(_KNOTS)])
    return np.concatenate([hats * size for size in sizes])


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
        The lines of each response behind those of the one before. Natural frequencies and damping are those of the
        structure, so that all responses err alike in them; magnitude and phase err in each response on their own.
    """
    each = [model_errors(frequency, own, level) for own in values]
    if len(each) == 1 or not len(each[0]):
        return np.concatenate(each, axis=1)
    own = [np.pad(one[_OF_POLES:], ((0, 0), (k * len(frequency), (len(each) - k - 1) * len(frequency))))
        for k, one in enumerate(each)]  # fmt: skip
    return np.concatenate([np.concatenate([one[:_OF_POLES] for one in each], axis=1), *own])


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
