"""A list of measurements and the models that predict them, read from one YAML file."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, model_validator

from dovetail import Frf, read_frf
from dovetail.evaluation import FaultList, Mass, MeasuredFile, check_format, read_source, validate

FORMAT = 1
"""Version of the format, which is what ``dovetail_cases:`` says."""


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
    """

    file: Path
    accelerometer_mass: float
    options: Mapping[str, Any] = field(hash=False)

    def read(self, *, compensated: bool) -> Frf:
        """Return the FRF as measured, or without the accelerometer's mass.

        Raises
        ------
        MeasurementError
        """
        mass = self.accelerometer_mass if compensated else 0.0
        return read_frf(self.file, accelerometer_mass=mass, **self.options)


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
    measured : Measurement
    joint : JointSource or None
        None where the description leaves nothing to identify.
    value : float or None
        Of the quantity that a series runs over.
    """

    name: str
    assembly: Path
    measured: Measurement
    joint: JointSource | None
    value: float | None


@dataclass(frozen=True)
class Cases:
    """All cases of a file.

    Parameters
    ----------
    title : str
    series : str
        What the cases' values are, with its unit, as ``tightening torque [N m]``; empty where they are no series.
    cases : tuple of Case
    """

    title: str
    series: str
    cases: tuple[Case, ...]


def _as_section(value: object) -> object:
    return {"file": value} if isinstance(value, str) else value


class _Section(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


_MeasuredFile = Annotated[MeasuredFile, BeforeValidator(_as_section)]


class _Joint(_Section):
    assembly: str | None = None
    measured: _MeasuredFile | None = None
    result: str | None = None

    @model_validator(mode="after")
    def _one_source(self) -> Self:
        sources = (self.assembly is not None, self.measured is not None, self.result is not None)
        if sources not in ((True, True, False), (False, False, True)):
            raise ValueError("a joint comes from 'assembly' and 'measured', or from 'result'")
        return self


class _Case(_Section):
    assembly: str
    measured: _MeasuredFile
    joint: _Joint | None = None
    value: float | None = None


class _File(_Section):
    title: str = "Validation"
    series: str = ""
    accelerometer_mass: Mass = 0.0
    cases: Annotated[dict[str, Any], Field(min_length=1)]


def read_cases(source: str | os.PathLike[str], **reading: Any) -> Cases:
    """Read a file of cases.

    Parameters
    ----------
    source : path
        YAML. File names in it are taken from its folder.
    **reading
        Options of `dovetail.read_frf`, such as `columns`, for measurements of which the file does not state them.

    Returns
    -------
    Cases

    Raises
    ------
    DescriptionError
        Everything that is wrong with the file, at once.
    """
    faults = FaultList()
    _, faults.root = read_source(source, faults)
    check_format(faults, "dovetail_cases", FORMAT, "the file does not say that it holds cases.")
    read = validate(_File, (), faults, "the file of cases", reserved=("dovetail_cases",))
    sections = {} if read is None else {name: _section(name, bool(read.series), faults) for name in read.cases}
    faults.raise_if_any()
    assert read is not None

    def measurement(measured: MeasuredFile) -> Measurement:
        described = measured.options
        options = {"accelerometer_mass": read.accelerometer_mass, **reading, **described}
        return Measurement(folder / measured.file, options.pop("accelerometer_mass"), options)

    folder = Path(source).parent
    cases = tuple(_case(name, case, folder, measurement) for name, case in sections.items() if case is not None)
    return Cases(read.title, read.series, cases)


def _section(name: str, in_series: bool, faults: FaultList) -> _Case | None:
    case = validate(_Case, ("cases", name), faults, f"case '{name}'")
    if case is not None and in_series and case.value is None:
        faults.add(("cases", name), "the case lacks 'value', which the series runs over.", key=True)
    return case


def _case(name: str, case: _Case, folder: Path, measurement: Callable[[MeasuredFile], Measurement]) -> Case:
    joint = case.joint
    source = None
    if joint is not None:
        source = JointSource(
            assembly=None if joint.assembly is None else folder / joint.assembly,
            measured=None if joint.measured is None else measurement(joint.measured),
            result=None if joint.result is None else folder / joint.result,
        )
    return Case(name, folder / case.assembly, measurement(case.measured), source, case.value)
