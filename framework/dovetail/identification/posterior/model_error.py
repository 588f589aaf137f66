"""What a model that is a little wrong can do to FRFs: resonances misplaced, too high or too broad."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import AAA

__all__ = ["MODEL_ERROR", "Resonances", "correlation_length", "hats", "model_errors", "resonances"]

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


_PLACES = 6


def hats(frequency: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return six hat functions (6, n_freq), each 1 at one of six equally spaced places and 0 at the others."""
    places = np.linspace(frequency[0], frequency[-1], _PLACES)
    return np.stack([np.interp(frequency, places, one) for one in np.eye(_PLACES)])


_TOLERANCE, _MOST_TERMS = 1e-6, 60
_BELOW, _ABOVE = 0.5, 1.2
"""Parts of the lowest and the highest frequency beyond which a pole belongs to the rest."""
_MOST_DAMPED = 0.2
"""Imaginary part of a pole over its real part above which it is no resonance."""
_FAINT = 1e-12


@dataclass(frozen=True, eq=False)
class Resonances:
    """FRFs as sums ``r / (f - p) - conj(r) / (f + conj(p))`` over resonances, and a rest.

    Parameters
    ----------
    poles : (n,) complex array
        Natural frequencies [Hz], ascending; the imaginary part is the real part times half the loss factor.
    terms : (n_responses, n, n_freq) complex array
        What each resonance contributes to each FRF.
    near : (n_responses, n, n_freq) complex array
        The first part of it, which is large beside the resonance.
    relative : (n, n_freq) complex array
        p / (f - p): where on its peak each resonance is at each frequency.
    rest : (n_responses, n_freq) complex array
        What the resonances do not make up: those outside the frequencies, and what is damped too much to be one.
    """

    poles: NDArray[np.complex128]
    terms: NDArray[np.complex128]
    near: NDArray[np.complex128]
    relative: NDArray[np.complex128]
    rest: NDArray[np.complex128]

    def displaced(self, by: float, order: int) -> NDArray[np.complex128]:
        """Return the term of an order in the Taylor series of poles moved by a part of themselves.

        Parameters
        ----------
        by : float
            Relative change of the poles.
        order : int
            1 for what is linear in the change.

        Returns
        -------
        (n, n_responses n_freq) complex array
            The lines of each response behind those of the one before. Where the pole moves by more than its distance,
            and the series diverges, no term is larger than the resonance itself.
        """
        moved = by * self.relative
        each = self.near * (moved / np.maximum(1.0, np.abs(moved))) ** order
        return np.asarray(each.transpose(1, 0, 2).reshape(len(self.poles), self.rest.size))


def resonances(frequency: NDArray[np.float64], values: Sequence[NDArray[np.complex128]]) -> Resonances:
    """Find the resonances that FRFs of one structure show.

    Parameters
    ----------
    frequency : (n_freq,) array
        Hz.
    values : sequence of (n_freq,) complex arrays
        The FRF of each response.

    Returns
    -------
    Resonances
        None at all where the FRFs show none; then the rest is all that there is.

    Notes
    -----
    The poles are those of a rational function through a mixture of the FRFs (AAA: Nakatsukasa, Sete and Trefethen,
    The AAA algorithm for rational approximation, 2018); the residues follow by linear least squares.
    """
    poles = _poles(frequency, values)
    residues = np.array([_residues(frequency, one, poles) for one in values]).reshape(len(values), len(poles))
    apart, mirrored = frequency - poles[:, np.newaxis], frequency + np.conj(poles)[:, np.newaxis]
    near = residues[:, :, np.newaxis] / apart
    terms = near - np.conj(residues)[:, :, np.newaxis] / mirrored
    return Resonances(poles, terms, near, poles[:, np.newaxis] / apart, np.asarray(values) - terms.sum(axis=1))


def _poles(frequency: NDArray[np.float64], values: Sequence[NDArray[np.complex128]]) -> NDArray[np.complex128]:
    """Return the poles of all FRFs; each enters with another phase, so that none is lost where two cancel."""
    sizes = [max(float(np.abs(one).std()), np.finfo(float).tiny) for one in values]
    mixture = sum(np.exp(1j * index) * one / size for index, (one, size) in enumerate(zip(values, sizes, strict=True)))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # measured parts have noise, which no rational function meets
        found = AAA(frequency, mixture, rtol=_TOLERANCE, max_terms=_MOST_TERMS).poles()
    inside = (found.real > _BELOW * frequency[0]) & (found.real < _ABOVE * frequency[-1])
    return np.sort_complex(found[inside & (found.imag > 0.0) & (found.imag < _MOST_DAMPED * found.real)])


def _residues(
    frequency: NDArray[np.float64], values: NDArray[np.complex128], poles: NDArray[np.complex128]
) -> NDArray[np.complex128]:
    """Return the residues (n,) of one FRF, beside a constant and a term that grows with the frequency squared."""
    near, mirrored = 1.0 / (frequency - poles[:, np.newaxis]), 1.0 / (frequency + np.conj(poles)[:, np.newaxis])
    rest = np.stack([np.ones(len(frequency)), (frequency / frequency[-1]) ** 2]).astype(np.complex128)
    shapes = np.concatenate([near - mirrored, 1j * (near + mirrored), rest])
    columns = np.concatenate([shapes.real, shapes.imag], axis=1).T
    lengths = np.linalg.norm(columns, axis=0)
    aim = np.concatenate([values.real, values.imag])
    found = np.linalg.lstsq(columns / lengths, aim, rcond=_FAINT)[0] / lengths
    return np.asarray(found[: len(poles)] + 1j * found[len(poles) : 2 * len(poles)])
