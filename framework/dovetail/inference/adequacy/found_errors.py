"""The errors of a model that a measurement shows."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from dovetail.inference.adequacy.error_effects import ErrorEffects, distance_of_lost_peaks
from dovetail.inference.adequacy.model_error_size import FitWithError, estimate_model_error, judge_with_error
from dovetail.inference.adequacy.single_resonance import separate_errors
from dovetail.inference.adequacy.verdict import errors_in_intervals
from dovetail.inference.fitting import Fit
from dovetail.inference.posterior.model_error import ModelError
from dovetail.interfaces import Progress, silent
from dovetail.problem import Problem

_EXCEEDS = 2.0
"""Ratio of an error whose size is unknown to what peaks and amplitudes show at least, above which it stays unknown."""


@dataclass(frozen=True, eq=False)
class FoundErrors:
    """The errors of a model that a measurement shows.

    Parameters
    ----------
    size : ModelError
        NaN for each kind that the measurement does not determine.
    shown : ModelError
        The same with what peaks and amplitudes show at least of such a kind, by which the model is judged.
    in_intervals : ModelError
        What intervals allow for.
    fit : FitWithError
    phases : tuple of float
        By which the measurement at each response is ahead of the model [rad], if that is known.
    """

    size: ModelError
    shown: ModelError
    in_intervals: ModelError
    fit: FitWithError
    phases: tuple[float, ...] = ()


def find_errors(problem: Problem, fit: Fit, progress: Progress = silent) -> FoundErrors:
    """Return the errors of a model whose fit does not reach the noise."""
    separated = separate_errors(problem, fit)
    if separated is not None:
        progress("model error", 1, 2)
        effects = ErrorEffects(problem, replace(fit, theta=separated.theta))
        judged = judge_with_error(effects, separated.in_intervals)
        progress("model error", 2, 2)
        return FoundErrors(separated.size, separated.size, judged.size, judged, separated.phases)
    effects = ErrorEffects(problem, fit)
    estimated = estimate_model_error(effects, progress)
    least = ModelError(distance_of_lost_peaks(effects.peaks), magnitude=effects.typical_ratio())
    size = estimated.size.at_least(least)
    unknown = {kind: np.nan for kind in estimated.unknown if getattr(size, kind) > _EXCEEDS * getattr(least, kind)}
    return FoundErrors(replace(size, **unknown), size, errors_in_intervals(size), estimated)
