"""Metropolis steps of several kinds, until samples are independent of their starts.

Each kind of step leaves the posterior invariant, and each is good at something else. Tangent steps follow curved
valleys. Difference steps move along the directions in which the samples differ, which they do not need to compute.
Prior steps draw single parameters anew, which moves those that the measurement hardly determines. How far each kind
moves each coordinate is measured, and the kind that moves the slowest coordinate farthest for its cost goes on.

References
----------
C. J. F. ter Braak, A Markov chain Monte Carlo version of the genetic algorithm Differential Evolution: easy Bayesian
computing for real parameter spaces, Statistics and Computing 16 (2006) 239-249.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from dovetail.inference.posterior.randomize_then_optimize import LinearisedPoints
from dovetail.inference.posterior.tangent_steps import Density, tangent_steps
from dovetail.interfaces import NO_LIMIT, Progress, TimeLimit, silent


@dataclass(frozen=True)
class Settings:
    """How far samples move from their starts, and by how many steps."""

    remaining_correlation: float = 0.25
    """Correlation of moved samples with their starts, in each coordinate, below which they count as independent."""
    most_cost: float = 1500.0
    """Computations of the residuals of each sample, those for derivatives included, after which no step begins."""
    tangent: int = 2
    """Tangent steps at a time."""
    iteration_cost: float = 3.5
    """Cost of an iteration of a tangent step over that of computing the residuals."""
    differences: int = 10
    """Difference steps at a time."""
    least_points: int = 4
    """Points from which there are differences to step by."""
    whole_difference: float = 0.1
    """Probability that a sample moves by a whole difference of two others, from one group of samples to another."""
    shorter: float = 0.2
    """Smallest step, over the one that is best for a normal distribution."""
    scatter: float = 1e-4
    """Standard deviation added to a difference, so that all places can be reached."""
    largest_jump: float = 0.9
    """Largest mean square of the steps, over that of two independent points, that is counted."""


_SETTINGS = Settings()


class Chains:
    """Points that move by steps of several kinds.

    Parameters
    ----------
    density : Density
    points : LinearisedPoints
        Their starts.
    random : numpy.random.Generator
    limit : TimeLimit

    Attributes
    ----------
    z : (n, d) array
    log_posterior : (n,) array
    correlation : float
        With the starts, of the coordinate that has moved least; 1 before `decorrelate`.
    """

    correlation = 1.0

    def __init__(
        self, density: Density, points: LinearisedPoints, random: np.random.Generator, limit: TimeLimit
    ) -> None:
        self._density, self._random, self._limit = density, random, limit
        self.z, self.log_posterior = points.z.copy(), points.log_posterior

    def tangent_steps(self) -> float:
        """Move along the valley of the posterior; return the cost, in computations of the residuals of each point."""
        start = self._density.points_at(self.z)
        points, _, iterations = tangent_steps(self._density, start, self._random, _SETTINGS.tangent, self._limit)
        self.z, self.log_posterior = points.z.copy(), points.log_posterior
        return _SETTINGS.iteration_cost * iterations / len(self.z)

    def difference_steps(self) -> float:
        """Move each half of the points by differences of points of the other half; return the cost."""
        count, width = self.z.shape
        for _ in range(_SETTINGS.differences):
            order = self._random.permutation(count)
            for moved, others in (
                (order[: count // 2], order[count // 2 :]),
                (order[count // 2 :], order[: count // 2]),
            ):
                first, second = self._random.integers(0, len(others), (2, len(moved)))
                shorter = _SETTINGS.shorter ** self._random.random(len(moved))
                whole = self._random.random(len(moved)) < _SETTINGS.whole_difference
                length = np.where(whole, 1.0, 2.38 / np.sqrt(2.0 * width) * shorter)
                step = length[:, np.newaxis] * (self.z[others[first]] - self.z[others[second]])
                step += _SETTINGS.scatter * self._random.standard_normal(step.shape)
                self._propose(moved, self.z[moved] + step, 0.0)
        return float(_SETTINGS.differences)

    def prior_steps(self) -> float:
        """Draw each coordinate of all points anew from the prior, one after the other; return the cost."""
        for column in self._random.permutation(self.z.shape[1]):
            proposed = self.z.copy()
            proposed[:, column] = self._random.standard_normal(len(proposed))
            prior_ratio = (proposed[:, column] ** 2 - self.z[:, column] ** 2) / 2.0
            self._propose(np.arange(len(proposed)), proposed, prior_ratio)
        return float(self.z.shape[1])

    def _propose(
        self, rows: NDArray[np.intp], proposed: NDArray[np.float64], log_ratio: NDArray[np.float64] | float
    ) -> None:
        """Move points to proposals (k, d) where the rule of Metropolis and Hastings accepts them.

        `log_ratio` is the log density of the steps back, less that of the steps to the proposals.
        """
        log_posterior = self._density.log(proposed)
        levels = np.log(self._random.random(len(rows)))
        accepted = levels < log_posterior - self.log_posterior[rows] + log_ratio
        self.z[rows[accepted]], self.log_posterior[rows[accepted]] = proposed[accepted], log_posterior[accepted]


class _Kind:
    """A kind of step, with how far it has moved each coordinate.

    Parameters
    ----------
    chains : Chains
    steps : callable
        Takes some steps and returns their cost.

    Attributes
    ----------
    decay : (d,) array
        Of the logarithm of each coordinate's correlation with the starts.
    cost : float
    """

    def __init__(self, chains: Chains, steps: Callable[[], float]) -> None:
        self._chains, self._steps = chains, steps
        self.decay, self.cost = np.zeros(chains.z.shape[1]), 0.0

    def take(self) -> None:
        """Take steps, and add how far they have moved each coordinate."""
        before = self._chains.z.copy()
        self.cost += self._steps()
        jumps = np.mean((self._chains.z - before) ** 2, axis=0)
        variance = np.maximum(np.maximum(before.var(axis=0), self._chains.z.var(axis=0)), np.finfo(float).tiny)
        self.decay -= np.log1p(-np.minimum(jumps / (2.0 * variance), _SETTINGS.largest_jump))

    def rate(self, column: int) -> float:
        """Return the mean decay of a coordinate's correlation for the cost."""
        return float(self.decay[column] / self.cost)


def decorrelate(
    density: Density,
    points: LinearisedPoints,
    random: np.random.Generator,
    progress: Progress = silent,
    limit: TimeLimit = NO_LIMIT,
) -> Chains:
    """Move points by Metropolis steps until they are independent of their starts, or time is over."""
    chains = Chains(density, points, random, limit)
    steps = [chains.tangent_steps, chains.prior_steps]
    if len(points.z) >= _SETTINGS.least_points:
        steps.append(chains.difference_steps)
    kinds = [_Kind(chains, one) for one in steps]
    goal, spent = -np.log(_SETTINGS.remaining_correlation), 0.0
    decayed, untried = np.zeros(points.z.shape[1]), list(kinds)
    progress("independence", 0, 100)
    while decayed.min() < goal and spent < _SETTINGS.most_cost:
        slowest = int(np.argmin(decayed))
        if limit.is_over:
            limit.leave_out("steps that make samples independent")
            break
        kind = untried.pop(0) if untried else max(kinds, key=partial(_Kind.rate, column=slowest))
        kind.take()
        decayed, spent = np.sum([each.decay for each in kinds], axis=0), sum(each.cost for each in kinds)
        chains.correlation = float(np.exp(-decayed.min()))
        progress("independence", int(100 * min(1.0, max(decayed.min() / goal, spent / _SETTINGS.most_cost))), 100)
    return chains
