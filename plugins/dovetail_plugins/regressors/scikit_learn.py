"""Any regressor of scikit-learn."""

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


class FittedScikitLearnRegressor(dovetail.FittedRegressor):
    """A regressor as arrays and plain values.

    Parameters
    ----------
    kept : KeptEstimator
    """

    def __init__(self, kept: KeptEstimator) -> None:
        self._kept = kept

    def predict(self, features: NDArray[np.float32]) -> NDArray[np.float64]:
        """Predict targets (n_samples, n_targets) from features (n_samples, n_features)."""
        return self._kept.answer(features, "predict")

    def state(self) -> dovetail.ComponentState:
        """Return the regressor's attributes."""
        return self._kept.state()


class ScikitLearnRegressor(dovetail.Regressor):
    """A regressor of scikit-learn, by its name; its random state is the description's seed.

    Notes
    -----
    A regressor for a single target is fitted to each target separately. Its fitted attributes must be arrays and plain
    values, so that a model can be stored without pickle. That is tried on random numbers when the description is read,
    so that others, such as forests of trees, are refused before any work.
    """

    name = "sklearn"
    summary = "any regressor of scikit-learn, by its name"
    references = ("F. Pedregosa et al., Scikit-learn: machine learning in Python, JMLR 12 (2011) 2825-2830",)

    class Config(EstimatorConfig):
        """The regressor and its options."""

        method: ClassVar = "predict"
        estimator: str = Field(description="Name of the class, such as KernelRidge.")

    config: Config

    @classmethod
    def examples(cls, folder: Path) -> Sequence[Mapping[str, Any]]:  # noqa: ARG003
        """Return a regressor for several targets, and one for a single target."""
        return (
            {"estimator": "KernelRidge", "options": {"kernel": "rbf", "alpha": 0.01}},
            {"estimator": "SVR", "options": {"C": 10.0, "epsilon": 0.01}},
        )

    @property
    def _owner(self) -> str:
        return f"regressor 'sklearn' ({self.config.estimator})"

    def fit(
        self,
        features: NDArray[np.float32],
        targets: NDArray[np.float64],
        *,
        seed: int,
        progress: dovetail.Progress = dovetail.silent,
    ) -> FittedScikitLearnRegressor:
        """Fit to features (n_samples, n_features) and targets (n_samples, n_targets).

        Raises
        ------
        DovetailError
            The regressor cannot be fitted to these samples, or its fitted attributes are not arrays or plain values.
        """
        rows = checked_rows(features, self._owner)
        wanted = checked_rows(targets, f"{self._owner}, targets").astype(np.float64)
        estimator = self.config.new_estimator(seed)
        if not estimator.__sklearn_tags__().target_tags.multi_output:
            from sklearn.multioutput import MultiOutputRegressor

            estimator = MultiOutputRegressor(estimator)
        kept = KeptEstimator.fitted(estimator, rows, wanted, method="predict", owner=self._owner)
        progress("regressor", 1, 1, self.config.estimator)
        return FittedScikitLearnRegressor(kept)

    def restore(self, state: dovetail.ComponentState) -> FittedScikitLearnRegressor:
        """Rebuild the regressor from its attributes."""
        return FittedScikitLearnRegressor(KeptEstimator(state, self._owner))
