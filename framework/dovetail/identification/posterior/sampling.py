"""Samples of the posterior: the region found, the misfit reduced to it, independent weighted samples drawn."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dovetail.assembly import Assembly
from dovetail.identification.fitting.least_squares import Linear, minimise
from dovetail.identification.fitting.misfit import FrfMisfit, SideBySide, Weighted
from dovetail.identification.posterior.coordinates import FURTHEST, PriorAndData, fraction_of, quantile_of
from dovetail.identification.posterior.optimised import Chart
from dovetail.identification.posterior.reduced import ReducedMisfit, squares_with_errors

__all__ = ["Samples", "draw"]

_PILOTS, _MOST_ROUNDS, _FEWEST_ROUNDS = 48, 14, 3
_PILOT_STEPS, _STEPS = 30, 200
_BATCH = 100
_EXACT = 0.05
"""Difference of chi-squared between the reduced misfit and all lines that is let pass."""
_FAR = 200.0
"""Chi-squared above the best beyond which a place is not in the region of interest."""
_CUT = 0.975
"""Quantile of the weights at which those above are cut."""
_MOST_DRAWN, _FEWEST_EFFECTIVE = 4, 0.25
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
    residual: Weighted | SideBySide[Weighted],
    best: NDArray[np.float64],
    information: NDArray[np.float64],
    errors: NDArray[np.float64],
    *,
    count: int,
    seed: int,
) -> Samples:
    """Draw samples of the parameters, uniform over their ranges before the measurement.

    Parameters
    ----------
    assembly : Assembly
    residual : Weighted or SideBySide
        Of all lines.
    best : (p,) array
        Fractions of the ranges at the best fit.
    information : (p, p) array
        Fisher information there.
    errors : (k, m) array
        What one standard deviation of each error of the model adds to the residuals.
    count : int
        Searches; four times as many where their weights differ so much that they tell as little as a quarter of them.
    seed : int

    Notes
    -----
    The posterior is a narrow, curved valley, which walkers of a Markov chain hardly move along. Each sample here is a
    search of its own, weighted by the ratio of the densities; the weights are those of all lines.
    """
    return _Drawing(assembly, residual, errors, np.random.default_rng([seed, 2])).run(best, information, count)


class _Drawing:
    """What one drawing of samples knows as it goes on."""

    def __init__(
        self,
        assembly: Assembly,
        residual: Weighted | SideBySide[Weighted],
        errors: NDArray[np.float64],
        random: np.random.Generator,
    ) -> None:
        self._assembly = assembly
        self._residual = residual
        self._exact = FrfMisfit(assembly, residual)
        self._errors = errors
        self._random = random

    def run(self, best: NDArray[np.float64], information: NDArray[np.float64], count: int) -> Samples:
        began = time.perf_counter()
        region = self._region(np.clip(best, 0.01, 0.99), information)
        chart, known = Chart(region.problem, region.mode), region.known
        z, log_weight = np.empty((0, len(best))), np.empty(0)
        drawn = 0
        while drawn < count or (drawn < _MOST_DRAWN * count and _effective(log_weight) < _FEWEST_EFFECTIVE * count):
            target = self._random.standard_normal((_BATCH, len(best)))
            found = chart.solve(target, _nearest(chart, target, known), _STEPS)
            reached = found.z[found.reached]
            log_density = found.log_density[found.reached]
            known, z = np.concatenate([known, reached]), np.concatenate([z, reached])
            log_weight = np.concatenate([log_weight, self._log_posterior(reached) - log_density])
            drawn += _BATCH
        weight = _weights(log_weight)
        return Samples(fraction_of(z), weight / weight.sum(), drawn, region.lines, time.perf_counter() - began)

    def _log_posterior(self, z: NDArray[np.float64]) -> NDArray[np.float64]:
        squares = squares_with_errors(self._exact.residuals(fraction_of(z)), self._errors)
        return np.asarray(-(squares + np.einsum("np,np->n", z, z)) / 2.0)

    def _region(self, best: NDArray[np.float64], information: NDArray[np.float64]) -> _Region:
        """Reduce the misfit to the region of the posterior, which pilot searches explore."""
        origin = self._exact.residuals(best[np.newaxis])[0]
        values, vectors = np.linalg.eigh(information + 12.0 * np.eye(len(best)))
        steps = self._random.standard_normal((_PILOTS, len(best))) / np.sqrt(np.maximum(values, 12.0)) @ vectors.T
        snapshots = self._exact.residuals(np.clip(best + 0.3 * steps, 1e-3, 1.0 - 1e-3))
        known = quantile_of(best)[np.newaxis]
        for round_ in range(_MOST_ROUNDS):
            reduced = ReducedMisfit(self._assembly, self._residual, snapshots, origin, self._errors, _TOLERANCE)
            problem = PriorAndData(reduced)
            mode = _mode(problem, known)
            known = np.concatenate([known, mode[np.newaxis]])
            chart = Chart(problem, mode)
            target = self._random.standard_normal((_PILOTS, len(mode)))
            pilots = chart.solve(target, _nearest(chart, target, known), _PILOT_STEPS)
            exact = self._exact.residuals(fraction_of(pilots.z))
            squares = squares_with_errors(exact, self._errors)
            inside = reduced.residuals(fraction_of(pilots.z))
            error = np.abs(np.einsum("nk,nk->n", inside, inside) + reduced.outside - squares)
            near = squares <= squares.min() + _FAR
            known = np.concatenate([known, pilots.z[near]])
            if round_ + 1 >= _FEWEST_ROUNDS and error[near].max(initial=0.0) < _EXACT:
                break
            snapshots = np.concatenate([snapshots, exact[near]])[-_MOST_SNAPSHOTS:]
        return _Region(problem, known, mode, len(reduced.lines))


@dataclass(frozen=True, eq=False)
class _Region:
    """The misfit reduced to where the posterior is, places there, and the most probable one."""

    problem: PriorAndData
    known: NDArray[np.float64]
    mode: NDArray[np.float64]
    lines: int


def _weights(log_weight: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return weights, the largest of them cut: where the posterior folds over, single samples would rule all others."""
    return np.exp(np.minimum(log_weight - np.quantile(log_weight, _CUT), 0.0))


def _effective(log_weight: NDArray[np.float64]) -> float:
    if not len(log_weight):
        return 0.0
    weight = _weights(log_weight)
    return float(weight.sum() ** 2 / np.sum(weight**2))


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


def _mode(problem: PriorAndData, known: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the most probable z, from the best of the known places."""
    residuals = problem.residuals(known)
    start = known[np.argmin(np.einsum("nm,nm->n", residuals, residuals))]
    position = (start[np.newaxis] / FURTHEST + 1.0) / 2.0
    found = minimise(_InCube(problem), position, tolerance=1e-3, most_steps=100)
    return _out_of_cube(found.position[0])
