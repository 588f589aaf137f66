"""Checks of reducers in addition to those that they share with regressors."""

from __future__ import annotations

import numpy as np

from dovetail.errors import DovetailError
from dovetail.testing.fitted_shape_checks import SMALL
from dovetail.testing.fitted_specimens import ReducerSpecimen
from dovetail.testing.outcomes import Nonconformity, NotApplicable, Reservation


def check_features_are_not_multiplied(specimen: ReducerSpecimen) -> None:
    """A reducer returns no more features than it gets."""
    reduced = specimen.ask(specimen.fitted, specimen.training.features[:3])
    if reduced.shape[1] > specimen.training.features.shape[1]:
        problem = f"of {specimen.training.features.shape[1]} features it makes {reduced.shape[1]}."
        raise Nonconformity(problem, "Give fewer components.")


def check_different_samples_stay_different(specimen: ReducerSpecimen) -> None:
    """Different FRFs have different reduced features; otherwise nothing can be identified from them."""
    for samples in (specimen.training, specimen.unseen):
        reduced = specimen.ask(specimen.fitted, samples.features)
        if len(np.unique(reduced, axis=0)) < len(reduced) // 2:
            raise Nonconformity("most FRFs have the same reduced features.", "Keep the features that distinguish FRFs.")


def check_small_features_stay_different(specimen: ReducerSpecimen) -> None:
    """FRFs of a billionth of the size, as of a heavy machine in m/(N s^2), have different reduced features too."""
    samples = specimen.training.scaled(SMALL)
    try:
        reduced = specimen.ask(specimen.fit(samples.copy()), samples.features)
    except DovetailError as refusal:
        raise NotApplicable(f"it refuses features of {SMALL:g} times the size: {refusal.faults[0].problem}") from None
    if len(np.unique(reduced, axis=0)) < len(reduced) // 2:
        problem = f"most FRFs of {SMALL:g} times the size have the same reduced features."
        raise Reservation(problem, "Use no fixed limits or digits; where an option sets the scale, say so.")
