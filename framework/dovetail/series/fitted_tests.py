"""The tests of a series, each read, fitted and judged by itself, as a single identification does."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations, product

import numpy as np
from numpy.typing import NDArray

from dovetail.errors import Fault, MeasurementError
from dovetail.frf import Frf
from dovetail.identification.measured_lines import MeasuredLines, batch_contradictions
from dovetail.identification.one_measurement import lines_to_fit
from dovetail.inference.adequacy.judgement import JudgedFit, JudgementOptions, judge
from dovetail.inference.fitting import refine
from dovetail.inference.posterior.likelihood import Likelihood
from dovetail.inference.posterior.mode_search import likelihood_at_mode
from dovetail.interfaces import Progress, silent
from dovetail.problem import Problem
from dovetail.problem.least_squares import SumOfSquares
from dovetail.series.description import SeriesDescription, SeriesTest
from dovetail.series.measured_files import read_test

_ROUNDING = 1e-5
"""Relative difference of equal values in files of six digits."""


@dataclass(frozen=True, eq=False)
class FittedTest:
    """A test with its measurement, and the fit to it alone.

    Parameters
    ----------
    test : SeriesTest
    lines : MeasuredLines
    judged : JudgedFit
    """

    test: SeriesTest
    lines: MeasuredLines
    judged: JudgedFit

    @property
    def problem(self) -> Problem:
        """The problem of this test alone."""
        return self.lines.problem

    @property
    def fraction(self) -> NDArray[np.float64]:
        """(p,) fractions of the ranges at the fit."""
        return np.clip(self.problem.to_unit(self.judged.fit.theta), 0.0, 1.0)

    @property
    def is_noise(self) -> bool:
        """Whether the model explains the measurement down to its random error."""
        return self.judged.adequacy.word in ("to the noise", "not judged")

    def likelihood(self) -> Likelihood:
        """Return the likelihood with the random error and the model error of this test's own identification."""
        fit = self.judged.fit.allowing_for_unknown_noise(self.problem.observations)
        return likelihood_at_mode(self.problem, fit, self.judged.adequacy.error_in_intervals)[0]

    def misfit(self) -> SumOfSquares:
        """Return the residuals that a fit of the series makes small, as functions of the fractions."""
        if self.is_noise:
            fit = self.judged.fit
            return self.problem.weighted(fit.variance, fit.used)
        return self.likelihood().marginalised


def fit_tests(
    series: SeriesDescription,
    *,
    model_error: float | None = None,
    seed: int | None = None,
    progress: Progress = silent,
) -> tuple[FittedTest, ...]:
    """Read the measurements of a series, and fit and judge each test by itself.

    Parameters
    ----------
    series : SeriesDescription
    model_error : float, optional
        As in `fit_test`.
    seed : int, optional
    progress : Progress

    Raises
    ------
    MeasurementError
        A file cannot be read, does not fit its test, or was measured at other points than those of other tests of the
        same parts.
    """
    fitted = []
    measured = [read_test(test.name, test.measured, test.covariates, series.covariates) for test in series.tests]
    _check_own_values(series.tests, measured)
    _check_same_points(series.tests, measured)
    for number, (test, frfs) in enumerate(zip(series.tests, measured, strict=True)):
        progress("tests", number, len(series.tests))
        fitted.append(fit_test(test, frfs, series.seed if seed is None else seed, model_error))
    progress("tests", len(series.tests), len(series.tests))
    return tuple(fitted)


def _check_own_values(tests: Sequence[SeriesTest], measured: Sequence[Sequence[Frf]]) -> None:
    """Raise a MeasurementError if two tests have the same values, as those of a copied or converted file.

    Raises
    ------
    MeasurementError
    """
    for (first, frfs), (second, others) in combinations(zip(tests, measured, strict=True), 2):
        for frf, other in product(frfs, others):
            if _are_same(frf, other):
                problem = f"the test '{second.name}' has the same values as '{first.name}' ({frf.label})."
                remedy = "Give each test its own: a measurement that is used twice makes the intervals too narrow."
                raise MeasurementError(Fault(other.label, problem, remedy=remedy))


def _kind(frf: Frf) -> tuple[bool, bool | None, bool]:
    return frf.rotation, frf.by_moment, frf.has_phase


def _are_same(first: Frf, second: Frf) -> bool:
    """Return whether two FRFs are the same but for their unit, quantity and rounding."""
    if first.frequency.shape != second.frequency.shape or _kind(first) != _kind(second):
        return False
    values, others = (frf.to("receptance").values for frf in (first, second))
    same_axis = np.allclose(first.frequency, second.frequency, rtol=_ROUNDING, atol=0.0)
    return same_axis and bool(np.all(np.abs(values - others) <= _ROUNDING * np.abs(values)))


def _check_same_points(tests: Sequence[SeriesTest], measured: Sequence[Sequence[Frf]]) -> None:
    """Raise a MeasurementError if tests of the same parts, with the same nodes and responses, have other DOFs."""
    groups: dict[object, list[int]] = {}
    for number, test in enumerate(tests):
        description = test.assembly.description
        nodes = tuple((name, part.nodes) for name, part in description.substructures.items())
        groups.setdefault((nodes, description.responses), []).append(number)
    for numbers in groups.values():
        description = tests[numbers[0]].assembly.description
        if faults := batch_contradictions(description, [measured[number] for number in numbers]):
            raise MeasurementError(*faults.values())


def fit_test(test: SeriesTest, frfs: Sequence[Frf], seed: int, model_error: float | None = None) -> FittedTest:
    """Fit and judge one test with its measured FRFs, one for each response.

    Parameters
    ----------
    test : SeriesTest
    frfs : sequence of Frf
    seed : int
    model_error : float, optional
        Relative error of natural frequencies that the model is allowed; by default the one that the test shows.
    """
    lines = lines_to_fit(test.assembly, tuple(frfs), None, silent, phase=True).merged(seed, silent)
    fit = refine(lines.problem, [] if lines.start is None else [lines.start], seed=seed)
    options = JudgementOptions(model_error=model_error, cause_seconds=0.0)
    return FittedTest(test, lines, judge(lines.problem, fit, options, seed=seed))
