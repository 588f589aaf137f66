"""The order of samples of two posteriors in one array."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Alternating:
    """Rows that belong to two posteriors in turn, so that each half of all rows holds as many of both.

    Samples given the measurement alternate with those about the best fit where a model has errors. Where it has none,
    all are given the measurement, and those of the first posterior represent them.

    Parameters
    ----------
    count : int
        Of all rows.
    """

    count: int

    @property
    def given_measurement(self) -> NDArray[np.bool_]:
        """(count,) whether a row is certainly one of the posterior given the measurement."""
        return np.asarray(np.arange(self.count) % 2 == 0)

    @property
    def about_fit(self) -> NDArray[np.bool_]:
        """(count,) whether a row is one of the posterior about the best fit, if there is one."""
        return ~self.given_measurement
