"""Reducers and regressors under test, with training samples and the results of fits to them."""

from __future__ import annotations

import os
from abc import ABC, abstractmethod
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.errors import DovetailError
from dovetail.interfaces import Component, Reducer, Regressor
from dovetail.testing.fresh_process import FreshAnswers, ask_a_fresh_process
from dovetail.testing.specimen import SEED, Specimen
from dovetail.testing.surroundings import Observation, observe
from dovetail.testing.training_sets import TrainingSet, fit, frf_samples, regression_samples

_SAMPLES = 160
"""Training samples: enough for every check, and quick to fit."""
_LINES, _FEATURES = 120, 6
"""Features of a reducer and of a regressor; the latter are fewer than seven targets."""
_OTHER_SEED = SEED + 1
_EPOCH_SEED = 1000
"""Seed of the first epoch."""


@dataclass(frozen=True, eq=False)
class FittedSpecimen(Specimen, ABC):
    """A reducer or regressor with its fits; those that several checks need are computed once.

    Parameters
    ----------
    model : type[Component]
    options : mapping
        As in a description.
    component : Reducer or Regressor
    """

    @abstractmethod
    def samples(self, count: int, *, columns: int = 0, targets: int = 2, seed: int = SEED) -> TrainingSet:
        """Return samples for this kind of component, with `columns` features or the usual number."""

    def fit(self, samples: TrainingSet | None = None, *, component: Any = None, seed: int = SEED) -> Any:
        """Fit this or another component to a copy of the training samples, or to other samples, not copied."""
        return fit(component or self.component, samples or self.training.copy(), seed)

    @abstractmethod
    def answer(self, fitted: Any, features: NDArray[Any]) -> Any:
        """Return the output of a fitted object for features."""

    def ask(self, fitted: Any, features: NDArray[Any]) -> NDArray[Any]:
        """Return a copy of the output of a fitted object for a copy of features."""
        return np.array(self.answer(fitted, np.array(features, order="C")))

    @cached_property
    def training(self) -> TrainingSet:
        """The training samples."""
        return self.samples(_SAMPLES)

    @cached_property
    def unseen(self) -> TrainingSet:
        """Other samples of the same kind."""
        return self.samples(_SAMPLES, seed=_OTHER_SEED)

    @cached_property
    def _first_fit(self) -> tuple[dict[str, str], Any]:
        return dict(os.environ), self.fit()

    @property
    def environment(self) -> Mapping[str, str]:
        """Environment variables before the first fit."""
        return self._first_fit[0]

    @property
    def fitted(self) -> Any:
        """The result of the first fit."""
        return self._first_fit[1]

    @cached_property
    def observed(self) -> ObservedFit:
        """A second fit to the same samples, with all its side effects."""
        samples = self.training.copy()

        def fit_and_answer() -> Any:
            fitted = self.fit(samples)
            self.ask(fitted, samples.features)
            return fitted

        observation = observe(fit_and_answer, environment=self.environment)
        changed = _differences(samples, self.training)
        answers = self.ask(observation.answer, self.unseen.features)
        for array in vars(samples).values():
            array[...] = 0
        overwritten = self.ask(observation.answer, self.unseen.features)
        return ObservedFit(observation, changed, answers, overwritten)

    @cached_property
    def elsewhere(self) -> ElsewhereFit:
        """Fits to other samples, with other options and with a new instance, which then fits the training samples."""
        new = self.model(self.component.config)
        other = with_other_options(self.component)
        with suppress(DovetailError):  # other options may not suit the samples
            self.fit(self.unseen.copy(), component=other)
        answers = self.ask(self.fit(self.unseen.copy(), component=new, seed=_OTHER_SEED), self.unseen.features)
        meanwhile = self.ask(self.fitted, self.unseen.features)
        again = self.ask(self.fit(component=new), self.unseen.features)
        return ElsewhereFit(answers, meanwhile, again)

    @cached_property
    def fresh(self) -> FreshAnswers:
        """The results of a fresh process for the unseen samples."""
        return ask_a_fresh_process(self.component, self.fitted.state(), self.unseen, _OTHER_SEED)


@dataclass(frozen=True, eq=False)
class ObservedFit:
    """A fit with its side effects.

    Parameters
    ----------
    observation : Observation
    changed : list of str
        Names of the training arrays that it changed.
    answers, overwritten : arrays
        Output for unseen samples, before and after the caller overwrote the training samples.
    """

    observation: Observation
    changed: list[str]
    answers: NDArray[Any]
    overwritten: NDArray[Any]


@dataclass(frozen=True, eq=False)
class ElsewhereFit:
    """The output for unseen samples after fits of a new instance to these and then to the training samples.

    Parameters
    ----------
    answers : array
        Of the fit to the unseen samples.
    meanwhile : array
        Of the first instance's fit to the training samples, computed after that.
    again : array
        Of the new instance's fit to the training samples.
    """

    answers: NDArray[Any]
    meanwhile: NDArray[Any]
    again: NDArray[Any]


@dataclass(frozen=True, eq=False)
class EpochFit:
    """A fit by epochs.

    Parameters
    ----------
    fitted : FittedRegressor
    numbers : list
        Of the epochs that it requested.
    changed : bool
        Whether it changed an epoch's arrays.
    progress : list of tuple
        Its progress reports: stage, steps done, their total, note.
    """

    fitted: Any
    numbers: list[Any]
    changed: bool
    progress: list[tuple[str, int, int, str]]


@dataclass(frozen=True, eq=False)
class ReducerSpecimen(FittedSpecimen):
    """A reducer, fitted to FRFs of oscillators."""

    component: Reducer

    def samples(self, count: int, *, columns: int = 0, targets: int = 2, seed: int = SEED) -> TrainingSet:  # noqa: ARG002
        """Return FRFs with `columns` lines or the usual number."""
        return frf_samples(count, lines=columns or _LINES, seed=seed)

    def answer(self, fitted: Any, features: NDArray[Any]) -> Any:
        """Reduce features."""
        return fitted.transform(features)


@dataclass(frozen=True, eq=False)
class RegressorSpecimen(FittedSpecimen):
    """A regressor, fitted to smooth functions of its targets."""

    component: Regressor

    def samples(self, count: int, *, columns: int = 0, targets: int = 2, seed: int = SEED) -> TrainingSet:
        """Return standardised features and their targets."""
        return regression_samples(count, features=columns or _FEATURES, targets=targets, seed=seed)

    def answer(self, fitted: Any, features: NDArray[Any]) -> Any:
        """Predict targets."""
        return fitted.predict(features)

    def skill(self, fitted: Any, samples: TrainingSet) -> NDArray[np.float64]:
        """Return R2 of each target: 1 for exact predictions, 0 for predictions as good as the mean."""
        error = np.square(self.ask(fitted, samples.features) - samples.targets).mean(axis=0)
        return np.asarray(1.0 - error / samples.targets.var(axis=0), dtype=np.float64)

    def fit_epochs(self, *, repeated: bool = False) -> EpochFit:
        """Fit to epochs of new samples, or to the first epoch repeatedly."""
        numbers: list[Any] = []
        handed_out: list[tuple[TrainingSet, TrainingSet]] = []

        def epoch(number: int) -> tuple[NDArray[np.float32], NDArray[np.float64]]:
            samples = self.samples(_SAMPLES, seed=_EPOCH_SEED if repeated else _EPOCH_SEED + int(number))
            numbers.append(number)
            handed_out.append((samples, samples.copy()))
            return samples.features, samples.targets

        stages: list[tuple[str, int, int, str]] = []

        def listen(stage: str, done: int, total: int, note: str = "") -> None:
            stages.append((stage, done, total, note))

        fitted = self.component.fit_epochs(epoch, seed=SEED, progress=listen)
        changed = any(_differences(samples, kept) for samples, kept in handed_out)
        return EpochFit(fitted, numbers, changed, stages)

    @cached_property
    def epochs(self) -> EpochFit:
        """A fit to epochs of new samples."""
        return self.fit_epochs()


def _differences(samples: TrainingSet, others: TrainingSet) -> list[str]:
    return [name for name, array in vars(samples).items() if not np.array_equal(array, getattr(others, name))]


def with_other_options(component: Component) -> Component:
    """Return a component of the same class with other values of as many options as possible."""
    config = component.config
    for name, value in config:
        for other in _others(value):
            with suppress(Exception):  # options may exclude each other, and a constructor may raise anything
                changed = type(config).model_validate({**dict(config), name: other})
                type(component)(changed)
                config = changed
                break
    return type(component)(config)


def _others(value: Any) -> tuple[Any, ...]:
    if isinstance(value, bool):
        return (not value,)
    if isinstance(value, int):
        return value + 1, value - 1
    return (0.5 * value, 2.0 * value, 1.0) if isinstance(value, float) else ()
