"""The random error of a measured FRF: known, or told from its scatter from line to line."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from dovetail.frf import Frf

__all__ = ["estimated_variance", "isolated_lines", "known_variance"]

_DIFFERENCE = np.array([1.0, -4.0, 6.0, -4.0, 1.0]) / np.sqrt(70.0)
"""Fourth difference: of white noise it keeps the variance, of a smooth curve it leaves next to nothing."""
_BINS = 24
_LOWER_HALF = 0.4
"""Quantile of each bin from which the noise is told: sharp resonances have their differences in the upper part."""
_LEAST = 1e-9
"""Random error, in parts of the largest value, below which none is assumed: no measurement is better."""


def known_variance(frf: Frf) -> NDArray[np.float64] | None:
    """Return E|error|^2 of each line where the measurement tells it, else None.

    Lines of which nothing is known, with a coherence of 0, are given the largest variance that is known or the square
    of their own value.
    """
    variance = frf.random_variance
    if variance is None:
        return None
    finite = np.isfinite(variance)
    largest = np.max(variance[finite], initial=0.0)
    found = np.where(finite, variance, np.maximum(largest, frf.amplitude**2))
    return np.asarray(np.maximum(found, (_LEAST * frf.amplitude.max()) ** 2))


def estimated_variance(frf: Frf, explained: NDArray[Any] | None = None) -> NDArray[np.float64]:
    """Tell the random error from the scatter from line to line.

    Parameters
    ----------
    frf : Frf
        With phase, or an amplitude.
    explained : (n_freq,) array, optional
        What a model says these lines are, of the same kind; the smooth rest disturbs the estimate less.

    Returns
    -------
    (n_freq,) array
        E|error|^2 of the complex values, ``a^2 + b^2 |H|^2``: a floor and a part of each line's magnitude.

    Notes
    -----
    Fourth differences keep the noise and lose the curve. In bins of the magnitude their lower quantile gives the
    variance, since peaks that are sharper than a few lines spoil only the upper part; a and b follow by least squares.
    """
    least = (_LEAST * frf.amplitude.max()) ** 2
    values = frf.values if frf.has_phase else frf.amplitude
    if len(values) < 2 * len(_DIFFERENCE):
        return np.full(len(values), np.maximum(least, (0.01 * frf.amplitude.max()) ** 2))
    rest = values if explained is None else values - explained
    squares = np.abs(np.convolve(rest, _DIFFERENCE, mode="valid")) ** 2
    level = np.sqrt(np.convolve(frf.amplitude**2, _DIFFERENCE**2, mode="valid"))
    bins = np.array_split(np.argsort(level), min(_BINS, max(1, len(level) // 20)))
    magnitude = np.array([np.sqrt(np.mean(level[rows] ** 2)) for rows in bins])
    told = np.array([np.quantile(squares[rows], _LOWER_HALF) for rows in bins]) / _quantile_of_unit(frf.has_phase)
    floor, part = _floor_and_part(magnitude, np.maximum(told, least))
    return np.asarray(np.maximum(floor + part * frf.amplitude**2, least))


def _quantile_of_unit(has_phase: bool) -> float:
    """Return the quantile of |e|^2 where E|e|^2 = 1; for an amplitude, of half of it in the one direction."""
    if has_phase:
        return float(-np.log(1.0 - _LOWER_HALF))
    from scipy.stats import chi2

    return float(chi2.ppf(_LOWER_HALF, 1)) / 2.0


def _floor_and_part(magnitude: NDArray[np.float64], told: NDArray[np.float64]) -> tuple[float, float]:
    """Fit floor + part * magnitude^2 to variances, in their logarithms, indifferent to a few that are far off."""
    lowest = float(np.log(told.min()))
    relative = float(np.log(np.median(told / magnitude**2)))

    def misfit(logs: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(np.log(np.exp(logs[0]) + np.exp(logs[1]) * magnitude**2) - np.log(told))

    fitted = least_squares(misfit, [lowest, relative], loss="soft_l1", f_scale=0.2, max_nfev=200).x
    return float(np.exp(fitted[0])), float(np.exp(fitted[1]))


_CLEARLY = 4.5
"""Standard deviations that noise alone practically never reaches."""
_ALONE = 5.0
"""How far a bad line stands out of its neighbours; a misplaced resonance raises these too."""
_NEIGHBOURS = (2, 3, 4)
"""How many lines away the neighbours are that a bad line is held against; so two lines beside each other are found."""
_MOST = 0.05
"""Part of all lines above which they are no longer a few, and none is called bad."""


def isolated_lines(size: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Find the lines whose residual stands alone.

    Parameters
    ----------
    size : (n_freq,) array
        Size of each line's residual over its standard deviation.

    Returns
    -------
    (n_freq,) bool array
    """
    reach = max(_NEIGHBOURS)
    padded = np.pad(size, reach, mode="reflect") if len(size) > reach else np.pad(size, reach, mode="edge")
    shifts = [sign * distance for distance in _NEIGHBOURS for sign in (-1, 1)]
    around = np.max([padded[reach + shift : reach + shift + len(size)] for shift in shifts], axis=0)
    found = size > np.maximum(_CLEARLY, _ALONE * np.maximum(around, 1.0))
    return found if found.mean() <= _MOST else np.zeros_like(found)
