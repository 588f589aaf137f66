"""Checks of the targets of regressors."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.errors import DovetailError
from dovetail.testing.agreement import require_agreement
from dovetail.testing.fitted_specimens import RegressorSpecimen
from dovetail.testing.outcomes import Nonconformity, NotApplicable
from dovetail.testing.specimen import SEED

_FEWEST_DRAWS = 50
"""Draws from a distribution from which its mean and deviation are estimated."""

_SKILL = 0.6
"""Smallest R2 of a target on unseen samples. Predicting the mean of two targets for both gives 0.5, training with four
in five targets exchanged 0.36, and linear regression 0.9999."""
_SKILL_OF_SEVEN = 0.5
"""The same with fewer features than targets, when at most 6/7 can be reached; a support vector regression, with the
options of its example, reaches 0.61."""


def check_every_target_is_learned(specimen: RegressorSpecimen) -> str:
    """On unseen samples of a smooth function, each target is predicted much better than by its mean."""
    skill = specimen.skill(specimen.fitted, specimen.unseen)
    require_skill(skill)
    return f"R2 {skill.min():.3f}"


def check_one_target_is_learned(specimen: RegressorSpecimen) -> None:
    """A single target is learned too, and predicted as a column."""
    _require_targets(specimen, 1)


def check_seven_targets_are_learned(specimen: RegressorSpecimen) -> None:
    """Seven targets, more than there are features, are learned too."""
    _require_targets(specimen, 7)


def check_targets_are_left_unchanged(specimen: RegressorSpecimen) -> None:
    """The caller's targets are not changed."""
    if "targets" in specimen.observed.changed:
        raise Nonconformity("fit changed the targets that it was given.", "Compute with copies.")


def check_targets_that_do_not_fit_are_refused(specimen: RegressorSpecimen) -> None:
    """A NaN among the targets, or fewer targets than samples, raises an error."""
    nan, short = specimen.training.copy(), specimen.training.copy()
    nan.targets[3, -1] = np.nan
    for what, targets in (("a NaN among the targets", nan.targets), ("a target too few", short.targets[:-1])):
        try:
            specimen.component.fit(short.features, targets, seed=SEED)
        except (DovetailError, ValueError):
            continue
        raise Nonconformity(f"fitting to {what} raises nothing.", "Raise a dovetail.DovetailError that names it.")


def require_skill(skill: NDArray[np.float64], what: str = "") -> None:
    """Raise a Nonconformity if a target is not learned."""
    if not (skill > (_SKILL if len(skill) < 7 else _SKILL_OF_SEVEN)).all():
        worst = int(np.argmin(np.where(np.isnan(skill), -np.inf, skill)))
        problem = (
            f"{what}it does not learn target {worst + 1} of {len(skill)}: on new samples R2 is {skill[worst]:.2f}."
        )
        raise Nonconformity(problem, "Check that each target is fitted and returned in its own column.")


def _require_targets(specimen: RegressorSpecimen, count: int) -> None:
    samples, unseen = (specimen.samples(160, targets=count, seed=seed) for seed in (21, 22))
    try:
        fitted = specimen.fit(samples)
    except DovetailError as refusal:
        raise NotApplicable(f"it refuses {count} targets: {refusal.faults[0].problem}") from None
    shape = specimen.ask(fitted, unseen.features).shape
    if shape != unseen.targets.shape:
        problem = f"for {count} targets and {len(unseen.features)} samples it predicts {shape}."
        raise Nonconformity(problem, "Return a row for each sample and a column for each target.")
    require_skill(specimen.skill(fitted, unseen))


def check_a_distribution_belongs_to_its_row(specimen: RegressorSpecimen) -> str:
    """A predicted distribution has draws for each row, which do not depend on other rows; `predict` is their mean."""
    features = specimen.unseen.features[:20]
    distribution = specimen.fitted.predict_distribution(features.copy())
    if distribution is None:
        raise NotApplicable("it predicts values without a distribution.")
    samples: Any = getattr(distribution, "samples", None)
    shape = (len(features), specimen.unseen.targets.shape[1])
    if not isinstance(samples, np.ndarray) or samples.ndim != 3 or (samples.shape[0], samples.shape[2]) != shape:
        raise Nonconformity(f"its samples are {np.shape(samples)}.", "Return a dovetail.TargetDistribution.")
    if samples.shape[1] < _FEWEST_DRAWS or not np.isfinite(samples).all():
        raise Nonconformity(f"of {samples.shape[1]} draws some are not finite, or they are too few.", "Give 200.")
    single = specimen.fitted.predict_distribution(features[3:4].copy()).samples
    require_agreement(
        single[0], samples[3], "a single row has another distribution", "Compute each row from this row only."
    )
    deviation = samples.std(axis=1) / np.sqrt(_FEWEST_DRAWS)
    if np.any(np.abs(samples.mean(axis=1) - specimen.ask(specimen.fitted, features)) > 3.0 * deviation + 1e-3):
        raise Nonconformity("predict is not the mean of the distribution.", "Return the mean.")
    low, high = np.quantile(samples, [0.05, 0.95], axis=1)
    covered = np.mean((low < specimen.unseen.targets[:20]) & (specimen.unseen.targets[:20] < high))
    return f"90 % intervals contain {covered:.0%} of {covered.size * low.size} targets"
