"""Where the searches of a fit begin, and which of their ends differ.

Searches begin at random points with similar FRFs, at points that have evolved from these (differential evolution), and
at points that differ from a minimum in one parameter, while all others are constant (cuts) or fitted (profiles).

References
----------
R. Storn, K. Price, Differential evolution - a simple and efficient heuristic for global optimization over continuous
spaces, J. Global Optim. 11 (1997) 341-359.
J. Zhang, A. C. Sanderson, JADE: adaptive differential evolution with optional external archive, IEEE Trans. Evol.
Comput. 13 (2009) 945-958.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from dovetail.frf.resonance_peaks import prominent_peaks
from dovetail.interfaces import NO_LIMIT, TimeLimit
from dovetail.problem.definition import latin_hypercube
from dovetail.problem.least_squares import Linearisation, Minima, SumOfSquares
from dovetail.problem.residuals import FrfResiduals


@dataclass(frozen=True)
class Settings:
    """Numbers of points, and how they evolve."""

    evolving: int = 64
    """The most similar of the random points, which evolve."""
    along_axes: int = 4
    """Points that differ from a minimum in one parameter."""
    grid_points: int = 128
    """Points along the range of each parameter among which these are found."""
    best: float = 1.0 / 8.0
    """Share of the points, the lowest ones, towards which the others move."""
    lengths: tuple[float, float] = 0.3, 0.9
    """Smallest and largest move, over the distance from such a point, and over the difference of two others."""
    moved: tuple[float, float] = 0.3, 0.9
    """Probabilities with which a coordinate moves, one drawn for each point: few coordinates at a time, or most."""
    apart: float = 0.1
    """Largest difference of a coordinate above which two points count as different."""


_SETTINGS = Settings()
_RISE = 1e-3
"""Rise of a profile on both sides of a minimum: 1 and this fraction of the lowest sum of squares."""
_SETTLED = 0.1
"""Decrease of the sum of squares in one step, over such a rise, at which a profile is low enough."""
_FIRST_DAMPING, _DAMPING_FACTOR = 1e-2, 10.0
"""Damping along a profile, relative to the curvature, and its change after each step."""

_SAME_DERIVATIVES = 6
"""Most steps by the same derivatives. Along profiles of two end mills and six random structures (seed 777 of the
benchmark of genuine measurements), six come as low as four steps with derivatives of their own, in less time."""


@dataclass(frozen=True)
class Similar:
    """How many points with similar FRFs are wanted, and how they are found.

    Attributes
    ----------
    candidates : int
        Random points, whose FRFs take less time than a few steps of a search. The most similar of them evolve.
    random : int
        How many of them are wanted, the most similar ones.
    evolved : tuple of (int, int)
        How many evolved points are wanted, the most similar ones that differ, after a number of generations each: the
        generations, in which each point may move once, and the points. The longer points evolve the more similar they
        are, but they come together, perhaps in the valley of a wrong minimum.
    """

    candidates: int
    random: int
    evolved: tuple[tuple[int, int], ...]


class Starts:
    """Starts of searches, by random numbers of its own.

    Parameters
    ----------
    size : int
        Number p of parameters.
    seed : int
    """

    def __init__(self, size: int, seed: int) -> None:
        self._size = size
        self._candidates, self._random = np.random.default_rng(seed).spawn(1)[0], np.random.default_rng([seed, 1])

    def similar(self, misfit: FrfResiduals, wanted: Similar) -> NDArray[np.float64]:
        """Return points (n, p) with FRFs like the measured ones, as many as wanted or fewer.

        Parameters
        ----------
        misfit : FrfResiduals
            By which FRFs are compared.
        wanted : Similar
        """

        def squares(points: NDArray[np.float64]) -> NDArray[np.float64]:
            return np.asarray(np.sum(misfit.residuals(points) ** 2, axis=1))

        points = latin_hypercube(wanted.candidates, self._size, self._candidates)
        points = points[np.argsort(squares(points), kind="stable")[: _SETTINGS.evolving]]
        found, generation = [points[: wanted.random]], 0
        for generations, count in wanted.evolved:
            points = evolved(squares, points, self._candidates, generations - generation, misfit.limit)
            found.append(different_points(points, _SETTINGS.apart)[:count])
            generation = generations
        return np.concatenate(found)

    def along_axes(self, misfit: FrfResiduals, position: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return points that differ from a minimum in one parameter only, at the minima along that parameter.

        Where two resonances are close together, the valley of the right minimum is narrow, but in a wrong minimum most
        parameters are right already. Each call uses another grid, so that repetitions find other points nearby.
        """
        return cuts(misfit, position, self.grid()).low_points(position, _SETTINGS.along_axes)

    def grid(self) -> NDArray[np.float64]:
        """Return evenly spaced values along a range, with a random offset."""
        return (np.arange(_SETTINGS.grid_points) + self._random.random()) / _SETTINGS.grid_points


def evolved(
    cost: Callable[[NDArray[np.float64]], NDArray[np.float64]],
    points: NDArray[np.float64],
    random: np.random.Generator,
    generations: int,
    limit: TimeLimit = NO_LIMIT,
) -> NDArray[np.float64]:
    """Let points of the unit cube evolve; return where they are then, the lowest first.

    Parameters
    ----------
    cost : callable
        Takes points (n, p) to their costs (n,).
    points : (n, p) array
    random : numpy.random.Generator
    generations : int
        Times that each point may move.
    limit : TimeLimit
        After which no further generation follows.

    Returns
    -------
    (n, p) array

    Notes
    -----
    Each point tries a move towards one of the best and along the difference of two others, in some of its coordinates,
    and keeps it if the cost is lower. A move across a face ends half way to it. The differences of points in several
    valleys lead from one valley to another, where a search would end in the nearest.
    """

    def costs_of(points: NDArray[np.float64]) -> NDArray[np.float64]:
        costs = cost(points)
        return np.where(np.isnan(costs), np.inf, costs)

    costs = costs_of(points)
    order = np.argsort(costs, kind="stable")
    points, costs = points[order], costs[order]
    for _ in range(generations):
        if limit.is_over:
            break
        tried = _moved(points, random)
        costs_there = costs_of(tried)
        lower = costs_there < costs
        points, costs = np.where(lower[:, np.newaxis], tried, points), np.where(lower, costs_there, costs)
        order = np.argsort(costs, kind="stable")
        points, costs = points[order], costs[order]
    return points


def _moved(points: NDArray[np.float64], random: np.random.Generator) -> NDArray[np.float64]:
    """Return where points (n, p), the lowest first, try to move."""
    count, width = points.shape
    towards = points[random.integers(0, max(1, round(_SETTINGS.best * count)), count)]
    one, other = points[random.integers(0, count, (2, count))]
    length = random.uniform(*_SETTINGS.lengths, (count, 1))
    there = points + length * (towards - points + one - other)
    there = np.where(there < 0.0, points / 2.0, np.where(there > 1.0, (1.0 + points) / 2.0, there))
    moves = random.random((count, width)) < random.choice(_SETTINGS.moved, (count, 1))
    moves[np.arange(count), random.integers(0, width, count)] = True
    return np.where(moves, there, points)


def different_points(points: NDArray[np.float64], difference: float) -> NDArray[np.float64]:
    """Return the points (n, p) of which some coordinate differs by more than this from that of each earlier one."""
    kept: list[int] = []
    for number, point in enumerate(points):
        if not kept or np.abs(points[kept] - point).max(axis=1).min() > difference:
            kept.append(number)
    return points[kept]


def different(minima: Minima, deviations: float) -> Minima:
    """Return the minima that are not near a lower one, the lowest first, with the searches that ended near each.

    Parameters
    ----------
    minima : Minima
    deviations : float
        Smallest distance from a lower minimum, in standard deviations of the Gaussian about that.
    """
    ranked = Minima.ranked(minima)
    chosen = np.flatnonzero(are_different(ranked, deviations))
    steps = ranked.position[:, np.newaxis] - ranked.position[chosen]
    nearest = np.argmin(np.einsum("nkp,kpq,nkq->nk", steps, ranked.curvature[chosen], steps), axis=1)
    searches = np.bincount(nearest, ranked.searches, len(chosen)).astype(np.int64)
    return replace(ranked.at(chosen), searches=searches)


def are_different(minima: Minima, deviations: float) -> NDArray[np.bool_]:
    """Return which minima (n,) are not near a lower one, as in `different`."""
    different = np.zeros(len(minima.cost), dtype=np.bool_)
    order = np.argsort(minima.cost, kind="stable").tolist()
    different[distinct(minima.position, minima.curvature, order, deviations)] = True
    return different


def distinct(
    position: NDArray[np.float64], curvature: NDArray[np.float64], order: Sequence[int], deviations: float
) -> list[int]:
    """Choose points in a given order, without those near a point that was chosen before.

    Parameters
    ----------
    position : (n, p) array
    curvature : (n, p, p) array
        Inverse covariance of the Gaussian about each point.
    order : sequence of int
    deviations : float
        Smallest distance from a chosen point, in standard deviations of its Gaussian.
    """
    chosen: list[int] = []
    for number in order:
        steps = position[chosen] - position[number]
        squares = np.einsum("kp,kpq,kq->k", steps, curvature[chosen], steps)
        if (squares > deviations**2).all():
            chosen.append(number)
    return chosen


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
