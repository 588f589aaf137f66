"""Where the searches of a fit begin, and which of their ends differ.

Searches begin at random points with similar FRFs, at points that have evolved from these (differential evolution), at
points that differ from a minimum in one parameter, and at points that differ in those which had run away to the ends of
their ranges.

References
----------
R. Storn, K. Price, Differential evolution - a simple and efficient heuristic for global optimization over continuous
spaces, J. Global Optim. 11 (1997) 341-359.
J. Zhang, A. C. Sanderson, JADE: adaptive differential evolution with optional external archive, IEEE Trans. Evol.
Comput. 13 (2009) 945-958.
M. K. Transtrum, B. B. Machta, J. P. Sethna, Geometry of nonlinear least squares with applications to sloppy models and
optimization, Phys. Rev. E 83 (2011) 036701.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from copy import copy
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from dovetail.frf.resonance_peaks import prominent_peaks
from dovetail.interfaces import NO_LIMIT, TimeLimit
from dovetail.meanwhile import meanwhile, shared_numbers
from dovetail.problem.definition import latin_hypercube
from dovetail.problem.least_squares import Minima, SumOfSquares, minimise
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
    face: float = 0.01
    """Distance from an end of its range, as a fraction of it, within which a parameter has run away to this end."""
    released: int = 24
    """Points at which such parameters are drawn anew, about as many for each minimum."""
    best: float = 1.0 / 8.0
    """Share of the points, the lowest ones, towards which the others move."""
    lengths: tuple[float, float] = 0.3, 0.9
    """Smallest and largest move, over the distance from such a point, and over the difference of two others."""
    moved: tuple[float, float] = 0.3, 0.9
    """Probabilities with which a coordinate moves, one drawn for each point: few coordinates at a time, or most."""
    apart: float = 0.1
    """Largest difference of a coordinate above which two points count as different."""
    tolerance: float = 1.0
    """Decrease of the sum of squares in one step that ends a search; the fit continues from there."""
    most_steps: int = 40
    """Largest number of steps of a search; one that needs more is in a wrong valley."""
    same: float = 15.0
    """Standard deviations, by the curvature, within which two searches have ended in the same minimum."""


_SETTINGS = Settings()
RISE = 1e-3
"""Rise of a profile on both sides of a minimum: 1 and this fraction of the lowest sum of squares."""


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

    @property
    def count(self) -> int:
        """How many points are wanted in all."""
        return self.random + sum(count for _, count in self.evolved)


_FIRST = Similar(candidates=1024, random=2, evolved=((30, 1),))
"""Starts of the first batch, besides the middle of the ranges: more random ones if more are asked for. Of the searches
from the best of 1024 random points 86 % end in the right minimum; of those from any, 51 %."""
FURTHER = Similar(candidates=4096, random=8, evolved=((40, 24), (100, 4)))
"""Starts of each further batch, besides those along the axes. Searches from many points that have evolved a little find
more than those from a few that have evolved for long: on six wrong models of machines (of the seeds 100 to 111 of the
benchmark of wide posteriors), three times as often the lowest minimum, in the same time. Some narrow valleys are found
from the latter alone."""
CONFIRMING = Similar(candidates=4096, random=8, evolved=((100, 4),))
"""Starts that a fit to the noise is confirmed by."""


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

    def apart(self) -> Starts:
        """Return starts by other random numbers, for searches that another process may do."""
        others = copy(self)
        others._candidates, others._random = self._candidates.spawn(1)[0], self._random.spawn(1)[0]
        return others

    def first(self, misfit: FrfResiduals, count: int) -> NDArray[np.float64]:
        """Return the middle of the ranges and points with FRFs like the measured ones, `count` in all."""
        wanted = replace(_FIRST, random=max(0, count - 1 - (_FIRST.count - _FIRST.random)))
        return np.concatenate([np.full((1, self._size), 0.5), self.similar(misfit, wanted)[: count - 1]])

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

    def released(self, minima: Minima) -> NDArray[np.float64]:
        """Return points (n, p) that differ from minima in the parameters at ends of their ranges, which are drawn anew.

        A search can drive a parameter so far away that the FRF hardly depends on it any more, and ends there, on a
        plateau: a stiffness becomes rigid, or a damper locks (Transtrum et al.). The others are often nearly right.
        """
        points = [np.empty((0, self._size))]
        ran_away = np.minimum(minima.position, 1.0 - minima.position) < _SETTINGS.face
        count = -(-_SETTINGS.released // max(1, int(np.count_nonzero(ran_away.any(axis=1)))))
        for position, away in zip(minima.position, ran_away, strict=True):
            if away.any():
                points.append(np.tile(position, (count, 1)))
                points[-1][:, away] = latin_hypercube(count, int(np.count_nonzero(away)), self._random)
        return np.concatenate(points)

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


def search_ends(problem: SumOfSquares, start: NDArray[np.float64], callback: Callable[[], None]) -> Minima:
    """Return the different minima where searches from some points (n, p) end, the lowest first.

    `callback` is called when a search ends.
    """
    tolerance, most_steps = _SETTINGS.tolerance, _SETTINGS.most_steps
    return different(minimise(problem, start, tolerance=tolerance, most_steps=most_steps, callback=callback))


@contextmanager
def searching(
    problem: FrfResiduals, points: Callable[[], NDArray[np.float64]], callback: Callable[[], None]
) -> Iterator[Callable[[], Minima]]:
    """Search from some points (n, p) while other work goes on, in another process if there is a core for it.

    Yields what waits for the ends of the searches and returns them, as `search_ends`.
    """
    ended, reported, process = shared_numbers(1), 0, os.getpid()

    def report() -> bool:
        nonlocal reported
        while reported < ended[0]:
            reported += 1
            callback()
        return problem.limit.was_stopped

    def count_one() -> None:
        ended[0] += 1.0
        if os.getpid() == process:
            report()

    def result() -> Minima:
        found = ends()
        report()
        return found

    with meanwhile(lambda: search_ends(problem, points(), count_one), report) as ends:
        yield result


def different(minima: Minima, deviations: float = _SETTINGS.same) -> Minima:
    """Return the minima that are not near a lower one, the lowest first, each with the searches that ended near it.

    Parameters
    ----------
    minima : Minima
    deviations : float
        Smallest distance from a lower minimum, in standard deviations of the Gaussian about that.
    """
    ranked = Minima.ranked(minima)
    if not len(ranked.cost):
        return ranked
    chosen = np.flatnonzero(are_different(ranked, deviations))
    steps = ranked.position[:, np.newaxis] - ranked.position[chosen]
    nearest = np.argmin(np.einsum("nkp,kpq,nkq->nk", steps, ranked.curvature[chosen], steps), axis=1)
    steps_near, searches = (
        np.bincount(nearest, numbers, len(chosen)).astype(np.int64) for numbers in (ranked.steps, ranked.searches)
    )
    return replace(ranked.at(chosen), steps=steps_near, searches=searches)


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
        rise = self.cost.min() * RISE + 1.0
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
