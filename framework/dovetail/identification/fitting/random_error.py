"""The random error of a measured FRF: known, or estimated from its scatter from line to line."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.stats import chi2

from dovetail.frf import Frf

__all__ = ["estimated_variance", "isolated_lines", "known_variance", "random_error_variance"]

_DIFFERENCE = np.array([1.0, -4.0, 6.0, -4.0, 1.0]) / np.sqrt(70.0)
"""Fourth difference: it keeps the variance of white noise and removes nearly all of a smooth curve."""


@dataclass(frozen=True)
class Settings:
    """Tuning constants of the estimate and of the search for isolated lines."""

    least: float = 1e-9
    """Random error, as a part of the largest value, below which none is assumed: no measurement is better."""
    short: float = 0.01
    """Random error, as a part of the largest value, of an FRF with too few lines for an estimate."""
    bins: int = 24
    """Of the magnitude: enough for a floor and a proportional part."""
    lines_per_bin: int = 20
    """At least: a quantile of fewer lines scatters too much."""
    quantile: float = 0.4
    """Of each bin, from which the noise is estimated: sharp resonances have their differences in the upper part."""
    prominence: float = 5.0
    """Size of an isolated line over that of its neighbours, or over that of noise, which practically never reaches it;
    a misplaced resonance raises the neighbours too."""
    neighbours: tuple[int, ...] = (2, 3, 4)
    """Distances, in lines, of the neighbours: the adjacent line is none, so that a bad pair is isolated too."""
    most_isolated: float = 0.05
    """Part of all lines above which no line is called isolated: then the model is wrong, not the lines."""


_SETTINGS = Settings()


def random_error_variance(frf: Frf) -> NDArray[np.float64]:
    """Return E|error|^2 (n_freq,) of each line: known from the measurement, or else estimated."""
    variance = known_variance(frf)
    return estimated_variance(frf) if variance is None else variance


def known_variance(frf: Frf) -> NDArray[np.float64] | None:
    """Return E|error|^2 of each line if the measurement has it, else None.

    Lines with a coherence of 0, of which nothing is known, get the largest known variance or the square of their own
    value, whichever is larger.
    """
    variance = frf.random_variance
    if variance is None:
        return None
    finite = np.isfinite(variance)
    largest = np.max(variance[finite], initial=0.0)
    variance = np.where(finite, variance, np.maximum(largest, frf.amplitude**2))
    return np.asarray(np.maximum(variance, _least_variance(frf)))


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
    """
    least = _least_variance(frf)
    values = frf.values if frf.has_phase else frf.amplitude
    if len(values) < 2 * len(_DIFFERENCE):
        return np.full(len(values), np.maximum(least, (_SETTINGS.short * frf.amplitude.max()) ** 2))
    residuals = values if model is None else values - model
    squares = np.abs(np.convolve(residuals, _DIFFERENCE, mode="valid")) ** 2
    level = np.sqrt(np.convolve(frf.amplitude**2, _DIFFERENCE**2, mode="valid"))
    count = min(_SETTINGS.bins, max(1, len(level) // _SETTINGS.lines_per_bin))
    bins = np.array_split(np.argsort(level), count)
    magnitude = np.array([np.sqrt(np.mean(level[rows] ** 2)) for rows in bins])
    quantiles = np.array([np.quantile(squares[rows], _SETTINGS.quantile) for rows in bins])
    floor, share = _floor_and_share(magnitude, np.maximum(quantiles / _unit_quantile(frf.has_phase), least))
    return np.asarray(np.maximum(floor + share * frf.amplitude**2, least))


def _least_variance(frf: Frf) -> float:
    return float((_SETTINGS.least * frf.amplitude.max()) ** 2)


def _unit_quantile(has_phase: bool) -> float:
    """Return the quantile of |e|^2 where E|e|^2 = 1; for an amplitude, of its half in one direction."""
    if has_phase:
        return float(-np.log(1.0 - _SETTINGS.quantile))
    return float(chi2.ppf(_SETTINGS.quantile, 1)) / 2.0


def _floor_and_share(magnitude: NDArray[np.float64], variance: NDArray[np.float64]) -> tuple[float, float]:
    """Fit floor + share * magnitude^2 to variances, in their logarithms, robust against a few outliers."""
    lowest = float(np.log(variance.min()))
    relative = float(np.log(np.median(variance / magnitude**2)))

    def residuals(logs: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(np.log(np.exp(logs[0]) + np.exp(logs[1]) * magnitude**2) - np.log(variance))

    fitted = least_squares(residuals, [lowest, relative], loss="soft_l1", f_scale=0.2, max_nfev=200).x
    return float(np.exp(fitted[0])), float(np.exp(fitted[1]))


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
