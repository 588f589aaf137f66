"""Profiles of a sum of squares: one coordinate is moved, and all others are fitted."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from dovetail.inference.fitting.searches import RISE, Profiles
from dovetail.problem.least_squares import Linearisation, SumOfSquares

_SETTLED = 0.1
"""Decrease of the sum of squares in one step, over the rise about a minimum, at which a profile is low enough."""
_FIRST_DAMPING, _DAMPING_FACTOR = 1e-2, 10.0
"""Damping along a profile, relative to the curvature, and its change after each step."""

_SAME_DERIVATIVES = 6
"""Most steps by the same derivatives. Along profiles of two end mills and six random structures (seed 777 of the
benchmark of genuine measurements), six come as low as four steps with derivatives of their own, in less time."""


def profiles(
    problem: SumOfSquares,
    start: NDArray[np.float64],
    values: NDArray[np.float64],
    steps: int,
    callback: Callable[[], None] = lambda: None,
) -> Profiles:
    """Hold each coordinate in turn at given values and minimise over all others.

    The values are taken in order of their distance from the start, on either side; each search begins where the one at
    the value before ended. All coordinates advance together, so that their residuals are computed in one batch.

    Parameters
    ----------
    problem : SumOfSquares
    start : (p,) array
    values : (n,) array
        Increasing.
    steps : int
        Largest number of times that derivatives are computed at each value; they serve for several steps.
    callback : callable
        Called when all coordinates have gone on by one value, `values` times at most.

    Returns
    -------
    Profiles
        Where time was over before, sums of squares are infinite.
    """
    size, count = len(start), len(values)
    lowest, computed = Profiles(values, np.full((size, count), np.inf), np.empty((size, count, size))), 0
    upper = np.searchsorted(values, start)
    ways = [(axis, way) for axis in range(size) for way in (1, -1)]
    axes, signs = np.array(ways).T
    numbers = np.where(signs > 0, upper[axes], upper[axes] - 1)
    position = np.tile(start, (len(ways), 1))
    while (inside := (numbers >= 0) & (numbers < count)).any() and not problem.limit.is_over:
        axes, signs, numbers, position = axes[inside], signs[inside], numbers[inside], position[inside]
        position[np.arange(len(axes)), axes] = values[numbers]
        position, cost, more = _stepped(problem, position, axes, steps)
        lowest.position[axes, numbers], lowest.cost[axes, numbers] = position, cost
        numbers, computed = numbers + signs, computed + more
        callback()
    return replace(lowest, steps=computed)


def _stepped(
    problem: SumOfSquares, position: NDArray[np.float64], fixed: NDArray[np.intp], steps: int
) -> tuple[NDArray[np.float64], NDArray[np.float64], int]:
    """Minimise from n positions, each with one fixed coordinate.

    Returns the ends, their sums of squares, and how often the derivatives were computed.
    """
    position, cost = position.copy(), np.full(len(position), np.inf)
    active, computed = np.arange(len(position)), 0
    for _ in range(steps):
        here, computed = problem.linearise(position[active]), computed + len(active)
        position[active], after = _with_same_derivatives(problem, position[active], fixed[active], here)
        cost[active] = after
        active = active[here.cost - after > _SETTLED * (RISE * here.cost + 1.0)]
        if not len(active):
            break
    return position, cost, computed


def _with_same_derivatives(
    problem: SumOfSquares, position: NDArray[np.float64], fixed: NDArray[np.intp], here: Linearisation
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Take damped Gauss-Newton steps by residuals alone; return the ends and their sums of squares.

    The derivatives at the start serve for all of them, since the ends are near. With them, several steps take less time
    than one more set of derivatives, and come lower.
    """
    free = fixed[:, np.newaxis] != np.arange(position.shape[1])
    damping, active = np.full(len(position), _FIRST_DAMPING), np.arange(len(position))
    gradient, cost = here.gradient.copy(), here.cost.copy()
    for _ in range(_SAME_DERIVATIVES):
        place, slope = position[active], gradient[active]
        moving = free[active] & ~((place <= 0.0) & (slope > 0.0)) & ~((place >= 1.0) & (slope < 0.0))
        matrix = here.curvature[active] * (moving[:, :, np.newaxis] & moving[:, np.newaxis])
        diagonal = np.einsum("nii->ni", matrix)
        diagonal += damping[active, np.newaxis] * diagonal + np.where(moving, np.finfo(float).tiny, 1.0)
        step = np.linalg.solve(matrix, np.where(moving, -slope, 0.0)[:, :, np.newaxis])[:, :, 0]
        tried = np.clip(place + step, 0.0, 1.0)
        there = Linearisation(problem.residuals(tried), here.jacobian[active])
        decrease = cost[active] - there.cost
        lower = decrease > 0.0
        moved = active[lower]
        position[moved], cost[moved], gradient[moved] = tried[lower], there.cost[lower], there.gradient[lower]
        damping[active] *= np.where(lower, 1.0 / _DAMPING_FACTOR, _DAMPING_FACTOR)
        active = active[~lower | (decrease > _SETTLED * (RISE * cost[active] + 1.0))]
        if not len(active):
            break
    return position, cost
