"""Samples of the posterior: the region found, the misfit reduced to it, independent weighted samples drawn."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dovetail.assembly import Assembly
from dovetail.frf import Frf
from dovetail.identification.fitting import Fit
from dovetail.identification.fitting.residuals import FrfMisfit, SideBySide, Weighted
from dovetail.identification.posterior.likelihood import ReducedMisfit, check_options, likelihood, squares_with_errors
from dovetail.identification.posterior.mode_search import climb, search_modes
from dovetail.identification.posterior.model_error import MODEL_ERROR
from dovetail.identification.posterior.posterior import Posterior
from dovetail.identification.posterior.prior import PriorAndData, fraction_of
from dovetail.identification.posterior.randomize_then_optimize import KEPT, Charts, Places, move

__all__ = ["Samples", "draw", "sample_posterior"]

_PILOTS, _MOST_ROUNDS, _FEWEST_ROUNDS = 48, 14, 3
_PILOT_STEPS, _STEPS = 30, 200
_BATCH = 100
_EXACT = 0.05
"""Difference of chi-squared between the reduced misfit and all lines that is let pass."""
_FAR = 200.0
"""Chi-squared above the best beyond which a place is not in the region of interest."""
_EVEN, _RULED = 0.4, 0.1
"""Effective samples over searches: from which samples need not be moved, and below which single weights rule."""
_CUT = 0.975
"""Quantile of the weights at which those above are then cut; at a fold single ones are huge."""
_FORGOTTEN, _MOST_MOVES = 0.1, 10
"""Part of the components at the start that moved samples may have left."""
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
    reached : float
        Part of the searches that reached their target.
    lines : int
        Lines to which the misfit was reduced.
    seconds : float
    """

    fraction: NDArray[np.float64]
    weight: NDArray[np.float64]
    reached: float
    lines: int
    seconds: float


def draw(
    assembly: Assembly,
    residual: Weighted | SideBySide[Weighted],
    modes: NDArray[np.float64],
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
    modes : (n, p) array
        Peaks of the posterior, as normal quantiles of the fractions of the ranges, the most probable first.
    information : (p, p) array
        Fisher information of the fractions at the best fit.
    errors : (k, m) array
        What one standard deviation of each error of the model adds to the residuals.
    count : int
        Searches, each of which gives one sample.
    seed : int

    Notes
    -----
    The posterior is a narrow, curved valley, which walkers of a Markov chain hardly move along. Each sample here is a
    search of its own, weighted by the ratio of the densities; the weights are those of all lines. Where they are
    uneven, since the chart folds over, samples are drawn by their weights and moved, each in a chart of its own, until
    they have forgotten where they began.
    """
    return _Drawing(assembly, residual, errors, np.random.default_rng([seed, 2])).run(modes, information, count)


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

    def run(self, modes: NDArray[np.float64], information: NDArray[np.float64], count: int) -> Samples:
        began = time.perf_counter()
        region = self._region(modes, information)
        z, log_weight = self._searched(region, count)
        reached = len(z)
        if _effective(log_weight) < _EVEN * count:
            z, log_weight = self._moved(region, z, log_weight, count)
        weight = np.exp(log_weight - log_weight.max())
        seconds = time.perf_counter() - began
        return Samples(fraction_of(z), weight / weight.sum(), reached / count, len(region.lines), seconds)

    def _searched(self, region: _Region, count: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return where searches for components that are drawn ended, and the logarithms of their weights."""
        charts, known = Charts(region.problem, Places.at(region.problem, region.mode[np.newaxis])), region.known
        z, log_weight = np.empty((0, len(region.mode))), np.empty(0)
        for first in range(0, count, _BATCH):
            target = self._random.standard_normal((min(_BATCH, count - first), len(region.mode)))
            ends, reached = charts.solve(target, _nearest(region.problem, charts, target, known), _STEPS)
            ends = ends.at_rows(np.flatnonzero(reached))
            components = charts.components(ends.residuals)
            log_density = charts.log_stretch(ends) - np.einsum("nd,nd->n", components, components) / 2.0
            known, z = np.concatenate([known, ends.z]), np.concatenate([z, ends.z])
            log_weight = np.concatenate([log_weight, self._log_posterior(ends.z) - log_density])
        return z, log_weight

    def _moved(
        self, region: _Region, z: NDArray[np.float64], log_weight: NDArray[np.float64], count: int
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return samples drawn by their weights and moved, and the logarithms of the weights that are left."""
        if not len(z):
            z, log_weight = region.mode[np.newaxis], np.zeros(1)
        if _effective(log_weight) < _RULED * count:
            log_weight = np.minimum(log_weight, np.quantile(log_weight, _CUT))
        weight = np.exp(log_weight - log_weight.max())
        above = (np.arange(count) + self._random.random()) / count * weight.sum()
        chosen = np.minimum(np.searchsorted(np.cumsum(weight), above), len(z) - 1)
        places, left = Places.at(region.problem, z[chosen]), 1.0
        for _ in range(_MOST_MOVES):
            places, taken = move(region.problem, places, self._random)
            left *= 1.0 - (1.0 - KEPT) * taken
            if left < _FORGOTTEN:
                break
        return places.z, self._log_posterior(places.z) - places.log_posterior

    def _log_posterior(self, z: NDArray[np.float64]) -> NDArray[np.float64]:
        squares = squares_with_errors(self._exact.residuals(fraction_of(z)), self._errors)
        return np.asarray(-(squares + np.einsum("np,np->n", z, z)) / 2.0)

    def _region(self, modes: NDArray[np.float64], information: NDArray[np.float64]) -> _Region:
        """Reduce the misfit to the region of the posterior, which pilot searches explore."""
        log_posterior = self._log_posterior(modes)
        known = modes[log_posterior >= log_posterior.max() - _FAR / 2.0]
        best = fraction_of(known)
        origin = self._exact.residuals(best[:1])[0]
        values, vectors = np.linalg.eigh(information + 12.0 * np.eye(modes.shape[1]))
        steps = self._random.standard_normal((_PILOTS, len(values))) / np.sqrt(np.maximum(values, 12.0)) @ vectors.T
        around = best[np.arange(_PILOTS) % len(best)] + 0.3 * steps
        snapshots = self._exact.residuals(np.clip(np.concatenate([best, around]), 1e-3, 1.0 - 1e-3))
        for round_ in range(_MOST_ROUNDS):
            reduced = ReducedMisfit(self._assembly, self._residual, snapshots, origin, self._errors, _TOLERANCE)
            problem = PriorAndData(reduced)
            mode = _mode(problem, known)
            known = np.concatenate([known, mode[np.newaxis]])
            charts = Charts(problem, Places.at(problem, mode[np.newaxis]))
            target = self._random.standard_normal((_PILOTS, len(mode)))
            pilots, _ = charts.solve(target, _nearest(problem, charts, target, known), _PILOT_STEPS)
            exact = self._exact.residuals(fraction_of(pilots.z))
            squares = squares_with_errors(exact, self._errors)
            inside = reduced.residuals(fraction_of(pilots.z))
            error = np.abs(np.einsum("nk,nk->n", inside, inside) + reduced.outside - squares)
            near = squares <= squares.min() + _FAR
            known = np.concatenate([known, pilots.z[near]])
            if round_ + 1 >= _FEWEST_ROUNDS and error[near].max(initial=0.0) < _EXACT:
                break
            snapshots = np.concatenate([snapshots, exact[near]])[-_MOST_SNAPSHOTS:]
        return _Region(problem, known, mode, reduced.lines)


@dataclass(frozen=True, eq=False)
class _Region:
    """The misfit reduced to where the posterior is, places there, the most probable one, and the lines it takes."""

    problem: PriorAndData
    known: NDArray[np.float64]
    mode: NDArray[np.float64]
    lines: NDArray[np.intp]


def _effective(log_weight: NDArray[np.float64]) -> float:
    if not len(log_weight):
        return 0.0
    weight = np.exp(log_weight - log_weight.max())
    return float(weight.sum() ** 2 / np.sum(weight**2))


def _nearest(problem: PriorAndData, charts: Charts, target: NDArray[np.float64], known: NDArray[np.float64]) -> Places:
    """Return, for each target, the known place whose components are nearest."""
    components = charts.components(problem.residuals(known))
    squares = np.einsum("kd,kd->k", components, components) - 2.0 * target @ components.T
    return Places.at(problem, known[np.argmin(squares, axis=1)])


def _mode(problem: PriorAndData, known: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the most probable z, from the best of the known places."""
    residuals = problem.residuals(known)
    start = known[np.argmin(np.einsum("nm,nm->n", residuals, residuals))]
    return np.asarray(climb(problem, start[np.newaxis], tolerance=1e-3)[0][0])


def sample_posterior(
    assembly: Assembly,
    measured: Frf | Sequence[Frf],
    fit: Fit,
    *,
    samples: int = 400,
    model_error: float = MODEL_ERROR,
    seed: int = 0,
) -> Posterior:
    """Draw samples of the parameters given a measured FRF, or one for each response.

    Parameters
    ----------
    assembly : Assembly
        Its ranges are the prior: uniform on the parameters' scales.
    measured : Frf or sequence of Frf
        One for each response, on the assembly's frequencies.
    fit : Fit
        Of the same measurement. Its random error and the lines it left out are taken over, and so is the part of the
        FRF by which it found the model to be off: neighbouring lines are off alike, so many of them count as one.
    samples : int
        Searches, each of which gives one sample.
    model_error : float
        Standard deviation of the relative error of natural frequencies that the model is allowed, 0 for a model that
        is exact; errors of damping, magnitude and phase are in proportion (`model_errors`). It cannot be told from the
        measurement, since the parameters follow it.
    seed : int

    Returns
    -------
    Posterior

    Raises
    ------
    ParameterError
        An option is out of its range.
    """
    check_options(samples, model_error)
    given = likelihood(assembly, measured, fit, model_error)
    best, random = assembly.to_unit(fit.theta), np.random.default_rng([seed, 3])
    modes = search_modes(assembly, given.target, given.variance, given.residual, given.errors, best, random)
    drawn = draw(assembly, given.residual, modes, fit.information, given.errors, count=samples, seed=seed)
    return Posterior.of(
        assembly,
        drawn.fraction,
        drawn.weight,
        model_error=model_error,
        drawn=round(len(drawn.weight) / max(drawn.reached, 1.0 / samples)),
        lines=drawn.lines,
        seconds=drawn.seconds,
    )
