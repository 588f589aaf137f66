"""The contract of a regressor: from reduced features to scaled joint parameters."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from dovetail.interfaces.component import Component, Kind
from dovetail.interfaces.progress import Progress, silent
from dovetail.interfaces.state import State

__all__ = ["Epoch", "FittedRegressor", "Regressor"]

Epoch = Callable[[int], tuple[NDArray[np.float32], NDArray[np.float64]]]
"""From the number of an epoch, from 0, to its features (n_samples, n_features) and targets (n_samples, n_targets)."""

_EPOCHS_AT_ONCE = 4


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

    @abstractmethod
    def state(self) -> State:
        """Return all that `Regressor.restore` needs, as arrays and plain values."""


class Regressor(Component):
    """A recipe for a regression from features to targets."""

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

        A regressor that must know what they are of takes a further argument, ``context: FeatureContext | None = None``,
        by its name; so may `fit_epochs`.
        """

    def fit_epochs(self, epoch: Epoch, *, seed: int, progress: Progress = silent) -> FittedRegressor:
        """Fit to samples whose features change from epoch to epoch, for robust training.

        By default `fit` to the samples of the first four epochs together. A regressor that passes over its samples many
        times overrides this method and calls `epoch` for each pass.

        Parameters
        ----------
        epoch : callable
            Row i of each epoch is the same FRF with other noise or, if samples are drawn anew, another FRF. All epochs
            have the same number of rows.
        """
        first = [epoch(number) for number in range(_EPOCHS_AT_ONCE)]
        features = np.concatenate([features for features, _ in first])
        targets = np.concatenate([targets for _, targets in first])
        return self.fit(features, targets, seed=seed, progress=progress)

    @abstractmethod
    def restore(self, state: State) -> FittedRegressor:
        """Rebuild the fitted regressor from its state."""
