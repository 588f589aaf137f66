"""Metropolis steps of several kinds, until samples are independent of their starts.

Each kind of step leaves the posterior invariant, and each is good at something else. Tangent steps follow curved
valleys. Difference steps move along the directions in which the samples differ, which they do not need to compute.
Prior steps draw single parameters anew, which moves those that the measurement hardly determines. How far each kind
moves the ranks of each coordinate is measured, and the kind that moves the slowest coordinate farthest for its cost
goes on. Ranks, since a few points far away would otherwise hide how far all others have moved.

References
----------
C. J. F. ter Braak, A Markov chain Monte Carlo version of the genetic algorithm Differential Evolution: easy Bayesian
computing for real parameter spaces, Statistics and Computing 16 (2006) 239-249.
A. Vehtari, A. Gelman, D. Simpson, B. Carpenter, P.-C. Buerkner, Rank-normalization, folding, and localization: an
improved R-hat for assessing convergence of MCMC, Bayesian Analysis 16 (2021) 667-718: normal scores of ranks.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from dovetail.inference.posterior.tangent_steps import Density, tangent_steps
from dovetail.inference.posterior.weights import INDEPENDENT
from dovetail.interfaces import NO_LIMIT, Progress, TimeLimit, silent
from dovetail.meanwhile import in_parts


@dataclass(frozen=True)
class Settings:
    """How far samples move from their starts, and by how many steps."""

    most_cost: float = 1500.0
    """Computations of the residuals of each sample, those for derivatives included, after which no step begins."""
    tangent: tuple[int, int] = (2, 4)
    """Fewest and most tangent steps at a time: as many as seem to be missing."""
    tried: int = 100
    """Points that take tangent steps, which cost most, before these are known to be worth it: all points if fewer of
    them are distinct, since other steps need points that differ."""
    iteration_cost: float = 3.5
    """Cost of an iteration of a tangent step over that of computing the residuals."""
    differences: tuple[int, int] = (10, 40)
    """Fewest and most difference steps at a time."""
    prior: tuple[int, int] = (1, 4)
    """Fewest and most draws of all coordinates from the prior at a time."""
    least_points: int = 4
    """Points from which there are differences to step by."""
    whole_difference: float = 0.1
    """Probability that a sample moves by a whole difference of two others, from one group of samples to another."""
    some_coordinates: float = 0.3
    """Probability with which each coordinate moves in steps that move some of them only."""
    shorter: float = 0.2
    """Smallest step, over the one that is best for a normal distribution."""
    most_moves: int = 4_000_000
    """Largest number of coordinates of all difference steps that begin from the same places."""
    apart: int = 4000
    """Difference steps, those of all points together, that are worth a process of their own."""
    scatter: float = 1e-4
    """Standard deviation added to a difference, so that all places can be reached."""
    largest_jump: float = 0.9
    """Largest mean square of the steps of normal scores, over that of two independent points, that is counted."""


_SETTINGS = Settings()


class Chains:
    """Points that move by steps of several kinds.

    Parameters
    ----------
    density : Density
    starts : (n, d) array
    random : numpy.random.Generator
    limit : TimeLimit

    Attributes
    ----------
    z : (n, d) array
    log_posterior : (n,) array
    correlation : float
        Of the ranks, as normal scores, with those at the start, of the coordinate that has moved least; 1 before
        `decorrelate`.
    """

    correlation = 1.0

    def __init__(
        self, density: Density, starts: NDArray[np.float64], random: np.random.Generator, limit: TimeLimit = NO_LIMIT
    ) -> None:
        self._density, self._random, self._limit = density, random, limit
        self.z, self.log_posterior = starts.copy(), density.log(starts)

    def tangent_steps(self, steps: int = _SETTINGS.tangent[0], points: int | None = None) -> float:
        """Move some or all points along the valley; return the cost, in computations of the residuals of each point."""
        count = len(self.z)
        rows = np.linspace(0, count - 1, min(count, points or count)).round().astype(np.intp)
        start = self._density.points_at(self.z[rows])
        moved, _, iterations = tangent_steps(self._density, start, self._random, steps, self._limit)
        self.z[rows], self.log_posterior[rows] = moved.z, moved.log_posterior
        return _SETTINGS.iteration_cost * iterations / count

    def difference_steps(self, steps: int = _SETTINGS.differences[0], *, some: bool = False) -> float:
        """Move each half of the points by differences of points of the other half, as these are now; return the cost.

        With `some`, half of the points move in some of their coordinates only. Of many points, fewer steps follow from
        the same places, so that memory is limited.
        """
        at_once = min(steps, max(1, _SETTINGS.most_moves // self.z.size))
        for first in range(0, steps, at_once):
            self._move_by_differences(min(at_once, steps - first), some=some)
        return float(steps)

    def _move_by_differences(self, steps: int, *, some: bool) -> None:
        moves = self._differences(steps, some=some)
        levels = np.log(self._random.random(moves.shape[:2]))

        def walk(rows: NDArray[np.intp]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
            z, log_posterior = self.z[rows], self.log_posterior[rows]
            for move, level in zip(moves[:, rows], levels[:, rows], strict=True):
                proposed = z + move
                there = self._density.log(proposed)
                accepted = level < there - log_posterior
                z = np.where(accepted[:, np.newaxis], proposed, z)
                log_posterior = np.where(accepted, there, log_posterior)
            return z, log_posterior

        parts = in_parts(walk, len(self.z), _SETTINGS.apart // steps + 1, lambda: self._limit.was_stopped)
        z, log_posterior = zip(*parts, strict=True)
        self.z, self.log_posterior = np.concatenate(z), np.concatenate(log_posterior)

    def _differences(self, steps: int, *, some: bool) -> NDArray[np.float64]:
        """Return the moves (steps, n, d) of each half of the points by differences of points of the other half."""
        count, width = self.z.shape
        order, shape = self._random.permutation(count), (steps, count, width)
        halves = order[: count // 2], order[count // 2 :]
        difference = np.empty(shape)
        for moved, others in (halves, halves[::-1]):
            first, second = others[self._random.integers(0, len(others), (2, steps, len(moved)))]
            difference[:, moved] = self.z[first] - self.z[second]
        shorter = _SETTINGS.shorter ** self._random.random(shape[:2])
        whole = self._random.random(shape[:2]) < _SETTINGS.whole_difference
        length = np.where(whole, 1.0, 2.38 / np.sqrt(2.0 * width) * shorter)
        moves = length[..., np.newaxis] * difference + _SETTINGS.scatter * self._random.standard_normal(shape)
        return moves * self._coordinates(shape) if some else moves

    def _coordinates(self, shape: tuple[int, int, int]) -> NDArray[np.bool_]:
        """Return which coordinates of points (..., d) move: some, at least one, of about half of them, else all."""
        moves = self._random.random(shape) < self._random.choice([_SETTINGS.some_coordinates, 1.0], (*shape[:2], 1))
        always = self._random.integers(0, shape[-1], (*shape[:2], 1))
        np.put_along_axis(moves, always, values=True, axis=-1)
        return moves

    def prior_steps(self, steps: int = _SETTINGS.prior[0]) -> float:
        """Draw each coordinate of all points anew from the prior, one after the other; return the cost."""
        for column in np.concatenate([self._random.permutation(self.z.shape[1]) for _ in range(steps)]):
            proposed = self.z.copy()
            proposed[:, column] = self._random.standard_normal(len(proposed))
            prior_ratio = (proposed[:, column] ** 2 - self.z[:, column] ** 2) / 2.0
            self._propose(np.arange(len(proposed)), proposed, prior_ratio)
        return float(steps * self.z.shape[1])

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
        Takes a number of steps and returns their cost.
    counts : (int, int)
        Fewest and most steps at a time.

    Attributes
    ----------
    decay : (d,) array
        Of the logarithm of the correlation of each coordinate's normal scores with those of the starts.
    cost : float
    """

    def __init__(self, chains: Chains, steps: Callable[[int], float], counts: tuple[int, int]) -> None:
        self._chains, self._steps, self._counts = chains, steps, counts
        self.decay, self.cost, self._taken = np.zeros(chains.z.shape[1]), 0.0, 0

    def take(self, steps: Callable[[int], float] | None = None, *, count: int | None = None) -> None:
        """Take steps, and add how far they have moved each coordinate."""
        before, count = self._chains.z.copy(), count or self._counts[0]
        self.cost += (steps or self._steps)(count)
        self._taken += count
        scores = _normal_scores(np.concatenate([before, self._chains.z]))
        jumps = np.mean((scores[len(before) :] - scores[: len(before)]) ** 2, axis=0)
        variance = np.maximum(scores.var(axis=0), np.finfo(float).tiny)
        self.decay -= np.log1p(-np.minimum(jumps / (2.0 * variance), _SETTINGS.largest_jump))

    def take_for(self, column: int, decay: float) -> None:
        """Take as many steps as a decay of a coordinate's correlation seems to need."""
        wanted = decay * self._taken / max(float(self.decay[column]), np.finfo(float).tiny)
        self.take(count=int(np.clip(np.ceil(wanted), *self._counts)))

    def rate(self, column: int) -> float:
        """Return the mean decay of a coordinate's correlation for the cost."""
        return float(self.decay[column] / self.cost)


def _normal_scores(z: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the normal quantiles of the ranks of each coordinate of points (n, d), (n, d); equal ones share a rank."""
    both = [np.searchsorted(np.sort(one), one, "left") + np.searchsorted(np.sort(one), one, "right") for one in z.T]
    return np.asarray(ndtri(np.stack(both, axis=1) / (2.0 * len(z))))


def decorrelate(
    density: Density,
    starts: NDArray[np.float64],
    random: np.random.Generator,
    progress: Progress = silent,
    limit: TimeLimit = NO_LIMIT,
    correlation: float = INDEPENDENT,
) -> Chains:
    """Move points by Metropolis steps until the correlation of each coordinate with its start is small enough.

    They end earlier if time is over or the steps have cost too much.
    """
    chains = Chains(density, starts, random, limit)
    tangent = _Kind(chains, chains.tangent_steps, _SETTINGS.tangent)
    kinds = [tangent, _Kind(chains, chains.prior_steps, _SETTINGS.prior)]
    if len(starts) >= _SETTINGS.least_points:
        kinds.append(_Kind(chains, chains.difference_steps, _SETTINGS.differences))
    goal, spent = -np.log(correlation), 0.0
    decayed, untried = np.zeros(starts.shape[1]), list(kinds)
    differ = len(np.unique(starts, axis=0)) >= _SETTINGS.tried
    few_tangent_steps = partial(chains.tangent_steps, points=_SETTINGS.tried if differ else None)
    progress("independence", 0, 100)
    while decayed.min() < goal and spent < _SETTINGS.most_cost:
        slowest = int(np.argmin(decayed))
        if limit.is_over:
            limit.leave_out("steps that make samples independent")
            break
        if untried:
            kind = untried.pop(0)
            kind.take(few_tangent_steps if kind is tangent else None)
        else:
            max(kinds, key=partial(_Kind.rate, column=slowest)).take_for(slowest, goal - decayed[slowest])
        decayed, spent = np.sum([each.decay for each in kinds], axis=0), sum(each.cost for each in kinds)
        chains.correlation = float(np.exp(-decayed.min()))
        progress("independence", int(100 * min(1.0, max(decayed.min() / goal, spent / _SETTINGS.most_cost))), 100)
    return chains
