"""Checks of the training of a regressor: its progress reports, its epochs, and that it can be stopped."""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from dovetail.interfaces import FittedRegressor, Regressor
from dovetail.testing.fitted_specimens import RegressorSpecimen
from dovetail.testing.outcomes import Nonconformity, NotApplicable
from dovetail.testing.regressor_checks import require_skill
from dovetail.testing.specimen import SEED
from dovetail.testing.surroundings import observe

_HOW_TO_REPORT = "Call progress(stage, done, total, note) with done from 1 to total, or not at all."
_NOT_A_LOSS = re.compile(r"\b(nan|inf|infinity)\b", re.IGNORECASE)


def check_progress_is_reported_in_order(specimen: RegressorSpecimen) -> None:
    """The progress of `fit` and `fit_epochs` increases, up to the total at most, and its notes have finite losses."""
    reported: list[tuple[Any, ...]] = []

    def listen(stage: str, done: int, total: int, note: str = "") -> None:
        reported.append((stage, done, total, note))

    samples = specimen.training.copy()
    specimen.component.fit(samples.features, samples.targets, seed=SEED, progress=listen)
    for progress in (reported, specimen.epochs.progress):
        for stage, _, _, note in progress:
            if not isinstance(stage, str) or not isinstance(note, str):
                raise Nonconformity(f"progress got the stage {stage!r:.40}.", _HOW_TO_REPORT)
            if _NOT_A_LOSS.search(note):
                raise Nonconformity(f"progress reports {note!r:.60}.", "Stop where a loss is no longer finite.")
        done = [step for _, step, _, _ in progress]
        if done != sorted(done) or any(not 0 <= step <= total for _, step, total, _ in progress):
            raise Nonconformity("progress is reported out of order, or beyond the total.", _HOW_TO_REPORT)


def check_fitting_by_epochs_learns(specimen: RegressorSpecimen) -> None:
    """`fit_epochs`, for robust training, returns a fitted regressor that has learned all targets."""
    fitted = specimen.epochs.fitted
    if not isinstance(fitted, FittedRegressor):
        problem = f"fit_epochs returned {type(fitted).__name__}."
        raise Nonconformity(problem, "Return a dovetail.FittedRegressor, or leave fit_epochs to the base class.")
    require_skill(specimen.skill(fitted, specimen.unseen), "fitted by epochs, ")


def check_epochs_are_counted_from_zero(specimen: RegressorSpecimen) -> None:
    """`fit_epochs` requests at least two epochs, numbered 0, 1, 2 and so on by int, without gaps."""
    numbers = specimen.epochs.numbers
    if any(type(number) is not int for number in numbers) or sorted(set(numbers)) != list(range(max(numbers) + 1)):
        listed = ", ".join(str(number) for number in numbers[:8])
        raise Nonconformity(f"it requests the epochs {listed}.", "Count epochs from 0 without gaps.")
    if len(numbers) < 2:
        raise Nonconformity("it requests a single epoch.", "Call epoch(number) for each pass over the samples.")


def check_every_epoch_counts(specimen: RegressorSpecimen) -> None:
    """Other later epochs give another fit; a single noisy epoch could be memorised."""
    _require_own_epochs(specimen)
    repeated = specimen.ask(specimen.fit_epochs(repeated=True).fitted, specimen.unseen.features)
    if np.array_equal(repeated, specimen.ask(specimen.epochs.fitted, specimen.unseen.features)):
        problem = "epochs after the first have no influence."
        raise Nonconformity(problem, "Train each pass on the arrays of epoch(number).")


def check_the_same_epochs_give_the_same_fit(specimen: RegressorSpecimen) -> None:
    """`fit_epochs` with the same seed and epochs gives the same fit, and does not change global state."""
    _require_own_epochs(specimen)
    observation = observe(lambda: specimen.fit_epochs().fitted, environment=specimen.environment)
    features = specimen.unseen.features
    if not np.array_equal(specimen.ask(observation.answer, features), specimen.ask(specimen.epochs.fitted, features)):
        raise Nonconformity("two fits to the same epochs differ.", "Draw all random numbers from default_rng(seed).")
    if changed := [*observation.settings, *observation.generators]:
        raise Nonconformity(f"fit_epochs changes {', '.join(changed)}.", "Restore it in a `finally`.")


def check_epochs_are_left_unchanged(specimen: RegressorSpecimen) -> None:
    """The arrays of an epoch are not changed."""
    if specimen.epochs.changed:
        raise Nonconformity("it changed the arrays of an epoch.", "Compute with copies.")


def check_training_can_be_stopped(specimen: RegressorSpecimen) -> None:
    """Ctrl-C during a progress report or the request of an epoch ends the training and leaves settings unchanged."""
    samples = specimen.training.copy()

    def fit(press: _CtrlC) -> None:
        specimen.component.fit(samples.features, samples.targets, seed=SEED, progress=press)

    def fit_epochs(press: _CtrlC) -> None:
        specimen.component.fit_epochs(
            lambda number: press() if number else (samples.features, samples.targets), seed=SEED, progress=press
        )

    for call in (fit, fit_epochs):
        press = _CtrlC()
        observation = observe(partial(press.ends, call))
        if press.times and not observation.answer:
            raise Nonconformity(f"{call.__name__} continues after Ctrl-C.", "Let KeyboardInterrupt pass.")
        if changed := [*observation.settings, *observation.generators]:
            problem = f"{call.__name__}, when stopped, leaves {', '.join(changed)} changed."
            raise Nonconformity(problem, "Restore it in a `finally`.")


class _CtrlC:
    """A callable that raises KeyboardInterrupt, as pressing Ctrl-C does."""

    def __init__(self) -> None:
        self.times = 0

    def __call__(self, *_: Any, **__: Any) -> Any:
        self.times += 1
        raise KeyboardInterrupt

    def ends(self, call: Callable[[_CtrlC], None]) -> bool:
        """Return whether it ends a call; a call that never uses it returns normally."""
        try:
            call(self)
        except KeyboardInterrupt:
            return True
        return False


def _require_own_epochs(specimen: RegressorSpecimen) -> None:
    if specimen.model.fit_epochs is Regressor.fit_epochs:  # type: ignore[attr-defined]
        raise NotApplicable("it inherits fit_epochs.")
