"""Leave one test out: how well each test of a series is predicted from all others."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from dovetail.assembly.summary import natural_frequencies
from dovetail.errors import Fault, ParameterError
from dovetail.inference.posterior import LEVEL, with_model_error
from dovetail.inference.posterior.evidence import Evidence
from dovetail.inference.posterior.verdicts import ends_of
from dovetail.interfaces import Progress, progress_reporter
from dovetail.parallel import one_blas_thread
from dovetail.series.description import SeriesDescription
from dovetail.series.fitted_tests import FittedTest
from dovetail.series.fitting import fit_series
from dovetail.series.prediction import allowed_error, drawn_fractions
from dovetail.series.result import SeriesIdentification
from dovetail.series.sampling import sample_series
from dovetail.series.unknowns import SeriesUnknowns

_DRAWS = 400
"""Samples of the posterior from which a band is computed."""


@dataclass(frozen=True)
class LeftOutTest:
    """How well a test is predicted from all others.

    Parameters
    ----------
    test : str
    extrapolated : bool
        Whether a covariate of a law lies outside the other tests.
    coverage : float
        Share of the measured lines whose amplitude is within the 90 % band of the prediction, random errors included.
    frequency_error : float
        Largest relative difference of a natural frequency from the fit to this test alone.
    evidence : Evidence or None
        Log predictive density of the whole test, the ratio of marginal likelihoods with and without it, and its
        standard error; None if one of these is not known.
    """

    test: str
    extrapolated: bool
    coverage: float
    frequency_error: float
    evidence: Evidence | None

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        density, error = (None, None) if self.evidence is None else (self.evidence.log, self.evidence.error)
        return {
            "extrapolated": self.extrapolated,
            "lines_within_the_band": self.coverage,
            "largest_error_of_a_natural_frequency": self.frequency_error,
            "log_predictive_density": density,
            "log_predictive_density_error": error,
        }


def leave_one_out(
    result: SeriesIdentification,
    *,
    samples: int = 400,
    seed: int | None = None,
    progress: Progress | bool | None = None,
) -> tuple[LeftOutTest, ...]:
    """Predict each test of a series from all others.

    Parameters
    ----------
    result : SeriesIdentification
        Of the whole series, by the method "posterior".
    samples : int
        Number of searches for the posterior without each test.
    seed : int, optional
        That of the description by default.
    progress : bool or callable, optional
        As in `identify_series`.

    Raises
    ------
    ParameterError
        The result has no posterior, or a single test.
    """
    if result.posterior is None or len(result.tests) < 2:
        problem = "the result has no posterior." if result.posterior is None else "the series has a single test."
        raise ParameterError(Fault("leave_one_out", problem, "two or more tests, by the method 'posterior'"))
    seed = result.series.seed if seed is None else seed
    left_out = []
    with one_blas_thread(), progress_reporter(progress) as report:
        for index, fitted in enumerate(result.tests):
            report("left out", index, len(result.tests))
            series = result.series.without(fitted.test.name)
            others = [one for one in result.tests if one is not fitted]
            left_out.append(_predicted(result, fitted, _identified(series, others, samples, seed), seed))
        report("left out", len(result.tests), len(result.tests))
    return tuple(left_out)


def _identified(
    series: SeriesDescription, tests: Sequence[FittedTest], samples: int, seed: int
) -> SeriesIdentification:
    unknowns = SeriesUnknowns(series)
    fit = fit_series(unknowns, tests)
    return SeriesIdentification(
        series, tuple(tests), unknowns, fit, sample_series(unknowns, tests, fit, samples=samples, seed=seed)
    )


def _predicted(whole: SeriesIdentification, fitted: FittedTest, others: SeriesIdentification, seed: int) -> LeftOutTest:
    assert whole.posterior is not None
    assert others.posterior is not None
    problem, test = fitted.problem, fitted.test
    random = np.random.default_rng([seed, 32])
    fractions = drawn_fractions(others, test, _DRAWS, random)
    middle = problem.from_unit(np.median(fractions, axis=0))
    pairs = zip(problem.measured, problem.observations.split(problem.frf_at(middle)), strict=True)
    centre = [replace(frf, values=values) for frf, values in pairs]
    values = with_model_error(problem.frf(problem.from_unit(fractions)), centre, allowed_error(others), random)
    noise = random.standard_normal((*values.shape, 2)) @ [1.0, 1.0j] * np.sqrt(fitted.judged.fit.variance / 2.0)
    low, high = np.quantile(np.abs(values + noise), ends_of(LEVEL), axis=0)
    used, amplitude = fitted.judged.fit.used, np.abs(problem.values)
    inside = (low <= amplitude) & (amplitude <= high)
    before, after = others.posterior.evidence, whole.posterior.evidence
    evidence = None
    if before is not None and after is not None:
        evidence = Evidence(after.log - before.log, float(np.hypot(before.error, after.error)))
    over = {role.over for role in whole.series.roles.values() if role.over}
    outside = any(not (ends := others.series.ends(n))[0] <= test.covariates[n] <= ends[1] for n in over)
    error = _frequency_error(fitted, middle)
    return LeftOutTest(test.name, outside, float(np.mean(inside[used])), error, evidence)


def _frequency_error(fitted: FittedTest, predicted: np.ndarray) -> float:
    """Return the largest relative difference of the natural frequencies of two parameter vectors."""
    assembly = fitted.test.assembly
    both = [np.array(natural_frequencies(assembly, theta)[0]) for theta in (fitted.judged.fit.theta, predicted)]
    count = min(map(len, both))
    return float(np.max(np.abs(both[1][:count] / both[0][:count] - 1.0), initial=0.0))
