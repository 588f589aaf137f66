"""The contract of a regressor: reduced features in, scaled joint parameters out."""

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
"""Gives the features (n_samples, n_features) and targets (n_samples, n_targets) of an epoch, by its number from 0."""

_EPOCHS_AT_ONCE = 4


class FittedRegressor(ABC):
    """What fitting a regressor gives."""

    @abstractmethod
    def predict(self, features: NDArray[np.float32]) -> NDArray[np.float64]:
        """Predict targets.

        Parameters
        ----------
        features : (n_samples, n_features) array

        Returns
        -------
        (n_samples, n_targets) array
            Each row depends on its own row of `features` alone.
        """

    @abstractmethod
    def state(self) -> State:
        """Return everything `Regressor.restore` needs, as arrays and plain values only."""


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
        """Fit to standardised features (n_samples, n_features) and scaled targets (n_samples, n_targets)."""

    def fit_epochs(self, epoch: Epoch, *, seed: int, progress: Progress = silent) -> FittedRegressor:
        """Fit to samples whose features change from epoch to epoch: robust training.

        Here, for regressors that know no epochs: `fit` to the first four together. One that goes through its samples
        many times overrides it and asks for each epoch as it comes to it.

        Parameters
        ----------
        epoch : callable
            Row i of any epoch stands for the same FRF with other noise, or, where samples are drawn anew, for
            another FRF; every epoch has as many rows.
        """
        first = [epoch(number) for number in range(_EPOCHS_AT_ONCE)]
        features = np.concatenate([features for features, _ in first])
        targets = np.concatenate([targets for _, targets in first])
        return self.fit(features, targets, seed=seed, progress=progress)

    @abstractmethod
    def restore(self, state: State) -> FittedRegressor:
        """Rebuild what `state` was taken from."""
