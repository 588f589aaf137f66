"""What features and targets are of: what a reducer or a regressor may know beside the numbers."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["FeatureContext", "fit_in_context", "takes_context"]


@dataclass(frozen=True, eq=False)
class FeatureContext:
    """What features and targets are of.

    Parameters
    ----------
    frequency : (n_freq,) array
        Hz; the lines of each response.
    responses : tuple of str
        Names of the responses, whose features stand side by side: those of response i are the columns ``columns(i)``.
    parameters : tuple of str
        Names of the joint's parameters, one for each target.
    accelerance : callable or None
        Returns the training FRFs (n_samples, n_responses n_freq) with their phases, complex64 [m/(N s^2)], in the order
        of the features; None where the dataset keeps amplitudes alone, or each epoch draws others.
    seconds : float or None
        Time after which a regressor should end with the best that it has; None for as long as it takes.
    """

    frequency: NDArray[np.float64]
    responses: tuple[str, ...]
    parameters: tuple[str, ...]
    accelerance: Callable[[], NDArray[np.complex64]] | None = None
    seconds: float | None = None

    def columns(self, response: int) -> slice:
        """Return the columns of a response among the features, by its number from 0."""
        count = len(self.frequency)
        return slice(response * count, (response + 1) * count)


def takes_context(fit: Callable[..., Any]) -> bool:
    """Return whether `fit` or `fit_epochs` of a component asks for the context."""
    return "context" in inspect.signature(fit).parameters


def fit_in_context(fit: Callable[..., Any], *arguments: Any, context: FeatureContext, **named: Any) -> Any:
    """Call `fit` or `fit_epochs` of a component, with the context if it takes one."""
    if takes_context(fit):
        named["context"] = context
    return fit(*arguments, **named)
