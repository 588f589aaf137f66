"""The result of identifying a series: unknowns of the series, parameters of each test, and how well they agree."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.errors import listing
from dovetail.inference.posterior import LEVEL, NOT_TRUSTWORTHY, Posterior
from dovetail.inference.posterior.likelihood import normal_density, unit_from_normal
from dovetail.inference.posterior.verdicts import ends_of, quantiles
from dovetail.series.description import SeriesDescription
from dovetail.series.fitted_tests import FittedTest
from dovetail.series.fitting import CONTRADICTION, SeriesFit
from dovetail.series.sampling import SeriesPosterior
from dovetail.series.unknowns import SeriesUnknowns, Unknown


@dataclass(frozen=True)
class SeriesRow:
    """One line of a table: an unknown of the series, or a parameter of one test.

    Parameters
    ----------
    name : str
    test : str
        Empty for an unknown of the series.
    unit : str
    role : str
    fit : float
        SI; at the best fit.
    deviation : float
        SI; standard deviation by the fit's information.
    estimate, low, high : float or None
        SI; posterior mean, and ends of the 90 % interval.
    precision, verdict, reason : str
        Empty without a posterior.
    """

    name: str
    test: str
    unit: str
    role: str
    fit: float
    deviation: float
    estimate: float | None = None
    low: float | None = None
    high: float | None = None
    precision: str = ""
    verdict: str = ""
    reason: str = ""

    def to_dict(self) -> dict[str, Any]:
        """Return the row as plain values for JSON."""
        own = {"unit": self.unit, "role": self.role, "fit": self.fit, "standard_deviation": self.deviation}
        if self.estimate is None:
            return own
        interval = {"estimate": self.estimate, "interval": [self.low, self.high]}
        return {**own, **interval, "precision": self.precision, "verdict": self.verdict, "reason": self.reason}


@dataclass(frozen=True, eq=False)
class SeriesIdentification:
    """What the tests of a series say together.

    Parameters
    ----------
    series : SeriesDescription
    tests : tuple of FittedTest
        With the fit to each test alone.
    unknowns : SeriesUnknowns
    fit : SeriesFit
    posterior : SeriesPosterior or None
        None with the method "refined".
    """

    series: SeriesDescription
    tests: tuple[FittedTest, ...]
    unknowns: SeriesUnknowns
    fit: SeriesFit
    posterior: SeriesPosterior | None = None

    @property
    def method(self) -> str:
        """The method of identification."""
        return "refined" if self.posterior is None else "posterior"

    def theta(self, test: int) -> NDArray[np.float64]:
        """Return the parameters (p,) of a test at the best fit, SI."""
        z = self.unknowns.for_test(test, self.fit.z[np.newaxis])
        return np.asarray(self.tests[test].problem.from_unit(self.unknowns.maps[test].fractions(z))[0])

    def law_curve(self, name: str, points: int = 60) -> tuple[NDArray[np.float64], ...]:
        """Return the law of a parameter between the smallest and the largest covariate of the tests.

        Parameters
        ----------
        name : str
            Of a parameter that follows a law.
        points : int

        Returns
        -------
        covariate, low, middle, high : (points,) arrays
            SI; median and ends of the 90 % interval of the samples, of a value that varies without its scatter. Without
            samples all three are the best fit.
        """
        role = self.series.role_of(name)
        test = next(one.test for one in self.tests if name in {p.name for p in one.test.assembly.parameters})
        column = [p.name for p in test.assembly.parameters].index(name)
        covariate = np.linspace(*self.series.ends(role.over), points)
        z, weight = self.fit.z[np.newaxis], np.ones(1)
        if self.posterior is not None:
            z, weight = self.posterior.z, self.posterior.weight
        curves = []
        for value in covariate.tolist():
            test_map, own = self.unknowns.elsewhere(test, {**test.covariates, role.over: value})
            by_test = np.concatenate([z[:, : test_map.shared], np.zeros((len(z), len(own)))], axis=1)
            curves.append(test.assembly.from_unit(np.clip(test_map.fractions(by_test), 0.0, 1.0))[:, column])
        levels = [ends_of(LEVEL)[0], 0.5, ends_of(LEVEL)[1]]
        return covariate, *quantiles(np.stack(curves, axis=1), weight, levels)

    @property
    def is_trustworthy(self) -> bool:
        """Whether the model fits every test, and the tests do not contradict the relations between them."""
        return not self.warning

    @property
    def warning(self) -> str:
        """Why the result is not trustworthy; empty if it is."""
        misfits = [one.test.name for one in self.tests if not one.judged.is_trustworthy]
        if misfits:
            return f"The model does not fit {listing(misfits)} even alone: nothing here is to be trusted."
        if self.fit.contradiction < CONTRADICTION:
            return (
                "The tests contradict the relations between them: with shared values and laws the sum of squares rises "
                f"by {np.sum(self.fit.squares - self.fit.squares_alone):.0f}, where {max(self.fit.constraints, 0)} are "
                "expected. Make parameters 'free' or 'varying', or choose another law."
            )
        return ""

    @property
    def warnings(self) -> tuple[str, ...]:
        """Further warnings about the samples."""
        return () if self.posterior is None else self.posterior.warnings

    @property
    def rows(self) -> tuple[SeriesRow, ...]:
        """The unknowns of the series."""
        variances = np.diagonal(self.fit.matrix.shared_covariance()[0])
        posterior = None if self.posterior is None else self.posterior.shared
        return tuple(self._rows("", self.unknowns.shared, self.fit.z, variances, posterior))

    def rows_of(self, test: int) -> tuple[SeriesRow, ...]:
        """Return the parameters of one test."""
        fitted, assembly = self.tests[test], self.tests[test].test.assembly
        z = self.unknowns.for_test(test, self.fit.z[np.newaxis])
        fractions, slopes = self.unknowns.maps[test].linearise(z)
        covariance = slopes[0] @ self.fit.matrix.own_covariance(test)[0] @ slopes[0].T
        values = assembly.from_unit(fractions)[0]
        deviations = np.sqrt(np.maximum(np.diagonal(covariance), 0.0))
        posterior = None if self.posterior is None else self.posterior.tests[test]
        rows = []
        for index, parameter in enumerate(assembly.parameters):
            role = self.series.role_of(parameter.name).describe()
            spread = float(deviations[index] * parameter.slope(values[index]))
            known = {} if posterior is None else _posterior_columns(posterior, index, self.warning)
            name, unit = parameter.name, parameter.unit
            rows.append(SeriesRow(name, fitted.test.name, unit, role, float(values[index]), spread, **known))
        return tuple(rows)

    def _rows(
        self,
        test: str,
        unknowns: Sequence[Unknown],
        z: NDArray[np.float64],
        variances: NDArray[np.float64],
        posterior: Posterior | None,
    ) -> Iterator[SeriesRow]:
        for index, unknown in enumerate(unknowns):
            parameter = unknown.definition
            value = float(parameter.from_unit(unit_from_normal(z[index])))
            slope = float(parameter.slope(np.array(value)) * normal_density(z[index]))
            deviation = float(np.sqrt(variances[index])) * slope
            known = {} if posterior is None else _posterior_columns(posterior, index, self.warning)
            role = self.series.role_of(unknown.parameter).describe()
            yield SeriesRow(parameter.name, test, parameter.unit, role, value, deviation, **known)

    def to_dict(self) -> dict[str, Any]:
        """Return the result as plain values for JSON."""
        tests = {}
        for index, fitted in enumerate(self.tests):
            rows = self.rows_of(index)
            tests[fitted.test.name] = {
                "covariates": dict(fitted.test.covariates),
                "model_fits": fitted.judged.adequacy.word,
                "sum_of_squares": float(self.fit.squares[index]),
                "sum_of_squares_alone": float(self.fit.squares_alone[index]),
                "parameters": {row.name: row.to_dict() for row in rows},
            }
        return {
            "series": self.series.name,
            "method": self.method,
            "is_trustworthy": self.is_trustworthy,
            "warning": self.warning,
            "warnings": list(self.warnings),
            "level": LEVEL,
            "unknowns": {row.name: row.to_dict() for row in self.rows},
            "tests": tests,
            "contradiction": self.fit.contradiction,
            "posterior": None if self.posterior is None else self.posterior.to_dict(),
        }


def _posterior_columns(posterior: Posterior, index: int, warning: str) -> dict[str, Any]:
    name = posterior.names[index]
    low, high = posterior.interval()[name]
    verdict = posterior.verdicts[name]
    word = NOT_TRUSTWORTHY if warning else verdict.word
    precision = "" if warning else verdict.precision
    return {
        "estimate": float(posterior.estimate[index]),
        "low": low,
        "high": high,
        "precision": precision,
        "verdict": word,
        "reason": warning or verdict.reason,
    }
