"""Derivatives of a joint's matrices: exact where they are linear in a parameter, by differences elsewhere."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dovetail.interfaces.matrices import StructuralMatrices

__all__ = ["STENCIL", "Differentiation", "difference_steps"]

Matrices = Callable[[NDArray[np.float64]], StructuralMatrices]
"""Matrices (n, d, d) of parameter vectors (n, n_params)."""

STENCIL = ((1.0, 8.0), (-1.0, -8.0), (2.0, -1.0), (-2.0, 1.0))
"""Distances in steps, and weights, of the central difference of fourth order; their sum is divided by twelve steps."""


@dataclass(frozen=True)
class Settings:
    """How derivatives are taken.

    Attributes
    ----------
    step : float
        Step of the differences, relative to the parameter. Their truncation error is about step^4 and their rounding
        error about 1e-16 / step; here both are near 1e-12 of the derivative.
    least_step : float
        Least step, relative to the parameter's range, for a parameter near zero.
    probes : int
        Number of parameter vectors at which slopes are compared.
    rounding : float
        Largest difference, relative to the entry, that counts as rounding.
    block_bytes : float
        Memory of the matrices that are evaluated at once. They stay in the processor's cache.
    """

    step: float = 1e-3
    least_step: float = 1e-6
    probes: int = 4
    rounding: float = 1e-12
    block_bytes: float = 1e6


SETTINGS = Settings()


def difference_steps(
    theta: NDArray[np.float64], lower: NDArray[np.float64], upper: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the steps (n, n_params) of differences at parameter vectors (n, n_params)."""
    return np.maximum(SETTINGS.step * np.abs(theta), SETTINGS.least_step * (upper - lower))


class Differentiation:
    """Derivatives of matrices by their parameters.

    Where the matrices are linear in a parameter over its whole range, with a slope that no other parameter changes,
    that slope is the derivative. It is computed once. All other derivatives are central differences of fourth order.
    So are all derivatives at a parameter vector outside the ranges where the matrices are no longer linear.

    Parameters
    ----------
    matrices : callable
    size : int
        Number d of their DOFs.
    lower, upper : (n_params,) arrays
        Ranges of the parameters.
    """

    def __init__(self, matrices: Matrices, size: int, lower: NDArray[np.float64], upper: NDArray[np.float64]) -> None:
        self._matrices, self._size, self._lower, self._upper = matrices, size, lower, upper
        self._changing = np.zeros(size, dtype=np.bool_)
        slopes = {column: self._constant_slope(column) for column in range(len(lower))}
        self._slopes = {column: slope for column, slope in slopes.items() if slope is not None}
        self._nonlinear = [column for column, slope in slopes.items() if slope is None]
        changing = np.flatnonzero(self._changing)
        self._dofs = slice(int(changing.min()), int(changing.max()) + 1) if len(changing) else slice(0, 0)

    def jacobian(self, theta: NDArray[np.float64]) -> list[StructuralMatrices]:
        """Return the derivatives (n, d, d) by each parameter at parameter vectors (n, n_params)."""
        derivatives = self._differences(theta, self._nonlinear, self._dofs)
        bent = self._is_bent(theta)
        differences = self._differences(theta[bent], list(self._slopes), slice(None)) if bent.any() else {}
        for column, slope in self._slopes.items():
            derivatives[column] = np.broadcast_to(slope, (4, len(theta), self._size, self._size))
            if differences:
                derivatives[column] = derivatives[column].copy()
                derivatives[column][:, bent] = differences[column]
        return [StructuralMatrices(*derivative) for _, derivative in sorted(derivatives.items())]

    def _constant_slope(self, column: int) -> NDArray[np.float64] | None:
        """Return the slope (4, 1, d, d) of M, K, C and D by a parameter, None where it is not the same everywhere."""
        low, width = self._lower, self._upper - self._lower
        slope: NDArray[np.float64] | None = None
        constant, changing = True, np.zeros_like(self._changing)
        for fractions in np.random.default_rng(0).random((SETTINGS.probes, len(low))):
            rows = np.tile(low + fractions * width, (3, 1))
            rows[0, column], rows[2, column] = low[column], self._upper[column]
            distance = (rows[:, column] - low[column])[:, np.newaxis, np.newaxis]
            values = np.stack(_four(self._matrices(rows)))
            slope = (values[:, 2:] - values[:, :1]) / width[column] if slope is None else slope
            errors = np.abs(values - values[:, :1] - distance * slope)
            constant &= bool((errors <= SETTINGS.rounding * np.abs(values).max(axis=1, keepdims=True)).all())
            changing |= (values != values[:, :1]).any(axis=(0, 1, 2))
        if not constant:
            self._changing |= changing
        return slope if constant else None

    def _is_bent(self, theta: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Return which of n parameter vectors lie outside the ranges where the constant slopes do not hold, (n,)."""
        bent: NDArray[np.bool_] = np.asarray(((theta < self._lower) | (theta > self._upper)).any(axis=1))
        linear = list(self._slopes)
        if not linear or not bent.any():
            return np.zeros_like(bent)
        outside, start = theta[bent], theta[bent]
        start[:, linear] = self._lower[linear]
        values = np.stack(_four(self._matrices(np.concatenate([outside, start]))))
        there, here = values.reshape(4, 2, len(start), self._size, self._size).swapaxes(0, 1)
        change = sum((outside - start)[:, c, np.newaxis, np.newaxis] * slope for c, slope in self._slopes.items())
        limit = SETTINGS.rounding * np.maximum(np.abs(here), np.abs(there))
        bent[bent] = np.any(np.abs(there - here - change) > limit, axis=(0, 2, 3))
        return bent

    def _differences(
        self, theta: NDArray[np.float64], columns: Sequence[int], dofs: slice
    ) -> dict[int, NDArray[np.float64]]:
        """Return the derivatives (4, n, d, d) of M, K, C and D by some parameters, by differences between some DOFs."""
        matrix = (self._size, self._size)
        derivatives = np.zeros((4, len(columns), len(theta), *matrix))
        memory = 4 * 8 * self._size**2 * len(STENCIL) * max(1, len(columns))
        count = max(1, int(SETTINGS.block_bytes / memory))
        for first in range(0, len(theta) if columns else 0, count):
            block = slice(first, first + count)
            steps = difference_steps(theta[block], self._lower, self._upper)
            moved = np.tile(theta[block], (len(STENCIL), len(columns), 1, 1))
            for index, column in enumerate(columns):
                moved[:, index, :, column] += np.outer([distance for distance, _ in STENCIL], steps[:, column])
            values = self._matrices(moved.reshape(-1, theta.shape[1]))
            for derivative, entries in zip(derivatives, _four(values), strict=True):
                near = entries.reshape(*moved.shape[:3], *matrix)[..., dofs, dofs]
                total = sum(weight * value for value, (_, weight) in zip(near, STENCIL, strict=True))
                derivative[:, block, dofs, dofs] = total / (12.0 * steps[:, columns].T[..., np.newaxis, np.newaxis])
        return dict(zip(columns, derivatives.swapaxes(0, 1), strict=True))


def _four(matrices: StructuralMatrices) -> tuple[NDArray[np.float64], ...]:
    return matrices.M, matrices.K, matrices.C, matrices.D
