"""Proposals of a joint search, and which of them are given up early: by Optuna, from the trials that have ended.

Optuna keeps nothing here. Its sampler and its pruner get the trials of the ledger each time, so that the ledger
alone says what a killed process was doing.
"""

from __future__ import annotations

import json
import warnings
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from dovetail.description import SearchRange
from dovetail.errors import require_package
from dovetail_bench.evaluation.study_ledger import Trial

_FEWEST = 4
"""Trials that have ended on all samples, with which a median on the first part means something."""


class SearchSpace:
    """The options of a joint search.

    Parameters
    ----------
    options : mapping of str to SearchRange or tuple
        Ranges, or choices.
    described : mapping of str to Any
        Their values in the description.
    trials, seed : int

    Raises
    ------
    DovetailError
        Optuna is not installed.
    """

    def __init__(
        self, options: Mapping[str, SearchRange | tuple[Any, ...]], described: Mapping[str, Any], trials: int, seed: int
    ) -> None:
        optuna = require_package("optuna", "study", "the joint search over settings")
        optuna.logging.set_verbosity(optuna.logging.ERROR)
        self._optuna, self._options, self._described = optuna, options, described
        self._startup, self._seed = min(10, 1 + trials // 3), seed
        self._distributions = {place: self._distribution(option) for place, option in options.items()}

    def propose(self, trials: Iterable[Trial], number: int) -> dict[str, Any]:
        """Return options for a trial of this number, from what is known of the others."""
        asked = self._study(trials, number).ask(self._distributions)
        return {
            place: value if isinstance(self._options[place], SearchRange) else json.loads(value)
            for place, value in asked.params.items()
        }

    def is_hopeless(self, trials: Iterable[Trial], error: float) -> bool:
        """Return whether an error on the first part of the samples is above the median of the others there."""
        asked = self._study(trials, 0).ask()
        asked.report(error, 1)
        return bool(asked.should_prune())

    def _study(self, trials: Iterable[Trial], number: int) -> Any:
        optuna = self._optuna
        with warnings.catch_warnings(action="ignore", category=optuna.exceptions.ExperimentalWarning):
            sampler = optuna.samplers.TPESampler(
                seed=self._seed + number, n_startup_trials=self._startup, constant_liar=True
            )
        study = optuna.create_study(sampler=sampler, pruner=optuna.pruners.MedianPruner(0, n_min_trials=_FEWEST))
        states = optuna.trial.TrialState
        for trial in trials:
            state = {"done": states.COMPLETE, "pruned": states.PRUNED, "running": states.RUNNING}.get(trial.state)
            params = self._params(trial)
            if state is None or params is None or trial.kind == "test" or (state == states.RUNNING and number == 0):
                continue
            study.add_trial(
                optuna.trial.create_trial(
                    state=state,
                    params=params,
                    distributions=self._distributions,
                    values=[trial.answer["mae"]] if trial.answer is not None else None,
                    intermediate_values={} if trial.first is None else {1: trial.first},
                )
            )
        return study

    def _params(self, trial: Trial) -> dict[str, Any] | None:
        """Return the options of a trial, or None if one of them is outside of the search."""
        params: dict[str, Any] = {}
        for place, option in self._options.items():
            value = trial.changes.get(place, self._described.get(place))
            if isinstance(option, SearchRange):
                if not isinstance(value, (int, float)) or not option.range[0] <= value <= option.range[1]:
                    return None
                params[place] = value
            elif _text(value) not in (choices := [_text(choice) for choice in option]):
                return None
            else:
                params[place] = choices[choices.index(_text(value))]
        return params

    def _distribution(self, option: SearchRange | Sequence[Any]) -> Any:
        kinds = self._optuna.distributions
        if not isinstance(option, SearchRange):
            return kinds.CategoricalDistribution([_text(choice) for choice in option])
        low, high = option.range
        if isinstance(low, int) and isinstance(high, int):
            return kinds.IntDistribution(low, high, log=option.scale == "log")
        return kinds.FloatDistribution(low, high, log=option.scale == "log")


def _text(value: Any) -> str:
    return json.dumps(value, sort_keys=True, default=str)
