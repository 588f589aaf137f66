"""Whether there are samples enough: the intervals of two halves of them, side by side."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dovetail.identification.posterior.quantiles import quantiles

__all__ = ["FEWEST", "MOST_APART", "halves_apart"]

FEWEST = 50
"""Effective samples below which a tail of an interval rests on two or three."""
MOST_APART = 0.5
"""Part of an interval's width by which its ends may differ between two halves of the samples."""


def halves_apart(values: NDArray[np.float64], weight: NDArray[np.float64], level: float) -> NDArray[np.float64]:
    """Return by how much the intervals of the first and of the second half of the samples differ.

    Parameters
    ----------
    values : (n, m) array
        Samples, in the order in which they were drawn.
    weight : (n,) array
    level : float
        Probability of the interval.

    Returns
    -------
    (m,) array
        The larger difference of the two ends, over the width of the interval that all samples give; 1 where there
        are not two halves.
    """
    middle = len(weight) // 2
    halves = [(values[part], weight[part]) for part in (slice(None, middle), slice(middle, None))]
    if min(half.sum() for _, half in halves) <= 0.0:
        return np.ones(values.shape[1])
    levels = [(1.0 - level) / 2.0, (1.0 + level) / 2.0]
    low, high = quantiles(values, weight, levels)
    first, second = (np.array(quantiles(part, half / half.sum(), levels)) for part, half in halves)
    return np.asarray(np.abs(first - second).max(axis=0) / np.maximum(high - low, np.finfo(float).tiny))
