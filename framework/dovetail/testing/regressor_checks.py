"""Checks of regressors beyond those that they share with reducers."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dovetail.interfaces import FittedRegressor
from dovetail.testing.outcomes import Nonconformity
from dovetail.testing.specimens import SEED, RegressorSpecimen

__all__: list[str] = []

_HOW_TO_REPORT = "Call progress(stage, done, total, note) with done from 1 to total, or not at all."


def check_it_learns(specimen: RegressorSpecimen) -> None:
    """On a smooth function of its features it does better than the mean of the targets."""
    predicted = specimen.answer(specimen.fitted, specimen.features.copy())
    error = np.square(predicted - specimen.targets).mean()
    if not error < np.square(specimen.targets - specimen.targets.mean(axis=0)).mean():
        raise Nonconformity(
            "on its own training samples it does no better than their mean.", "Check targets and scaling."
        )


def check_targets_are_left_unchanged(specimen: RegressorSpecimen) -> None:
    """The targets belong to the caller."""
    targets = specimen.targets.copy()
    specimen.component.fit(specimen.features.copy(), targets, seed=SEED)
    if not np.array_equal(targets, specimen.targets):
        raise Nonconformity("fit changed the targets that it was given.", "Compute with copies.")


def check_progress_is_reported_in_order(specimen: RegressorSpecimen) -> None:
    """What `fit` says of its progress goes up, and not beyond the total."""
    reported: list[tuple[int, int]] = []

    def listen(stage: str, done: int, total: int, note: str = "") -> None:
        if not isinstance(stage, str) or not isinstance(note, str):
            raise Nonconformity(f"progress got the stage {stage!r:.40}.", _HOW_TO_REPORT)
        reported.append((done, total))

    specimen.component.fit(specimen.features.copy(), specimen.targets.copy(), seed=SEED, progress=listen)
    done = [step for step, _ in reported]
    if done != sorted(done) or any(step > total for step, total in reported):
        raise Nonconformity("progress is reported out of order, or beyond the total.", _HOW_TO_REPORT)


def check_epochs_with_other_noise_can_be_learnt_from(specimen: RegressorSpecimen) -> None:
    """`fit_epochs`, for robust training, returns a fitted regressor too."""
    random = np.random.default_rng(SEED)

    def epoch(number: int) -> tuple[NDArray[np.float32], NDArray[np.float64]]:
        if number < 0:
            raise Nonconformity("fit_epochs asked for an epoch below 0.", "Count epochs from 0.")
        noise = 0.01 * random.standard_normal(specimen.features.shape)
        return (specimen.features + noise).astype(np.float32), specimen.targets.copy()

    fitted = specimen.component.fit_epochs(epoch, seed=SEED)
    if not isinstance(fitted, FittedRegressor):
        problem = f"fit_epochs returned {type(fitted).__name__}."
        raise Nonconformity(problem, "Return a dovetail.FittedRegressor, or leave fit_epochs to the base class.")
    if fitted.predict(specimen.features[:3].copy()).shape != (3, specimen.targets.shape[1]):
        raise Nonconformity("fitted by epochs it predicts another shape.", "Return a row for each sample.")
