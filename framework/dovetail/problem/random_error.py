"""The random error of a measured FRF: known, or estimated from its scatter from line to line."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Self

import numpy as np
import scipy
from numpy.typing import NDArray

from dovetail.errors import Fault, MeasurementError
from dovetail.frf import Frf, conversion
from dovetail.frf.rice import noise_in_scatter, rice_negative_log_density

Surprise = Callable[[NDArray[np.float64]], tuple[NDArray[np.float64], NDArray[np.float64]]]
"""Negative log densities (n,) of errors at their variances (n,), and the derivatives."""

FOURTH_DIFFERENCE = np.array([1.0, -4.0, 6.0, -4.0, 1.0]) / np.sqrt(70.0)
"""Fourth difference: it keeps the variance of white noise and removes nearly all of a smooth curve."""
_FEWEST_AVERAGES = 3
"""Smallest number of averages for which the mean of 1 / s^2 is finite."""


@dataclass(frozen=True)
class Settings:
    """Tuning constants of the estimate and of the search for isolated lines."""

    least: float = 1e-9
    """Smallest random error, relative to the largest value: no measurement is better."""
    bins: int = 24
    """Largest number of bins of the magnitude: enough for a floor and a proportional part."""
    lines_per_bin: int = 20
    """Smallest number of lines in a bin: a quantile of fewer lines scatters too much."""
    smoothing: int = 9
    """Lines over which amplitudes that sort lines into bins are averaged: noise would sort its own lines."""
    quantile: float = 0.4
    """Quantile of each bin from which the noise is estimated; differences at sharp resonances lie above it."""
    prominence: float = 5.0
    """Size of an isolated line relative to its neighbours, or to noise, which practically never reaches it; a misplaced
    resonance raises the neighbours too."""
    neighbours: tuple[int, ...] = (2, 3, 4)
    """Distances, in lines, of the neighbours; without the adjacent line, so that a bad pair is isolated too."""
    rounded: float = 0.01
    """Share of lines with a coherence of exactly 1 above which the file's coherences are rounded too coarsely."""
    scattering: float = 0.5
    """Share of the scatter of variances estimated line by line above which given ones are taken for such estimates."""
    most_decrease: float = 5.0
    """Natural logarithm of the factor by which the most likely floor and share may lie below the least variance."""
    most_isolated: float = 0.05
    """Share of all lines above which no line counts as isolated: then the model is wrong, not the lines."""


_SETTINGS = Settings()

ASSUMED_NOISE = 0.01
"""Random error, relative to the largest value, that is assumed for an FRF with too few lines for an estimate."""


def random_error_variance(frf: Frf) -> NDArray[np.float64]:
    """Return E|error|^2 of each line (n_freq,): known from the measurement, or else estimated."""
    variance = known_variance(frf)
    return estimated_variance(frf) if variance is None else variance


def known_variance(frf: Frf) -> NDArray[np.float64] | None:
    """Return E|error|^2 of each line if the measurement states it, else None.

    Lines with a coherence of 0, of which nothing is known, get the largest known variance or the square of their own
    value, whichever is larger. A coherence of 1 is taken as rounded and replaced by the highest one below 1; where a
    file has more than a few of these, its coherences do not determine the variance.

    Notes
    -----
    A coherence from n averages is itself an estimate, and so is the variance s^2 of a line: 2 (n - 1) s^2 / E[s^2] is
    chi-squared distributed with 2 (n - 1) degrees of freedom. The mean of the weights 1 / s^2 is (n - 1) / (n - 2)
    times what it would be with exact variances. Where the coherences scatter like such estimates, the variances are
    multiplied by this factor, so that noise has a chi-squared of 1.
    """
    if frf.variance is None and frf.coherence is not None:
        rounded = frf.coherence == 1.0
        if np.mean(rounded) > _SETTINGS.rounded:
            return None
        frf = replace(frf, coherence=np.minimum(frf.coherence, frf.coherence[~rounded].max()))
    variance = frf.random_variance
    if variance is None:
        return None
    finite = np.isfinite(variance)
    largest = np.max(variance[finite], initial=0.0)
    variance = np.where(finite, variance, np.maximum(largest, frf.amplitude**2))
    factor = _factor_of_scatter(_scattering_averages(frf))
    return np.asarray(np.maximum(variance * factor, least_variance(frf)))


def _factor_of_scatter(averages: int) -> float:
    return (averages - 1) / (averages - 2) if averages else 1.0


def _scattering_averages(frf: Frf) -> int:
    """Return from how many averages coherences and variances were estimated; 0 if they do not scatter like that."""
    variance = frf.random_variance
    if variance is None or frf.variance is not None or frf.averages is None or frf.averages < _FEWEST_AVERAGES:
        return 0
    variance = variance[np.isfinite(variance)]
    if len(variance) < 2 * len(FOURTH_DIFFERENCE) or not np.all(variance > 0.0):
        return 0
    scatter = np.convolve(np.log(variance), FOURTH_DIFFERENCE, mode="valid") ** 2
    expected = float(scipy.special.polygamma(1, frf.averages - 1)) * 2.0 * float(scipy.special.gammaincinv(0.5, 0.5))
    return frf.averages if np.median(scatter) > _SETTINGS.scattering * expected else 0


def normal_residuals(frf: Frf, residuals: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rescale residuals so that those of noise are normally distributed.

    Parameters
    ----------
    frf : Frf
    residuals : (n_freq, n) array
        Over the standard deviation of `known_variance`.

    Notes
    -----
    Divided by a variance that is itself estimated from k averages, the mean square of n residuals of noise has an F
    distribution with n and 2 (k - 1) degrees of freedom. Its tail is long: with 10,000 lines from eight averages, noise
    would be taken for a misfit in one case of eight. Each line's square is therefore replaced by the one that is
    equally improbable under a chi-squared distribution.
    """
    averages = _scattering_averages(frf)
    if not averages:
        return residuals
    width, squares = residuals.shape[1], np.sum(residuals**2, axis=1)
    improbable = scipy.special.fdtrc(width, 2 * (averages - 1), squares * _factor_of_scatter(averages) / width)
    normal = scipy.special.chdtri(width, np.maximum(improbable, np.finfo(float).tiny))
    ratio = np.sqrt(normal / np.maximum(squares, np.finfo(float).tiny))
    return np.asarray(residuals * ratio[:, np.newaxis])


def estimated_variance(frf: Frf, model: NDArray[Any] | None = None) -> NDArray[np.float64]:
    """Estimate the random error from the scatter from line to line.

    Parameters
    ----------
    frf : Frf
        With phase, or an amplitude.
    model : (n_freq,) array, optional
        A model's values of the same kind. The smooth difference disturbs the estimate less than the FRF itself.

    Returns
    -------
    (n_freq,) array
        E|error|^2 of the complex values, ``a^2 + b^2 |H|^2``: a floor and a part of each line's magnitude.

    Notes
    -----
    Fourth differences keep the noise and remove the curve. In bins of the magnitude their lower quantile gives the
    variance, since peaks that are sharper than a few lines spoil only the upper part. a and b follow by least squares.
    Amplitudes scatter as Rice's distribution says. The lowest of those that are mostly noise are the ones with the
    least noise, so that bins are those of the model's magnitudes where there is one, and |H|^2 is a mean of five lines.
    """
    floor, share = _estimated_parts(frf, model)
    square = frf.amplitude**2 if frf.has_phase else _squares_around(np.pad(frf.amplitude, 2, mode="edge"))
    return np.asarray(np.maximum(floor + share * square, least_variance(frf)))


def error_parts(frf: Frf) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return a and b (n_freq,) of ``E|error|^2 = a + b |H|^2`` for a measurement.

    A variance in the file is a. Coherence and averages give b; lines with a coherence of 0 get the largest b of the
    others, or 1. Otherwise both are estimated from the scatter, the same for all lines.
    """
    if frf.variance is not None:
        return frf.variance, np.zeros_like(frf.variance)
    if (variance := frf.random_variance) is None:
        floor, share = (np.full(frf.frequency.shape, part) for part in _estimated_parts(frf))
        return floor, share
    known = np.isfinite(variance) & (frf.amplitude > 0.0)
    share = np.divide(variance, frf.amplitude**2, out=np.zeros_like(variance), where=known)
    return np.zeros_like(share), np.where(known, share, share[known].max(initial=0.0) or 1.0)


@dataclass(frozen=True, eq=False)
class MeasuredNoise:
    """The random error of a measured FRF, ``E|error|^2 = floor + share |H|^2``, at an assembly's lines.

    Parameters
    ----------
    floor : (n_freq,) array
        Of the accelerance [(m/(N s^2))^2].
    share : (n_freq,) array
    """

    floor: NDArray[np.float32]
    share: NDArray[np.float32]

    @classmethod
    def of(cls, frf: Frf, frequency: NDArray[np.float64]) -> Self:
        """Interpolate to some lines (n_freq,); those beyond the measurement get the values of its last line.

        Raises
        ------
        MeasurementError
            No line of the measurement is in the band.
        """
        first, last = frf.frequency[0], frf.frequency[-1]
        if first > frequency[-1] or last < frequency[0]:
            problem = f"it was measured from {first:g} to {last:g} Hz."
            band = f"lines from {frequency[0]:g} to {frequency[-1]:g} Hz, those of the description"
            raise MeasurementError(Fault(frf.label, problem, band))
        own, part = error_parts(frf)  # in its own quantity, in which an estimated floor is the same at all lines
        parts = own * np.abs(conversion(frf.frequency, frf.quantity, "accelerance")) ** 2, part
        floor, share = (np.interp(frequency, frf.frequency, part).astype(np.float32) for part in parts)
        return cls(floor, share)

    def add(self, amplitude: NDArray[np.float32], level: NDArray[np.float32], generator: np.random.Generator) -> None:
        """Add complex noise to amplitudes (n, n_freq), in place, with `level` (n, 1) times the measured deviation."""
        deviation = level * np.sqrt(0.5 * (self.floor + self.share * np.square(amplitude)))
        in_phase, quadrature = (deviation * generator.standard_normal(amplitude.shape, np.float32) for _ in range(2))
        np.hypot(amplitude + in_phase, quadrature, out=amplitude)


def _estimated_parts(frf: Frf, model: NDArray[Any] | None = None) -> tuple[float, float]:
    """Estimate a and b of ``a + b |H|^2``."""
    least = least_variance(frf)
    values = frf.values if frf.has_phase else frf.amplitude
    if is_too_short(frf):
        return float((ASSUMED_NOISE * frf.amplitude.max()) ** 2), 0.0
    residuals = values if model is None else values - model
    squares = np.abs(np.convolve(residuals, FOURTH_DIFFERENCE, mode="valid")) ** 2
    measured = _squares_around(frf.amplitude)
    level = measured
    if not frf.has_phase:
        level = (
            scipy.ndimage.uniform_filter1d(measured, _SETTINGS.smoothing) if model is None else _squares_around(model)
        )
    count = min(_SETTINGS.bins, max(1, len(level) // _SETTINGS.lines_per_bin))
    bins = np.array_split(np.argsort(level), count)
    middle = np.mean if frf.has_phase else np.median
    magnitude = np.sqrt(np.maximum([middle(level[rows]) for rows in bins], least))
    variance = np.array([np.quantile(squares[rows], _SETTINGS.quantile) for rows in bins])
    variance /= _unit_quantile(frf.has_phase)
    if not frf.has_phase:
        variance = noise_in_scatter(variance / 2.0, np.array([np.mean(measured[rows]) for rows in bins]))
    return _floor_and_share(magnitude, np.maximum(variance, least))


def _squares_around(amplitude: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the mean squares (n - 4,) of amplitudes (n,) over five lines, weighted as in a fourth difference."""
    return np.convolve(amplitude**2, FOURTH_DIFFERENCE**2, mode="valid")


def is_too_short(frf: Frf) -> bool:
    """Return whether an FRF has fewer than 10 lines; 1 % of the largest value is then taken as its random error."""
    return len(frf.frequency) < 2 * len(FOURTH_DIFFERENCE)


def residual_variance(frf: Frf, model: NDArray[np.complex128], used: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Estimate the random error from all residuals of a model, if they are nothing but noise.

    Parameters
    ----------
    frf : Frf
        With phase, or an amplitude.
    model : (n_freq,) complex array
        The FRF that was fitted to it.
    used : (n_freq,) bool array
        Lines that were not left out.

    Returns
    -------
    (n_freq,) array
        E|error|^2 of the complex values: ``a^2 + b^2 |H|^2`` with the most likely a and b.

    Notes
    -----
    This estimate is much more certain than `estimated_variance`, which needs no model that fits.
    """
    least = least_variance(frf)
    amplitude = np.abs(model)
    magnitude = np.maximum(amplitude**2, np.finfo(float).tiny)
    squares = np.abs(frf.values - model if frf.has_phase else frf.amplitude - amplitude)[used] ** 2
    surprise = None if frf.has_phase else partial(rice_negative_log_density, frf.amplitude[used], amplitude[used])
    floor, share = most_likely_parts(squares, np.ones_like(squares), magnitude[used], least, surprise=surprise)
    return np.asarray(np.maximum(floor + share * magnitude, least))


def most_likely_parts(
    squares: NDArray[np.float64],
    level: NDArray[np.float64],
    magnitude: NDArray[np.float64],
    least: float,
    known: NDArray[np.float64] | None = None,
    surprise: Surprise | None = None,
) -> tuple[float, float]:
    """Return a and b with which ``known + a level + b magnitude`` is the most likely variance of complex errors.

    Parameters
    ----------
    squares : (n,) array
        |error|^2, which are distributed exponentially.
    level, magnitude : (n,) arrays
        Positive.
    least : float
        Variance that is negligible.
    known : (n,) array, optional
        The rest of the variance; 0 by default.
    surprise : callable, optional
        Returns the negative log densities (n,) at variances (n,), and their derivatives; by default those of squares
        of complex errors.
    """
    lowest = np.argsort(magnitude / level)[: max(1, len(magnitude) // 4)]
    starts = np.array([np.median((squares / level)[lowest]), np.median(squares / magnitude)]) / np.log(2.0)
    smallest = np.array([least / level.max(), least / magnitude.max()])
    terms, rest = np.stack([level, magnitude]), np.zeros_like(squares) if known is None else known
    surprise = surprise or partial(_complex_surprise, squares)

    def negative_log(logs: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
        parts = np.exp(logs)[:, np.newaxis] * terms
        variance = rest + parts.sum(axis=0)
        each, slope = surprise(variance)
        return float(np.mean(each)), np.asarray((parts @ slope) / len(squares))

    largest = np.maximum((squares / terms).max(axis=1), smallest)  # more than any error needs
    bounds = list(zip(np.log(smallest) - _SETTINGS.most_decrease, np.log(largest), strict=True))
    logs = scipy.optimize.minimize(
        negative_log, np.log(np.maximum(starts, smallest)), jac=True, method="L-BFGS-B", bounds=bounds
    ).x
    floor, share = np.exp(logs).tolist()
    return floor, share


def _complex_surprise(
    squares: NDArray[np.float64], variance: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    return np.log(variance) + squares / variance, (1.0 - squares / variance) / variance


def least_variance(frf: Frf) -> float:
    """Return the smallest E|error|^2 that an FRF is assumed to have."""
    return float((_SETTINGS.least * frf.amplitude.max()) ** 2)


def _unit_quantile(has_phase: bool) -> float:
    """Return the quantile of |e|^2 for E|e|^2 = 1; for an amplitude, that of the component along the phase."""
    if has_phase:
        return float(-np.log(1.0 - _SETTINGS.quantile))
    return float(scipy.special.gammaincinv(0.5, _SETTINGS.quantile))  # half that of chi-squared


def _floor_and_share(magnitude: NDArray[np.float64], variance: NDArray[np.float64]) -> tuple[float, float]:
    """Fit floor + share * magnitude^2 to variances, in their logarithms, robust against a few outliers."""
    lowest = float(np.log(variance.min()))
    relative = float(np.log(np.median(variance / magnitude**2)))

    terms, target = np.stack([np.ones_like(variance), magnitude**2], axis=1), np.log(variance)

    def residuals(logs: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(np.log(terms @ np.exp(logs)) - target)

    def slopes(logs: NDArray[np.float64]) -> NDArray[np.float64]:
        parts = terms * np.exp(logs)
        return np.asarray(parts / parts.sum(axis=1, keepdims=True))

    start = [lowest, relative]
    fitted = scipy.optimize.least_squares(residuals, start, slopes, loss="soft_l1", f_scale=0.2, max_nfev=200)
    floor, share = np.exp(fitted.x).tolist()
    return floor, share


def isolated_lines(size: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return which lines have a large residual that their neighbours do not share.

    Parameters
    ----------
    size : (n_freq,) array
        Size of each line's residual over its standard deviation.

    Returns
    -------
    (n_freq,) bool array
    """
    reach = max(_SETTINGS.neighbours)
    padded = np.pad(size, reach, mode="reflect") if len(size) > reach else np.pad(size, reach, mode="edge")
    shifts = [sign * distance for distance in _SETTINGS.neighbours for sign in (-1, 1)]
    around = np.max([padded[reach + shift : reach + shift + len(size)] for shift in shifts], axis=0)
    isolated = size > _SETTINGS.prominence * np.maximum(around, 1.0)
    return isolated if isolated.mean() <= _SETTINGS.most_isolated else np.zeros_like(isolated)
