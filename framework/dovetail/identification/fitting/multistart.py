"""Many local searches from all over the ranges, the best of which counts."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Literal, TypeAlias, get_args

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from dovetail.assembly import Assembly
from dovetail.errors import Fault, ParameterError, listing
from dovetail.frf import Frf
from dovetail.identification.fitting.fit import Fit, agreeing, at_bounds
from dovetail.identification.fitting.levenberg_marquardt import minimise
from dovetail.identification.fitting.observations import Measured
from dovetail.identification.fitting.residuals import FrfMisfit

__all__ = ["Objective", "multistart"]

Objective: TypeAlias = Literal["frf", "weighted"]
"""What is minimised: differences of the FRFs as they are, or over their random error."""

_AT_ONCE = 32
_TOLERANCE, _STEPS = 0.02, 150


def multistart(
    assembly: Assembly,
    measured: Frf | Sequence[Frf],
    *,
    starts: int = 64,
    seconds: float | None = None,
    objective: Objective = "frf",
    seed: int = 0,
) -> Fit:
    """Fit the parameters by bounded local searches from Latin hypercube points.

    Parameters
    ----------
    assembly : Assembly
        With parameters to seek.
    measured : Frf or sequence of Frf
        One for each response, on the assembly's frequencies.
    starts : int
    seconds : float, optional
        Time after which no further step is taken.
    objective : {"frf", "weighted"}
    seed : int

    Returns
    -------
    Fit
        Its chi-squared is over the random error, whichever the objective.

    Raises
    ------
    ParameterError
        An option is out of its range.
    """
    _check(starts, seconds, objective)
    began = time.monotonic()
    deadline = np.inf if seconds is None else began + seconds
    target = Measured.of(assembly, measured)
    known = target.known_variances()
    variance = target.variance(known)
    used = np.ones(len(variance), dtype=np.bool_)
    level = variance if objective == "weighted" else _levelled(target, variance)
    problem = FrfMisfit(assembly, target.weighted(level, used))
    points = qmc.LatinHypercube(len(assembly.parameters), rng=np.random.default_rng(seed)).random(starts)
    ends = []
    for first in range(0, starts, _AT_ONCE):
        batch = points[first : first + _AT_ONCE]
        ends.append(minimise(problem, batch, tolerance=_TOLERANCE, most_steps=_STEPS, deadline=deadline))
        if time.monotonic() > deadline:
            break
    costs = np.concatenate([end.cost for end in ends])
    best = np.concatenate([end.position for end in ends])[np.argmin(costs)]
    at_best = FrfMisfit(assembly, target.weighted(variance, used)).linear(best[np.newaxis])
    freedom = max(1, target.residuals_of(used) - len(best))
    return Fit(
        theta=assembly.from_unit(best),
        information=at_best.curvature[0],
        chi_squared=float(at_best.cost[0]) / freedom,
        degrees_of_freedom=freedom,
        variance=variance,
        variance_known=all(one is not None for one in known),
        discrepancy=0.0,
        ignored=np.empty(0),
        used=used,
        at_bounds=at_bounds(assembly, best),
        starts=len(costs),
        agreeing=agreeing(costs),
        steps=sum(int(end.steps.sum()) for end in ends),
        seconds=time.monotonic() - began,
    )


def _check(starts: int, seconds: float | None, objective: str) -> None:
    if starts < 1:
        raise ParameterError(Fault("starts", f"{starts} searches are no search.", "1 or more"))
    if seconds is not None and not seconds > 0:
        raise ParameterError(Fault("seconds", f"{seconds:g} s is no time.", "more than 0"))
    if objective not in get_args(Objective):
        raise ParameterError(Fault("objective", f"'{objective}' is not an objective.", listing(get_args(Objective))))


def _levelled(target: Measured, variance: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the mean variance of each response at all its lines."""
    return np.concatenate([np.full_like(own, own.mean()) for own in target.split(variance)])
