"""Exact nearest neighbours, and their membership strengths."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["Neighbours", "membership_strengths"]


@dataclass(frozen=True)
class Settings:
    """How neighbours are searched and weighted.

    Attributes
    ----------
    block : int
        Points that are compared with all rows at once. It bounds the memory of their distances.
    spare : int
        Candidates beyond the number of neighbours, since the matrix product rounds their distances.
    bisections : int
        Halvings of the interval of sigma, to the last bit.
    least_sigma : float
        Least sigma over the mean distance of the neighbours, umap-learn's MIN_K_DIST_SCALE.
    """

    block: int = 256
    spare: int = 8
    bisections: int = 64
    least_sigma: float = 1e-3


SETTINGS = Settings()


class Neighbours:
    """Search for the nearest of some rows, by Euclidean distance.

    Parameters
    ----------
    rows : (n_rows, n_columns) array
    """

    def __init__(self, rows: NDArray[Any]) -> None:
        self._rows = np.ascontiguousarray(rows, dtype=np.float64)
        self._squares = np.einsum("ij,ij->i", self._rows, self._rows)

    def nearest(self, points: NDArray[Any], count: int) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
        """Find the nearest rows of each point.

        Parameters
        ----------
        points : (n_points, n_columns) array
        count : int

        Returns
        -------
        indices, squares : (n_points, count) arrays
            Numbers of the rows and their squared distances, nearest first. A point's answer does not depend on the
            other points.
        """
        blocks = [
            self._nearest(points[start : start + SETTINGS.block], count)
            for start in range(0, len(points), SETTINGS.block)
        ]
        return np.concatenate([indices for indices, _ in blocks]), np.concatenate([squares for _, squares in blocks])

    def _nearest(self, points: NDArray[Any], count: int) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
        """Choose candidates by a matrix product, whose rounding depends on the block, then measure each distance."""
        points = points.astype(np.float64)
        ranking = points @ self._rows.T
        ranking *= -2.0
        ranking += self._squares
        spared = min(count + SETTINGS.spare, len(self._rows))
        candidates = np.sort(np.argpartition(ranking, spared - 1, axis=1)[:, :spared], axis=1)
        differences = self._rows[candidates] - points[:, np.newaxis]
        squares = np.einsum("ijk,ijk->ij", differences, differences)
        order = np.argsort(squares, axis=1, kind="stable")[:, :count]
        return np.take_along_axis(candidates, order, axis=1), np.take_along_axis(squares, order, axis=1)


def membership_strengths(distances: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the weight of each neighbour of a new point, by umap-learn's rule.

    Parameters
    ----------
    distances : (n_points, n_neighbors) array
        Nearest first.

    Returns
    -------
    (n_points, n_neighbors) array
        exp(-d / sigma), with sigma such that the strengths of all but the nearest add up to log2(n_neighbors).
        umap-learn bounds sigma from below by a fraction of the batch's mean distance, this function by a fraction of
        the point's own mean distance.
    """
    target = np.log2(distances.shape[1])
    mean = distances.mean(axis=1, keepdims=True)
    sigma = np.where(mean > 0.0, mean, 1.0)
    low, high = np.zeros_like(sigma), np.full_like(sigma, np.inf)
    for _ in range(SETTINGS.bisections):
        above = np.exp(-distances[:, 1:] / sigma).sum(axis=1, keepdims=True) > target
        low, high = np.where(above, low, sigma), np.where(above, sigma, high)
        sigma = np.where(np.isinf(high), 2.0 * sigma, 0.5 * (low + high))
    return np.exp(-distances / np.maximum(sigma, SETTINGS.least_sigma * np.where(mean > 0.0, mean, 1.0)))
