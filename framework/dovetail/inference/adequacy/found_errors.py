"""The errors of a model that a measurement shows."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from dovetail.frf.resonance_peaks import counterpart, resonance_peaks
from dovetail.inference.adequacy.model_error_size import FitWithError, estimate_model_error, judge_with_error
from dovetail.inference.adequacy.single_resonance import separate_errors
from dovetail.inference.adequacy.verdict import AdequacyWord, errors_in_intervals, word_for
from dovetail.inference.fitting import Fit
from dovetail.inference.posterior.model_error import ModelError
from dovetail.interfaces import Progress, silent
from dovetail.problem import Problem
from dovetail.problem.observations import Observations

_EXCEEDS = 2.0
"""Ratio of an error whose size is unknown to what peaks and amplitudes show at least, above which it stays unknown."""


@dataclass(frozen=True, eq=False)
class FoundErrors:
    """The errors of a model that a measurement shows.

    Parameters
    ----------
    word : str
    size : ModelError
        NaN for each kind that the measurement does not determine.
    in_intervals : ModelError
        What intervals allow for.
    fit : FitWithError
    phases : tuple of float
        By which the measurement at each response is ahead of the model [rad], if that is known.
    """

    word: AdequacyWord
    size: ModelError
    in_intervals: ModelError
    fit: FitWithError
    phases: tuple[float, ...] = ()


def find_errors(problem: Problem, fit: Fit, progress: Progress = silent) -> FoundErrors:
    """Return the errors of a model whose fit does not reach the noise."""
    target, separated = problem.observations, separate_errors(problem, fit)
    if separated is not None:
        progress("model error", 1, 2)
        there = replace(fit, theta=separated.theta)
        judged = judge_with_error(problem, there, separated.in_intervals)
        progress("model error", 2, 2)
        return FoundErrors(word_for(separated.size), separated.size, judged.size, judged, separated.phases)
    estimated = estimate_model_error(problem, fit, progress)
    least = ModelError(
        _distance_of_lost_peaks(target, estimated.values), magnitude=_typical_ratio(target, estimated.values)
    )
    size = estimated.size.at_least(least)
    unknown = {kind: np.nan for kind in estimated.unknown if getattr(size, kind) > _EXCEEDS * getattr(least, kind)}
    return FoundErrors(word_for(size), replace(size, **unknown), errors_in_intervals(size), estimated)


def _typical_ratio(target: Observations, values: NDArray[np.complex128]) -> float:
    """Return the median of |log(measured / fitted amplitude)|.

    It complements the error of magnitude, which is relative to the fitted FRF and therefore never exceeds 1 where that
    is much too large.
    """
    measured = target.amplitude
    clear = (measured > 0.0) & (values != 0.0)
    return float(np.median(np.abs(np.log(measured[clear] / np.abs(values[clear]))))) if clear.any() else 0.0


def _distance_of_lost_peaks(target: Observations, values: NDArray[np.complex128]) -> float:
    """Return how far the measured peaks are from the model's nearest, as an rms, if most of them have no counterpart.

    Such a model does not show which of its resonances is which of the measurement. 0 if most have a counterpart, or if
    all peaks of the model have one: then it merely lacks resonances.
    """
    distances, paired, modelled = list[float](), 0, 0
    for frf, of_model in zip(target.frfs, target.split(values), strict=True):
        peaks, others = resonance_peaks(frf), resonance_peaks(replace(frf, values=of_model))
        modelled += len(others)
        for peak in peaks.tolist() if others.size else []:
            paired += counterpart(peak, peaks, others) is not None
            distances.append(float(np.abs(others - peak).min()) / peak)
    is_lost = 2 * paired < len(distances) and paired < modelled
    return float(np.sqrt(np.mean(np.square(distances)))) if is_lost else 0.0
