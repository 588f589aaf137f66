"""The trained chain from an FRF's amplitude to joint parameters."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.errors import Fault, PluginError
from dovetail.identification.network.preprocessing import TargetScaling, ZScore, blocks, log10p1
from dovetail.interfaces import (
    Component,
    FittedReducer,
    FittedRegressor,
    Progress,
    Reducer,
    Regressor,
    blamed_on,
    silent,
)

__all__ = ["Network", "checked_fit", "checked_rows", "label_of", "reduce_features"]


@dataclass(frozen=True, eq=False)
class Network:
    """Features, reducer, scaling, regressor, scaling back: everything fitted, nothing to be changed.

    Parameters
    ----------
    reducer : FittedReducer
    feature_scaling : ZScore
    regressor : FittedRegressor
    target_scaling : TargetScaling
    recipes : (Reducer, Regressor)
        What the two were fitted by; errors name it.

    Raises
    ------
    PluginError
        One of the two is not what its contract says.
    """

    reducer: FittedReducer
    feature_scaling: ZScore
    regressor: FittedRegressor
    target_scaling: TargetScaling
    recipes: tuple[Reducer, Regressor]

    def __post_init__(self) -> None:
        checked_fit(self.reducer, self.recipes[0], FittedReducer)
        checked_fit(self.regressor, self.recipes[1], FittedRegressor)

    def predict(self, amplitude: NDArray[np.floating]) -> NDArray[np.float64]:
        """Predict parameters from the accelerance's amplitude.

        Parameters
        ----------
        amplitude : (n_samples, n_responses n_freq) array
            m/(N s^2), all responses side by side.

        Returns
        -------
        (n_samples, n_params) array
            SI values; not confined to the parameters' ranges.

        Raises
        ------
        PluginError
            The reducer or the regressor fails, or returns another shape than one row for each FRF.
        """
        return np.concatenate([self._predict(amplitude[rows]) for rows in blocks(len(amplitude))])

    def _predict(self, amplitude: NDArray[np.floating]) -> NDArray[np.float64]:
        count, (reducer, regressor) = len(amplitude), self.recipes
        with blamed_on(self.reducer, label_of(reducer)):
            reduced = self.reducer.transform(log10p1(amplitude))
        features = checked_rows(reduced, label_of(reducer), count, len(self.feature_scaling.mean))
        with blamed_on(self.regressor, label_of(regressor)):
            predicted = self.regressor.predict(self.feature_scaling.transform(features))
        targets = checked_rows(predicted, label_of(regressor), count, len(self.target_scaling.lower))
        return self.target_scaling.inverse(targets)


def label_of(component: Component) -> str:
    """Return how messages name a reducer or a regressor."""
    return f"{component.kind} '{component.name}'"


def checked_rows(values: object, label: str, count: int, width: int | None = None) -> NDArray[Any]:
    """Return what `transform` or `predict` gave, if it has a row for each FRF.

    Parameters
    ----------
    values : object
    label : str
        Who gave it.
    count : int
        Number of FRFs.
    width : int, optional
        Number of columns; any from 1 by default.

    Returns
    -------
    (count, width) array

    Raises
    ------
    PluginError
        It is no array of numbers of that shape; NumPy would spread one of another shape over all columns.
    """
    if not isinstance(values, np.ndarray) or values.dtype.kind not in "fiu":
        given = f"an array of {values.dtype}" if isinstance(values, np.ndarray) else type(values).__name__
        raise PluginError(Fault(label, f"it returned {given}.", "an array of numbers"))
    wanted = (count, width or values.shape[-1] if values.ndim else 0)
    if values.shape != wanted or 0 in values.shape:
        accepted = f"({count}, {'n_components' if width is None else width})"
        raise PluginError(Fault(label, f"it returned the shape {values.shape} for {count} FRFs.", accepted))
    return values


def checked_fit(made: object, recipe: Component, contract: type) -> None:
    """Make sure that `fit` or `restore` returned what its contract says.

    Raises
    ------
    PluginError
    """
    if not isinstance(made, contract):
        problem = f"its fit returned {type(made).__name__}."
        raise PluginError(Fault(label_of(recipe), problem, f"a {contract.__name__}"))


def reduce_features(
    reducer: FittedReducer, name: str, features: NDArray[np.float32], progress: Progress = silent
) -> NDArray[np.float32]:
    """Reduce features (n_samples, n_freq) to (n_samples, n_components).

    Raises
    ------
    PluginError
        The reducer, called `name`, does not return one finite row for each FRF.
    """
    reduced = np.empty((len(features), 0), dtype=np.float32)
    for rows in blocks(len(features)):
        with blamed_on(reducer, f"reducer '{name}'"):
            part = reducer.transform(features[rows])
        part = checked_rows(part, f"reducer '{name}'", rows.stop - rows.start, reduced.shape[1] or None)
        if not np.isfinite(part).all():
            raise PluginError(Fault(f"reducer '{name}'", "it returned features that are not finite.", "finite numbers"))
        if rows.start == 0:
            reduced = np.empty((len(features), part.shape[1]), dtype=np.float32)
        reduced[rows] = part
        progress("reduction", rows.stop, len(features))
    return reduced
