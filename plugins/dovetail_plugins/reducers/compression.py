"""Rows of many features as short rows with nearly the same distances between them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal, Self

import numpy as np
from numpy.typing import NDArray

__all__ = ["METRICS", "Compression", "Metric"]

Metric = Literal["correlation", "cosine", "euclidean"]
METRICS: tuple[Metric, ...] = ("correlation", "cosine", "euclidean")

_BLOCK = 1024
_SAMPLE = 8000
_KEPT_ENERGY = 0.9999
_MOST_DIRECTIONS = 256


@dataclass(frozen=True, eq=False)
class Compression:
    """A projection on the leading directions of the training rows, after what the metric asks for.

    The Euclidean distance of two rows of unit length (of which the mean was taken before, for a correlation) is a
    function of their cosine or correlation distance: d^2 / 2. So one search serves the three metrics.

    Parameters
    ----------
    metric : 'correlation', 'cosine' or 'euclidean'
    mean : (n_features,) array
        Of the training rows.
    directions : (n_directions, n_features) array
        Orthonormal.
    """

    metric: Metric
    mean: NDArray[np.float64]
    directions: NDArray[np.float64]

    @classmethod
    def fit(cls, features: NDArray[Any], metric: Metric, *, fewest: int, seed: int) -> Self:
        """Find the directions that hold nearly all variation of training features.

        Parameters
        ----------
        features : (n_samples, n_features) array
        metric : 'correlation', 'cosine' or 'euclidean'
        fewest : int
            Directions to keep even if fewer would do, as far as there are so many.
        seed : int
            Of the choice of the rows looked at (8000 at most) and of the decomposition.

        Notes
        -----
        As many directions as hold 99.99 % of the variance, 256 at most. On 8000 FRFs of the collet assembly 140 of
        4451 are left, and 99.9 % of the nearest neighbours stay what they were.
        """
        from sklearn.utils.extmath import randomized_svd

        generator = np.random.default_rng(seed)
        chosen = np.sort(generator.permutation(len(features))[:_SAMPLE])
        rows = _prepared(features[chosen], metric)
        mean = rows.mean(axis=0)
        rows -= mean
        most = min(*rows.shape, _MOST_DIRECTIONS)
        _, values, directions = randomized_svd(rows.astype(np.float32), most, random_state=seed)
        energy = np.cumsum(np.asarray(values, dtype=np.float64) ** 2)
        kept = int(np.searchsorted(energy, _KEPT_ENERGY * np.einsum("ij,ij->", rows, rows))) + 1
        kept = min(max(kept, fewest), most)
        return cls(
            metric, mean.astype(np.float32).astype(np.float64), np.array(directions[:kept], dtype=np.float64, order="C")
        )

    def project(self, features: NDArray[Any]) -> NDArray[np.float32]:
        """Return features (n_samples, n_features) as rows (n_samples, n_directions)."""
        rows = np.empty((len(features), len(self.directions)), dtype=np.float32)
        for start in range(0, len(features), _BLOCK):
            block = slice(start, start + _BLOCK)
            rows[block] = (_prepared(features[block], self.metric) - self.mean) @ self.directions.T
        return rows

    def distances(self, squares: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the distances in the metric that belong to squared Euclidean distances of projected rows."""
        return np.sqrt(squares) if self.metric == "euclidean" else 0.5 * squares


def _prepared(features: NDArray[Any], metric: Metric) -> NDArray[np.float64]:
    rows = features.astype(np.float64)
    if metric == "correlation":
        rows -= rows.mean(axis=1, keepdims=True)
    if metric != "euclidean":
        length = np.linalg.norm(rows, axis=1, keepdims=True)
        rows /= np.where(length > 0.0, length, 1.0)
    return rows
