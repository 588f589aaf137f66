"""Sums of squares along single coordinates, with all others constant (cuts) or fitted (profiles)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from dovetail.frf.resonance_peaks import prominent_peaks
from dovetail.problem.least_squares import Linearisation, SumOfSquares

_RISE = 1e-3
"""Rise of a profile on both sides of a minimum: 1 and this fraction of the lowest sum of squares."""
_SETTLED = 0.1
"""Decrease of the sum of squares in one step, over such a rise, at which a profile is low enough."""
_FIRST_DAMPING, _DAMPING_FACTOR = 1e-2, 10.0
"""Damping along a profile, relative to the curvature, and its change after each step."""

_SAME_DERIVATIVES = 6
"""Most steps by the same derivatives. Along profiles of two end mills and six random structures (seed 777 of the
benchmark of genuine measurements), six come as low as four steps with derivatives of their own, in less time."""


@dataclass(frozen=True, eq=False)
class Profiles:
    """Sums of squares with one coordinate held at given values, for each of p coordinates.

    The other coordinates are either constant (`cuts`) or fitted (`profiles`).

    Parameters
    ----------
    values : (n,) array
        Of the coordinate that is held.
    cost : (p, n) array
        Sums of squares, a row for each coordinate.
    position : (p, n, p) array
        Where they were taken.
    steps : int
        Number of times that the derivatives were computed.
    """

    values: NDArray[np.float64]
    cost: NDArray[np.float64]
    position: NDArray[np.float64]
    steps: int = 0

    def low_points(self, start: NDArray[np.float64], most: int) -> NDArray[np.float64]:
        """Return the lowest minima (k, p) of the profiles, without the one at their start."""
        rise = self.cost.min() * _RISE + 1.0
        padded = -np.pad(self.cost, ((0, 0), (1, 1)), constant_values=np.inf)
        tops_of = (prominent_peaks(row, rise)[0] - 1 for row in padded)
        tops = [(axis, top) for axis, tops in enumerate(tops_of) for top in tops]
        spacing = 1.0 / len(self.values)
        distant = [(axis, top) for axis, top in tops if abs(self.values[top] - start[axis]) > spacing]
        distant.sort(key=lambda entry: float(self.cost[entry]))
        return np.array([self.position[entry] for entry in distant[:most]]).reshape(-1, len(start))


def cuts(problem: SumOfSquares, start: NDArray[np.float64], values: NDArray[np.float64]) -> Profiles:
    """Return sums of squares along each coordinate in turn, with all others constant."""
    size, count = len(start), len(values)
    position = np.tile(start, (size, count, 1))
    position[np.arange(size), :, np.arange(size)] = values
    cost = np.sum(problem.residuals(position.reshape(-1, size)) ** 2, axis=1).reshape(size, count)
    return Profiles(values, cost, position)


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
        active = active[here.cost - after > _SETTLED * (_RISE * here.cost + 1.0)]
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
        active = active[~lower | (decrease > _SETTLED * (_RISE * cost[active] + 1.0))]
        if not len(active):
            break
    return position, cost
