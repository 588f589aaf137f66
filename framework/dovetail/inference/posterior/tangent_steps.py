"""Metropolis steps by tangent maps, which follow curved valleys of the posterior.

In the tangent map anchored at a point, the posterior is nearly standard normal, however curved its valley is. The
proposal from there has the components ``0.6 u + 0.8 n``, with those of the point, u, and a standard normal draw n. The
Metropolis-Hastings rule makes the step exact: the density of a proposal is that of its components times the map's
determinant. A proposal whose reverse does not return, because the map folds over, is rejected.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from dovetail.inference.posterior.likelihood import PosteriorResiduals, squared_norms
from dovetail.inference.posterior.randomize_then_optimize import LinearisedPoints, TangentMap, TangentSearches
from dovetail.interfaces import NO_LIMIT, TimeLimit
from dovetail.meanwhile import in_parts


@dataclass(frozen=True)
class Settings:
    """How far a step goes, and when its searches end."""

    correlation: float = 0.6
    """Correlation of the components before and after a step; the larger, the more steps are accepted."""
    iterations: int = 40
    """Iterations after which a search is given up; most converge after ten to thirty."""
    return_distance: float = 1e-2
    """Largest difference of coordinates at which a reversed step counts as back at its start."""


_SETTINGS = Settings()


@dataclass(frozen=True)
class Density:
    """The density of a posterior, as Metropolis steps need it.

    Parameters
    ----------
    residuals : callable
        Takes points z (n, d) to residuals (n, d + m), half whose squares add up to the negative logarithm.
    points_at : callable
        Linearises these.
    map_at : callable
        Makes the tangent map that is anchored at points, one for each.
    """

    residuals: Callable[[NDArray[np.float64]], NDArray[np.float64]]
    points_at: Callable[[NDArray[np.float64]], LinearisedPoints]
    map_at: Callable[[LinearisedPoints], TangentMap]

    @staticmethod
    def of(posterior: PosteriorResiduals) -> Density:
        """Return the density of the posterior of one measurement."""
        return Density(posterior.residuals, partial(LinearisedPoints.at, posterior), partial(TangentMap, posterior))

    def log(self, z: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return its logarithm (n,), up to a constant."""
        return np.asarray(squared_norms(self.residuals(z)) / -2.0)


def tangent_steps(
    density: Density,
    points: LinearisedPoints,
    random: np.random.Generator,
    steps: int,
    limit: TimeLimit = NO_LIMIT,
) -> tuple[LinearisedPoints, float, int]:
    """Move each point by steps that leave the posterior invariant.

    Parameters
    ----------
    density : Density
    points : LinearisedPoints
    random : numpy.random.Generator
    steps : int
        Of each point.
    limit : TimeLimit
        After which each point stays where its steps have led so far.

    Returns
    -------
    LinearisedPoints
    float
        Fraction of the steps that were accepted.
    int
        Iterations of the searches of all points.
    """
    shape = (steps, *points.z.shape)
    drawn, levels = random.standard_normal(shape), np.log(random.random(shape[:2]))

    def walk(rows: NDArray[np.intp]) -> tuple[LinearisedPoints, int, int]:
        chains = _Walk(density, points.at_rows(rows), drawn[:, rows], levels[:, rows])
        chains.run(limit)
        return chains.points, chains.accepted, chains.iterations

    parts = in_parts(walk, len(points.z), points.fewest_apart, lambda: limit.was_stopped)
    moved, accepted, iterations = zip(*parts, strict=True)
    return LinearisedPoints.joined(moved), sum(accepted) / (steps * len(points.z)), sum(iterations)


class _Walk:
    """Chains of Metropolis steps, one from each point.

    A step is a search for the proposal and, if that is accepted, one back to the start. Chains do not wait for one
    another: the searches of all chains advance together, whichever step they belong to.

    Parameters
    ----------
    density, points
        As in `tangent_steps`.
    drawn : (steps, n, d) array
        Standard normal draws.
    levels : (steps, n) array
        Logarithms of draws between 0 and 1, above which a step is accepted.

    Attributes
    ----------
    points : LinearisedPoints
        Where the chains are.
    accepted : int
        Number of accepted steps.
    """

    def __init__(
        self,
        density: Density,
        points: LinearisedPoints,
        drawn: NDArray[np.float64],
        levels: NDArray[np.float64],
    ) -> None:
        self._drawn, self._levels = drawn, levels
        self._map_at, self._steps = density.map_at, len(drawn)
        self.points, self._proposed, self.accepted = points.copy(), points.copy(), 0
        self._maps = density.map_at(points)  # anchored at the points
        rows = np.arange(len(points.z))
        self._taken, self._returning = np.zeros(len(rows), dtype=np.int64), np.zeros(len(rows), dtype=np.bool_)
        self._searches = TangentSearches(self._maps.at_rows(rows), self._targets(rows), points, _SETTINGS.iterations)

    @property
    def iterations(self) -> int:
        """Iterations of the searches."""
        return self._searches.iterations

    def run(self, limit: TimeLimit = NO_LIMIT) -> None:
        """Take all steps of all chains."""
        self._searches.run(self._go_on, limit)

    def _targets(self, rows: NDArray[np.intp]) -> NDArray[np.float64]:
        """Return the components (k, d) of the proposals of some of the chains."""
        components = self._maps.along(self.points.residuals[rows], rows)
        drawn = self._drawn[self._taken[rows], rows]
        return np.asarray(_SETTINGS.correlation * components + np.sqrt(1.0 - _SETTINGS.correlation**2) * drawn)

    def _go_on(self, rows: NDArray[np.intp]) -> NDArray[np.intp]:
        """Continue the chains whose searches have ended: reverse an accepted proposal, or begin the next step.

        Returns the chains that have not taken all their steps.
        """
        returning = self._returning[rows]
        self._arrive(rows[returning])
        reversing = self._judge(rows[~returning])
        done = np.setdiff1d(rows, reversing, assume_unique=True)
        self._taken[done] += 1
        self._returning[done] = False
        next_step = done[self._taken[done] < self._steps]
        if len(next_step):
            maps, start = self._maps.at_rows(next_step), self.points.at_rows(next_step)
            self._searches.restart(next_step, maps, self._targets(next_step), start)
        return np.union1d(reversing, next_step)

    def _judge(self, rows: NDArray[np.intp]) -> NDArray[np.intp]:
        """Accept or reject the proposals that were found; return the chains whose step has to be reversed."""
        rows = rows[self._searches.converged[rows]]
        if not len(rows):
            return rows
        start, end, forth = self.points.at_rows(rows), self._searches.ends.at_rows(rows), self._maps.at_rows(rows)
        back = self._map_at(end)
        log_ratio = end.log_posterior - start.log_posterior
        log_ratio += _log_proposal(back, end, start) - _log_proposal(forth, start, end)
        accepted = np.flatnonzero(self._levels[self._taken[rows], rows] < log_ratio)
        rows, end, back = rows[accepted], end.at_rows(accepted), back.at_rows(accepted)
        self._proposed.overwrite(rows, end)
        self._returning[rows] = True
        self._searches.restart(rows, back, back.components(start.residuals[accepted]), end)
        return rows

    def _arrive(self, rows: NDArray[np.intp]) -> None:
        """Move the chains whose reversed steps lead back to their starts."""
        distance = np.abs(self._searches.ends.z[rows] - self.points.z[rows]).max(axis=1, initial=0.0)
        moved = rows[self._searches.converged[rows] & (distance < _SETTINGS.return_distance)]
        if len(moved):
            self.points.overwrite(moved, self._proposed.at_rows(moved))
            self._maps.overwrite(moved, self._map_at(self.points.at_rows(moved)))
            self.accepted += len(moved)


def _log_proposal(tangent_map: TangentMap, start: LinearisedPoints, end: LinearisedPoints) -> NDArray[np.float64]:
    """Return the log density of proposals `end` from `start`, the map's anchors."""
    kept = _SETTINGS.correlation * tangent_map.components(start.residuals)
    squares = squared_norms(tangent_map.components(end.residuals) - kept)
    return np.asarray(tangent_map.log_determinant(end) - squares / (2.0 * (1.0 - _SETTINGS.correlation**2)))
