"""Measurements and the models that predict them: the tests of a series, one by one."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from dovetail import Frf
from dovetail.evaluation import Covariate, FaultList, MeasuredFile, SeriesFile, TestSection, read_test


@dataclass(frozen=True)
class Measurement:
    """A measured file and how it is read.

    Parameters
    ----------
    file : Path
    accelerometer_mass : float
        kg at the measured point, to be taken off.
    options : mapping
        Further ones of `dovetail.read_frf`.
    test : str
        To which it belongs.
    values : mapping of str to float
        Covariates of the test, SI, with which those in the file are compared.
    covariates : mapping of str to Covariate
    """

    file: Path
    accelerometer_mass: float
    options: Mapping[str, Any] = field(hash=False)
    test: str = ""
    values: Mapping[str, float] = field(default_factory=dict, hash=False)
    covariates: Mapping[str, Covariate] = field(default_factory=dict, hash=False)

    def read(self, *, compensated: bool) -> Frf:
        """Return the FRF as measured, or without the accelerometer's mass.

        Raises
        ------
        MeasurementError
        """
        options = {**self.options, "accelerometer_mass": self.accelerometer_mass if compensated else 0.0}
        return read_test(self.test, [(self.file, options)], self.values, self.covariates)[0]


@dataclass(frozen=True)
class JointSource:
    """Where a case's joint comes from: an assembly with its measurement, or the result of an identification."""

    assembly: Path | None
    measured: Measurement | None
    result: Path | None


@dataclass(frozen=True)
class Case:
    """One measurement and the model that predicts it.

    Parameters
    ----------
    name : str
    assembly : Path
        Its description.
    change : mapping
        Part of a description that overrides it.
    measured : Measurement
    joint : JointSource or None
        None where the description leaves nothing to identify.
    value : float or None
        Of the quantity that the series runs over, in its unit.
    """

    name: str
    assembly: Path
    change: Mapping[str, Any] = field(hash=False)
    measured: Measurement
    joint: JointSource | None
    value: float | None

    @property
    def source(self) -> Path | dict[str, Any]:
        """The description, as `dovetail.load` takes it."""
        return {"extends": str(self.assembly), **self.change} if self.change else self.assembly


@dataclass(frozen=True)
class Cases:
    """The tests of a series.

    Parameters
    ----------
    title : str
    series : str
        The first covariate with its unit, as ``torque [N m]``; empty if the tests have none.
    cases : tuple of Case
    """

    title: str
    series: str
    cases: tuple[Case, ...]


def read_cases(source: str | os.PathLike[str], **reading: Any) -> Cases:
    """Read the tests of a series as cases.

    Parameters
    ----------
    source : path
        Description of a series (YAML). File names in it are taken from its folder.
    **reading
        Options of `dovetail.read_frf`, such as `columns`, for measurements of which the file does not give them.

    Returns
    -------
    Cases

    Raises
    ------
    DescriptionError
        Everything that is wrong with the file, at once.
    """
    faults = FaultList()
    file = SeriesFile(source, faults)
    covariates = file.covariates()
    cases = [_case(file, name, test, covariates, reading) for name, test in file.tests()]
    quantity = next(iter(covariates.values()), None)
    faults.raise_if_any()
    series = "" if quantity is None else quantity.name if quantity.unit == "1" else f"{quantity.name} [{quantity.unit}]"
    return Cases(file.section.name, series, tuple(case for case in cases if case is not None))


def _case(
    file: SeriesFile, name: str, test: TestSection, covariates: Mapping[str, Covariate], reading: Mapping[str, Any]
) -> Case | None:
    place = ("tests", name)
    values, assembly = file.values(place, test, covariates), file.assembly_of(place, test)
    over = next(iter(file.section.covariates), None)
    if over is not None and over not in test.at:
        problem = f"the test does not give '{over}', over which the series runs."
        file.faults.add(place, problem, remedy=f"Add 'at: {{{over}: ...}}'.", key=True)
    if len(test.measured) != 1:
        problem = f"{len(test.measured)} measured files, and a test has one response here."
        file.faults.add((*place, "measured"), problem, "one file")
    if assembly is None:
        return None
    measured, joint = _measurement(file, test.measured[0], reading), test.joint
    measured = replace(measured, test=name, values=values, covariates=covariates)
    source = None
    if joint is not None:
        source = JointSource(
            assembly=None if joint.assembly is None else file.folder / joint.assembly,
            measured=None if joint.measured is None else _measurement(file, joint.measured, reading),
            result=None if joint.result is None else file.folder / joint.result,
        )
    value = None if over is None else values.get(over)
    return Case(name, file.folder / assembly[0], test.change, measured, source, value)


def _measurement(file: SeriesFile, measured: MeasuredFile, reading: Mapping[str, Any]) -> Measurement:
    options = {**file.options(measured), **reading, **measured.options}
    return Measurement(file.folder / measured.file, options.pop("accelerometer_mass"), options)
