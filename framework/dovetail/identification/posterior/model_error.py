"""What a model that is a little wrong can do to FRFs: resonances misplaced, too high or too broad.

The FRFs of one structure are split into resonances and a background (`fit_resonances`). From these follows what one
standard deviation of each error of the model adds to the FRFs (`model_errors`).
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import AAA

__all__ = ["MODEL_ERROR", "Resonances", "correlation_length", "fit_resonances", "hat_functions", "model_errors"]

MODEL_ERROR = 5e-4
"""Standard deviation of the relative error of natural frequencies that a model is allowed by default."""


@dataclass(frozen=True)
class ModelErrorSettings:
    """Sizes of the model's errors, and what counts as a resonance.

    Natural frequencies are stationary in the mode shapes, modal constants and damping are not. Their errors are the
    largest ratios that a mesh twice as fine shows among the assemblies that ship (docs/uncertainty.md).
    """

    damping: float = 0.3
    """Relative error of damping ratios, over that of natural frequencies."""
    magnitude: float = 20.0
    """Relative error of magnitudes, over that of natural frequencies."""
    phase: float = 2.0
    """Error of phases [rad], over that of natural frequencies."""
    individual: float = 0.3
    """Error of each resonance alone, over the one that it shares with its neighbours."""
    orders: tuple[int, ...] = (2, 3)
    """Of the Taylor series beyond the linear term: a misplaced peak far above the noise shows them."""
    hat_functions: int = 6
    """Over the frequency axis: resonances nearer than a fifth of it err alike."""
    tolerance: float = 1e-6
    """Relative error of the rational function whose poles are the resonances."""
    most_terms: int = 60
    """Of that function; a resonance takes two."""
    pole_limits: tuple[float, float] = (0.5, 1.2)
    """Times the lowest and the highest frequency: a pole beyond belongs to the background."""
    largest_damping: float = 0.2
    """Imaginary part of a pole over its real part above which it is no resonance."""


_SETTINGS = ModelErrorSettings()


@dataclass(frozen=True, eq=False)
class Resonances:
    """FRFs as sums ``r / (f - p) - conj(r) / (f + conj(p))`` over resonances, and a background.

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
    background : (n_responses, n_freq) complex array
        The FRFs without the resonances: those outside the frequencies, and what is damped too much to be one.
    """

    poles: NDArray[np.complex128]
    terms: NDArray[np.complex128]
    near: NDArray[np.complex128]
    relative: NDArray[np.complex128]
    background: NDArray[np.complex128]

    def displaced(self, change: float, order: int) -> NDArray[np.complex128]:
        """Return one term of the FRFs' Taylor series in a relative change of each pole.

        Parameters
        ----------
        change : float
            Relative change of the poles.
        order : int
            1 for the linear term.

        Returns
        -------
        (n, n_responses n_freq) complex array
            The lines of each response behind those of the one before. Where the pole moves by more than its distance,
            and the series diverges, no term is larger than the resonance itself.
        """
        step = change * self.relative
        terms = self.near * (step / np.maximum(1.0, np.abs(step))) ** order
        return np.asarray(terms.transpose(1, 0, 2).reshape(len(self.poles), self.background.size))


def fit_resonances(frequency: NDArray[np.float64], values: Sequence[NDArray[np.complex128]]) -> Resonances:
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
        Without any pole where the FRFs show no resonance; then all is background.

    Notes
    -----
    The poles are those of a rational function through a mixture of the FRFs (AAA: Nakatsukasa, Sete and Trefethen,
    The AAA algorithm for rational approximation, 2018); the residues follow by linear least squares.
    """
    poles = _poles(frequency, values)
    residues = np.array([_residues(frequency, frf, poles) for frf in values]).reshape(len(values), len(poles))
    distance, mirrored = frequency - poles[:, np.newaxis], frequency + np.conj(poles)[:, np.newaxis]
    near = residues[:, :, np.newaxis] / distance
    terms = near - np.conj(residues)[:, :, np.newaxis] / mirrored
    background = np.asarray(values) - terms.sum(axis=1)
    return Resonances(poles, terms, near, poles[:, np.newaxis] / distance, background)


def _poles(frequency: NDArray[np.float64], values: Sequence[NDArray[np.complex128]]) -> NDArray[np.complex128]:
    """Return the poles of all FRFs; each enters with another phase, so that none is lost where two cancel."""
    sizes = [float(np.abs(frf).std()) or 1.0 for frf in values]
    mixture = sum(np.exp(1j * index) * frf / size for index, (frf, size) in enumerate(zip(values, sizes, strict=True)))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # measured parts have noise, which no rational function meets
        poles = AAA(frequency, mixture, rtol=_SETTINGS.tolerance, max_terms=_SETTINGS.most_terms).poles()
    lowest, highest = _SETTINGS.pole_limits * frequency[[0, -1]]
    inside = (poles.real > lowest) & (poles.real < highest)
    underdamped = (poles.imag > 0.0) & (poles.imag < _SETTINGS.largest_damping * poles.real)
    return np.sort_complex(poles[inside & underdamped])


def _residues(
    frequency: NDArray[np.float64], values: NDArray[np.complex128], poles: NDArray[np.complex128]
) -> NDArray[np.complex128]:
    """Return the residues (n,) of one FRF, beside a constant and a term that grows with the frequency squared."""
    near, mirrored = 1.0 / (frequency - poles[:, np.newaxis]), 1.0 / (frequency + np.conj(poles)[:, np.newaxis])
    background = np.stack([np.ones(len(frequency)), (frequency / frequency[-1]) ** 2]).astype(np.complex128)
    shapes = np.concatenate([near - mirrored, 1j * (near + mirrored), background])
    columns = np.concatenate([shapes.real, shapes.imag], axis=1).T
    lengths = np.linalg.norm(columns, axis=0)
    target = np.concatenate([values.real, values.imag])
    coefficients = np.linalg.lstsq(columns / lengths, target, rcond=1e-12)[0] / lengths
    return np.asarray(coefficients[: len(poles)] + 1j * coefficients[len(poles) : 2 * len(poles)])


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
        structure, so that all responses err alike in them; magnitude and phase err in each response separately.

    Notes
    -----
    Neighbouring resonances err alike for the most part: the FRF is stretched, and its magnitude and phase change,
    smoothly over the frequency axis, by six hat functions. Beside this each resonance errs alone, which moves the
    antiresonances too. An error of 5e-4 is a quarter of the half width of a peak with a loss factor of 0.004. What
    that adds is not linear in it: terms of higher order are errors of their own. They have the size that one standard
    deviation of the whole gives them, and any phase, since frequency and damping mix.
    """
    count, lines = len(values), len(frequency)
    if level == 0.0 or lines < 2:
        return np.zeros((0, count * lines), dtype=np.complex128)
    resonances, hats = fit_resonances(frequency, values), hat_functions(frequency)
    stretched = np.concatenate([hats * (frequency * np.gradient(frf, frequency)) for frf in values], axis=1)
    linear = np.concatenate([level * stretched, resonances.displaced(_SETTINGS.individual * level, 1)])
    higher = np.concatenate([resonances.displaced(level, order) for order in _SETTINGS.orders])
    pairs = zip(values, resonances.terms, strict=True)
    shapes = [np.concatenate([hats * frf, _SETTINGS.individual * terms]) for frf, terms in pairs]
    sizes = level * np.concatenate([_in_response(shape, index, count) for index, shape in enumerate(shapes)])
    structure = [linear, 1j * _SETTINGS.damping * linear, higher, 1j * higher]
    return np.concatenate([*structure, _SETTINGS.magnitude * sizes, 1j * _SETTINGS.phase * sizes])


def _in_response(errors: NDArray[np.complex128], index: int, count: int) -> NDArray[np.complex128]:
    """Return errors (n, n_freq) of one of several responses, (n, count n_freq)."""
    lines = errors.shape[1]
    return np.pad(errors, ((0, 0), (index * lines, (count - index - 1) * lines)))


def hat_functions(frequency: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return six hat functions (6, n_freq), each 1 at one of six equally spaced frequencies and 0 at the others."""
    peaks = np.linspace(frequency[0], frequency[-1], _SETTINGS.hat_functions)
    return np.stack([np.interp(frequency, peaks, height) for height in np.eye(_SETTINGS.hat_functions)])


def correlation_length(residuals: NDArray[Any]) -> float:
    """Return how many neighbouring lines err alike: 1 for noise.

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
    uncorrelated = np.flatnonzero(correlation < 0.05)
    last = int(uncorrelated[0]) if len(uncorrelated) else len(correlation)
    return float(1.0 + 2.0 * np.sum(correlation[1:last]))
