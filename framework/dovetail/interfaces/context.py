"""The meaning of features and targets, for reducers and regressors that need more than the numbers."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class FeatureContext:
    """The meaning of features and targets.

    Parameters
    ----------
    frequency : (n_freq,) array
        Hz; the lines of each response.
    responses : tuple of str
        Names of the responses. Their features are concatenated; those of response i are the columns ``columns(i)``.
    parameters : tuple of str
        Names of the joint's parameters, one for each target.
    accelerance : callable or None
        Returns the training FRFs (n_samples, n_responses n_freq) with their phases, complex64 [m/(N s^2)], in the order
        of the features; None if the dataset holds only amplitudes, or if each epoch draws new samples.
    seconds : float or None
        Time [s] after which a regressor should stop with its best result so far; None for no limit.
    """

    frequency: NDArray[np.float64]
    responses: tuple[str, ...]
    parameters: tuple[str, ...]
    accelerance: Callable[[], NDArray[np.complex64]] | None = None
    seconds: float | None = None

    def columns(self, response: int) -> slice:
        """Return the columns of a response among the features, by its index."""
        count = len(self.frequency)
        return slice(response * count, (response + 1) * count)


def takes_context(fit: Callable[..., Any]) -> bool:
    """Return whether `fit` or `fit_epochs` of a component takes the context."""
    return "context" in inspect.signature(fit).parameters


def fit_in_context(fit: Callable[..., Any], *arguments: Any, context: FeatureContext, **named: Any) -> Any:
    """Call `fit` or `fit_epochs` of a component, with the context if it takes one."""
    if takes_context(fit):
        named["context"] = context
    return fit(*arguments, **named)
