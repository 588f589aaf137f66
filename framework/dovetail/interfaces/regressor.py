"""The contract of a regressor, which predicts scaled joint parameters from reduced features."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from dovetail.interfaces.component import Component, Kind
from dovetail.interfaces.context import FeatureContext, takes_context
from dovetail.interfaces.progress import Progress, silent
from dovetail.interfaces.state import ComponentState

TrainingEpoch = Callable[[int], tuple[NDArray[np.float32], NDArray[np.float64]]]
"""From the index of an epoch to its features (n_samples, n_features) and targets (n_samples, n_targets)."""

_EPOCHS_AT_ONCE = 4
"""Epochs whose samples a regressor that knows no epochs gets together."""


@dataclass(frozen=True, eq=False)
class TargetDistribution:
    """The predicted distribution of the targets of each row.

    Parameters
    ----------
    samples : (n_samples, n_draws, n_targets) array
        Draws of equal weight; 200 or more suffice for the ends of a 90 % interval.
    """

    samples: NDArray[np.float64]

    @staticmethod
    def gaussian(mean: NDArray[np.float64], covariance: NDArray[np.float64], draws: int = 1000) -> TargetDistribution:
        """Return evenly spread draws of Gaussians.

        Parameters
        ----------
        mean : (n_samples, n_targets) array
        covariance : (n_samples, n_targets, n_targets) array
        draws : int
        """
        normal = spread_normal(draws, mean.shape[1])
        return TargetDistribution(mean[:, None] + normal @ np.swapaxes(np.linalg.cholesky(covariance), 1, 2))


def spread_normal(draws: int, dimensions: int) -> NDArray[np.float64]:
    """Return standard normal draws (draws, dimensions), evenly spread and the same in each call."""
    return _spread_normal(draws, dimensions).copy()


@lru_cache(maxsize=8)
def _spread_normal(draws: int, dimensions: int) -> NDArray[np.float64]:
    from scipy.stats import norm, qmc

    return np.asarray(norm.ppf(qmc.Halton(dimensions, rng=np.random.default_rng(0)).random(draws)))


class FittedRegressor(ABC):
    """A regressor after fitting."""

    @abstractmethod
    def predict(self, features: NDArray[np.float32]) -> NDArray[np.float64]:
        """Predict targets.

        Parameters
        ----------
        features : (n_samples, n_features) array

        Returns
        -------
        (n_samples, n_targets) array
            Each row depends only on the same row of `features`.
        """

    def predict_distribution(self, features: NDArray[np.float32]) -> TargetDistribution | None:  # noqa: ARG002
        """Predict the distribution of the targets; None, the default, for a regressor that predicts values only.

        Parameters
        ----------
        features : (n_samples, n_features) array

        Returns
        -------
        TargetDistribution or None
            Each row depends only on the same row of `features`; `predict` gives its mean.
        """
        return None

    @abstractmethod
    def state(self) -> ComponentState:
        """Return everything that `Regressor.restore` needs, as arrays and plain values."""


class Regressor(Component):
    """A regression from features to targets, before fitting."""

    kind: ClassVar[Kind] = "regressor"

    @abstractmethod
    def fit(
        self,
        features: NDArray[np.float32],
        targets: NDArray[np.float64],
        *,
        seed: int,
        progress: Progress = silent,
    ) -> FittedRegressor:
        """Fit to standardised features (n_samples, n_features) and scaled targets (n_samples, n_targets).

        A regressor that needs to know their meaning takes a further keyword argument,
        ``context: FeatureContext | None = None``; so may `fit_epochs`.
        """

    def fit_epochs(
        self, epoch: TrainingEpoch, *, seed: int, progress: Progress = silent, context: FeatureContext | None = None
    ) -> FittedRegressor:
        """Fit to samples whose features change from epoch to epoch, for robust training.

        By default, `fit` to the samples of the first four epochs together. A regressor that passes over its samples
        many times overrides this method and calls `epoch` for each pass.

        Parameters
        ----------
        epoch : callable
            Row i of each epoch is the same FRF with other noise or, if samples are drawn again, another FRF. All epochs
            have the same number of rows.
        context : FeatureContext, optional
            Passed to `fit`, if that takes it.
        """
        first = [epoch(number) for number in range(_EPOCHS_AT_ONCE)]
        features = np.concatenate([features for features, _ in first])
        targets = np.concatenate([targets for _, targets in first])
        named = {"context": context} if takes_context(self.fit) else {}
        return self.fit(features, targets, seed=seed, progress=progress, **named)

    @abstractmethod
    def restore(self, state: ComponentState) -> FittedRegressor:
        """Rebuild the fitted regressor from its state."""
