"""The next test of a series: by how much each candidate would narrow the intervals, before it is made."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.design.truncated_gaussian import remaining_uncertainty
from dovetail.errors import Fault, ParameterError
from dovetail.frf import Frf
from dovetail.inference.fitting import fit_at
from dovetail.inference.posterior.likelihood import normal_density, unit_from_normal
from dovetail.inference.posterior.mode_search import likelihood_at_mode
from dovetail.interfaces import Progress, progress_reporter
from dovetail.measurement import noisy_frf
from dovetail.problem import Problem
from dovetail.problem.least_squares import SumOfSquares
from dovetail.series.description import SeriesTest
from dovetail.series.prediction import allowed_error
from dovetail.series.result import SeriesIdentification
from dovetail.series.unknowns import TestMap

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class PlannedTest:
    """A test that might be made next.

    Parameters
    ----------
    name : str
    narrowing : mapping of str to float
        Of each unknown of the series: expected width of its interval with this test, of that without it.
    remaining : mapping of str to float
        Its expected standard deviation with this test, in fractions of its range.
    """

    name: str
    narrowing: dict[str, float]
    remaining: dict[str, float]

    @property
    def mean_narrowing(self) -> float:
        """Geometric mean of the narrowing of all unknowns."""
        return float(np.exp(np.mean(np.log(np.maximum([*self.narrowing.values()], 1e-12)))))


@dataclass(frozen=True, eq=False)
class SeriesPlan:
    """Tests that might be made next, the most informative first.

    Parameters
    ----------
    name : str
        Of the series.
    known : mapping of str to float
        Of each unknown of the series: expected standard deviation now, in fractions of its range.
    tests : tuple of PlannedTest
    noise : float
        Standard deviation of the random error over that of each FRF.
    """

    name: str
    known: dict[str, float]
    tests: tuple[PlannedTest, ...]
    noise: float

    def to_dict(self) -> dict[str, Any]:
        """Return the plan as plain values for JSON."""
        tests = [
            {
                "name": one.name,
                "mean_narrowing": one.mean_narrowing,
                "narrowing": one.narrowing,
                "remaining": one.remaining,
            }
            for one in self.tests
        ]
        return {"name": self.name, "noise": self.noise, "known": self.known, "tests": tests}


def plan_next_test(
    result: SeriesIdentification,
    *,
    noise: float | None = None,
    samples: int = 40,
    seed: int = 0,
    progress: Progress | bool | None = None,
) -> SeriesPlan:
    """Rank the candidates of a series by how much they would narrow the intervals of its unknowns.

    Parameters
    ----------
    result : SeriesIdentification
        By the method "posterior", of a series that describes candidates. Without candidates, each of its tests is one
        that might be made again.
    noise : float, optional
        Standard deviation of the random error of the next test over that of its FRF; by default that of the first test.
    samples : int
        Samples of the posterior, each taken for the truth.
    seed : int
    progress : bool or callable, optional
        As in `identify`.

    Returns
    -------
    SeriesPlan

    Raises
    ------
    ParameterError
        The result has no posterior, no unknown is common to the tests, or an option is out of its range.

    Notes
    -----
    All tests are linearised at each sample, with the random and the model errors of the identification; a new test is
    allowed the largest of these. Unknowns of a test alone are integrated out. The prior ends at the ends of the ranges
    (`remaining_uncertainty`).
    """
    _check(result, noise, samples)
    posterior, unknowns = result.posterior, result.unknowns
    assert posterior is not None
    random = np.random.default_rng([seed, 41])
    z = posterior.z[random.choice(len(posterior.z), samples, p=posterior.weight)]
    shared = z[:, : len(unknowns.shared)]
    noise = _noise(result) if noise is None else noise
    before = _tests_information(result, z)
    candidates, information = result.series.candidates or result.series.tests, [before]
    with progress_reporter(progress) as report:
        for number, candidate in enumerate(candidates):
            report("candidates", number, len(candidates))
            information.append(before + _candidate_information(result, candidate, shared, noise, random))
        report("candidates", len(candidates), len(candidates))
    by_fraction = np.array(information) / _outer(normal_density(shared))
    remaining = remaining_uncertainty(by_fraction, unit_from_normal(shared), seed).deviation
    names = [unknown.definition.name for unknown in unknowns.shared]
    known, *expected = (dict(zip(names, row, strict=True)) for row in remaining.tolist())
    tests = [
        PlannedTest(candidate.name, {name: min(one[name] / known[name], 1.0) for name in names}, one)
        for candidate, one in zip(candidates, expected, strict=True)
    ]
    return SeriesPlan(result.series.name, known, tuple(sorted(tests, key=lambda one: one.mean_narrowing)), noise)


def _check(result: SeriesIdentification, noise: float | None, samples: int) -> None:
    if result.posterior is None:
        raise ParameterError(Fault("result", "it has no posterior.", remedy="Identify by the method 'posterior'."))
    if not result.unknowns.shared:
        problem = "every parameter is 'free': another test says nothing about the values of these."
        remedy = "Give parameters that the tests have in common the role 'shared', 'varying' or a law."
        raise ParameterError(Fault("parameters", problem, remedy=remedy))
    if noise is not None and not noise > 0.0:
        raise ParameterError(Fault("noise", f"a noise of {noise:g} is not positive.", "more than 0"))
    if samples < 1:
        raise ParameterError(Fault("samples", f"{samples} are too few to average over.", "1 or more"))


def _noise(result: SeriesIdentification) -> float:
    """Return the random error of the first test over the standard deviation of its FRF."""
    test = result.tests[0]
    frf = test.problem.measured[0]
    variance = test.judged.fit.variance[: len(frf.frequency)]
    return float(np.sqrt(np.mean(variance)) / np.std(frf.values))


def _tests_information(result: SeriesIdentification, z: Array) -> Array:
    """Return the information (n, g, g) of the tests of the series about the shared unknowns, at all unknowns (n, d)."""
    unknowns = result.unknowns
    pairs = zip(result.tests, unknowns.maps, strict=True)
    each = [
        _information(test.likelihood().marginalised, test_map, unknowns.for_test(number, z))
        for number, (test, test_map) in enumerate(pairs)
    ]
    return np.asarray(np.sum(each, axis=0))


def _candidate_information(
    result: SeriesIdentification, candidate: SeriesTest, shared: Array, noise: float, random: np.random.Generator
) -> Array:
    """Return the information (n, g, g) of a test that has not been made, about the shared unknowns z (n, g)."""
    test_map, own = result.unknowns.elsewhere(candidate, candidate.covariates)
    z = np.concatenate([shared, random.standard_normal((len(shared), len(own)))], axis=1)
    middle = np.median(test_map.fractions(z), axis=0)
    theta = candidate.assembly.from_unit(middle)
    measured = [_measured(one.simulate(theta), noise, random) for one in candidate.assembly.each_response]
    problem = Problem.of(candidate.assembly, measured)
    likelihood, _ = likelihood_at_mode(problem, fit_at(problem, middle), allowed_error(result))
    return _information(likelihood.marginalised, test_map, z)


def _measured(exact: Frf, noise: float, random: np.random.Generator) -> Frf:
    """Return an FRF with a random error of a known size."""
    variance = np.full(len(exact.frequency), (noise * np.std(exact.values)) ** 2)
    return replace(noisy_frf(exact, noise, random), variance=variance)


def _information(misfit: SumOfSquares, test_map: TestMap, z: Array) -> Array:
    """Return the information (n, g, g) of a test about the shared unknowns, its own integrated out."""
    fractions, slopes = test_map.linearise(z)
    jacobian = np.swapaxes(slopes, 1, 2) @ misfit.linearise(fractions).jacobian
    information, shared = jacobian @ np.swapaxes(jacobian, 1, 2), test_map.shared
    if not test_map.own:
        return np.asarray(information)
    coupling, own = information[:, :shared, shared:], information[:, shared:, shared:] + np.eye(test_map.own)
    return np.asarray(information[:, :shared, :shared] - coupling @ np.linalg.solve(own, np.swapaxes(coupling, 1, 2)))


def _outer(slopes: Array) -> Array:
    return np.asarray(slopes[:, :, np.newaxis] * slopes[:, np.newaxis, :])
