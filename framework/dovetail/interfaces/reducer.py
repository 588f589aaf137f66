"""The contract of a reducer: many FRF lines in, a few features out."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from dovetail.interfaces.component import Component, Kind
from dovetail.interfaces.state import State

__all__ = ["FittedReducer", "Reducer"]


class FittedReducer(ABC):
    """What fitting a reducer gives."""

    @abstractmethod
    def transform(self, features: NDArray[np.float32]) -> NDArray[np.float32]:
        """Reduce FRF features.

        Parameters
        ----------
        features : (n_samples, n_features) array

        Returns
        -------
        (n_samples, n_components) array
            Each row depends on its own row of `features` alone, so that one FRF gives the same answer alone and in
            any batch.
        """

    @abstractmethod
    def state(self) -> State:
        """Return everything `Reducer.restore` needs, as arrays and plain values only."""


class Reducer(Component):
    """A recipe for reducing FRF features."""

    kind: ClassVar[Kind] = "reducer"

    @abstractmethod
    def fit(self, features: NDArray[np.float32], *, seed: int) -> FittedReducer:
        """Fit to training features (n_samples, n_features); the same seed gives the same result."""

    @abstractmethod
    def restore(self, state: State) -> FittedReducer:
        """Rebuild what `state` was taken from."""
