"""Any transformer of scikit-learn as a reducer."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

import dovetail
from dovetail_plugins.arrays import checked_rows
from dovetail_plugins.scikit_learn import EstimatorConfig, KeptEstimator


class FittedTransformer(dovetail.FittedReducer):
    """A transformer as arrays and plain values.

    Parameters
    ----------
    kept : KeptEstimator
    """

    def __init__(self, kept: KeptEstimator) -> None:
        self._kept = kept

    def transform(self, features: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return the transformed features (n_samples, n_components) of features (n_samples, n_features)."""
        return self._kept.answer(features, "transform").astype(np.float32)

    def state(self) -> dovetail.ComponentState:
        """Return the transformer's attributes."""
        return self._kept.state()


class Transformer(dovetail.Reducer):
    """A transformer of scikit-learn, by its name; its random state is the description's seed.

    Notes
    -----
    Its fitted attributes must be arrays and plain values, so that a model can be stored without pickle. That is tried
    on random numbers when the description is read. It computes in double precision.
    """

    name = "sklearn"
    summary = "any transformer of scikit-learn, by its name"
    references = ("F. Pedregosa et al., Scikit-learn: machine learning in Python, JMLR 12 (2011) 2825-2830",)

    class Config(EstimatorConfig):
        """The transformer and its options."""

        method: ClassVar = "transform"
        estimator: str = Field(description="Name of the class, such as KernelPCA.")

    config: Config

    @classmethod
    def examples(cls, folder: Path) -> Sequence[Mapping[str, Any]]:  # noqa: ARG003
        """Return a transformer that contains another estimator, and one with a random state."""
        kernel = {"n_components": 8, "kernel": "rbf", "gamma": 0.01}
        return (
            {"estimator": "KernelPCA", "options": kernel},
            {"estimator": "GaussianRandomProjection", "options": {"n_components": 6}},
        )

    @property
    def _owner(self) -> str:
        return f"reducer 'sklearn' ({self.config.estimator})"

    def fit(self, features: NDArray[np.float32], *, seed: int) -> FittedTransformer:
        """Fit to training features (n_samples, n_features).

        Raises
        ------
        DovetailError
            The transformer cannot be fitted to these features, or its fitted attributes are not arrays or plain values.
        """
        rows = checked_rows(features, self._owner)
        estimator = self.config.new_estimator(seed)
        return FittedTransformer(KeptEstimator.fitted(estimator, rows, method="transform", owner=self._owner))

    def restore(self, state: dovetail.ComponentState) -> FittedTransformer:
        """Rebuild the transformer from its attributes."""
        return FittedTransformer(KeptEstimator(state, self._owner))
