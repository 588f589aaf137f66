"""The contract of a reducer, which reduces many FRF lines to a few features."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from dovetail.interfaces.component import Component, Kind
from dovetail.interfaces.state import ComponentState


class FittedReducer(ABC):
    """A reducer after fitting."""

    @abstractmethod
    def transform(self, features: NDArray[np.float32]) -> NDArray[np.float32]:
        """Reduce FRF features.

        Parameters
        ----------
        features : (n_samples, n_features) array

        Returns
        -------
        (n_samples, n_components) array
            Each row depends only on the same row of `features`, so that an FRF gives the same result in any
            batch.
        """

    @abstractmethod
    def state(self) -> ComponentState:
        """Return everything that `Reducer.restore` needs, as arrays and plain values."""


class Reducer(Component):
    """A reducer of FRF features, before fitting."""

    kind: ClassVar[Kind] = "reducer"

    @abstractmethod
    def fit(self, features: NDArray[np.float32], *, seed: int) -> FittedReducer:
        """Fit to training features (n_samples, n_features); the same seed gives the same result.

        A reducer that needs to know the meaning of the features takes a further keyword argument,
        ``context: FeatureContext | None = None``.
        """

    @abstractmethod
    def restore(self, state: ComponentState) -> FittedReducer:
        """Rebuild the fitted reducer from its state."""
