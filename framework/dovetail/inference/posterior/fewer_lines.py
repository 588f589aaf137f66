"""Means of neighbouring lines, from which samples of a posterior are drawn where they say as much as all lines."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import NDArray

from dovetail.inference.fitting import Fit
from dovetail.inference.posterior.frequency_average import needs_average
from dovetail.inference.posterior.likelihood import PRIOR_PRECISION, Likelihood, build_likelihood
from dovetail.inference.posterior.model_error import ModelError
from dovetail.meanwhile import meanwhile
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


def with_fewer_lines(problem: Problem, fit: Fit, model_error: ModelError) -> tuple[Problem, Fit]:
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
    density of the scatter of the lines within their groups (`log_constant_meanwhile`).
    """
    same = problem, fit
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
    kept, whole = _information(fewer, there), _information(problem, fit)
    return (fewer, there) if scipy.linalg.eigh(kept, whole, eigvals_only=True)[0] >= _SETTINGS.information else same


def _information(problem: Problem, fit: Fit) -> NDArray[np.float64]:
    """Return the information (p, p) on fractions of the ranges, with the prior's."""
    linear = problem.weighted(fit.variance, fit.used).linearise(problem.to_unit(fit.theta)[np.newaxis])
    return np.asarray(linear.curvature[0] + PRIOR_PRECISION * np.eye(len(fit.theta)))


@contextmanager
def log_constant_meanwhile(
    likelihood: Likelihood, used: tuple[Problem, Fit], measured: tuple[Problem, Fit], model_error: ModelError
) -> Iterator[Callable[[], float]]:
    """Compute the constant of a likelihood while other work goes on.

    Parameters
    ----------
    likelihood : Likelihood
        Of what is used.
    used, measured : (Problem, Fit)
        Means of neighbouring lines, and these lines, of which the likelihood becomes a density; or twice the same.
    model_error : ModelError

    Yields
    ------
    callable
        Waits for the constant and returns it.
    """

    def on_lines() -> float:
        return _log_density_at_fit(build_likelihood(*measured, model_error), *measured)

    if used == measured:
        yield lambda: likelihood.log_constant
        return
    with meanwhile(on_lines, lambda: used[0].limit.was_stopped) as found:
        yield lambda: likelihood.log_constant + found() - _log_density_at_fit(likelihood, *used)


def _log_density_at_fit(likelihood: Likelihood, problem: Problem, fit: Fit) -> float:
    """Return the logarithm of the density of the measured values, of a line or a mean each, at the fit."""
    return float(likelihood.log(problem.to_unit(fit.theta)[np.newaxis])[0]) + likelihood.log_constant
