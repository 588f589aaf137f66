"""The fit of a series: one least-squares problem of all tests, in the form of an arrow."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from dovetail.inference.posterior.likelihood import Z_LIMIT, normal_from_unit, unit_from_normal
from dovetail.interfaces import Progress, silent
from dovetail.series.arrow import ArrowMatrix
from dovetail.series.fitted_tests import FittedTest
from dovetail.series.residuals import QuadraticMisfit, SeriesResiduals
from dovetail.series.unknowns import SeriesUnknowns

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Settings:
    """Constants of the search."""

    damping: float = 1e-3
    """First damping, relative to the diagonal of the normal matrix."""
    factors: tuple[float, float] = (1 / 5, 4.0)
    """Change of the damping after a step that lowers the sum of squares, and after one that does not."""
    least_diagonal: float = 1e-6
    """Smallest damped diagonal; unknowns that no test depends on stay where they are."""
    longest_step: float = 1.0
    """Largest change of an unknown in one step, in standard deviations of its prior."""
    tolerance: float = 1e-3
    """Decrease of the sum of squares in one step that ends a search."""
    steps: int = 100
    margin: float = 1e-4
    """Distance of starts from the ends of the ranges."""
    scatter_rounds: int = 30
    """Largest number of updates of the standard deviations from test to test."""
    settled: float = 1e-3
    """Relative change of a standard deviation at which the updates end."""


_SETTINGS = Settings()


@dataclass(frozen=True, eq=False)
class SeriesFit:
    """The unknowns of a series at the best fit.

    Parameters
    ----------
    z : (d,) array
        Normal quantiles of the unknowns' priors.
    matrix : ArrowMatrix
        Gauss-Newton matrix there.
    squares : (n_tests,) array
        Sums of the squared residuals of each test.
    squares_alone : (n_tests,) array
        The same at the fits to each test alone.
    constraints : int
        By how many numbers the fits to each test alone are more flexible.
    """

    z: Array
    matrix: ArrowMatrix
    squares: Array
    squares_alone: Array
    constraints: int

    @property
    def contradiction(self) -> float:
        """Probability of so large a rise of the sum of squares if the relations between the tests are right."""
        if self.constraints <= 0:
            return 1.0
        rise = float(np.sum(self.squares) - np.sum(self.squares_alone))
        return float(scipy.stats.chi2.sf(max(rise, 0.0), self.constraints))


def fit_series(unknowns: SeriesUnknowns, tests: Sequence[FittedTest], *, progress: Progress = silent) -> SeriesFit:
    """Fit all tests together.

    Values and numbers of laws have no prior within their ranges, as in the fit of a single test, unless it is normal;
    deviations from a mean or a law have theirs. Their standard deviation is the most likely one, the deviations
    marginalised (expectation-maximisation, with a normal approximation of the likelihood).
    """
    residuals = SeriesResiduals(unknowns, [test.misfit() for test in tests])
    prior, frozen = _prior_weights(unknowns), _is_scatter(unknowns)
    best, cost = None, np.inf
    starts = _starts(unknowns, tests)
    for number, start in enumerate(starts):
        progress("fit", number, len(starts))
        z, _ = minimise(residuals, start, prior, frozen)
        reached = _squares(residuals, z, prior)
        if reached < cost - _SETTINGS.tolerance:
            best, cost = z, reached
    assert best is not None
    if frozen.any():
        best = _with_scatter(residuals, best, prior, frozen)
    points = residuals.linearise(best[np.newaxis])
    matrix, _ = residuals.normal_equations(points, prior)
    pairs = zip(residuals.misfits, tests, strict=True)
    alone = [float(np.sum(misfit.residuals(test.fraction[np.newaxis]) ** 2)) for misfit, test in pairs]
    used = sum(len(test.problem.parameters) for test in tests)
    free = unknowns.count - int(np.count_nonzero(frozen))
    squares = np.array([float(np.sum(part**2)) for part in points.residuals])
    progress("fit", len(starts), len(starts))
    return SeriesFit(best, matrix, squares, np.array(alone), used - free)


def minimise(
    residuals: SeriesResiduals, start: Array, prior: Array, frozen: NDArray[np.bool_] | None = None
) -> tuple[Array, ArrowMatrix]:
    """Return the unknowns (d,) with the least sum of squares near a start, and the Gauss-Newton matrix there.

    Parameters
    ----------
    residuals : SeriesResiduals
    start : (d,) array
    prior : (d,) array
        As in `SeriesResiduals.normal_equations`.
    frozen : (d,) bool array, optional
        Unknowns that keep their values.
    """
    z, damping = start.copy(), _SETTINGS.damping
    held = np.zeros(len(z)) if frozen is None else np.where(frozen, 1e12, 0.0)
    points = residuals.linearise(z[np.newaxis])
    cost = _cost(points.squares[0], z, prior)
    matrix, gradient = residuals.normal_equations(points, prior)
    for _ in range(_SETTINGS.steps):
        diagonal = np.maximum(matrix.diagonal(), _SETTINGS.least_diagonal)
        step = -matrix.plus(damping * diagonal + held).solve(gradient)[0]
        step *= min(1.0, _SETTINGS.longest_step / max(float(np.abs(step).max()), 1e-300))
        tried = np.clip(z + step, -Z_LIMIT, Z_LIMIT)
        there = residuals.linearise(tried[np.newaxis])
        new = _cost(there.squares[0], tried, prior)
        if np.isfinite(new) and new < cost:
            done = cost - new < _SETTINGS.tolerance and damping <= _SETTINGS.damping
            z, cost, damping = tried, new, damping * _SETTINGS.factors[0]
            matrix, gradient = residuals.normal_equations(there, prior)
            if done:
                break
        else:
            damping = max(damping, 1e-8) * _SETTINGS.factors[1]
            if damping > 1e8:
                break
    return z, matrix


def _cost(squares: float, z: Array, prior: Array) -> float:
    return float(squares + np.sum(prior * z**2))


def _squares(residuals: SeriesResiduals, z: Array, prior: Array) -> float:
    return _cost(sum(float(np.sum(part**2)) for part in residuals.residuals(z[np.newaxis])), z, prior)


def _prior_weights(unknowns: SeriesUnknowns) -> Array:
    every = [*unknowns.shared, *(one for own in unknowns.own for one in own)]
    return np.array([float(one.kind == "deviation" or one.definition.prior == "normal") for one in every])


def _is_scatter(unknowns: SeriesUnknowns) -> NDArray[np.bool_]:
    own = unknowns.count - len(unknowns.shared)
    return np.array([one.kind == "scatter" for one in unknowns.shared] + [False] * own, dtype=np.bool_)


def _starts(unknowns: SeriesUnknowns, tests: Sequence[FittedTest]) -> list[Array]:
    """Return starts of the fit: where the fits to each test alone agree best, by their information."""
    misfits = [QuadraticMisfit.of(test.fraction, test.judged.fit.information) for test in tests]
    nearby = SeriesResiduals(unknowns, misfits)
    prior = np.ones(unknowns.count)
    starts = []
    for test in (None, *tests[:3]):
        start = np.zeros(unknowns.count)
        for index, one in enumerate(tests):
            source = one if test is None else test
            values = dict(zip((p.name for p in source.problem.parameters), source.fraction, strict=True))
            own = {p.name: f for p, f in zip(one.problem.parameters, one.fraction, strict=True)}
            columns = range(*unknowns.columns[index].indices(unknowns.count))
            for column, unknown in zip(columns, unknowns.own[index], strict=True):
                if unknown.kind == "value":
                    start[column] = _quantile(own[unknown.parameter])
            for column, unknown in enumerate(unknowns.shared):
                if unknown.kind == "value" and unknown.parameter in values:
                    start[column] = _quantile(values[unknown.parameter])
        starts.append(minimise(nearby, start, prior)[0] if test is None else start)
    return starts if len(tests) > 1 else starts[1:]


def _quantile(fraction: float) -> float:
    clipped = np.clip(fraction, _SETTINGS.margin, 1.0 - _SETTINGS.margin)
    return float(normal_from_unit(np.array([clipped]))[0])


def _with_scatter(residuals: SeriesResiduals, z: Array, prior: Array, frozen: NDArray[np.bool_]) -> Array:
    """Return the fit with the most likely standard deviations from test to test."""
    unknowns = residuals.unknowns
    columns = np.flatnonzero(frozen).tolist()
    for _ in range(_SETTINGS.scatter_rounds):
        points = residuals.linearise(z[np.newaxis])
        matrix, _ = residuals.normal_equations(points, prior)
        changes = []
        for column in columns:
            unknown = unknowns.shared[column]
            second = []
            for index, own in enumerate(unknowns.own):
                covariance = matrix.own_covariance(index)[0]
                for place, one in enumerate(own):
                    if one.kind == "deviation" and one.parameter == unknown.parameter:
                        at = unknowns.columns[index].start + place
                        row = len(unknowns.shared) + place
                        second.append(z[at] ** 2 + covariance[row, row])
            factor = float(np.sqrt(np.mean(second)))
            before = float(unknown.definition.from_unit(unit_from_normal(z[[column]]))[0])
            after = float(np.clip(before * factor, unknown.definition.lower, unknown.definition.upper))
            z[column] = _quantile(float(unknown.definition.to_unit(np.array(after))))
            changes.append(abs(after / before - 1.0))
        z, _ = minimise(residuals, z, prior, frozen)
        if max(changes) < _SETTINGS.settled:
            break
    return z
