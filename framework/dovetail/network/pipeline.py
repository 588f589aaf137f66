"""The trained chain from an FRF's amplitude to joint parameters: features, reducer, scaling, regressor, scaling back.

Reducer and regressor are plugins, so what they return is checked.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.errors import Fault, PluginError
from dovetail.interfaces import (
    FittedReducer,
    FittedRegressor,
    Progress,
    Reducer,
    Regressor,
    TargetDistribution,
    plugin_errors,
    silent,
)
from dovetail.interfaces.component import check_contract, component_label
from dovetail.network.correction import Correction
from dovetail.network.preprocessing import TargetScaling, ZScore, blocks, log10p1

Pair = tuple[NDArray[np.float32], NDArray[np.float64]]
"""Features (n, n_components) and targets (n, n_targets)."""

FEWEST_DRAWS = 50
"""Smallest number of draws of a distribution, for the ends of an interval."""


@dataclass(frozen=True, eq=False)
class Network:
    """The fitted chain; immutable.

    Parameters
    ----------
    reducer : FittedReducer
    feature_scaling : ZScore
    regressor : FittedRegressor
    target_scaling : TargetScaling
    recipes : (Reducer, Regressor)
        The components that fitted the two, for messages.
    corrections : tuple of Correction
        Applied to the regressor's predictions in turn; the last one gives the result.

    Raises
    ------
    PluginError
        One of the two violates its contract.
    """

    reducer: FittedReducer
    feature_scaling: ZScore
    regressor: FittedRegressor
    target_scaling: TargetScaling
    recipes: tuple[Reducer, Regressor]
    corrections: tuple[Correction, ...] = ()

    def __post_init__(self) -> None:
        for fitted, recipe, contract in zip(
            (self.reducer, self.regressor), self.recipes, (FittedReducer, FittedRegressor), strict=True
        ):
            with plugin_errors(recipe, component_label(recipe)):
                check_contract(fitted, recipe, contract)

    def predict(self, amplitude: NDArray[np.floating]) -> NDArray[np.float64]:
        """Predict parameters from the accelerance's amplitude.

        Parameters
        ----------
        amplitude : (n_samples, n_responses n_freq) array
            m/(N s^2), all responses concatenated.

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
        regressor, features = self._final_regressor(amplitude)
        label = component_label(self.recipes[1])
        with plugin_errors(regressor, label):
            predicted = regressor.predict(features)
            targets = check_rows(predicted, label, len(amplitude), len(self.target_scaling.lower))
        return self.target_scaling.inverse(targets)

    def predict_samples(self, amplitude: NDArray[np.floating]) -> NDArray[np.float64] | None:
        """Draw samples of the parameters of one FRF, if the regressor predicts distributions.

        Parameters
        ----------
        amplitude : (n_responses n_freq,) array
            m/(N s^2), one FRF, all responses concatenated.

        Returns
        -------
        (n_draws, n_params) array or None
            SI values of equal weight.

        Raises
        ------
        PluginError
            The regressor fails, or returns anything else than finite draws.
        """
        distribution = self.predict_distribution(amplitude[np.newaxis])
        return None if distribution is None else self.target_scaling.inverse(distribution.samples[0])

    def predict_distribution(self, amplitude: NDArray[np.floating]) -> TargetDistribution | None:
        """Return the distribution of the targets of FRFs (n_samples, n_responses n_freq), or None.

        The regressor may predict values without a distribution.

        Raises
        ------
        PluginError
            As in `predict_samples`.
        """
        return self._distribution(*self._final_regressor(amplitude))

    def _final_regressor(self, amplitude: NDArray[np.floating]) -> tuple[FittedRegressor, NDArray[np.float32]]:
        """Return the last regressor, after all corrections, and its features."""
        regressor, features = self.regressor, self._features(amplitude)
        for correction in self.corrections:
            distribution = self._distribution(regressor, features)
            if distribution is None:
                raise PluginError(missing_distribution(self.recipes[1]))
            regressor, features = correction.regressor, correction.features(amplitude, distribution)
        return regressor, features

    def _distribution(self, regressor: FittedRegressor, features: NDArray[np.float32]) -> TargetDistribution | None:
        """Return the distribution that a regressor predicts; it must have finite draws for each row."""
        recipe = self.recipes[1]
        label = component_label(recipe)
        with plugin_errors(regressor, label):
            distribution = regressor.predict_distribution(features)
            if distribution is None:
                return None
            check_contract(distribution, recipe, TargetDistribution, "predict_distribution")
            samples = distribution.samples if isinstance(distribution.samples, np.ndarray) else np.empty(0)
            if samples.ndim != 3 or len(samples) != len(features) or samples.shape[1] < FEWEST_DRAWS:
                accepted = f"an array ({len(features)}, {FEWEST_DRAWS} or more, {len(self.target_scaling.lower)})"
                raise PluginError(Fault(label, f"its distribution has the shape {samples.shape}.", accepted))
            rows, draws, width = samples.shape
            check_rows(samples.reshape(rows * draws, width), label, rows * draws, len(self.target_scaling.lower))
            if not np.isfinite(samples).all():
                raise PluginError(Fault(label, "its distribution is not finite.", "finite numbers"))
        return distribution

    def _features(self, amplitude: NDArray[np.floating]) -> NDArray[np.float32]:
        label = component_label(self.recipes[0])
        with plugin_errors(self.reducer, label):
            reduced = self.reducer.transform(log10p1(amplitude))
            features = check_rows(reduced, label, len(amplitude), len(self.feature_scaling.mean))
        return self.feature_scaling.transform(features)


def missing_distribution(recipe: Regressor) -> Fault:
    """Return the fault of a regressor that is to be corrected but predicts values without a distribution."""
    problem = f"the {component_label(recipe)} predicts values without their uncertainty."
    return Fault(
        "identification.correction", problem, "a regressor with uncertainty, such as mlp with 'uncertainty: gaussian'"
    )


def check_rows(values: object, label: str, count: int, width: int | None) -> NDArray[Any]:
    """Return the result of `transform` or `predict` after checking that it has a row for each FRF.

    Parameters
    ----------
    values : object
    label : str
        Name of the component in messages.
    count : int
        Number of FRFs.
    width : int or None
        Number of columns; with None any from 1.

    Returns
    -------
    (count, width) array

    Raises
    ------
    PluginError
        It is not an array of numbers of that shape; NumPy would broadcast another shape over all columns.
    """
    if not isinstance(values, np.ndarray) or values.dtype.kind not in "fiu":
        kind = f"an array of {values.dtype}" if isinstance(values, np.ndarray) else type(values).__name__
        raise PluginError(Fault(label, f"it returned {kind}.", "an array of numbers"))
    expected = (count, width or values.shape[-1] if values.ndim else 0)
    if values.shape != expected or 0 in values.shape:
        accepted = f"({count}, {'n_components' if width is None else width})"
        raise PluginError(Fault(label, f"it returned the shape {values.shape} for {count} FRFs.", accepted))
    return values


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
        with plugin_errors(reducer, f"reducer '{name}'"):
            block = reducer.transform(features[rows])
            block = check_rows(block, f"reducer '{name}'", rows.stop - rows.start, reduced.shape[1] or None)
            if not np.isfinite(block).all():
                problem = "it returned features that are not finite."
                raise PluginError(Fault(f"reducer '{name}'", problem, "finite numbers"))
        if rows.start == 0:
            reduced = np.empty((len(features), block.shape[1]), dtype=np.result_type(block, np.float32))
        reduced[rows] = block
        progress("reduction", rows.stop, len(features))
    return reduced


@dataclass(frozen=True, eq=False)
class Reduction:
    """The conversion of FRFs to the training data of the regressor.

    Parameters
    ----------
    name : str
        Name of the reducer.
    reducer : FittedReducer
    features : ZScore
    targets : TargetScaling
    """

    name: str
    reducer: FittedReducer
    features: ZScore
    targets: TargetScaling

    def __call__(self, features: NDArray[np.float32], theta: NDArray[np.float64]) -> Pair:
        """Reduce and standardise features (n, n_responses n_freq); scale parameters (n, n_params)."""
        return self.standardise(reduce_features(self.reducer, self.name, features), theta)

    def standardise(self, reduced: NDArray[np.float32], theta: NDArray[np.float64]) -> Pair:
        """Standardise reduced features, in their place; scale parameters."""
        out = reduced if reduced.dtype == np.float32 else None
        return self.features.transform(reduced, out=out), self.targets.transform(theta)
