"""The trained chain from an FRF's amplitude to joint parameters."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dovetail.identification.features import log10p1
from dovetail.identification.scaling import TargetScaling, ZScore, blocks
from dovetail.interfaces import FittedReducer, FittedRegressor

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
    """

    reducer: FittedReducer
    feature_scaling: ZScore
    regressor: FittedRegressor
    target_scaling: TargetScaling

    def predict(self, amplitude: NDArray[np.floating]) -> NDArray[np.float64]:
        """Predict parameters from the accelerance's amplitude.

        Parameters
        ----------
        amplitude : (n_samples, n_freq) array
            m/(N s^2).

        Returns
        -------
        (n_samples, n_params) array
            SI values; not confined to the parameters' ranges.
        """
        return np.concatenate([self._predict(amplitude[rows]) for rows in blocks(len(amplitude))])

    def _predict(self, amplitude: NDArray[np.floating]) -> NDArray[np.float64]:
        reduced = self.reducer.transform(log10p1(amplitude))
        return self.target_scaling.inverse(self.regressor.predict(self.feature_scaling.transform(reduced)))
