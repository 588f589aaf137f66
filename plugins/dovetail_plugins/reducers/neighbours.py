"""Exact nearest neighbours, and their membership strengths."""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits


@dataclass(frozen=True)
class Settings:
    """How neighbours are searched and weighted.

    Attributes
    ----------
    block : int
        Number of points that are compared with all rows at a time, which limits the memory of their distances.
    spare : int
        Number of candidates in addition to the neighbours, since the matrix product rounds their distances.
    group : int
        Number of rows whose minimum is determined before single rows are ranked.
    threads : int
        Largest number of blocks that are computed at the same time.
    bisections : int
        Number of bisections for sigma, down to the last bit.
    least_sigma : float
        Smallest sigma over the mean distance of the neighbours, umap-learn's MIN_K_DIST_SCALE.
    """

    block: int = 128
    spare: int = 8
    group: int = 32
    threads: int = 8
    bisections: int = 64
    least_sigma: float = 1e-3


SETTINGS = Settings()


class Neighbours:
    """Search for the nearest neighbours among given rows, by Euclidean distance.

    Parameters
    ----------
    rows : (n_rows, n_columns) array
    """

    def __init__(self, rows: NDArray[Any]) -> None:
        self._rows = np.ascontiguousarray(rows, dtype=np.float64)
        self._short_rows = self._rows.astype(np.float32)
        self._squares = np.einsum("ij,ij->i", self._rows, self._rows)
        self._short_squares = self._squares.astype(np.float32)
        self._longest = float(np.sqrt(self._squares.max(initial=0.0)))

    def nearest(self, points: NDArray[Any], count: int) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
        """Find the nearest rows of each point.

        Parameters
        ----------
        points : (n_points, n_columns) array
        count : int

        Returns
        -------
        indices, squares : (n_points, count) arrays
            Indices of the rows and their squared distances, nearest first. The result for a point does not depend on
            the other points.
        """
        blocks = [points[start : start + SETTINGS.block] for start in range(0, len(points), SETTINGS.block)]
        threads = min(len(blocks), SETTINGS.threads, os.cpu_count() or 1)
        if threads <= 1:
            found = [self._nearest(block, count) for block in blocks]
        else:
            with threadpool_limits(1, user_api="blas"), ThreadPoolExecutor(threads) as pool:
                found = list(pool.map(lambda block: self._nearest(block, count), blocks))
        return np.concatenate([indices for indices, _ in found]), np.concatenate([squares for _, squares in found])

    def _nearest(self, points: NDArray[Any], count: int) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
        """Find candidates in single precision; repeat in double precision if rounding might hide a nearer row."""
        points = points.astype(np.float64)
        candidates, border = _candidates(points.astype(np.float32), self._short_rows, self._short_squares, count)
        indices, squares = self._sorted(points, candidates, count)
        own = np.einsum("ij,ij->i", points, points)
        rounding = (points.shape[1] + 4) * np.finfo(np.float32).eps * (np.sqrt(own) + self._longest) ** 2
        unsure = np.flatnonzero(squares[:, -1] >= border + own - rounding)
        if len(unsure) and candidates.shape[1] < len(self._rows):
            candidates, _ = _candidates(points[unsure], self._rows, self._squares, count)
            indices[unsure], squares[unsure] = self._sorted(points[unsure], candidates, count)
        return indices, squares

    def _sorted(
        self, points: NDArray[np.float64], candidates: NDArray[np.intp], count: int
    ) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
        """Compute the distances of all candidates and keep the shortest, nearest first."""
        differences = self._rows[candidates] - points[:, np.newaxis]
        squares = np.einsum("ijk,ijk->ij", differences, differences)
        order = np.argsort(squares, axis=1, kind="stable")[:, :count]
        return np.take_along_axis(candidates, order, axis=1), np.take_along_axis(squares, order, axis=1)


def _candidates(
    points: NDArray[Any], rows: NDArray[Any], squares: NDArray[Any], count: int
) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    """Return the nearest rows of each point, and a lower bound of the distances of all other rows.

    Both are computed with a matrix product and are subject to its rounding, which depends on the block. The bound is a
    squared distance minus the point's squared norm.
    """
    ranking = points @ rows.T
    ranking *= -2.0
    ranking += squares
    spared = min(count + SETTINGS.spare, len(rows))
    columns = _columns_of_smallest(ranking, spared)
    nearby = np.take_along_axis(ranking, columns, axis=1)
    chosen = np.argpartition(nearby, spared - 1, axis=1)[:, :spared]
    border = np.take_along_axis(nearby, chosen, axis=1).max(axis=1).astype(np.float64)
    return np.sort(np.take_along_axis(columns, chosen, axis=1), axis=1), border


def _columns_of_smallest(ranking: NDArray[Any], count: int) -> NDArray[np.intp]:
    """Return columns (n_points, n) that include those of the `count` smallest values of each row.

    They are the groups of columns with the `count` smallest minima, or all columns if these groups contain most of
    them.
    """
    groups = ranking.shape[1] // SETTINGS.group
    if groups < 2 * count:
        return np.broadcast_to(np.arange(ranking.shape[1]), ranking.shape)
    grouped = ranking[:, : groups * SETTINGS.group].reshape(len(ranking), SETTINGS.group, groups)
    chosen = np.argpartition(grouped.min(axis=1), count - 1, axis=1)[:, np.newaxis, :count]
    columns = (chosen + groups * np.arange(SETTINGS.group)[:, np.newaxis]).reshape(len(ranking), -1)
    rest = np.arange(groups * SETTINGS.group, ranking.shape[1])
    return np.concatenate([columns, np.broadcast_to(rest, (len(ranking), len(rest)))], axis=1)


def membership_strengths(distances: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the weight of each neighbour of a new point, by umap-learn's rule.

    Parameters
    ----------
    distances : (n_points, n_neighbors) array
        Nearest first.

    Returns
    -------
    (n_points, n_neighbors) array
        exp(-d / sigma), with sigma such that the strengths of all but the nearest sum to log2(n_neighbors). The lower
        bound of sigma is a fraction of the point's mean distance; in umap-learn it is one of the batch's mean distance.
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
