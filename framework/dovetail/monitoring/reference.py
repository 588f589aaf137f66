"""What a series says of the files to come: the model, how a file is read, the roles of the parameters, the laws."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from dovetail.errors import Fault, MeasurementError, ParameterError, listing
from dovetail.frf import Frf
from dovetail.identification.measured_lines import batch_contradictions
from dovetail.identification.one_measurement import lines_to_fit
from dovetail.inference.posterior.laplace import LaplaceApproximation
from dovetail.inference.posterior.likelihood import normal_density, normal_from_unit
from dovetail.interfaces import Parameter, Progress, silent
from dovetail.measurement.roles import MOST_DELIVERED, PHASE_ERROR, SUSPICIOUS, power_delivered
from dovetail.monitoring.equivalent import LawCurve
from dovetail.monitoring.estimate import FileModel
from dovetail.monitoring.kalman import RandomWalk
from dovetail.monitoring.response_names import ResponseNames
from dovetail.problem.observations import Observations
from dovetail.problem.random_error import random_error_variance
from dovetail.registry import PluginPaths, components
from dovetail.series.description import SeriesDescription
from dovetail.series.fitted_tests import FittedTest, fit_tests
from dovetail.series.measured_files import ReadFile, read_file

Array = NDArray[np.float64]

Dofs: TypeAlias = Sequence[tuple[str, str]]

_MARGIN = 1e-4
"""Distance of a start from the ends of the ranges."""
_INCOMPLETE = "It may be incomplete: it is read again when it changes."


class Reading(NamedTuple):
    """What a measurement contains, in one file or several.

    Parameters
    ----------
    observations : Observations
    files : tuple of (Path, ReadFile)
        One for each response.
    """

    observations: Observations
    files: tuple[tuple[Path, ReadFile], ...]

    @property
    def dofs(self) -> Dofs:
        """Response and force of each FRF; empty unless the files give some of them."""
        given = tuple((file.frf.response, file.frf.force) for _, file in self.files)
        return given if any(name for pair in given for name in pair) else ()


@dataclass(frozen=True, eq=False)
class Reference:
    """What is known before the first file.

    Parameters
    ----------
    series : SeriesDescription
    model : FileModel
    start : (p,) array
        Positions at the fit of the first test.
    common : (p, p) array
        Covariance of the positions by the error of the model, which all files have in common.
    curves : tuple of LawCurve
        Laws of the parameters over their covariates, as the tests of the series determine them.
    responses : ResponseNames or None
        How the names of the files of one measurement differ; None if all its FRFs are in one file.
    plugins : path or iterable of paths
    """

    series: SeriesDescription
    model: FileModel
    start: Array
    common: Array
    curves: tuple[LawCurve, ...]
    responses: ResponseNames | None = None
    plugins: PluginPaths = ()

    @staticmethod
    def of(series: SeriesDescription, *, plugins: PluginPaths = (), progress: Progress = silent) -> Reference:
        """Fit the tests of a series, and return what they say of files to come.

        Raises
        ------
        ParameterError
            The names of the files of the first test do not show which belong together.
        MeasurementError
            A measurement of a test cannot be read, or does not fit its test.
        """
        responses = _response_names(series)
        tests = fit_tests(series, progress=progress)
        first = tests[0]
        if first.lines.all_lines is not None:
            count = sum(len(frf.frequency) for frf in first.lines.all_lines.frfs)
            problem = f"its measurement has {count:,} lines, more than a watch fits in each file."
            remedy = "Use fewer: 'frequency: {step: ...}' of a narrower band in the assembly."
            raise ParameterError(Fault(f"test {first.test.name}", problem, remedy=remedy))
        curves = LawCurve.from_series(series, tests, progress)
        fraction = np.clip(first.fraction, _MARGIN, 1.0 - _MARGIN)
        model, common = _file_model(series, first), _common_covariance(first)
        return Reference(series, model, fraction, common, curves, responses, plugins)

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """The unknown parameters of the first test's assembly."""
        return self.model.problem.parameters

    @property
    def walk(self) -> RandomWalk:
        """The random walk before its steps are learned: 0 for shared parameters, 1 for those that vary."""
        roles = [self.series.role_of(parameter.name).name for parameter in self.parameters]
        step = np.array([0.0 if role in ("shared", "free") else 1.0 for role in roles])
        return RandomWalk(step, self.model.is_free)

    @property
    def fingerprint(self) -> str:
        """Hash of all that decides how files are identified."""
        test, series = self.series.tests[0], self.series
        said = {
            "assembly": test.assembly.description.fingerprint,
            "options": [options for _, options in test.measured],
            "covariates": [test.covariates, {name: one.unit for name, one in series.covariates.items()}],
            "laws": [[curve.covariate, np.round(curve.positions, 6).tolist()] for curve in self.curves],
            "roles": {parameter.name: series.role_of(parameter.name).describe() for parameter in self.parameters},
            "start": [round(value, 6) for value in self.start.tolist()],
            "lines": len(self.model.random_variance),
        }
        return hashlib.sha256(json.dumps(said, sort_keys=True, default=str).encode()).hexdigest()

    def read(self, files: Sequence[Path], dofs: Dofs = ()) -> Reading:
        """Return what is in a file, or in a file for each response.

        Parameters
        ----------
        files : sequence of Path
        dofs : sequence of (str, str)
            Response and force of each FRF, as earlier files give them; empty if none does.

        Raises
        ------
        DovetailError
            It cannot be read as the first test was, does not fit its assembly, or has other lines or DOFs.
        """
        test = self.series.tests[0]
        if len(files) not in (1, len(test.measured)) or (self.responses is not None and len(files) == 1):
            words = listing(self.responses.words if self.responses else ())
            raise MeasurementError(Fault(files[0].name, "its name does not say which response it is.", words))
        paths = files if len(files) > 1 else [files[0]] * len(test.measured)
        registry, covariates = components(self.plugins), self.series.covariates
        read = [
            read_file(path, options, covariates, registry)
            for path, (_, options) in zip(paths, test.measured, strict=True)
        ]
        frfs = tuple(file.frf for file in read)
        lines = lines_to_fit(test.assembly, frfs, None, silent, phase=True)
        expected = _with_dofs(self.model.problem.measured, dofs)
        if faults := batch_contradictions(test.assembly.description, [expected, frfs]):
            raise MeasurementError(*faults.values())
        responses = test.assembly.description.responses
        for path, frf, known, response in zip(paths, lines.frfs, expected, responses, strict=True):
            _check_lines(path, frf, known)
            if response.is_drive_point:
                _check_power(path, frf, known)
        for path, file, (first, _) in zip(paths, read, test.measured, strict=True):
            if isinstance(file.content, str) and not _has_end(path) and _has_end(first):
                problem = "its last line has no end, and that of the first test's file has."
                raise MeasurementError(Fault(str(path), problem, remedy=_INCOMPLETE))
        return Reading(lines.problem.observations, tuple(zip(paths, read, strict=True)))

    def offset(self, covariates: Mapping[str, float]) -> Array:
        """Return by how much laws move the positions (p,) from those at the first test's covariates."""
        offset, first = np.zeros(len(self.parameters)), self.series.tests[0].covariates
        for curve in self.curves:
            if curve.covariate in covariates and curve.covariate in first:
                at_these, at_first = (curve.at(values[curve.covariate]) for values in (covariates, first))
                offset[curve.columns] += at_these - at_first
        return offset


def _with_dofs(frfs: Sequence[Frf], dofs: Dofs) -> tuple[Frf, ...]:
    """Return FRFs with the DOFs that earlier files give, where they have none of their own."""
    if not dofs:
        return tuple(frfs)
    given = zip(frfs, dofs, strict=True)
    return tuple(
        replace(frf, response=frf.response or response, force=frf.force or force) for frf, (response, force) in given
    )


def _response_names(series: SeriesDescription) -> ResponseNames | None:
    """Return how the names of the files of one measurement differ; None if all its FRFs are in one file."""
    test = series.tests[0]
    files = [path for path, _ in test.measured]
    if len(set(files)) == 1:
        return None
    names = ResponseNames.of([path.name for path in files]) if len(set(files)) == len(files) else None
    if names is None:
        problem = f"its responses are in the files {listing([path.name for path in files])}."
        accepted = "one file, or a file for each response, with names that differ in one word"
        remedy = "As in '2026-03-01 tip.csv' and '2026-03-01 flange.csv'."
        raise ParameterError(Fault(f"test {test.name}", problem, accepted, remedy))
    return names


def _check_lines(path: Path, frf: Frf, known: Frf) -> None:
    if frf.has_phase != known.has_phase:
        has, had = ("a phase" if one.has_phase else "no phase" for one in (frf, known))
        raise MeasurementError(Fault(str(path), f"it has {has}, and the first test's measurement has {had}."))
    if len(frf.frequency) == len(known.frequency) and np.allclose(frf.frequency, known.frequency, rtol=1e-6):
        return
    has, expected = (
        f"{len(one.frequency)} lines from {one.frequency[0]:g} to {one.frequency[-1]:g} Hz" for one in (frf, known)
    )
    accepted = f"{expected}, as the first test"
    raise MeasurementError(Fault(str(path), f"it has {has} within the band.", accepted, _INCOMPLETE))


def _check_power(path: Path, frf: Frf, known: Frf) -> None:
    """Refuse an FRF by which the structure delivers power where it is driven, unless it did so in the first test."""
    now, before = (power_delivered(one, random_error_variance(one), turn=PHASE_ERROR) for one in (frf, known))
    if now > MOST_DELIVERED and before < SUSPICIOUS:
        problem = f"the structure delivers {100.0 * now:.0f} % of the power where it is driven, and took it up before"
        remedy = "Correct the file; it is read again when it has changed."
        raise MeasurementError(Fault(str(path), f"{problem}: a sign, a phase or a point is wrong.", remedy=remedy))


def _has_end(path: Path) -> bool:
    """Return whether the last line of a text file has an end."""
    with path.open("rb") as file:
        file.seek(-1, os.SEEK_END)
        return file.read(1) in b"\r\n"


def _file_model(series: SeriesDescription, first: FittedTest) -> FileModel:
    problem, fit = first.problem, first.judged.fit
    values = problem.frf_at(fit.theta)
    random = problem.observations.variance(values)
    model = (fit.discrepancy * np.abs(values)) ** 2 + (fit.background * problem.observations.level) ** 2
    is_free = np.array([series.role_of(parameter.name).name == "free" for parameter in problem.parameters])
    return FileModel(problem, model, random, fit.used, is_free)


def _common_covariance(first: FittedTest) -> Array:
    """Return the covariance (p, p) of positions by the errors of the model that a single identification allows for."""
    fraction = np.clip(first.fraction, _MARGIN, 1.0 - _MARGIN)
    if first.is_noise:
        return np.zeros((len(fraction), len(fraction)))
    z = normal_from_unit(fraction)
    axes = LaplaceApproximation.at(first.likelihood().posterior, z).axes * normal_density(z)
    return np.asarray(axes.T @ axes)
