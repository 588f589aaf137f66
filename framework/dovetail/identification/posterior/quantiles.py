"""Quantiles of weighted samples."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["quantiles"]


def quantiles(
    values: NDArray[np.float64], weight: NDArray[np.float64], levels: list[float]
) -> tuple[NDArray[np.float64], ...]:
    """Return weighted quantiles of the columns of (n, m) values, an (m,) array for each level."""
    order = np.argsort(values, axis=0)
    ordered = np.take_along_axis(values, order, axis=0)
    below = np.cumsum(weight[order], axis=0) - 0.5 * weight[order]
    return tuple(
        np.array([np.interp(level, below[:, column], ordered[:, column]) for column in range(values.shape[1])])
        for level in levels
    )
