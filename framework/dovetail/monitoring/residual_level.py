"""The residual of a file next to the mean residual of earlier files: what the parameters do not explain, and new."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_MEMORY = 50
"""Files over which residuals are averaged at most, so that the mean follows the parameters. Chosen by its meaning: the
mean then adds 1 % to the variance of a file."""


@dataclass(frozen=True, eq=False)
class MeanResidual:
    """The mean of residuals (m,), with the errors of the model that all files have in common.

    Parameters
    ----------
    count : int
    mean : (m,) array
    variance : float
        Of the mean, over that of one file.
    """

    count: int
    mean: Array
    variance: float

    @staticmethod
    def none(size: int) -> MeanResidual:
        """Return the mean of no files."""
        return MeanResidual(0, np.zeros(size), 0.0)

    def with_file(self, residuals: Array) -> MeanResidual:
        """Return the mean with one more file."""
        gain = max(1.0 / (self.count + 1), 1.0 / _MEMORY)
        mean = self.mean + gain * (residuals - self.mean)
        return MeanResidual(self.count + 1, mean, (1.0 - gain) ** 2 * self.variance + gain**2)

    def level(self, residuals: Array, noise: Array) -> float:
        """Return the logarithm of the mean square of a file's new residual over its random error.

        Parameters
        ----------
        residuals : (m,) array
        noise : (m,) array
            Variance of each residual by the file's random error; 0 for lines that do not count.
        """
        if not self.count:
            return 0.0
        counted = noise > 0.0
        new = (residuals - self.mean)[counted] ** 2 / noise[counted]
        return math.log(max(float(np.mean(new)) / (1.0 + self.variance), 1e-30))
