"""Uniform manifold approximation and projection, with a transform that treats each FRF separately."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

import dovetail
from dovetail_plugins.arrays import checked_rows, state_array, state_number
from dovetail_plugins.reducers.compression import METRICS, Compression, Metric
from dovetail_plugins.reducers.neighbours import Neighbours, membership_strengths

_OWNER = "reducer 'umap'"
_LAYOUT = "_nb_optimize_layout_euclidean_single_epoch"


class FittedUMAP(dovetail.FittedReducer):
    """The embedding of the training FRFs, and the transform of any FRF into it.

    Parameters
    ----------
    compression : Compression
        Projection of features to the short rows that are compared.
    rows : (n_samples, n_directions) float16 array
        The training FRFs, compressed, in units of `unit`.
    unit : float
    embedding : (n_samples, n_components) array
        Their coordinates in umap-learn's layout.
    n_neighbors : int
        Number of training FRFs that determine the coordinates of an FRF.

    Notes
    -----
    umap-learn transforms new points by a stochastic layout of the whole batch, which starts from an average over their
    neighbours. The same FRF would have other coordinates in another batch. Here its coordinates are this average: of
    the embedding of its exact nearest training FRFs, weighted by umap-learn's membership strengths. Training FRFs are
    transformed in the same way (each is its own nearest neighbour), so that the regressor is trained on the kind of
    features that it gets later. For the collet assembly the test R2 is slightly higher than with the layout itself.

    Only NumPy is needed, so that a stored model can be used without loading umap or numba.
    """

    def __init__(
        self,
        compression: Compression,
        rows: NDArray[np.float16],
        unit: float,
        embedding: NDArray[np.float32],
        n_neighbors: int,
    ) -> None:
        self._compression = compression
        self._rows = rows
        self._unit = unit
        self._embedding = embedding
        self._n_neighbors = n_neighbors
        self._neighbours = Neighbours(rows.astype(np.float64) * unit)

    def transform(self, features: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return the coordinates (n_samples, n_components) of features (n_samples, n_features), row by row."""
        values = checked_rows(features, _OWNER, width=self._compression.mean.size)
        points = self._compression.project(values)
        indices, squares = self._neighbours.nearest(points, self._n_neighbors)
        strengths = membership_strengths(self._compression.distances(squares))
        shares = strengths / strengths.sum(axis=1, keepdims=True)
        placed = np.zeros((len(points), self._embedding.shape[1]))
        for neighbour, share in zip(indices.T, shares.T, strict=True):
            placed += share[:, np.newaxis] * self._embedding[neighbour]
        return placed.astype(np.float32)

    def state(self) -> dovetail.ComponentState:
        """Return the compressed training FRFs, their embedding and the projection that compresses new ones."""
        return {
            "metric": self._compression.metric,
            "n_neighbors": self._n_neighbors,
            "mean": self._compression.mean.astype(np.float32),
            "directions": self._compression.directions.astype(np.float32),
            "unit": self._unit,
            "rows": self._rows.copy(),
            "embedding": self._embedding.copy(),
        }


class UMAP(dovetail.Reducer):
    """UMAP of the training FRFs by umap-learn, from exact nearest neighbours.

    Notes
    -----
    The neighbours are exact, not umap-learn's approximate ones. The layout starts from principal components: a spectral
    start takes longer and gives no better regression. `FittedUMAP` describes the transform of new FRFs.
    """

    name = "umap"
    summary = "uniform manifold approximation and projection (umap-learn)"
    references = ("McInnes, Healy and Melville, arXiv:1802.03426 (2018)",)

    class Config(dovetail.ComponentConfig):
        """Options of UMAP.

        Attributes
        ----------
        n_components : int
            Dimension of the embedding.
        n_neighbors : int
            Neighbours of a training FRF in the graph, and training FRFs that determine the coordinates of an FRF.
        min_dist : float
            Smallest distance of two FRFs in the embedding.
        metric : 'correlation', 'cosine' or 'euclidean'
            Distance of two FRFs' features.
        n_epochs : int, optional
            Passes of the layout. By default umap-learn decides: 500 for up to 10,000 samples, 200 for more.
        """

        n_components: int = Field(default=100, ge=1)
        n_neighbors: int = Field(default=15, ge=2)
        min_dist: float = Field(default=0.1, ge=0.0, le=1.0)
        metric: Metric = "correlation"
        n_epochs: int | None = Field(default=None, ge=1)

    @classmethod
    def examples(cls, folder: Path) -> Sequence[Mapping[str, Any]]:  # noqa: ARG003
        """Return a layout with few passes."""
        return ({"n_epochs": 50},)

    def fit(self, features: NDArray[np.float32], *, seed: int) -> FittedUMAP:
        """Fit to training features (n_samples, n_features).

        Raises
        ------
        DovetailError
            There are too few samples for the neighbours or the components, or all are equal.
        """
        config = self.config
        values = checked_rows(features, _OWNER)
        fewest = max(config.n_neighbors, config.n_components) + 2
        if len(values) < fewest:
            wanted = f"{config.n_neighbors} neighbours and {config.n_components} components"
            raise dovetail.DovetailError(
                dovetail.Fault(_OWNER, f"{len(values)} samples are too few for {wanted}.", f"{fewest} samples or more")
            )
        compression = Compression.fit(values, config.metric, fewest=config.n_components, seed=seed)
        projected = compression.project(values)
        unit = float(np.abs(projected).max())
        if not unit > 0.0:
            raise dovetail.DovetailError(dovetail.Fault(_OWNER, "all training rows are the same."))
        rows = (projected / unit).astype(np.float16)
        del projected
        exact = rows.astype(np.float64) * unit
        indices, squares = Neighbours(exact).nearest(exact, config.n_neighbors)
        embedding = _layout(exact.astype(np.float32), indices, compression.distances(squares), config, seed)
        return FittedUMAP(compression, rows, unit, embedding, config.n_neighbors)

    def restore(self, state: dovetail.ComponentState) -> FittedUMAP:
        """Rebuild the transform from its state.

        Raises
        ------
        DovetailError
            The state is incomplete, or its arrays are inconsistent.
        """
        metric = next((metric for metric in METRICS if metric == state.get("metric")), None)
        if metric is None:
            problem = f"its state has the metric {state.get('metric')!r}."
            raise dovetail.DovetailError(dovetail.Fault(_OWNER, problem, ", ".join(METRICS)))
        directions = state_array(state, "directions", _OWNER, (None, None)).astype(np.float64)
        mean = state_array(state, "mean", _OWNER, (directions.shape[1],)).astype(np.float64)
        rows = state_array(state, "rows", _OWNER, (None, len(directions))).astype(np.float16)
        embedding = state_array(state, "embedding", _OWNER, (len(rows), None)).astype(np.float32)
        n_neighbors = int(state_number(state, "n_neighbors", _OWNER))
        if not 2 <= n_neighbors <= len(rows):
            problem = f"its state has {n_neighbors} neighbours among {len(rows)} rows."
            raise dovetail.DovetailError(dovetail.Fault(_OWNER, problem, f"2 to {len(rows)}"))
        unit = state_number(state, "unit", _OWNER)
        return FittedUMAP(Compression(metric, mean, directions), rows, unit, embedding, n_neighbors)


def _layout(
    rows: NDArray[np.float32], indices: NDArray[Any], distances: NDArray[Any], config: UMAP.Config, seed: int
) -> NDArray[np.float32]:
    """Return umap-learn's embedding (n_samples, n_components), given the neighbours of each row."""
    import umap
    from umap import layouts, umap_

    layout: Any = getattr(layouts, _LAYOUT, None)
    for function in (umap_.smooth_knn_dist, umap_.compute_membership_strengths, layout):
        with suppress(AttributeError, RuntimeError):  # another version, or no cache folder
            function.enable_caching()  # otherwise each process compiles it, for ten seconds
    estimator = umap.UMAP(
        n_components=config.n_components,
        n_neighbors=config.n_neighbors,
        min_dist=config.min_dist,
        metric="euclidean",
        n_epochs=config.n_epochs,
        init="pca" if config.n_components <= rows.shape[1] else "random",
        random_state=seed,
        n_jobs=1,
        precomputed_knn=(indices.astype(np.int32), distances.astype(np.float32)),
    )
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message=".*knn_search_index.*")  # umap-learn's own transform is not used
        return np.asarray(estimator.fit_transform(rows), dtype=np.float32)
