"""Residuals that a model's own small errors hardly enlarge."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dovetail.identification.fitting.misfit import Weighted

__all__ = ["Tolerant"]


@dataclass(frozen=True, eq=False)
class Tolerant:
    """Residuals made white for a model that errs: what its errors may do to them counts little.

    Parameters
    ----------
    residual : Residual
        White where the model does not err.
    basis : (m, k) array
        Orthonormal; what the errors can do to the residuals.
    shrunk : (k,) array
        By which the residuals' part along each is multiplied, from 0 to 1.
    """

    residual: Weighted
    basis: NDArray[np.float64]
    shrunk: NDArray[np.float64]

    @staticmethod
    def towards(residual: Weighted, errors: NDArray[np.float64]) -> Tolerant:
        """Return the residuals for errors (k, m), each of one standard deviation."""
        if not len(errors):
            return Tolerant(residual, np.zeros((errors.shape[1], 0)), np.zeros(0))
        basis, size, _ = np.linalg.svd(errors.T, full_matrices=False)
        return Tolerant(residual, basis, 1.0 / np.sqrt(1.0 + size**2))

    @property
    def parts(self) -> int:
        """Residuals of each line: 2 where there is a phase."""
        return self.residual.parts

    def of(self, values: NDArray[np.complex128]) -> NDArray[np.float64]:
        """Return the residuals (n, m) of FRFs (n, f)."""
        return self._white(self.residual.of(values))

    def slopes(self, values: NDArray[np.complex128], of_values: NDArray[np.complex128]) -> NDArray[np.float64]:
        """Return their derivatives (n, p, m) from FRFs (n, f) and their derivatives (n, p, f)."""
        return self._white(self.residual.slopes(values, of_values))

    def _white(self, residuals: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(residuals + ((residuals @ self.basis) * (self.shrunk - 1.0)) @ self.basis.T)
