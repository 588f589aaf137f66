"""What a model that is a little wrong can do to FRFs: resonances misplaced, too high or too broad."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.identification.posterior.hats import hats
from dovetail.identification.posterior.resonances import resonances

__all__ = ["MODEL_ERROR", "correlation_length", "model_errors"]

MODEL_ERROR = 5e-4
"""Standard deviation of the relative error of natural frequencies that a model is allowed by default."""

_UNCORRELATED = 0.05
_DAMPING, _MAGNITUDE, _PHASE = 0.3, 20.0, 2.0
"""Errors over the relative error of natural frequencies: of damping ratios, of magnitudes (relative), of phases [rad].

Natural frequencies are stationary in the mode shapes, modal constants and damping are not. These are the largest ratios
that a mesh twice as fine shows among the assemblies that ship (docs/uncertainty.md).
"""
_OWN = 0.3
"""Error that each resonance has on its own, over the one that it shares with its neighbours."""
_BEYOND = (2, 3)
"""Orders beyond the linear one up to which a misplaced resonance is followed: a peak far above the noise shows them."""


def model_errors(
    frequency: NDArray[np.float64], values: Sequence[NDArray[np.complex128]], level: float
) -> NDArray[np.complex128]:
    """Return what one standard deviation of each error adds to the FRFs of one structure.

    Parameters
    ----------
    frequency : (n_freq,) array
        Hz.
    values : sequence of (n_freq,) complex arrays
        The FRF of each response.
    level : float
        Relative error of natural frequencies; the others are in proportion.

    Returns
    -------
    (n_errors, n_responses n_freq) complex array
        The lines of each response behind those of the one before. Natural frequencies and damping are those of the
        structure, so that all responses err alike in them; magnitude and phase err in each response on their own.

    Notes
    -----
    Neighbouring resonances err alike for the most part: the FRF is stretched, and its magnitude and phase change,
    smoothly over the frequency axis, by a hat function around each of six places. For the rest each resonance errs on
    its own, which moves the zeros between them too. An error of 5e-4 is a quarter of the half width of a peak with a
    loss factor of 0.004. What that adds is not linear in it: terms of higher order are errors of their own, of the
    size that they have for one standard deviation of the whole, and at any phase, since frequency and damping mix.
    """
    count, lines = len(values), len(frequency)
    if level == 0.0 or lines < 2:
        return np.zeros((0, count * lines), dtype=np.complex128)
    found, alike = resonances(frequency, values), hats(frequency)
    stretched = np.concatenate([alike * (frequency * np.gradient(one, frequency)) for one in values], axis=1)
    single = found.displaced(_OWN * level, 1)
    linear = np.concatenate([level * stretched, single])
    beyond = np.concatenate([found.displaced(level, order) for order in _BEYOND])
    of_each = [np.concatenate([alike * one, _OWN * found.terms[k]]) for k, one in enumerate(values)]
    sizes = level * np.concatenate([_in_place(one, k, count) for k, one in enumerate(of_each)])
    return np.concatenate(
        [linear, 1j * _DAMPING * linear, beyond, 1j * beyond, _MAGNITUDE * sizes, 1j * _PHASE * sizes]
    )


def _in_place(errors: NDArray[np.complex128], index: int, count: int) -> NDArray[np.complex128]:
    """Return errors (n, n_freq) of one of several responses, (n, count n_freq)."""
    lines = errors.shape[1]
    return np.pad(errors, ((0, 0), (index * lines, (count - index - 1) * lines)))


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
