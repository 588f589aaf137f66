"""Bounded nonlinear least squares in the unit cube, from many starts at once."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from dovetail.interfaces import NO_LIMIT, TimeLimit
from dovetail.problem.trust_region import TrustRegionModel

_TINY = np.finfo(float).tiny
_INSIDE = 1e-10
"""Smallest distance of a start from the faces of the cube."""
_AT_BOUND = 1e-5
"""Distance from a face of the cube within which a search that is driven towards the face is moved onto it."""
_NEAREST = 0.995
"""Largest part of the way to a face that a coordinate goes in one step."""
_LEAST_RADIUS = 1e-8
"""Radius, relative to the scaled position, at which a search ends."""
_PROBE = 0.1
"""Part of a step after which the curvature of the residuals along it is measured."""
_LARGEST_BEND = 0.15
"""Length of the acceleration, over that of the step, above which the step is not bent. Of 90 random structures (seed
777 of the benchmark of genuine measurements) 87 reach the right minimum with 0.15, and 86 with 0.375."""
_FEW_SEARCHES, _MOST_BYTES = 8, 128e6
"""Searches that advance together in any case, and memory of the derivatives up to which more do."""


@dataclass(frozen=True, eq=False)
class Linearisation:
    """Residuals at n positions and their derivatives.

    Parameters
    ----------
    residuals : (n, m) array
    jacobian : (n, p, m) array
        Derivatives of the residuals, transposed: J^T.
    """

    residuals: NDArray[np.float64]
    jacobian: NDArray[np.float64]

    @cached_property
    def gradient(self) -> NDArray[np.float64]:
        """(n, p) J^T r, half the derivative of the sum of squares."""
        return self.times_jacobian(self.residuals)

    @cached_property
    def curvature(self) -> NDArray[np.float64]:
        """(n, p, p) J^T J, half the Gauss-Newton Hessian of the sum of squares."""
        return np.asarray(self.jacobian @ self.jacobian.transpose(0, 2, 1))

    @cached_property
    def cost(self) -> NDArray[np.float64]:
        """(n,) sums of the squared residuals."""
        return np.asarray((self.residuals[:, np.newaxis] @ self.residuals[:, :, np.newaxis])[:, 0, 0])

    def times_jacobian(self, changes: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return J^T w (n, p) for changes w (n, m) of the residuals."""
        return np.asarray((self.jacobian @ changes[:, :, np.newaxis])[:, :, 0])

    def changes(self, step: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the linear changes J s (n, m) of the residuals with steps s (n, p)."""
        return np.asarray((step[:, np.newaxis] @ self.jacobian)[:, 0])

    def at_rows(self, rows: NDArray[np.intp]) -> Linearisation:
        """Return the linearisations at some of the positions."""
        return Linearisation(self.residuals[rows], self.jacobian[rows])


class SumOfSquares(ABC):
    """The function that is minimised. The residuals at a position do not depend on the rest of the batch.

    Attributes
    ----------
    limit : TimeLimit
        After which no further step of a search begins.
    """

    limit: TimeLimit = NO_LIMIT

    @abstractmethod
    def residuals(self, position: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return residuals (n, m) at positions (n, p) in the unit cube."""

    @abstractmethod
    def linearise(self, position: NDArray[np.float64]) -> Linearisation:
        """Return residuals and derivatives at positions (n, p) in the unit cube."""


@dataclass(frozen=True, eq=False)
class Minima:
    """The points where n searches ended.

    Parameters
    ----------
    position : (n, p) array
        In the unit cube.
    cost : (n,) array
    curvature : (n, p, p) array
        Sums of squares, and J^T J there.
    steps : (n,) array
        Number of times that the derivatives were computed.
    searches : (n,) array
        How many searches ended there: more than 1 if a minimum stands for several, whose steps it has too.
    """

    position: NDArray[np.float64]
    cost: NDArray[np.float64]
    curvature: NDArray[np.float64]
    steps: NDArray[np.int64]
    searches: NDArray[np.int64]

    @staticmethod
    def joined(minima: Sequence[Minima]) -> Minima:
        """Return all minima of several sets."""
        names = (entry.name for entry in fields(Minima))
        return Minima(*(np.concatenate([getattr(group, name) for group in minima]) for name in names))

    @staticmethod
    def ranked(*minima: Minima) -> Minima:
        """Merge several sets of minima, the lowest first."""
        joined = Minima.joined(minima)
        return joined.at(np.argsort(joined.cost, kind="stable"))

    def at(self, rows: NDArray[np.intp] | slice) -> Minima:
        """Return some of the minima."""
        return Minima(*(getattr(self, entry.name)[rows] for entry in fields(Minima)))


def minimise(
    problem: SumOfSquares,
    start: NDArray[np.float64],
    *,
    tolerance: float,
    most_steps: int,
    superfluous: Callable[[Minima, int], NDArray[np.bool_]] = lambda places, _: np.zeros(len(places.cost), np.bool_),
    callback: Callable[[], None] = lambda: None,
) -> Minima:
    """Minimise sums of squares from several starts, which advance together, by a trust-region interior method.

    Parameters
    ----------
    problem : SumOfSquares
    start : (n, p) array
        Points outside the unit cube are moved into it.
    tolerance : float
        Decrease of the sum of m squares in one step that ends a search, in proportion to the sum over m.
    most_steps : int
    superfluous : callable
        Called after each step with where all searches are and how many steps are left; returns which of them end.
    callback : callable
        Called when a search ends.

    Notes
    -----
    A search ends where it would end alone; it does not enter places where residuals or derivatives are not finite.
    In coordinates that are scaled by the curvature and, near a face, by the distance from it, a step minimises the
    Gauss-Newton model within a sphere. The sphere grows where the model predicts the sum of squares well, and shrinks
    where it does not. No coordinate reaches a face in a step. This is the method of `scipy.optimize.least_squares`
    without reflections at the faces, for many starts and by the normal equations. Steps also follow the curvature of
    the residuals (geodesic acceleration): the valleys of badly determined parameters are long and bent.

    References
    ----------
    M. A. Branch, T. F. Coleman, Y. Li, A subspace, interior, and conjugate gradient method for large-scale
    bound-constrained minimization problems, SIAM J. Sci. Comput. 21 (1999) 1-23.
    M. K. Transtrum, J. P. Sethna, Improvements to the Levenberg-Marquardt algorithm for nonlinear least-squares
    minimization (2012), arXiv:1201.5885.
    J. J. More, The Levenberg-Marquardt algorithm: implementation and theory, Numerical Analysis (1978) 105-116.
    """
    position = np.clip(start, _INSIDE, 1.0 - _INSIDE)
    if not len(position):
        none, size = np.empty(0, dtype=np.int64), position.shape[1]
        return Minima(position, np.empty(0), np.empty((0, size, size)), none, none)
    groups = np.array_split(position, _groups(problem, position))
    return Minima.joined([_minimised(problem, group, tolerance, most_steps, superfluous, callback) for group in groups])


def _groups(problem: SumOfSquares, position: NDArray[np.float64]) -> int:
    """Return into how many groups the searches are divided so that their derivatives fit into memory."""
    if len(position) <= _FEW_SEARCHES:
        return 1
    bytes_each = problem.residuals(position[:1]).nbytes * position.shape[1]
    return -(-len(position) // max(_FEW_SEARCHES, int(_MOST_BYTES / bytes_each)))


def _minimised(
    problem: SumOfSquares,
    position: NDArray[np.float64],
    tolerance: float,
    most_steps: int,
    superfluous: Callable[[Minima, int], NDArray[np.bool_]],
    callback: Callable[[], None],
) -> Minima:
    searches = _Searches(problem, position.copy(), tolerance)
    for steps_left in range(most_steps - 2, -1, -1):
        if not searches.active.size or problem.limit.is_over:
            break
        ended = searches.advance()
        for _ in range(ended + searches.stop(superfluous(searches.minima, steps_left)[searches.active])):
            callback()
    for _ in searches.active:
        callback()
    return searches.ends()


class _Searches:
    """Searches that take their steps together; those that have ended are left out.

    Attributes
    ----------
    active : (k,) array
        Numbers of the searches that have not ended.
    """

    def __init__(self, problem: SumOfSquares, position: NDArray[np.float64], tolerance: float) -> None:
        self._problem, self._tolerance = problem, tolerance
        self._linear = problem.linearise(position)  # of the active searches
        self._position = position
        self._cost, self._gradient, self._curvature = self._linear.cost, self._linear.gradient, self._linear.curvature
        self._sizes = _column_sizes(self._curvature)
        self._steps = np.ones(len(position), dtype=np.int64)
        scale = np.sqrt(self._distances(np.arange(len(position)))) / self._sizes
        first = np.linalg.norm(position / np.maximum(scale, _TINY), axis=1)
        self._radius = np.where(first > 0.0, first, 1.0)
        self.active = np.arange(len(position))
        self.stop(~_are_finite(self._linear))

    def _distances(self, rows: NDArray[np.intp]) -> NDArray[np.float64]:
        """Return the distances from the faces towards which the sum of squares falls."""
        position = self._position[rows]
        return np.where(self._gradient[rows] > 0.0, position, 1.0 - position)

    def advance(self) -> int:
        """Take one step in each active search; return how many end with it."""
        rows = self.active
        position, gradient, radius = self._position[rows], self._gradient[rows], self._radius[rows]
        distance = self._distances(rows)
        scale = np.sqrt(distance) / self._sizes[rows]
        barrier = np.abs(gradient) * scale**2 / np.maximum(distance, _TINY)
        model = TrustRegionModel.of(scale * gradient, self._curvature[rows], scale, barrier)
        velocity, damping = model.step(radius)
        room = np.stack([-_NEAREST * position, _NEAREST * (1.0 - position)])
        velocity, free = model.confined(velocity, damping, *(room / np.maximum(scale, _TINY)))
        straight = scale * velocity
        acceleration = model.newton(scale * self._bend(position, straight), damping, free)
        length = np.linalg.norm(velocity, axis=1)
        trusted = np.linalg.norm(acceleration, axis=1) <= _LARGEST_BEND * length
        step = straight + np.where(trusted[:, np.newaxis], scale * acceleration / 2.0, 0.0)
        step = np.clip(step, *room)
        tried = self._problem.linearise(position + step)
        self._steps[rows] += 1
        decrease, count = self._cost[rows] - tried.cost, tried.residuals.shape[1]
        with np.errstate(over="ignore"):
            barrier_cost = np.sum(barrier * (step / np.maximum(scale, _TINY)) ** 2, axis=1)
            ratio = (decrease - barrier_cost) / np.maximum(model.decrease(velocity), _TINY)
        grown = np.where((ratio > 0.75) & (length > 0.95 * radius), 2.0 * radius, radius)
        grown = np.where(trusted, grown, np.minimum(grown, 0.5 * length))
        self._radius[rows] = np.where(ratio >= 0.25, grown, 0.25 * length)
        better = (decrease > 0.0) & _are_finite(tried)
        ended = better & trusted & (ratio > 0.25) & (decrease < self._tolerance / count * self._cost[rows])
        ended |= self._radius[rows] < _LEAST_RADIUS * np.linalg.norm(position * self._sizes[rows], axis=1)
        self._move(rows, np.flatnonzero(better), position + step, tried)
        return self.stop(ended)

    def stop(self, ended: NDArray[np.bool_]) -> int:
        """Stop some of the active searches; return how many."""
        self.active, kept = self.active[~ended], np.flatnonzero(~ended)
        if len(kept) < len(ended):
            self._linear = self._linear.at_rows(kept)
        return len(ended) - len(kept)

    @property
    def minima(self) -> Minima:
        """Where the searches are."""
        return Minima(self._position, self._cost, self._curvature, self._steps, np.ones_like(self._steps))

    def _bend(self, position: NDArray[np.float64], step: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return J^T r'' (k, p) for the second derivatives r'' of the residuals along steps (k, p)."""
        ahead = self._problem.residuals(position + _PROBE * step)
        linear = self._linear.changes(step)
        return self._linear.times_jacobian(2.0 / _PROBE * ((ahead - self._linear.residuals) / _PROBE - linear))

    def _move(
        self, rows: NDArray[np.intp], better: NDArray[np.intp], position: NDArray[np.float64], new: Linearisation
    ) -> None:
        """Move those of the active searches, by their places among these, that have come lower."""
        moved = rows[better]
        self._position[moved], self._cost[moved] = position[better], new.cost[better]
        self._gradient[moved], self._curvature[moved] = new.gradient[better], new.curvature[better]
        self._sizes[moved] = np.maximum(self._sizes[moved], _column_sizes(new.curvature[better]))
        if len(better) == len(rows):
            self._linear = new
        else:
            self._linear.residuals[better], self._linear.jacobian[better] = new.residuals[better], new.jacobian[better]

    def ends(self) -> Minima:
        """Return where the searches have come to, on a face of the cube where they are driven towards it."""
        position, gradient = self._position, self._gradient
        onto = np.where((position < _AT_BOUND) & (gradient > 0.0), 0.0, position)
        onto = np.where((position > 1.0 - _AT_BOUND) & (gradient < 0.0), 1.0, onto)
        if (moved := np.flatnonzero((onto != position).any(axis=1))).size:
            tried = self._problem.linearise(onto[moved])
            self._position[moved], self._cost[moved], self._curvature[moved] = onto[moved], tried.cost, tried.curvature
        return self.minima


def _are_finite(linear: Linearisation) -> NDArray[np.bool_]:
    """Return at which positions (n,) a search can begin or go on."""
    return np.isfinite(linear.cost) & np.isfinite(linear.curvature).all(axis=(1, 2))


def _column_sizes(curvature: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the lengths (n, p) of the columns of the Jacobian."""
    diagonal = np.diagonal(curvature, axis1=1, axis2=2)
    return np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
