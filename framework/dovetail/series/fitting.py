"""The fit of a series: one least-squares problem of all tests, in the form of an arrow."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from dovetail.inference.posterior.likelihood import Z_LIMIT, normal_from_unit, squared_norms, unit_from_normal
from dovetail.inference.posterior.randomize_then_optimize import LinearisedPoints
from dovetail.interfaces import Progress, silent
from dovetail.series.arrow import ArrowMatrix
from dovetail.series.fitted_tests import FittedTest
from dovetail.series.residuals import QuadraticMisfit, SeriesResiduals
from dovetail.series.unknowns import SeriesUnknowns

Array = NDArray[np.float64]


CONTRADICTION = 1e-3
"""Probability of a rise of the sum of squares above that of the fits to each test alone, if the relations between the
tests are right, below which they contradict each other, or the search has not ended in the best minimum."""


@dataclass(frozen=True)
class Settings:
    """Constants of the search."""

    damping: float = 1e-3
    """First damping, relative to the diagonal of the normal matrix."""
    factors: tuple[float, float] = (1 / 5, 4.0)
    """Change of the damping after a step that lowers the sum of squares, and after one that does not."""
    least_damping: float = 1e-8
    most_damping: float = 1e8
    """Damping below which it is not decreased, and at which a search is given up."""
    least_diagonal: float = 1e-6
    """Smallest damped diagonal; unknowns that no test depends on stay where they are."""
    longest_step: float = 1.0
    """Largest change of an unknown in one step, in standard deviations of its prior."""
    tolerance: float = 1e-3
    """Decrease of the sum of squares in one step that ends a search."""
    steps: int = 100
    """Most steps of a search."""
    margin: float = 1e-4
    """Distance of starts from the ends of the ranges."""
    scatter_rounds: int = 30
    """Largest number of updates of the standard deviations from test to test."""
    grid: int = 801
    """Deviations among which those are interpolated that keep the values of the tests."""
    settled: float = 1e-3
    """Relative change of a standard deviation at which the updates end."""
    mean_steps: int = 3
    """Gauss-Newton steps of means and laws between two updates."""
    longest_mean_step: float = 0.5
    """Largest change of an unknown in one of these steps, in standard deviations of its prior."""


_SETTINGS = Settings()
_LEAST_SLOPE = 1e-12
"""Of a value by its deviation, by which is divided."""


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
    deviations : int
        Number of deviations from means or laws among the unknowns. They are pulled towards zero, by which each raises
        the sum of squares by 1 at most if their standard deviation is right.
    """

    z: Array
    matrix: ArrowMatrix
    squares: Array
    squares_alone: Array
    constraints: int
    deviations: int = 0

    @property
    def contradiction(self) -> float:
        """Probability of so large a rise of the sum of squares if the relations between the tests are right."""
        rise = float(np.sum(self.squares) - np.sum(self.squares_alone))
        freedom = self.constraints if self.constraints > 0 else max(self.deviations, 1)
        return float(scipy.stats.chi2.sf(max(rise, 0.0), freedom))


def fit_series(unknowns: SeriesUnknowns, tests: Sequence[FittedTest], *, progress: Progress = silent) -> SeriesFit:
    """Fit all tests together.

    Values and numbers of laws have no prior within their ranges, as in the fit of a single test, unless it is normal;
    deviations from a mean or a law have theirs. Their standard deviation is the most likely one on its logarithmic
    scale, with deviations, means and laws marginalised (expectation-maximisation, with a normal approximation of the
    likelihood): for well-known values that of a regression, whose squares are divided by their number less that of the
    unknowns of mean or law.
    """
    residuals = SeriesResiduals(unknowns, [test.misfit() for test in tests])
    prior, scatter = _prior_weights(unknowns), unknowns.scatter_columns
    progress("fit", 0, 1)
    pairs = zip(residuals.misfits, tests, strict=True)
    alone = [float(np.sum(misfit.residuals(test.fraction[np.newaxis]) ** 2)) for misfit, test in pairs]
    starts = _starts(unknowns, tests)
    ends = minimise(residuals, starts, prior, scatter)
    constraints = sum(len(test.problem.parameters) for test in tests) - (unknowns.count - len(scatter))
    expected = scipy.stats.chi2.isf(CONTRADICTION, max(constraints, 1))
    if _cost(residuals, ends, prior).min() > sum(alone) + expected:  # perhaps a local minimum
        rough = SeriesResiduals(unknowns, [test.problem.logarithms(test.judged.fit.variance) for test in tests])
        further = minimise(residuals, minimise(rough, starts, prior, scatter).z, prior, scatter)
        ends = LinearisedPoints.joined([ends, further])
    points = ends.at_rows(np.argmin(_cost(residuals, ends, prior), keepdims=True))
    if scatter:
        points = _with_scatter(residuals, points, prior)
    matrix, _ = normal_equations(residuals, points, prior)
    squares = np.array([float(np.sum(part**2)) for part in residuals.split_by_test(points.residuals)])
    progress("fit", 1, 1)
    deviations = sum(len(unknowns.deviation_columns(column)) for column in scatter)
    return SeriesFit(points.z[0], matrix, squares, np.array(alone), constraints, deviations)


def minimise(
    residuals: SeriesResiduals,
    start: Array,
    prior: Array | float = 1.0,
    held: Sequence[int] = (),
) -> LinearisedPoints:
    """Return the points with the least sums of squares near starts (n, d), which advance together.

    Parameters
    ----------
    residuals : SeriesResiduals
    start : (n, d) array
    prior : (d,) array or float
        Weight of each unknown's square among the squares: 1 with its prior, 0 without.
    held : sequence of int
        Shared unknowns that keep their values.

    Notes
    -----
    This is the method of Levenberg and Marquardt with normal equations in the form of an arrow, whose cost is linear in
    the number of tests. `dovetail.problem.least_squares` decomposes dense ones.
    """
    points = residuals.linearise(start.copy())
    cost, damping = _cost(residuals, points, prior), np.full(len(start), _SETTINGS.damping)
    active = np.arange(len(start))
    for _ in range(_SETTINGS.steps):
        current = points.at_rows(active)
        matrix, gradient = normal_equations(residuals, current, prior, held)
        diagonal = np.maximum(matrix.diagonal(), _SETTINGS.least_diagonal)
        step = -matrix.plus(damping[active, np.newaxis] * diagonal).solve(gradient)
        longest = np.maximum(np.abs(step).max(axis=1, keepdims=True), np.finfo(float).tiny)
        step *= np.minimum(1.0, _SETTINGS.longest_step / longest)
        tried = residuals.linearise(np.clip(current.z + step, -Z_LIMIT, Z_LIMIT))
        decrease = cost[active] - _cost(residuals, tried, prior)
        better = np.nan_to_num(decrease, nan=-np.inf) > 0.0
        ended = better & (decrease < _SETTINGS.tolerance) & (damping[active] <= _SETTINGS.damping)
        rows = active[better]
        points.overwrite(rows, tried.at_rows(np.flatnonzero(better)))
        cost[rows] -= decrease[better]
        damping[active] = np.where(
            better, damping[active] * _SETTINGS.factors[0], damping[active] * _SETTINGS.factors[1]
        )
        damping[active] = np.maximum(damping[active], _SETTINGS.least_damping)
        active = active[~ended & (damping[active] < _SETTINGS.most_damping)]
        if not len(active):
            break
    return points


def normal_equations(
    residuals: SeriesResiduals, points: LinearisedPoints, prior: Array | float = 1.0, held: Sequence[int] = ()
) -> tuple[ArrowMatrix, Array]:
    """Return the Gauss-Newton matrices and gradients (n, d) of half the sums of squares, as for `minimise`."""
    jacobian = residuals.without_rows(points.jacobian, held)
    diagonal = np.broadcast_to(prior, points.z.shape).copy()
    gradient = residuals.gradient(jacobian, points.residuals, prior)
    diagonal[:, list(held)], gradient[:, list(held)] = 1.0, 0.0
    return residuals.products(jacobian, jacobian, diagonal), gradient


def _cost(residuals: SeriesResiduals, points: LinearisedPoints, prior: Array | float) -> Array:
    count = residuals.unknowns.count
    return np.asarray(squared_norms(points.residuals[:, count:]) + np.sum(prior * points.z**2, axis=1))


def _prior_weights(unknowns: SeriesUnknowns) -> Array:
    every = [*unknowns.shared, *(one for own in unknowns.own for one in own)]
    return np.array([float(one.kind == "deviation" or one.definition.prior == "normal") for one in every])


def _starts(unknowns: SeriesUnknowns, tests: Sequence[FittedTest]) -> Array:
    """Return starts (n, d) of the fit: where the fits to each test alone agree best, by their information."""
    misfits = [QuadraticMisfit.of(test.fraction, test.judged.fit.information) for test in tests]
    nearby = SeriesResiduals(unknowns, misfits)
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
        starts.append(minimise(nearby, start[np.newaxis]).z[0] if test is None else start)
    return np.array(starts if len(tests) > 1 else starts[1:])


def _quantile(fraction: float) -> float:
    clipped = np.clip(fraction, _SETTINGS.margin, 1.0 - _SETTINGS.margin)
    return float(normal_from_unit(np.array([clipped]))[0])


def _with_scatter(residuals: SeriesResiduals, points: LinearisedPoints, prior: Array) -> LinearisedPoints:
    """Return the fit with the most likely standard deviations from test to test."""
    unknowns = residuals.unknowns
    for _ in range(_SETTINGS.scatter_rounds):
        matrix, _ = normal_equations(residuals, points, prior, unknowns.scatter_columns)
        z, variances, changes = points.z.copy(), matrix.variances()[0], []
        for column in unknowns.scatter_columns:
            definition = unknowns.shared[column].definition
            before = float(definition.from_unit(unit_from_normal(z[0, [column]]))[0])
            own = unknowns.deviation_columns(column)
            factor = np.sqrt(np.mean(z[0, own] ** 2 + variances[own]))
            after = float(np.clip(before * factor, definition.lower, definition.upper))
            z[0, column] = _quantile(float(definition.to_unit(np.array(after))))
            changes.append(abs(after / before - 1.0))
        values = residuals.fractions(points.z)
        z = _with_likely_means(residuals, z, values, prior)
        points = minimise(residuals, z, prior, unknowns.scatter_columns)
        if max(changes) < _SETTINGS.settled:
            break
    return points


def _with_likely_means(residuals: SeriesResiduals, z: Array, fractions: Sequence[Array], prior: Array) -> Array:
    """Return unknowns (1, d) with the means or laws about which given values (1, p_k) of the tests scatter least.

    Where the values are well known, means and deviations can only change together, along a narrow valley in which a
    search for all unknowns hardly advances.
    """
    unknowns = residuals.unknowns
    z = _with_values(residuals, z, fractions)
    for _ in range(_SETTINGS.mean_steps):
        for column in unknowns.scatter_columns:
            parameter, deviations = unknowns.shared[column].parameter, unknowns.deviation_columns(column)
            means = [
                number
                for number, one in enumerate(unknowns.shared)
                if one.parameter == parameter and one.kind != "scatter"
            ]
            by_means = _deviations_by(residuals, z, parameter, means)
            pull = np.sqrt(prior[means])  # towards the middle of a normal prior
            stacked = np.concatenate([by_means, np.diag(pull)])
            step = np.linalg.lstsq(stacked, -np.append(z[0, deviations], pull * z[0, means]), rcond=None)[0]
            longest = _SETTINGS.longest_mean_step
            z[0, means] = np.clip(z[0, means] + np.clip(step, -longest, longest), -Z_LIMIT, Z_LIMIT)
        z = _with_values(residuals, z, fractions)
    return z


def _deviations_by(residuals: SeriesResiduals, z: Array, parameter: str, means: Sequence[int]) -> Array:
    """Return the derivatives (k, m) of a parameter's deviations in its k tests by the unknowns of its mean or law.

    The values of the tests are constant.
    """
    unknowns, rows = residuals.unknowns, []
    tests = zip(unknowns.series.tests, unknowns.maps, unknowns.own, strict=True)
    for number, (test, test_map, unshared) in enumerate(tests):
        deviating = [one.parameter if one.kind == "deviation" else "" for one in unshared]
        if parameter in deviating:
            place = [one.name for one in test.assembly.parameters].index(parameter)
            slopes = test_map.linearise(unknowns.for_test(number, z))[1][0, place]
            by_deviation = slopes[len(unknowns.shared) + deviating.index(parameter)]
            rows.append(-slopes[means] / max(by_deviation, _LEAST_SLOPE))
    return np.array(rows)


def _with_values(residuals: SeriesResiduals, z: Array, fractions: Sequence[Array]) -> Array:
    """Return unknowns (1, d) with the deviations at which each test has given values (1, p_k), as far as they can."""
    unknowns, changed = residuals.unknowns, z.copy()
    grid = np.repeat(z, _SETTINGS.grid, axis=0)
    for column in unknowns.scatter_columns:
        own = unknowns.deviation_columns(column)
        grid[:, own] = np.linspace(-Z_LIMIT, Z_LIMIT, _SETTINGS.grid)[:, np.newaxis]
    kept = zip(unknowns.series.tests, unknowns.columns, unknowns.own, residuals.fractions(grid), fractions, strict=True)
    for test, columns, unshared, possible, wanted in kept:
        names = [parameter.name for parameter in test.assembly.parameters]
        for column, unknown in zip(range(columns.start, columns.stop), unshared, strict=True):
            if unknown.kind == "deviation":
                place = names.index(unknown.parameter)
                changed[0, column] = np.interp(wanted[0, place], possible[:, place], grid[:, column])
    return changed
