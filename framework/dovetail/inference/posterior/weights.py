"""How many independent samples weighted ones are worth, and what is done where a few weights dominate."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy  # loads a part of it when that is first used
from numpy.typing import NDArray


@dataclass(frozen=True)
class Settings:
    """When searches have found enough, and when their weights count as even."""

    even: float = 0.4
    """Effective samples over searches above which samples need no Metropolis steps."""
    complete: float = 0.7
    """Searches that must end, or else the samples may lack a part of the posterior. In 200 cases of the collet (seed 3
    of a calibration) 80 % of the intervals held the truth where fewer than half did, 89 to 93 % from here on."""
    uneven: float = 0.1
    """Effective samples over searches below which a few weights dominate and the largest are clipped."""
    quantile: float = 0.975
    """Quantile at which they are clipped: where the tangent map folds over, single weights are huge."""
    negligible: float = 12.0
    """Logarithm of the largest weight over those that are left out: thousands of them change nothing."""
    tempered: float = 0.25
    """Effective samples, over their number, from which anchors of further searches are drawn."""


_SETTINGS = Settings()

INDEPENDENT = 0.25
"""Correlation of moved samples with their starts, in each coordinate, below which they count as independent."""


def drawn_by_weight(weight: NDArray[np.float64], count: int, random: np.random.Generator) -> NDArray[np.intp]:
    """Return increasing indices (count,) of samples drawn by weight (systematic resampling)."""
    levels = (np.arange(count) + random.random()) / count * weight.sum()
    return np.asarray(np.minimum(np.searchsorted(np.cumsum(weight), levels), len(weight) - 1))


def effective_sample_size(log_weight: NDArray[np.float64]) -> float:
    """Return the number of samples of equal weight with the same information (Kish); 0 without samples."""
    if not len(log_weight):
        return 0.0
    weight = np.exp(log_weight - log_weight.max())
    return float(weight.sum() ** 2 / np.sum(weight**2))


def effective_after_moves(starts: float, count: int, correlation: float) -> float:
    """Return the effective number of samples that were drawn by weight and then moved.

    Parameters
    ----------
    starts : float
        Effective number of those by whose weights they were drawn; without any, all were at one place.
    count : int
        Number of samples drawn.
    correlation : float
        Of the moved samples with their starts: that part of their differences is still that of the starts.
    """
    before = min(max(starts, 1.0), count)
    return float(1.0 / (correlation**2 / before + (1.0 - correlation**2) / count))


def enough_correlation(log_weight: NDArray[np.float64], count: int, *, complete: bool = True) -> float:
    """Return the correlation with their starts to which moved samples may come, so that they count as even weights do.

    Parameters
    ----------
    log_weight, count
        Logarithms of the weights by which samples are drawn, and their number.
    complete : bool
        Whether the starts are all over the posterior, as far as their weights are.
    """
    if not complete or a_few_dominate(log_weight):
        return INDEPENDENT
    before, wanted = max(effective_sample_size(log_weight), 1.0), _SETTINGS.even * count
    if before >= wanted:
        return 1.0
    return float(max(INDEPENDENT, np.sqrt((1.0 / wanted - 1.0 / count) / (1.0 / before - 1.0 / count))))


def are_counted(log_weight: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return which samples do not have a negligible weight."""
    return np.asarray(log_weight > log_weight.max(initial=-np.inf) - _SETTINGS.negligible)


def are_even(log_weight: NDArray[np.float64], searches: int) -> bool:
    """Return whether weighted samples of a number of searches can be used as they are."""
    return effective_sample_size(log_weight) >= _SETTINGS.even * max(searches, 1)


def are_complete(ended: int, searches: int) -> bool:
    """Return whether so many of a number of searches ended that their samples hardly lack a part of the posterior."""
    return ended >= _SETTINGS.complete * searches


def a_few_dominate(log_weight: NDArray[np.float64]) -> bool:
    """Return whether the weights of samples are so uneven that further samples would not help."""
    return not len(log_weight) or effective_sample_size(log_weight) < _SETTINGS.uneven * len(log_weight)


def clipped(log_weight: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the logarithms of the weights, the largest of them clipped if a few dominate."""
    if len(log_weight) and a_few_dominate(log_weight):
        return np.asarray(np.minimum(log_weight, np.quantile(log_weight, _SETTINGS.quantile)))
    return log_weight


def tempered(log_weight: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the logarithms of the weights times a factor, 1 or less, with which not only a few count."""
    factor = largest_factor(log_weight, _SETTINGS.tempered * len(log_weight), tolerance=0.01)
    return log_weight if factor == 1.0 else np.asarray(factor * log_weight)


def largest_factor(
    log_weight: NDArray[np.float64], wanted: float, most: float = 1.0, *, tolerance: float = 1e-6
) -> float:
    """Return the largest factor of the logarithms of weights, up to `most`, with which so many samples are effective.

    Parameters
    ----------
    log_weight : (n,) array
    wanted : float
        Effective sample size.
    most : float
    tolerance : float
        Relative error of the factor.
    """

    def excess(factor: float) -> float:
        return effective_sample_size(factor * log_weight) - wanted

    if excess(most) >= 0.0:
        return most
    return float(scipy.optimize.bisect(excess, 0.0, most, xtol=1e-15, rtol=tolerance))


def from_logarithms(log_weight: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return weights (n,), the largest of them 1."""
    return np.asarray(np.exp(log_weight - log_weight.max(initial=-np.inf)))
