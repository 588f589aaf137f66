"""The contract of a regressor: reduced features in, scaled joint parameters out."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from dovetail.interfaces.component import Component, Kind
from dovetail.interfaces.progress import Progress, silent
from dovetail.interfaces.state import State

__all__ = ["FittedRegressor", "Regressor"]


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

    @abstractmethod
    def restore(self, state: State) -> FittedRegressor:
        """Rebuild what `state` was taken from."""
