"""Bounded nonlinear least squares in the unit cube, from one start or several."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, fields
from functools import cached_property, lru_cache
from typing import Protocol

import numpy as np
import scipy
from numpy.typing import NDArray
from scipy.optimize import least_squares

_AT_BOUND = 1e-5
"""Distance from a face of the cube within which a search that is driven towards the face is moved onto it; the method
itself keeps all positions inside."""
_ROWS_PER_BLOCK = 1024
"""Rows of the residuals and derivatives that are decomposed at once: four times as fast as 10,000 or more."""
_RISE = 1e-3
"""Rise of a profile on both sides of a minimum: 1 and this fraction of the lowest sum of squares."""
_FIRST_DAMPING, _DAMPING_FACTOR = 1e-2, 10.0
"""Levenberg-Marquardt damping along a profile, relative to the curvature, and its change after each step."""


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
        return np.asarray(np.einsum("npm,nm->np", self.jacobian, self.residuals))

    @cached_property
    def curvature(self) -> NDArray[np.float64]:
        """(n, p, p) J^T J, half the Gauss-Newton Hessian of the sum of squares."""
        return np.asarray(self.jacobian @ self.jacobian.transpose(0, 2, 1))

    @cached_property
    def cost(self) -> NDArray[np.float64]:
        """(n,) sums of the squared residuals."""
        return np.asarray(np.einsum("nm,nm->n", self.residuals, self.residuals))


class SumOfSquares(Protocol):
    """The function that is minimised. The residuals at a position do not depend on the rest of the batch."""

    def residuals(self, position: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return residuals (n, m) at positions (n, p) in the unit cube."""
        ...

    def linearise(self, position: NDArray[np.float64]) -> Linearisation:
        """Return residuals and derivatives at positions (n, p) in the unit cube."""
        ...


@dataclass(frozen=True, eq=False)
class Minima:
    """The points where n searches ended.

    Parameters
    ----------
    position : (n, p) array
        In the unit cube.
    cost : (n,) array
        Sums of squares.
    curvature : (n, p, p) array
        J^T J there.
    steps : (n,) array
        Number of times that the derivatives were computed.
    """

    position: NDArray[np.float64]
    cost: NDArray[np.float64]
    curvature: NDArray[np.float64]
    steps: NDArray[np.int64]

    @staticmethod
    def ranked(*minima: Minima) -> Minima:
        """Merge several sets of minima, the lowest first."""
        order = np.argsort(np.concatenate([group.cost for group in minima]), kind="stable")
        names = (entry.name for entry in fields(Minima))
        return Minima(*(np.concatenate([getattr(group, name) for group in minima])[order] for name in names))


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
    """

    values: NDArray[np.float64]
    cost: NDArray[np.float64]
    position: NDArray[np.float64]

    def low_points(self, start: NDArray[np.float64], most: int) -> NDArray[np.float64]:
        """Return the lowest minima (k, p) of the profiles, apart from the one at their start."""
        rise = self.cost.min() * _RISE + 1.0
        padded = -np.pad(self.cost, ((0, 0), (1, 1)), constant_values=np.inf)
        tops_of = (scipy.signal.find_peaks(row, prominence=rise)[0] - 1 for row in padded)
        tops = [(axis, top) for axis, tops in enumerate(tops_of) for top in tops]
        spacing = 1.0 / len(self.values)
        apart = [(axis, top) for axis, top in tops if abs(self.values[top] - start[axis]) > spacing]
        apart.sort(key=lambda entry: float(self.cost[entry]))
        return np.array([self.position[entry] for entry in apart[:most]]).reshape(-1, len(start))


def minimise(
    problem: SumOfSquares,
    start: NDArray[np.float64],
    *,
    tolerance: float,
    most_steps: int,
    deadline: float = np.inf,
    callback: Callable[[], None] = lambda: None,
) -> Minima:
    """Minimise sums of squares from several starts by the trust-region reflective method.

    Parameters
    ----------
    problem : SumOfSquares
    start : (n, p) array
        Points outside the unit cube are moved to its faces.
    tolerance : float
        Decrease of the sum of m squares in one step that ends a search, if the sum is about m, as for noise; for other
        sums in proportion.
    most_steps : int
    deadline : float
        `time.monotonic()` after which no further step begins.
    callback : callable
        Called after each search.

    References
    ----------
    M. A. Branch, T. F. Coleman, Y. Li, A subspace, interior, and conjugate gradient method for large-scale
    bound-constrained minimization problems, SIAM J. Sci. Comput. 21 (1999) 1-23; as `scipy.optimize.least_squares`.
    """
    searches = []
    for point in np.clip(start, 0.0, 1.0):
        searches.append(_search(problem, point, tolerance, most_steps, deadline))
        callback()
    position, cost, curvature, steps = (np.stack(values) for values in zip(*searches, strict=True))
    return Minima(position, cost, curvature, steps)


def _search(
    problem: SumOfSquares, start: NDArray[np.float64], tolerance: float, most_steps: int, deadline: float
) -> tuple[NDArray[np.float64], np.float64, NDArray[np.float64], int]:
    """Return the end of one search, the sum of squares and the curvature there, and the number of steps."""

    @lru_cache(maxsize=1)  # the method asks for the Jacobian where it has just asked for the residuals
    def linearise(position: bytes) -> Linearisation:
        return problem.linearise(np.frombuffer(position)[np.newaxis])

    @lru_cache(maxsize=1)
    def reduced(position: bytes) -> NDArray[np.float64]:
        return _triangle(linearise(position))

    reached = start.copy()

    def stop_when_late(position: NDArray[np.float64]) -> None:
        reached[:] = position
        if time.monotonic() > deadline:
            raise StopIteration

    try:
        end = least_squares(
            lambda position: reduced(position.tobytes())[:, -1],
            start,
            lambda position: reduced(position.tobytes())[:, :-1],
            bounds=(0.0, 1.0),
            x_scale="jac",  # the FRF tells some parameters a thousand times as well as others
            ftol=tolerance / linearise(start.tobytes()).residuals.size,
            max_nfev=most_steps,
            callback=stop_when_late,
        )
    except ValueError as error:
        if "trust region" not in str(error):
            raise
        position = reached  # huge residuals of few lines: by rounding a step begins outside of its own region
    else:
        position = end.x
        position[(position < _AT_BOUND) & (end.grad > 0)] = 0.0
        position[(position > 1.0 - _AT_BOUND) & (end.grad < 0)] = 1.0
    at_end = linearise(position.tobytes())
    return position, at_end.cost[0], at_end.curvature[0], linearise.cache_info().misses


def _triangle(linear: Linearisation) -> NDArray[np.float64]:
    """Return R of (J, r) = Q R: p + 1 rows with the same products J^T J, J^T r and r^T r as all m rows.

    `scipy.optimize.least_squares` decomposes the Jacobian several times in each step, which for thousands of lines
    takes longer than computing it. Blocks of rows that fit into the processor's cache are reduced first.
    """
    rows = np.concatenate([linear.jacobian[0], linear.residuals]).T
    blocks = len(rows) // _ROWS_PER_BLOCK
    if blocks > 1:
        whole = rows[: blocks * _ROWS_PER_BLOCK].reshape(blocks, _ROWS_PER_BLOCK, -1)
        reduced = np.asarray(np.linalg.qr(whole, mode="r")).reshape(-1, rows.shape[1])
        rows = np.concatenate([reduced, rows[blocks * _ROWS_PER_BLOCK :]])
    return np.asarray(np.linalg.qr(rows, mode="r"))


def cuts(problem: SumOfSquares, start: NDArray[np.float64], values: NDArray[np.float64]) -> Profiles:
    """Return sums of squares along each coordinate in turn, with all others constant."""
    size, count = len(start), len(values)
    position = np.tile(start, (size, count, 1))
    position[np.arange(size), :, np.arange(size)] = values
    cost = np.sum(problem.residuals(position.reshape(-1, size)) ** 2, axis=1).reshape(size, count)
    return Profiles(values, cost, position)


def profiles(problem: SumOfSquares, start: NDArray[np.float64], values: NDArray[np.float64], steps: int) -> Profiles:
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
        Levenberg-Marquardt steps at each value.
    """
    size, count = len(start), len(values)
    lowest = Profiles(values, np.full((size, count), np.inf), np.empty((size, count, size)))
    upper = np.searchsorted(values, start)
    ways = [(axis, way) for axis in range(size) for way in (1, -1)]
    axes, signs = np.array(ways).T
    numbers = np.where(signs > 0, upper[axes], upper[axes] - 1)
    position = np.tile(start, (len(ways), 1))
    while (inside := (numbers >= 0) & (numbers < count)).any():
        axes, signs, numbers, position = axes[inside], signs[inside], numbers[inside], position[inside]
        position[np.arange(len(axes)), axes] = values[numbers]
        position, cost = _stepped(problem, position, axes, steps)
        lowest.position[axes, numbers], lowest.cost[axes, numbers] = position, cost
        numbers += signs
    return lowest


def _stepped(
    problem: SumOfSquares, position: NDArray[np.float64], fixed: NDArray[np.intp], steps: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Take Levenberg-Marquardt steps from n positions, each with one fixed coordinate; return ends and costs."""
    size = position.shape[1]
    free = fixed[:, np.newaxis] != np.arange(size)
    damping = np.full(len(position), _FIRST_DAMPING)
    here = problem.linearise(position)
    gradient, curvature, cost = here.gradient.copy(), here.curvature.copy(), here.cost.copy()
    for _ in range(steps):
        moving = free & ~((position <= 0.0) & (gradient > 0.0)) & ~((position >= 1.0) & (gradient < 0.0))
        matrix = curvature * (moving[:, :, np.newaxis] & moving[:, np.newaxis])
        diagonal = np.einsum("nii->ni", matrix)
        diagonal += damping[:, np.newaxis] * diagonal + np.where(moving, np.finfo(float).tiny, 1.0)
        step = np.linalg.solve(matrix, np.where(moving, -gradient, 0.0)[:, :, np.newaxis])[:, :, 0]
        tried = np.clip(position + step, 0.0, 1.0)
        there = problem.linearise(tried)
        lower = there.cost < cost
        position[lower], cost[lower] = tried[lower], there.cost[lower]
        gradient[lower], curvature[lower] = there.gradient[lower], there.curvature[lower]
        damping *= np.where(lower, 1.0 / _DAMPING_FACTOR, _DAMPING_FACTOR)
    return position, cost


def without(vectors: NDArray[np.float64], directions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return vectors (..., m) without their projection on the span of some directions (k, m)."""
    lengths = np.maximum(np.linalg.norm(directions, axis=1), np.finfo(float).tiny)
    basis = np.linalg.qr(directions.T / lengths)[0]
    return np.asarray(vectors - (vectors @ basis) @ basis.T)
