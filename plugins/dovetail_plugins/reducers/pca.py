"""Principal component analysis."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from pydantic import Field
from threadpoolctl import threadpool_limits

import dovetail
from dovetail_plugins.arrays import checked_rows, state_array

_OWNER = "reducer 'pca'"
_BLOCK = 1024
"""Rows that are reduced at once, which bounds the memory."""


class FittedPCA(dovetail.FittedReducer):
    """A projection on principal components.

    Parameters
    ----------
    mean : (n_features,) array
        Subtracted from every row.
    components : (n_components, n_features) array
        Matrix by which the centred rows are multiplied, including whitening.
    """

    def __init__(self, mean: NDArray[np.float32], components: NDArray[np.float32]) -> None:
        self._mean = mean.astype(np.float64)
        self._projection = np.ascontiguousarray(components.T, dtype=np.float64)

    def transform(self, features: NDArray[np.float32]) -> NDArray[np.float32]:
        """Project features (n_samples, n_features) on the components.

        Notes
        -----
        In double precision, so that in single precision the sum over the features is the same bit for bit, for any
        number of rows in the matrix product.
        """
        rows = checked_rows(features, _OWNER, width=self._mean.size)
        reduced = np.empty((len(rows), self._projection.shape[1]), dtype=np.float32)
        for start in range(0, len(rows), _BLOCK):
            block = slice(start, start + _BLOCK)
            reduced[block] = (rows[block] - self._mean) @ self._projection
        return reduced

    def state(self) -> dovetail.ComponentState:
        """Return the mean and the components."""
        return {
            "mean": self._mean.astype(np.float32),
            "components": np.ascontiguousarray(self._projection.T, dtype=np.float32),
        }


class PCA(dovetail.Reducer):
    """Principal components of the training features, by randomised singular value decomposition."""

    name = "pca"
    summary = "principal component analysis (scikit-learn)"
    references = ("Halko, Martinsson and Tropp, SIAM Review 53 (2011) 217-288",)

    class Config(dovetail.ComponentConfig):
        """Options of the principal component analysis.

        Attributes
        ----------
        n_components : int
            Number of components that are kept.
        whiten : bool
            Divide each component by its standard deviation over the training features.
        """

        n_components: int = Field(default=100, ge=1)
        whiten: bool = False

    def fit(self, features: NDArray[np.float32], *, seed: int) -> FittedPCA:
        """Fit to training features (n_samples, n_features).

        Raises
        ------
        DovetailError
            There are fewer samples or features than components, or every row is the same.
        """
        from sklearn import decomposition

        rows = checked_rows(features, _OWNER).astype(np.float32, copy=False)
        wanted, most = self.config.n_components, min(rows.shape)
        if wanted > most:
            raise dovetail.DovetailError(
                dovetail.Fault(
                    f"{_OWNER} n_components",
                    f"{wanted} components cannot be had from {rows.shape[0]} samples of {rows.shape[1]} features.",
                    f"1 to {most}",
                )
            )
        with threadpool_limits(1, user_api="blas"):  # the last digits would depend on their number
            fitted = decomposition.PCA(wanted, svd_solver="randomized", random_state=seed).fit(rows)
        components = np.asarray(fitted.components_, dtype=np.float64)
        if self.config.whiten:
            deviation = np.sqrt(np.asarray(fitted.explained_variance_, dtype=np.float64))
            components /= np.maximum(deviation, np.finfo(np.float32).eps * deviation[0])[:, np.newaxis]
        return FittedPCA(fitted.mean_.astype(np.float32), components.astype(np.float32))

    def restore(self, state: dovetail.ComponentState) -> FittedPCA:
        """Rebuild the projection from its mean and components."""
        components = state_array(state, "components", _OWNER, (None, None))
        return FittedPCA(state_array(state, "mean", _OWNER, (components.shape[1],)), components)
