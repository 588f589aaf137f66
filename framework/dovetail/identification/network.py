"""The trained chain from an FRF's amplitude to joint parameters."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dovetail.identification.contracts import checked_fit, checked_rows, label_of
from dovetail.identification.features import log10p1
from dovetail.identification.scaling import TargetScaling, ZScore, blocks
from dovetail.interfaces import FittedReducer, FittedRegressor, Reducer, Regressor, blamed_on

__all__ = ["Network"]


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
