"""The judgement of a fit to a table of natural frequencies: by the errors that its residuals show."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy
from numpy.typing import NDArray
from scipy.optimize import brentq

from dovetail.inference.adequacy.verdict import TOO_FEW_VALUES, Adequacy, word_for
from dovetail.inference.fitting import Fit
from dovetail.inference.fitting.modal_fit import fit_with_errors
from dovetail.inference.posterior import LEVEL, TYPICAL, ModelError, typical_model_error
from dovetail.problem.definition import bounds_reached
from dovetail.problem.modal_observations import SETTINGS, ModalProblem

_ROUNDS = 3
"""Rounds in which errors are estimated from the residuals and the fit is repeated."""
_LEAST_FREEDOM = 0.5
"""Degrees of freedom below which the residuals of a fit say nothing about errors."""


def assess_modes(
    problem: ModalProblem, fit: Fit, allowed: float | None, limits: tuple[ModelError, ModelError]
) -> tuple[Adequacy, Fit]:
    """Judge a fit to a table of natural frequencies, and refit with the errors that it shows or that are allowed.

    Parameters
    ----------
    problem : ModalProblem
    fit : Fit
    allowed : float or None
        Relative error of natural frequencies that the user allowed.
    limits : (ModelError, ModelError)
        The largest errors of a good and of a rough model.
    """
    target, fraction = problem.observations, problem.to_unit(fit.theta)
    error = used = TYPICAL if allowed is None else typical_model_error(allowed)
    for _ in range(_ROUNDS):
        fraction = fit_with_errors(problem, fraction[np.newaxis], used.sizes_of_modes).position[0]
        error, freedom = _shown(problem, fraction, used)
        used = error if allowed is None else used
    (fraction,) = fit_with_errors(problem, fraction[np.newaxis], used.sizes_of_modes).position[:1]
    sizes = zip(target.deviations, used.sizes_of_modes, strict=False)
    variance = target.variance_with([size if sd is None else 0.0 for sd, size in sizes])
    linear = problem.weighted(variance).linearise(fraction[np.newaxis])
    refitted = replace(
        fit,
        theta=problem.from_unit(fraction),
        information=linear.curvature[0],
        chi_squared=float(linear.cost[0]) / max(1.0, freedom),
        degrees_of_freedom=freedom,
        variance=variance,
        discrepancy=error.natural_frequency,
        at_bounds=bounds_reached(problem.parameters, fraction),
    )
    plain = target.table.frequency_sd is not None and all(
        size <= least for size, least in zip(error.sizes_of_modes, SETTINGS.least, strict=True)
    )
    adequacy = Adequacy(
        "to the noise" if plain else word_for(error, *limits), None if plain else error, allowed, in_intervals=used
    )
    if adequacy.fits and freedom < 1.0:  # not one value more than unknowns
        adequacy = Adequacy("not judged", allowed=allowed, reasons=(TOO_FEW_VALUES,), in_intervals=used)
    return adequacy, refitted


def _shown(problem: ModalProblem, fraction: NDArray[np.float64], used: ModelError) -> tuple[ModelError, float]:
    """Return the errors that explain the residuals of a fit, and its degrees of freedom."""
    target = problem.observations
    variance = target.variance_with(used.sizes_of_modes)
    linear = problem.weighted(variance).linearise(fraction[np.newaxis])
    freedom = problem.freedom_of_groups(fraction, linear)
    remains = target.split(linear.residuals[0] * np.sqrt(variance))
    groups = zip(remains, target.deviations, target.scales, freedom, SETTINGS.least, SETTINGS.assumed, strict=False)
    sizes = [_size(*group) for group in groups]
    return ModelError(sizes[0], damping=sizes[1] if len(sizes) == 2 else 0.0), sum(freedom)


def _size(
    off: NDArray[np.float64],
    sd: NDArray[np.float64] | None,
    scale: NDArray[np.float64],
    freedom: float,
    least: float,
    assumed: float,
) -> float:
    """Return the relative error with which, added to the given ones, chi-squared equals the degrees of freedom."""
    if freedom < _LEAST_FREEDOM:
        return assumed if sd is None else least

    def excess(size: float) -> float:
        return float(np.sum(off**2 / ((0.0 if sd is None else sd**2) + (size * scale) ** 2)) - freedom)

    size = float(brentq(excess, least, 1e6)) if excess(least) > 0.0 else least
    if sd is not None:
        return size
    tails = scipy.special.stdtrit([freedom, np.inf], (1.0 + LEVEL) / 2.0)  # from few modes, it may be far larger
    return max(size, min(size * float(tails[0] / tails[1]), assumed))
