"""Steps of many searches for minima: to the lowest points of models within trust regions, and within limits."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

_TINY = np.finfo(float).tiny
_SINGULAR = 1e-14
"""Eigenvalue of the scaled normal matrix, over the largest, below which it is rounding."""
_RADIUS_ERROR = 0.1
"""Relative error with which the length of a step equals the radius of its trust region."""
_RADIUS_STEPS = 10
"""Largest number of Newton steps for the damping that gives this length; two or three are usual."""


@dataclass(frozen=True, eq=False)
class TrustRegionModel:
    """Gauss-Newton models of half of n sums of squares, in scaled coordinates: g^T s + s^T H s / 2.

    Parameters
    ----------
    gradient, matrix : (n, p) and (n, p, p) arrays
        g and H.
    values, vectors : (n, p) and (n, p, p) arrays
        Eigenvalues and eigenvectors of H; the values are not negative.
    """

    gradient: NDArray[np.float64]
    matrix: NDArray[np.float64]
    values: NDArray[np.float64]
    vectors: NDArray[np.float64]

    @staticmethod
    def of(
        gradient: NDArray[np.float64],
        curvature: NDArray[np.float64],
        scale: NDArray[np.float64],
        barrier: NDArray[np.float64],
    ) -> TrustRegionModel:
        """Return the model with a barrier (n, p) that is added to the scaled curvature."""
        matrix = curvature * scale[:, :, np.newaxis] * scale[:, np.newaxis]
        np.einsum("npp->np", matrix)[:] += barrier
        values, vectors = np.linalg.eigh(matrix)
        return TrustRegionModel(gradient, matrix, np.maximum(values, 0.0), vectors)

    def _along(self, vector: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray((vector[:, np.newaxis] @ self.vectors)[:, 0])

    def step(self, radius: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the steps (n, p) to the lowest points within spheres of given radii (n,), and their damping (n,)."""
        along = self._along(self.gradient)
        damping = _SINGULAR * self.values.max(axis=1) + _TINY
        lowest, highest, used = damping, np.linalg.norm(along, axis=1) / radius, damping
        components = -along / (self.values + damping[:, np.newaxis])
        outside = np.linalg.norm(components, axis=1) > (1.0 + _RADIUS_ERROR) * radius
        tried = np.maximum(1e-3 * highest, np.sqrt(lowest * highest))
        for _ in range(_RADIUS_STEPS):
            if not outside.any():
                break
            used = np.where(outside, tried, used)
            shrunk = self.values + used[:, np.newaxis]
            components = -along / shrunk
            length = np.linalg.norm(components, axis=1)
            excess = length - radius
            outside &= np.abs(excess) > _RADIUS_ERROR * radius
            tangent = excess * length / np.maximum(np.sum(components**2 / shrunk, axis=1), _TINY)
            highest = np.where(excess < 0.0, np.minimum(highest, used), highest)
            lowest = np.maximum(lowest, used + tangent)
            newton = used + length / radius * tangent
            safe = np.maximum(1e-3 * highest, np.sqrt(lowest * highest))
            tried = np.where((newton < lowest) | (newton > highest), safe, newton)
        return self._whole(components), used

    def confined(
        self,
        step: NDArray[np.float64],
        damping: NDArray[np.float64],
        least: NDArray[np.float64],
        most: NDArray[np.float64],
    ) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Return steps (n, p) within limits, and which of their coordinates are free.

        The others stop at their limits, and the free ones minimise the damped model given these: in a valley across the
        coordinates, it would rise if they stopped alone.
        """
        free = np.ones(step.shape, dtype=np.bool_)
        while (beyond := free & ((step < least) | (step > most))).any():
            free &= ~beyond
            stopped = np.where(free, 0.0, np.clip(step, least, most))
            gradient = self.gradient + (self.matrix @ stopped[:, :, np.newaxis])[:, :, 0]
            step = np.where(free.all(axis=1, keepdims=True), step, stopped + self.newton(gradient, damping, free))
        return np.clip(step, least, most), free

    def newton(
        self, gradient: NDArray[np.float64], damping: NDArray[np.float64], free: NDArray[np.bool_]
    ) -> NDArray[np.float64]:
        """Return the damped Newton steps -(H + damping)^-1 g (n, p) in the free coordinates for other gradients."""
        step = self._whole(-self._along(gradient) / (self.values + damping[:, np.newaxis]))
        if not (rows := np.flatnonzero(~free.all(axis=1))).size:
            return step
        matrix = self.matrix[rows] * (free[rows, :, np.newaxis] & free[rows, np.newaxis])
        np.einsum("npp->np", matrix)[:] += np.where(free[rows], damping[rows, np.newaxis], 1.0)
        step[rows] = np.linalg.solve(matrix, np.where(free[rows], -gradient[rows], 0.0)[:, :, np.newaxis])[:, :, 0]
        return step

    def _whole(self, along: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray((self.vectors @ along[:, :, np.newaxis])[:, :, 0])

    def decrease(self, step: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return by how much the models (n,) of the whole sums of squares fall along steps (n, p)."""
        along = self._along(step)
        linear = np.sum(self.gradient * step, axis=1)
        return np.asarray(-2.0 * linear - np.sum(self.values * along**2, axis=1))
