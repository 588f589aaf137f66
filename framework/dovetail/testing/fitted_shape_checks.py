"""Checks of reducers and regressors with samples of other shapes, sizes and kinds."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.errors import DovetailError
from dovetail.testing.agreement import require_agreement
from dovetail.testing.fitted_specimens import FittedSpecimen
from dovetail.testing.outcomes import Nonconformity, NotApplicable
from dovetail.testing.training_sets import TrainingSet

_FEW = 30
"""Training samples that may be too few."""
_LINES = 5000
"""More than the 4451 of the published measurements."""
_ENOUGH = 120
"""Number of samples with these lines: methods may need more samples than their usual hundred components."""
SMALL, _LARGE = 1e-9, 1e6
"""Factors of features: FRFs of a heavy machine in m/(N s^2), with log10(A + 1) near A / 2.3, and unscaled features."""


def check_thirty_samples_are_enough_or_refused(specimen: FittedSpecimen) -> None:
    """Thirty training samples give valid output, or an error that says how many are needed."""
    _require_sound(specimen, specimen.samples(_FEW, seed=31), f"{_FEW} samples")


def check_one_feature_is_enough_or_refused(specimen: FittedSpecimen) -> None:
    """A single feature gives valid output, or an error."""
    _require_sound(specimen, specimen.samples(_ENOUGH, columns=1, seed=32), "one feature")


def check_five_thousand_features_are_accepted_or_refused(specimen: FittedSpecimen) -> None:
    """Five thousand features, as many lines as a fine measurement has, give valid output, or an error."""
    _require_sound(specimen, specimen.samples(_ENOUGH, columns=_LINES, seed=33), f"{_LINES} features")


def check_constant_features_are_handled(specimen: FittedSpecimen) -> None:
    """A constant line, a line of zeros, repeated samples, a flat FRF and one of zeros give finite output."""
    samples = specimen.training.copy()
    samples.features[:, 0] = samples.features[0, 0]
    samples.features[:, 1] = 0.0
    samples.features[1] = samples.features[0]
    fitted, _ = _finite(specimen, samples, "features that do not vary")
    for level in (samples.features[0, 0], 0.0):
        try:
            answer = specimen.ask(fitted, np.full_like(samples.features[:1], level))
        except (DovetailError, ValueError):
            continue
        if not np.isfinite(answer).all():
            problem = f"for an FRF that is {level:.3g} at all lines its results are not finite."
            raise Nonconformity(problem, "Guard divisions by a row's own sum or deviation, or refuse such a row.")


def check_features_of_any_size_are_handled(specimen: FittedSpecimen) -> None:
    """Features times 1e-9 or 1e6 give finite output, also after fitting to features of the usual size."""
    for scale in SMALL, _LARGE:
        what = f"features of {scale:g} times the size"
        samples = specimen.training.scaled(scale)
        _finite(specimen, samples, what)
        try:
            answers = specimen.ask(specimen.fitted, samples.features)
        except (DovetailError, ValueError):
            continue
        if not np.isfinite(answers).all():
            raise Nonconformity(f"it answers {what} with values that are not finite.", "Guard what may overflow.")


def _require_sound(specimen: FittedSpecimen, samples: TrainingSet, what: str) -> None:
    """Fit to samples, which may be refused; the output is finite, and the same after restoring the state."""
    fitted, answers = _finite(specimen, samples, what)
    restored = specimen.ask(specimen.component.restore(fitted.state()), samples.features)
    problem = f"for {what} it answers otherwise when restored from its state"
    require_agreement(restored, answers, problem, "Keep integers and numbers of the state wide enough.")


def _finite(specimen: FittedSpecimen, samples: TrainingSet, what: str) -> tuple[Any, NDArray[Any]]:
    try:
        fitted = specimen.fit(samples.copy())
    except DovetailError as refusal:
        raise NotApplicable(f"it refuses {what}: {refusal.faults[0].problem}") from None
    answers = specimen.ask(fitted, samples.features)
    if answers.ndim != 2 or len(answers) != len(samples.features) or not np.isfinite(answers).all():
        problem = f"for {what} its results have the shape {answers.shape}, or are not finite."
        raise Nonconformity(problem, "Guard divisions and squeezed axes, or raise a dovetail.DovetailError in fit.")
    return fitted, answers
