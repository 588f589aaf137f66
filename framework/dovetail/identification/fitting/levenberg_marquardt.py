"""Bounded least squares from many starts at once, in the unit cube: Levenberg-Marquardt with geodesic acceleration."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

__all__ = ["Linear", "Minimum", "SumOfSquares", "minimise"]

_DAMPING = 1e-2
"""First damping, in parts of the diagonal of the normal matrix."""
_LESS, _MORE = 1 / 5, 2.0
"""What the damping is multiplied by after a step that lowers the sum, and after one that does not."""
_LEAST_DAMPING, _MOST_DAMPING = 1e-14, 1e9
_LOOSE = 1e-1
"""Damping above which a small step says nothing about how far the minimum is."""
_SINGULAR = 1e-12
"""Part of the largest curvature that a parameter without influence is given, so that its step stays finite."""
_PROBE = 0.1
"""Part of a step at which the curvature of the residuals along it is measured."""
_MOST_BENT = 1.5
"""Acceleration over velocity above which a step is not trusted."""


@dataclass(frozen=True, eq=False)
class Linear:
    """Residuals of n positions and their derivatives.

    Parameters
    ----------
    residuals : (n, m) array
    slopes : (n, p, m) array
        K^T, the derivatives of the residuals.
    gradient : (n, p) array
        K^T r, half the derivative of the sum of squares.
    curvature : (n, p, p) array
        K^T K, half its Gauss-Newton Hessian.
    """

    residuals: NDArray[np.float64]
    slopes: NDArray[np.float64]
    gradient: NDArray[np.float64]
    curvature: NDArray[np.float64]

    @property
    def cost(self) -> NDArray[np.float64]:
        """(n,) sums of the squared residuals."""
        return np.asarray(np.einsum("nm,nm->n", self.residuals, self.residuals))

    def put(self, rows: NDArray[np.intp], other: Linear, taken: NDArray[np.bool_]) -> None:
        """Overwrite `rows` with those of `other` that are taken."""
        for name in ("residuals", "slopes", "gradient", "curvature"):
            getattr(self, name)[rows] = getattr(other, name)[taken]


class SumOfSquares(Protocol):
    """What is minimised. Each row's answer is the same alone and in any batch."""

    def residuals(self, position: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return residuals (n, m) at positions (n, p) in the unit cube."""
        ...

    def linear(self, position: NDArray[np.float64]) -> Linear:
        """Return residuals and derivatives at positions (n, p) in the unit cube."""
        ...


@dataclass(frozen=True, eq=False)
class Minimum:
    """Where n searches ended.

    Parameters
    ----------
    position : (n, p) array
        In the unit cube.
    cost : (n,) array
        Sums of squares.
    curvature : (n, p, p) array
        K^T K there.
    steps : (n,) array
        How often the derivatives were computed.
    """

    position: NDArray[np.float64]
    cost: NDArray[np.float64]
    curvature: NDArray[np.float64]
    steps: NDArray[np.int64]


def minimise(
    problem: SumOfSquares, start: NDArray[np.float64], *, tolerance: float, most_steps: int, deadline: float = np.inf
) -> Minimum:
    """Minimise sums of squares from several starts.

    Parameters
    ----------
    problem : SumOfSquares
    start : (n, p) array
        Brought into the unit cube.
    tolerance : float
        A search ends where a step that is hardly damped lowers the sum by less.
    most_steps : int
    deadline : float
        `time.monotonic()` after which no further step begins.

    Returns
    -------
    Minimum

    Notes
    -----
    The damped step is bent along the valley by half its geodesic acceleration (Transtrum and Sethna, Improvements to
    the Levenberg-Marquardt algorithm for nonlinear least-squares minimization, 2012): the valleys of FRFs are narrow
    and curved, and this halves the steps. A step ends at the faces of the cube that it meets and goes on along them.
    """
    search = _Search(problem, np.clip(start, 0.0, 1.0), tolerance)
    for _ in range(most_steps):
        if not len(search.active) or time.monotonic() > deadline:
            break
        search.step()
    return Minimum(search.position, search.cost, search.at.curvature, search.steps)


class _Search:
    """The state of n searches that go on side by side."""

    def __init__(self, problem: SumOfSquares, start: NDArray[np.float64], tolerance: float) -> None:
        self._problem = problem
        self._tolerance = tolerance
        self.position = start.copy()
        self.at = problem.linear(start)
        self.cost = self.at.cost
        self.steps = np.ones(len(start), dtype=np.int64)
        self.active = np.arange(len(start))
        self._damping = np.full(len(start), _DAMPING)

    def step(self) -> None:
        """Try one step of every search that goes on; take those that lower its sum."""
        moves, trusted = self._moves()
        rows = self.active[trusted]
        lower = np.zeros(len(self.active))
        if len(rows):
            end = np.clip(self.position[rows] + moves[trusted], 0.0, 1.0)
            tried = self._problem.linear(end)
            cost = tried.cost
            self.steps[rows] += 1
            lower[trusted] = self.cost[rows] - cost
            taken = lower[trusted] > 0
            self.position[rows[taken]], self.cost[rows[taken]] = end[taken], cost[taken]
            self.at.put(rows[taken], tried, taken)
        self._go_on(lower)

    def _go_on(self, lower: NDArray[np.float64]) -> None:
        """Change the damping by how much the sums fell, and leave the searches that have arrived."""
        damping = self._damping[self.active] * np.where(lower > 0, _LESS, _MORE)
        self._damping[self.active] = np.maximum(damping, _LEAST_DAMPING)
        arrived = (lower > 0) & (lower < self._tolerance) & (damping < _LOOSE)
        self.active = self.active[~arrived & (damping < _MOST_DAMPING)]

    def _moves(self) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Return a step for each search that goes on, and whether it may be trusted."""
        position, at = self.position[self.active], self.at
        steps = [
            _Step(self.position[i], at.gradient[i], at.curvature[i], self._damping[i]) for i in self.active.tolist()
        ]
        velocity = np.stack([step.velocity for step in steps])
        probed = self._problem.residuals(np.clip(position + _PROBE * velocity, 0.0, 1.0))
        moves, trusted = velocity.copy(), np.ones(len(steps), dtype=np.bool_)
        for row, (step, i) in enumerate(zip(steps, self.active.tolist(), strict=True)):
            bend = 2.0 / _PROBE * ((probed[row] - at.residuals[i]) / _PROBE - step.velocity @ at.slopes[i])
            acceleration = step.solve(at.slopes[i] @ bend)
            trusted[row] = step.length(acceleration) <= _MOST_BENT * step.length(step.velocity)
            moves[row] += 0.5 * acceleration
        return moves, trusted


class _Step:
    """The damped Gauss-Newton step of one search; parameters that meet a face of the cube stay there."""

    def __init__(
        self,
        position: NDArray[np.float64],
        gradient: NDArray[np.float64],
        curvature: NDArray[np.float64],
        damping: float,
    ) -> None:
        diagonal = np.diag(curvature)
        least = _SINGULAR * max(float(diagonal.max()), np.finfo(float).tiny)
        self._matrix = curvature + np.diag(damping * diagonal + least)
        self._free = ~(((position <= 0.0) & (gradient > 0)) | ((position >= 1.0) & (gradient < 0)))
        self.velocity = np.zeros_like(position)
        while self._free.any():
            known = self._matrix[:, ~self._free] @ self.velocity[~self._free]
            self.velocity = np.where(self._free, self.solve(gradient + known), self.velocity)
            end = position + self.velocity
            outside = self._free & ((end < 0.0) | (end > 1.0))
            if not outside.any():
                break
            self.velocity[outside] = np.where(end[outside] < 0.0, 0.0, 1.0) - position[outside]
            self._free &= ~outside

    def solve(self, force: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the step that `force` drives the free parameters to; the others have none."""
        found = np.zeros_like(force)
        free = np.flatnonzero(self._free)
        if len(free):
            found[free] = np.linalg.solve(self._matrix[np.ix_(free, free)], -force[free])
        return found

    def length(self, step: NDArray[np.float64]) -> float:
        """Return the length of a step in the metric of the damping."""
        return float(np.sqrt(np.diag(self._matrix) @ step**2))
