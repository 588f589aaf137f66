"""Means of neighbouring lines, from which samples of a posterior are drawn where they say as much as all lines."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from dovetail.inference.fitting import Fit
from dovetail.inference.posterior.frequency_average import needs_average
from dovetail.inference.posterior.likelihood import PRIOR_PRECISION
from dovetail.inference.posterior.model_error import ModelError
from dovetail.problem import Problem
from dovetail.problem.merged_lines import merged_lines
from dovetail.problem.modal_observations import ModalProblem
from dovetail.problem.observations import Observations


@dataclass(frozen=True)
class Settings:
    """How many lines remain, and what they have to keep."""

    lines: int = 4000
    """Approximate number of means."""
    fewer: float = 0.5
    """Means over lines above which all lines are kept."""
    information: float = 0.99
    """Smallest part of the information on any combination of parameters, with that of the prior, that means keep."""


_SETTINGS = Settings()


class FewerLines(NamedTuple):
    """A problem of few lines with its fit, and by how much the logarithm of all lines' likelihood is larger."""

    problem: Problem
    fit: Fit
    log_constant: float


def with_fewer_lines(problem: Problem, fit: Fit, model_error: ModelError) -> FewerLines:
    """Merge neighbouring lines to means if these determine the parameters as well; return the problem itself if not.

    Parameters
    ----------
    problem : Problem
    fit : Fit
        Of the same measurement. Lines that it left out are in no mean.
    model_error : ModelError
        If residuals are averaged because of it, all lines remain.

    Notes
    -----
    The means of lines that are equally sensitive to the parameters have the same likelihood as the lines, up to the
    factor by which the lines scatter within their groups.
    """
    same = FewerLines(problem, fit, 0.0)
    if isinstance(problem, ModalProblem) or problem.changed is not None or len(problem.measured) > 1:
        return same
    lines = np.flatnonzero(fit.used)
    (measured,) = problem.measured
    if not measured.has_phase or _SETTINGS.lines > _SETTINGS.fewer * len(lines):
        return same
    if needs_average(model_error) or model_error.other or model_error.quantities:
        return same
    some = problem if len(lines) == len(fit.used) else problem.at(lines)
    known = replace(some.measured[0], variance=fit.variance[lines], coherence=None, averages=None)
    merged = merged_lines(some.with_frfs([known]), _SETTINGS.lines, fit.theta)
    assert merged.variance is not None
    fewer = Problem(some.assembly.on(merged.frequency), Observations((merged,)), limit=problem.limit)
    used = np.ones(len(merged.frequency), dtype=np.bool_)
    there = replace(fit, variance=merged.variance, used=used, ignored=np.empty(0))
    kept, fewer_constant = _information(fewer, there)
    whole, constant = _information(problem, fit)
    if scipy.linalg.eigh(kept, whole, eigvals_only=True)[0] < _SETTINGS.information:
        return same
    return FewerLines(fewer, there, constant - fewer_constant)


def _information(problem: Problem, fit: Fit) -> tuple[NDArray[np.float64], float]:
    """Return the information (p, p) on fractions of the ranges, with the prior's, and the log-likelihood at the fit."""
    residual = problem.observations.weighted(fit.variance, fit.used)
    linear = problem.residuals(residual).linearise(problem.to_unit(fit.theta)[np.newaxis])
    prior = PRIOR_PRECISION * np.eye(len(fit.theta))
    return linear.curvature[0] + prior, residual.log_scale - float(linear.cost[0]) / 2.0
