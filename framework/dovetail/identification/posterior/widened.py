"""A misfit that errors of the model widen, on all lines."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dovetail.identification.fitting.least_squares import Linear, SumOfSquares

__all__ = ["WidenedMisfit"]


class WidenedMisfit:
    """Residuals divided by the root of their covariance, which noise and errors of the model make up together.

    Parameters
    ----------
    misfit : SumOfSquares
        Residuals over their noise.
    errors : (k, m) array
        What one standard deviation of each error of the model adds to them: E, so that their covariance is 1 + E^T E.

    Notes
    -----
    Along each right singular vector of E, with the singular value s, the covariance is 1 + s^2; across all of them it
    stays 1. The errors of the model are thereby integrated out.
    """

    def __init__(self, misfit: SumOfSquares, errors: NDArray[np.float64]) -> None:
        self._misfit = misfit
        _, sizes, self._directions = np.linalg.svd(errors, full_matrices=False)
        self._taken = 1.0 - 1.0 / np.sqrt(1.0 + sizes**2)

    def residuals(self, fraction: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return residuals (n, m) at fractions (n, p) of the ranges."""
        return self._widened(self._misfit.residuals(fraction))

    def linear(self, fraction: NDArray[np.float64]) -> Linear:
        """Return residuals and derivatives at fractions (n, p) of the ranges."""
        found = self._misfit.linear(fraction)
        residuals, slopes = self._widened(found.residuals), self._widened(found.slopes)
        return Linear(residuals, slopes, np.einsum("npm,nm->np", slopes, residuals), slopes @ slopes.transpose(0, 2, 1))

    def _widened(self, residuals: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(residuals - ((residuals @ self._directions.T) * self._taken) @ self._directions)
