"""Checks of reducers beyond those that they share with regressors."""

from __future__ import annotations

import numpy as np

from dovetail.testing.outcomes import Nonconformity
from dovetail.testing.specimens import ReducerSpecimen

__all__: list[str] = []


def check_features_are_not_multiplied(specimen: ReducerSpecimen) -> None:
    """A reducer gives no more features than it was given."""
    reduced = specimen.answer(specimen.fitted, specimen.features[:3].copy())
    if reduced.shape[1] > specimen.features.shape[1]:
        problem = f"of {specimen.features.shape[1]} features it makes {reduced.shape[1]}."
        raise Nonconformity(problem, "Give fewer components.")


def check_unlike_samples_stay_unlike(specimen: ReducerSpecimen) -> None:
    """FRFs that differ have reduced features that differ, or nothing can be identified from them."""
    reduced = specimen.answer(specimen.fitted, specimen.features.copy())
    if len(np.unique(reduced, axis=0)) < len(reduced) // 2:
        raise Nonconformity("most FRFs have the same reduced features.", "Keep what tells one FRF from another.")
