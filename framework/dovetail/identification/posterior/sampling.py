"""Samples of the posterior: the region found, the misfit reduced to it, independent weighted samples drawn."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dovetail.assembly import Assembly
from dovetail.identification.fitting.least_squares import Linear, minimise
from dovetail.identification.fitting.misfit import FrfMisfit, Weighted
from dovetail.identification.posterior.coordinates import FURTHEST, PriorAndData
from dovetail.identification.posterior.optimised import Chart
from dovetail.identification.posterior.reduced import ReducedMisfit

__all__ = ["Samples", "draw"]

_PILOTS, _MOST_ROUNDS, _FEWEST_ROUNDS = 48, 14, 3
_PILOT_STEPS, _STEPS = 30, 200
_BATCH = 100
_EXACT = 0.05
"""Difference of chi-squared between the reduced misfit and all lines that is let pass."""
_FAR = 200.0
"""Chi-squared above the best beyond which a place is not in the region of interest."""
_TOLERANCE = 1e-3
_MOST_SNAPSHOTS = 600


@dataclass(frozen=True, eq=False)
class Samples:
    """Independent weighted samples.

    Parameters
    ----------
    fraction : (n, p) array
        Of the ranges, on the parameters' scales.
    weight : (n,) array
        Sums to 1.
    drawn : int
        Searches, n of which reached their target.
    lines : int
        Lines to which the misfit was reduced.
    seconds : float
    """

    fraction: NDArray[np.float64]
    weight: NDArray[np.float64]
    drawn: int
    lines: int
    seconds: float

    @property
    def effective(self) -> float:
        """Effective sample size, 1 / sum of the squared weights (Kish)."""
        return float(1.0 / np.sum(self.weight**2))


def draw(
    assembly: Assembly,
    residual: Weighted,
    best: NDArray[np.float64],
    information: NDArray[np.float64],
    nuisance: NDArray[np.float64],
    *,
    count: int,
    seed: int,
) -> Samples:
    """Draw samples of the parameters, uniform over their ranges before the measurement.

    Parameters
    ----------
    assembly : Assembly
    residual : Weighted
        Of all lines.
    best : (p,) array
        Fractions of the ranges at the best fit.
    information : (p, p) array
        Fisher information there.
    nuisance : (k, m) array
        What one standard deviation of each error of the model adds to the residuals.
    count : int
        Searches.
    seed : int

    Notes
    -----
    The posterior is a narrow, curved valley, which walkers of a Markov chain hardly move along. Each sample here is a
    search of its own, weighted by the ratio of the densities; the weights are those of all lines.
    """
    return _Drawing(assembly, residual, nuisance, np.random.default_rng([seed, 2])).run(best, information, count)


class _Drawing:
    """What one drawing of samples knows as it goes on."""

    def __init__(
        self, assembly: Assembly, residual: Weighted, nuisance: NDArray[np.float64], random: np.random.Generator
    ) -> None:
        self._assembly = assembly
        self._residual = residual
        self._exact = FrfMisfit(assembly, residual)
        self._nuisance = nuisance
        self._random = random

    def run(self, best: NDArray[np.float64], information: NDArray[np.float64], count: int) -> Samples:
        began = time.perf_counter()
        problem, known, mode, lines = self._region(np.clip(best, 0.01, 0.99), information)
        chart = Chart(problem, mode)
        z, log_weight = [], []
        for _ in range(-(-count // _BATCH)):
            target = self._random.standard_normal((_BATCH, len(mode)))
            found = chart.solve(target, _nearest(chart, target, known), _STEPS)
            reached = found.z[found.reached]
            known = np.concatenate([known, reached])
            z.append(reached)
            log_weight.append(self._log_posterior(reached) - found.log_density[found.reached])
        every, logs = np.concatenate(z), np.concatenate(log_weight)
        weight = np.exp(logs - logs.max())
        return Samples(
            problem.fraction(every), weight / weight.sum(), len(z) * _BATCH, lines, time.perf_counter() - began
        )

    def _log_posterior(self, z: NDArray[np.float64]) -> NDArray[np.float64]:
        exact = PriorAndData(self._exact, self._nuisance)
        residuals = exact.residuals(z)
        return np.asarray(-np.einsum("nm,nm->n", residuals, residuals) / 2.0)

    def _region(
        self, best: NDArray[np.float64], information: NDArray[np.float64]
    ) -> tuple[PriorAndData, NDArray[np.float64], NDArray[np.float64], int]:
        """Reduce the misfit to the posterior's region; return it, places there, the most probable one, its lines."""
        origin = self._exact.residuals(best[np.newaxis])[0]
        spread = np.linalg.cholesky(np.linalg.inv(information + 12.0 * np.eye(len(best))))
        cloud = best + 0.3 * self._random.standard_normal((_PILOTS, len(best))) @ spread.T
        snapshots = self._exact.residuals(np.clip(cloud, 1e-3, 1.0 - 1e-3))
        mode, known = best, np.empty((0, len(best) + len(self._nuisance)))
        for round_ in range(_MOST_ROUNDS):
            whole = np.concatenate([snapshots, origin + 3.0 * self._nuisance])
            reduced = ReducedMisfit(self._assembly, self._residual, whole, origin, _TOLERANCE)
            problem = PriorAndData(reduced, reduced.projected(self._nuisance))
            mode = _mode(problem, mode if round_ else problem.coordinates(best))
            known = np.concatenate([known, mode[np.newaxis]])
            chart = Chart(problem, mode)
            target = self._random.standard_normal((_PILOTS, len(mode)))
            pilots = chart.solve(target, _nearest(chart, target, known), _PILOT_STEPS)
            exact = self._exact.residuals(problem.fraction(pilots.z))
            error, near = self._errors(reduced, problem.fraction(pilots.z), exact)
            known = np.concatenate([known, pilots.z[near]])
            if round_ + 1 >= _FEWEST_ROUNDS and error[near].max(initial=0.0) < _EXACT:
                break
            snapshots = np.concatenate([snapshots, exact[near]])[-_MOST_SNAPSHOTS:]
        return problem, known, mode, len(reduced.lines)

    def _errors(
        self, reduced: ReducedMisfit, fraction: NDArray[np.float64], exact: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Return how far the reduced sums of squares are off, and which places belong to the region."""
        cost = np.einsum("nm,nm->n", exact, exact)
        inside = reduced.residuals(fraction)
        near = cost <= cost.min() + _FAR
        return np.abs(np.einsum("nk,nk->n", inside, inside) + reduced.outside - cost), near


def _nearest(chart: Chart, target: NDArray[np.float64], known: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return, for each target, the known place whose components are nearest."""
    components = chart.components(known)
    squares = np.einsum("kd,kd->k", components, components) - 2.0 * target @ components.T
    return np.asarray(known[np.argmin(squares, axis=1)])


class _InCube:
    """Residuals of prior and measurement by a place in the unit cube, for the search of their least sum."""

    def __init__(self, problem: PriorAndData) -> None:
        self._problem = problem

    def residuals(self, position: NDArray[np.float64]) -> NDArray[np.float64]:
        return self._problem.residuals(_out_of_cube(position))

    def linear(self, position: NDArray[np.float64]) -> Linear:
        residuals, slopes = self._problem.linear(_out_of_cube(position))
        slopes *= 2.0 * FURTHEST
        return Linear(residuals, slopes, np.einsum("npm,nm->np", slopes, residuals), slopes @ slopes.transpose(0, 2, 1))


def _out_of_cube(position: NDArray[np.float64]) -> NDArray[np.float64]:
    return (2.0 * position - 1.0) * FURTHEST


def _mode(problem: PriorAndData, start: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the most probable z."""
    position = (start[np.newaxis] / FURTHEST + 1.0) / 2.0
    found = minimise(_InCube(problem), position, tolerance=1e-3, most_steps=100)
    return _out_of_cube(found.position[0])
