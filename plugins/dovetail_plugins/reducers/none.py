"""No reduction: every FRF line is a feature."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

import dovetail
from dovetail_plugins.arrays import checked_rows, state_number

_OWNER = "reducer 'none'"


class FittedNoReducer(dovetail.FittedReducer):
    """The identity on features of a given width.

    Parameters
    ----------
    width : int
        The number of features of a row.
    """

    def __init__(self, width: int) -> None:
        self._width = width

    def transform(self, features: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return a copy of the features in single precision."""
        return checked_rows(features, _OWNER, width=self._width).astype(np.float32)

    def state(self) -> dovetail.ComponentState:
        """Return the width."""
        return {"width": self._width}


class NoReducer(dovetail.Reducer):
    """Passes the features to the regressor unchanged."""

    name = "none"
    summary = "no reduction: every FRF line is a feature"

    def fit(self, features: NDArray[np.float32], *, seed: int) -> FittedNoReducer:  # noqa: ARG002
        """Store the width of the features."""
        return FittedNoReducer(checked_rows(features, _OWNER).shape[1])

    def restore(self, state: dovetail.ComponentState) -> FittedNoReducer:
        """Rebuild the identity from its width."""
        return FittedNoReducer(int(state_number(state, "width", _OWNER)))
