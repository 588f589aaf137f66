"""Prediction from a series: an FRF with its band at another value of a covariate, or of another assembly."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.assembly import Assembly, as_assembly
from dovetail.errors import Fault, ParameterError, UnitError, argument, did_you_mean, listing
from dovetail.frf import Frf
from dovetail.identification.prediction import PredictedBand
from dovetail.inference.posterior import LEVEL, ModelError, with_model_error
from dovetail.inference.posterior.verdicts import ends_of, quantiles
from dovetail.series.description import SeriesTest
from dovetail.series.result import SeriesIdentification
from dovetail.units import format_quantity, to_si

_DRAWS = 400
"""Samples of the posterior from which a band is computed."""


@dataclass(frozen=True, eq=False)
class PredictedTest:
    """What a series says about a test that it does not contain.

    Parameters
    ----------
    frf : Frf
        Of the sample whose FRF is nearest to the median of all: the middle of each parameter alone may lie outside a
        narrow ridge of the posterior. Its note holds the warnings.
    band : PredictedBand
    intervals : mapping of str to (float, float, float)
        SI; median and ends of the 90 % interval of each parameter.
    warnings : tuple of str
        Extrapolation, parameters of which the series says nothing, and those of the result.
    """

    frf: Frf
    band: PredictedBand
    intervals: Mapping[str, tuple[float, float, float]]
    warnings: tuple[str, ...]

    def to_dict(self) -> dict[str, Any]:
        """Return the prediction without the FRF as plain values for JSON."""
        names = ("median", "low", "high")
        intervals = {name: dict(zip(names, ends, strict=True)) for name, ends in self.intervals.items()}
        return {"level": self.band.level, "parameters": intervals, "warnings": list(self.warnings)}


def predict_test(
    result: SeriesIdentification,
    at: Mapping[str, float | str],
    assembly: Assembly | str | os.PathLike[str] | None = None,
    *,
    level: float = LEVEL,
    seed: int = 0,
) -> PredictedTest:
    """Predict the FRF of a test that is not in the series.

    Parameters
    ----------
    result : SeriesIdentification
        By the method "posterior".
    at : mapping of str to float or str
        Covariates: numbers in SI, or texts with units.
    assembly : Assembly or path, optional
        With the identified parameters; that of the first test by default.
    level : float
        Probability of the band, line by line.
    seed : int

    Returns
    -------
    PredictedTest
        With the errors that the models of the tests are allowed, the largest of them. Values that scatter from test to
        test are drawn anew, free ones from their ranges.

    Raises
    ------
    ParameterError
        The result has no posterior, or a covariate of a law is missing.
    """
    if not 0.0 < level < 1.0:
        raise ParameterError(Fault("level", f"{level:g} is not a probability.", "more than 0 and less than 1"))
    model = result.tests[0].test.assembly if assembly is None else as_assembly(assembly)
    test = SeriesTest("prediction", model, (), checked_covariates(result, at))
    random = np.random.default_rng([seed, 31])
    fractions = drawn_fractions(result, test, _DRAWS, random)
    theta = model.from_unit(fractions)
    weight = np.full(len(theta), 1.0 / len(theta))
    low, middle, high = quantiles(theta, weight, [ends_of(LEVEL)[0], 0.5, ends_of(LEVEL)[1]])
    warnings = (*([result.warning] if result.warning else ()), *_extrapolations(result, test))
    frfs = model.frf(theta)
    centre = model.description.response.frf(model.frequency, frfs[most_central(frfs)], note=" ".join(warnings))
    values = with_model_error(frfs, [centre], allowed_error(result), random)
    lower, upper = np.quantile(np.abs(values), ends_of(level), axis=0)
    band = PredictedBand(model.frequency, lower, upper, level, " ".join(warnings))
    names = (parameter.name for parameter in model.parameters)
    ends = zip(middle.tolist(), low.tolist(), high.tolist(), strict=True)
    return PredictedTest(centre, band, dict(zip(names, ends, strict=True)), warnings)


def most_central(frfs: NDArray[np.complex128]) -> int:
    """Return which of some FRFs (n, f) is nearest to the median of the logarithms of their amplitudes."""
    levels = np.log(np.maximum(np.abs(frfs), np.finfo(float).tiny))
    return int(np.argmin(np.sum((levels - np.median(levels, axis=0)) ** 2, axis=1)))


def checked_covariates(result: SeriesIdentification, at: Mapping[str, float | str]) -> dict[str, float]:
    """Return covariates in SI.

    Raises
    ------
    ParameterError
        One is unknown, has another unit, or is missing for a law.
    """
    covariates, values = result.series.covariates, {}
    for name, value in at.items():
        if name not in covariates:
            problem, hint = f"'{name}' is not a covariate of the series.", did_you_mean(name, covariates)
            raise ParameterError(Fault("at", problem, listing(covariates) or "none", hint))
        try:
            values[name] = to_si(value, covariates[name].unit)
        except UnitError as error:
            raise ParameterError(Fault(f"at.{name}", error.faults[0].problem)) from None
    for role in result.series.roles.values():
        if role.over and role.over not in values:
            remedy = f"Give it, in {covariates[role.over].unit}: {argument('at', {role.over: 'VALUE'})}."
            raise ParameterError(Fault("at", f"a law runs over '{role.over}', which is not given.", remedy=remedy))
    return values


def drawn_fractions(
    result: SeriesIdentification, test: SeriesTest, count: int, random: np.random.Generator
) -> NDArray[np.float64]:
    """Return samples (count, p) of the parameters of a test outside the series, in fractions of their ranges."""
    posterior = result.posterior
    if posterior is None:
        problem = "the series was identified by the method 'refined', which does not say how sure it is."
        raise ParameterError(Fault("result", problem, remedy="Identify it by the method 'posterior'."))
    test_map, own = result.unknowns.elsewhere(test, test.covariates)
    shared = posterior.z[random.choice(len(posterior.weight), count, p=posterior.weight), : test_map.shared]
    z = np.concatenate([shared, random.standard_normal((count, len(own)))], axis=1)
    return np.clip(test_map.fractions(z), 0.0, 1.0)


def allowed_error(result: SeriesIdentification) -> ModelError:
    """Return the largest errors that the models of the tests are allowed, size by size."""
    first, *others = (test.judged.adequacy.error_in_intervals for test in result.tests)
    for other in others:
        first = first.at_least(other)
    return first


def _extrapolations(result: SeriesIdentification, test: SeriesTest) -> list[str]:
    """Return what the prediction rests on that no test shows, as sentences."""
    notes, series = [], result.series
    for name in dict.fromkeys(series.role_of(p.name).over for p in test.assembly.parameters):
        if not name:
            continue
        low, high = series.ends(name)
        unit, value = series.covariates[name].unit, test.covariates[name]
        if not low <= value <= high:
            ends = f"{format_quantity(low, unit)} to {format_quantity(high, unit)}"
            notes.append(
                f"{name} = {format_quantity(value, unit)} is outside the tests ({ends}): its laws are extrapolated."
            )
    common = {unknown.parameter for unknown in result.unknowns.shared}
    if unknown := [p.name for p in test.assembly.parameters if p.name not in common]:
        notes.append(f"The series says nothing about {listing(unknown)} of another test: the whole range is taken.")
    return notes
