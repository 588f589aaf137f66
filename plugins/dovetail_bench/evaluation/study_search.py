"""The options of a joint search, for Optuna's sampler (TPE). Needs Optuna."""

from __future__ import annotations

import json
import warnings
from collections.abc import Mapping, Sequence
from typing import Any

import optuna
from optuna.distributions import BaseDistribution, CategoricalDistribution, FloatDistribution, IntDistribution

from dovetail.evaluation import SearchRange, SearchSection


class SearchSpace:
    """The options of a joint search.

    Parameters
    ----------
    search : SearchSection
    described : mapping of str to Any
        Their values in the description.
    seed : int

    Attributes
    ----------
    distributions : dict of str to BaseDistribution
        Of each option. Choices are drawn as JSON texts.
    """

    def __init__(self, search: SearchSection, described: Mapping[str, Any], seed: int) -> None:
        self._options, self._described, self._seed = search.options, described, seed
        self._random_first = min(10, 1 + search.trials // 3)
        self.distributions = {option: _distribution(tried) for option, tried in search.options.items()}

    def sample(self, attempts: Sequence[optuna.trial.FrozenTrial], number: int) -> dict[str, Any]:
        """Return the options to try in the trial of this number, from Optuna's trials so far."""
        with warnings.catch_warnings(action="ignore", category=optuna.exceptions.ExperimentalWarning):
            sampler = optuna.samplers.TPESampler(
                seed=self._seed + number, n_startup_trials=self._random_first, constant_liar=True
            )
        copy = optuna.create_study(sampler=sampler)  # in memory, so that an interrupted proposal leaves nothing
        copy.add_trials([attempt for attempt in attempts if attempt.params])
        return {
            option: value if isinstance(self._options[option], SearchRange) else json.loads(value)
            for option, value in copy.ask(self.distributions).params.items()
        }

    def parameters(self, changes: Mapping[str, Any]) -> dict[str, Any]:
        """Return Optuna's parameters for a trial, or none if one of its options is outside the search."""
        params: dict[str, Any] = {}
        for option, tried in self._options.items():
            value = changes.get(option, self._described.get(option))
            params[option] = value if isinstance(tried, SearchRange) else _text(value)
            if not _contains(tried, params[option]):
                return {}
        return params


def _contains(tried: SearchRange | Sequence[Any], value: Any) -> bool:
    if not isinstance(tried, SearchRange):
        return value in map(_text, tried)
    numbers = int if all(isinstance(end, int) for end in tried.range) else (int, float)
    return isinstance(value, numbers) and tried.range[0] <= value <= tried.range[1]


def _distribution(tried: SearchRange | Sequence[Any]) -> BaseDistribution:
    if not isinstance(tried, SearchRange):
        return CategoricalDistribution([_text(choice) for choice in tried])
    low, high = tried.range
    if isinstance(low, int) and isinstance(high, int):
        return IntDistribution(low, high, log=tried.scale == "log")
    return FloatDistribution(low, high, log=tried.scale == "log")


def _text(value: Any) -> str:
    return json.dumps(value, sort_keys=True, default=str)
