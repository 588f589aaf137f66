"""Local searches from many points in the ranges, of which the best is taken."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Literal, TypeAlias, get_args

import numpy as np
import scipy
from numpy.typing import NDArray

from dovetail.assembly import Assembly
from dovetail.errors import Fault, ParameterError, listing
from dovetail.frf import Frf
from dovetail.identification.fitting.fit import Fit, bounds_reached, count_agreeing
from dovetail.identification.fitting.least_squares import minimise
from dovetail.identification.fitting.observations import Observations
from dovetail.identification.fitting.residuals import FrfResiduals
from dovetail.interfaces import Progress, silent

__all__ = ["Objective", "fit_at", "multistart"]

Objective: TypeAlias = Literal["frf", "weighted"]
"""Residuals that are minimised: differences of the FRFs as they are, or over their random error."""

_TOLERANCE = 0.02
"""Decrease of the sum of squares in one step that ends a search; it is small compared to the scatter of the sum."""
_MOST_STEPS = 150
"""Largest number of steps of one search; one that needs more is in a wrong valley."""


def multistart(
    assembly: Assembly,
    measured: Frf | Sequence[Frf],
    *,
    starts: int = 64,
    seconds: float | None = None,
    objective: Objective = "frf",
    seed: int = 0,
    progress: Progress = silent,
) -> Fit:
    """Fit the parameters by bounded local searches from Latin hypercube points.

    Parameters
    ----------
    assembly : Assembly
        With parameters to identify.
    measured : Frf or sequence of Frf
        One for each response, on its frequencies in the assembly.
    starts : int
    seconds : float, optional
        Time after which no further step begins.
    objective : {"frf", "weighted"}
    seed : int
    progress : Progress

    Returns
    -------
    Fit
        Its chi-squared is relative to the random error, whatever the objective.

    Raises
    ------
    ParameterError
        An option is out of its range.
    """
    _check(starts, seconds, objective)
    began = time.monotonic()
    deadline = np.inf if seconds is None else began + seconds
    target = Observations.of(assembly, measured)
    variance = target.variance()
    used = np.ones(len(variance), dtype=np.bool_)
    weights = variance if objective == "weighted" else _mean_of_response(target, variance)
    problem = FrfResiduals(assembly, target.weighted(weights, used))
    minima = []
    points = scipy.stats.qmc.LatinHypercube(len(assembly.parameters), rng=np.random.default_rng(seed)).random(starts)
    for number, point in enumerate(points):
        progress("fit", number, starts)
        start = point[np.newaxis]
        minima.append(minimise(problem, start, tolerance=_TOLERANCE, most_steps=_MOST_STEPS, deadline=deadline))
        if time.monotonic() > deadline:
            break
    costs = np.array([minimum.cost[0] for minimum in minima])
    return fit_at(
        assembly,
        target,
        minima[int(np.argmin(costs))].position[0],
        starts=len(costs),
        agreeing=count_agreeing(costs),
        steps=sum(int(minimum.steps[0]) for minimum in minima),
        seconds=time.monotonic() - began,
    )


def fit_at(
    assembly: Assembly,
    target: Observations,
    fraction: NDArray[np.float64],
    *,
    starts: int,
    agreeing: int,
    steps: int,
    seconds: float,
) -> Fit:
    """Judge how well given parameters fit, by the random error of all lines.

    Parameters
    ----------
    assembly : Assembly
    target : Observations
    fraction : (n_params,) array
        The parameters, in fractions of their ranges.
    starts, agreeing, steps, seconds
        As in `Fit`.
    """
    variance = target.variance()
    used = np.ones(len(variance), dtype=np.bool_)
    there = FrfResiduals(assembly, target.weighted(variance, used)).linearise(fraction[np.newaxis])
    freedom = max(1, target.residual_count(used) - len(fraction))
    return Fit(
        theta=assembly.from_unit(fraction),
        information=there.curvature[0],
        chi_squared=float(there.cost[0]) / freedom,
        degrees_of_freedom=freedom,
        variance=variance,
        variance_known=target.variance_known,
        variance_assumed=target.assumes(variance),
        discrepancy=0.0,
        background=0.0,
        ignored=np.empty(0),
        used=used,
        at_bounds=bounds_reached(assembly, fraction),
        starts=starts,
        agreeing=agreeing,
        steps=steps,
        seconds=seconds,
    )


def _check(starts: int, seconds: float | None, objective: str) -> None:
    if starts < 1:
        raise ParameterError(Fault("starts", f"{starts} searches are no search.", "1 or more"))
    if seconds is not None and not seconds > 0:
        raise ParameterError(Fault("seconds", f"{seconds:g} s is no time.", "more than 0"))
    if objective not in get_args(Objective):
        raise ParameterError(Fault("objective", f"'{objective}' is not an objective.", listing(get_args(Objective))))


def _mean_of_response(target: Observations, variance: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the mean variance of each response, repeated for all its lines."""
    return np.concatenate([np.full_like(values, values.mean()) for values in target.split(variance)])
