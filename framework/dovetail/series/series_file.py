"""The file of a series, as YAML: its sections, without the assemblies that it names."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, model_validator

from dovetail.documents.extends import read_source
from dovetail.documents.fault_list import FaultList
from dovetail.documents.mapping_reader import DICT
from dovetail.documents.tree import Path as Place
from dovetail.documents.validation import check_format, validate
from dovetail.errors import UnitError, did_you_mean, listing
from dovetail.measurement.file_section import MeasuredFile
from dovetail.series.description import Covariate
from dovetail.units import Mass, is_unit, to_si

FORMAT = 1
"""Version of the format, which is what ``dovetail_series:`` says."""
_KEY = "dovetail_series"


class _Section(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


def _as_file(value: object) -> object:
    return {"file": value} if isinstance(value, str) else value


def _as_files(value: object) -> object:
    several = value if isinstance(value, (list, tuple)) else (value,)
    return tuple(_as_file(one) for one in several)


class JointSection(_Section):
    """Where the joint of a test comes from: an assembly and its measurement, or a stored result."""

    assembly: str | None = None
    measured: Annotated[MeasuredFile, BeforeValidator(_as_file)] | None = None
    result: str | None = None

    @model_validator(mode="after")
    def _one_source(self) -> Self:
        sources = (self.assembly is not None, self.measured is not None, self.result is not None)
        if sources not in ((True, True, False), (False, False, True)):
            raise ValueError("a joint comes from 'assembly' and 'measured', or from 'result'")
        return self


class CandidateSection(_Section):
    """A test that might be made."""

    assembly: str | None = None
    change: dict[str, Any] = {}
    at: dict[str, Any] = {}


class TestSection(CandidateSection):
    """One test."""

    measured: Annotated[tuple[MeasuredFile, ...], BeforeValidator(_as_files), Field(min_length=1)]
    joint: JointSection | None = None


class SeriesSection(_Section):
    """The whole file; tests and roles are validated one by one."""

    name: str = "series"
    assembly: str | None = None
    accelerometer_mass: Mass = 0.0
    covariates: dict[str, Annotated[str, BeforeValidator(lambda unit: "1" if unit == 1 else unit)]] = {}
    tests: Annotated[dict[str, Any], Field(min_length=1)]
    candidates: dict[str, Any] = {}
    parameters: dict[str, Any] = {}
    other_parameters: Literal["shared", "free"] = "free"
    seed: Annotated[int, Field(ge=0)] = 0


def is_series(path: str | os.PathLike[str]) -> bool:
    """Return whether a description is that of a series; a file that cannot be read is reported by its reader."""
    return _KEY in read_source(path, FaultList())[1].entries


class SeriesFile:
    """The file of a series and its faults so far.

    Parameters
    ----------
    source : path or mapping
    faults : FaultList
        Takes the faults of all methods.

    Raises
    ------
    DescriptionError
        The file cannot be read, or its top level is wrong.
    """

    def __init__(self, source: str | os.PathLike[str] | Mapping[str, Any], faults: FaultList) -> None:
        name, faults.root = read_source(source, faults)
        self.faults = faults
        check_format(faults, _KEY, FORMAT, "the file does not say that it describes a series of tests.")
        read = validate(SeriesSection, (), faults, "the description of a series", reserved=(_KEY,))
        if read is None:
            raise faults.error()
        self.section = read
        self.folder = Path() if name == DICT else Path(os.path.abspath(name)).parent

    def covariates(self) -> dict[str, Covariate]:
        """Return the covariates whose units are units."""
        known = {}
        for name, unit in self.section.covariates.items():
            if not name.isidentifier():
                self.faults.add(
                    ("covariates", name), f"'{name}' cannot be a name.", "letters, digits and '_'", key=True
                )
            elif not is_unit(unit):
                self.faults.add(("covariates", name), f"'{unit}' is not a unit.", "an SI unit, such as N m; 1 for none")
            else:
                known[name] = Covariate(name, unit)
        return known

    def tests(self) -> Iterator[tuple[str, TestSection]]:
        """Yield the tests whose sections have no faults, by name."""
        for name in self.section.tests:
            section = validate(TestSection, ("tests", name), self.faults, f"test '{name}'")
            if section is not None:
                yield name, section

    def candidates(self) -> Iterator[tuple[str, CandidateSection]]:
        """Yield the candidates for the next test whose sections have no faults, by name."""
        for name in self.section.candidates:
            section = validate(CandidateSection, ("candidates", name), self.faults, f"candidate '{name}'")
            if section is not None:
                yield name, section

    def assembly_of(self, place: Place, test: CandidateSection) -> tuple[str, Place] | None:
        """Return the description that a test uses, and where the file names it; None with a fault if it has none."""
        if test.assembly:
            return test.assembly, (*place, "assembly")
        if self.section.assembly:
            return self.section.assembly, ("assembly",)
        problem = f"the test '{place[-1]}' names no assembly."
        remedy = "Name it here, or 'assembly:' for all tests at the top of the file."
        self.faults.add(place, problem, "the path of a description", remedy, key=True)
        return None

    def options(self, measured: MeasuredFile) -> dict[str, Any]:
        """Return the options of `read_frf` with which a file is read."""
        return {"accelerometer_mass": self.section.accelerometer_mass, **measured.options}

    def values(self, place: Place, test: CandidateSection, covariates: Mapping[str, Covariate]) -> dict[str, float]:
        """Return the covariates of a test, SI."""
        values = {}
        for key, value in test.at.items():
            where = (*place, "at", key)
            if key not in covariates:
                hint = did_you_mean(key, covariates) or "List it under 'covariates' with its unit."
                if key not in self.section.covariates:
                    problem = f"'{key}' is not a covariate of the series."
                    self.faults.add(where, problem, listing(covariates) or "none", hint, key=True)
                continue
            try:
                values[key] = to_si(value, covariates[key].unit)
            except UnitError as error:
                self.faults.add(where, error.faults[0].problem)
        return values
