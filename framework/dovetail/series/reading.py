"""Reads the description of a series, and reports all its faults at once, with their places."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from dovetail.assembly import Assembly, load
from dovetail.description.component_sections import build_component
from dovetail.documents.fault_list import FaultList
from dovetail.documents.tree import Path as Place
from dovetail.documents.tree import format_value, plain_values
from dovetail.documents.validation import validate
from dovetail.errors import DovetailError, UnitError, counted, did_you_mean, listing
from dovetail.measurement.file_section import MeasuredFile
from dovetail.registry import PluginPaths, Registry, components
from dovetail.series.description import FREE, Covariate, Role, SeriesDescription, SeriesTest
from dovetail.series.role_checks import check_files, check_roles
from dovetail.series.series_file import CandidateSection, SeriesFile, TestSection
from dovetail.units import to_fraction

_WIDEST_SCATTER = 1.0
"""Largest limit of a standard deviation, in parts of the range: more would be uniform over it."""


class _Role(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    role: Literal["shared", "free", "law", "varying"] | None = None
    law: Any = None
    over: str | None = None
    scatter: Annotated[tuple[Any, Any] | None, Field(min_length=2, max_length=2)] = None


def read_series(source: str | os.PathLike[str] | Mapping[str, Any], *, plugins: PluginPaths = ()) -> SeriesDescription:
    """Read the description of a series of tests.

    Parameters
    ----------
    source : path or mapping
        YAML, or the same as a dict. File names are relative to its folder, or to the working directory for a dict.
    plugins : path or iterable of paths
        As in `dovetail.load`.

    Returns
    -------
    SeriesDescription

    Raises
    ------
    DescriptionError
        Everything that is wrong with the file, at once.
    PluginError
        A plugin file cannot be loaded.
    """
    faults = FaultList()
    file = SeriesFile(source, faults)
    read = file.section
    reader = _Reader(faults, file, components(plugins), plugins)
    covariates = file.covariates()
    tests, candidates = reader.tests(covariates)
    roles = reader.roles(covariates, tests)
    check_files(tests, faults)
    if not faults:
        check_roles((*tests, *candidates), roles, Role(read.other_parameters), faults)
    faults.raise_if_any()
    return SeriesDescription(read.name, tests, covariates, roles, Role(read.other_parameters), read.seed, candidates)


@dataclass(frozen=True)
class _Reader:
    faults: FaultList
    file: SeriesFile
    registry: Registry
    plugins: PluginPaths

    def tests(self, covariates: Mapping[str, Covariate]) -> tuple[tuple[SeriesTest, ...], tuple[SeriesTest, ...]]:
        """Return the tests, and the candidates for the next one, without faults."""
        loaded: dict[str, Assembly] = {}
        tests = [self._test(name, section, covariates, loaded) for name, section in self.file.tests()]
        candidates = [self._candidate(name, section, covariates, loaded) for name, section in self.file.candidates()]
        return tuple(test for test in tests if test), tuple(candidate for candidate in candidates if candidate)

    def _candidate(
        self, name: str, section: CandidateSection, covariates: Mapping[str, Covariate], loaded: dict[str, Assembly]
    ) -> SeriesTest | None:
        place: Place = ("candidates", name)
        values = self.file.values(place, section, covariates)
        assembly = self._assembly(place, section, loaded)
        return None if assembly is None else SeriesTest(name, assembly, (), values)

    def _test(
        self, name: str, section: TestSection, covariates: Mapping[str, Covariate], loaded: dict[str, Assembly]
    ) -> SeriesTest | None:
        place: Place = ("tests", name)
        values = self.file.values(place, section, covariates)
        assembly = self._assembly(place, section, loaded)
        files = tuple(self._file(place, measured) for measured in section.measured)
        if assembly is None:
            return None
        count, wanted = len(files), len(assembly.description.responses)
        if count != wanted:
            problem = f"{counted(count, 'measured file')}, and its assembly has {wanted} responses."
            accepted = "; ".join(assembly.description.response_labels)
            self.faults.add((*place, "measured"), problem, accepted, "Give one file for each response, in order.")
        return SeriesTest(name, assembly, files, values)

    def _file(self, place: Place, measured: MeasuredFile) -> tuple[Path, Mapping[str, Any]]:
        path = self.file.folder / measured.file
        if not path.exists():
            remedy = "The path is relative to the description of the series."
            self.faults.add((*place, "measured"), f"there is no file '{measured.file}'.", remedy=remedy)
        return path, self.file.options(measured)

    def _assembly(self, place: Place, test: CandidateSection, loaded: dict[str, Assembly]) -> Assembly | None:
        """Return the assembly of a test; the same object for tests with the same description."""
        named = self.file.assembly_of(place, test)
        if named is None:
            return None
        file, where = named
        path = self.file.folder / file
        item = self.faults.root.at((*place, "change"))
        change: Any = {} if item is None else plain_values(item)
        key = f"{path} {change}"
        if key not in loaded:
            try:
                loaded[key] = load({"extends": str(path), **change} if change else path, plugins=self.plugins)
            except DovetailError as error:
                self._add_faults((*place, "change") if change else where, file, error)
                return None
        return loaded[key]

    def _add_faults(self, where: Place, file: str, error: DovetailError) -> None:
        first, *more = error.faults
        further = f" ({len(more)} further faults; see 'dovetail check {file}')" if more else ""
        problem = f"'{file}' is not usable: {first.where}: {first.problem}{further}"
        self.faults.add(where, problem, first.accepted, first.remedy)

    def roles(self, covariates: Mapping[str, Covariate], tests: Sequence[SeriesTest]) -> dict[str, Role]:
        """Return the roles of the parameters that the series names."""
        names = {p.name for test in tests for p in test.assembly.parameters}
        roles = {}
        for name in self.file.section.parameters:
            if name not in names:
                if tests:
                    problem = f"no test has a parameter '{name}' to identify."
                    accepted = listing(sorted(names), 30)
                    self.faults.add(("parameters", name), problem, accepted, did_you_mean(name, names), key=True)
                continue
            role = self._role(name, covariates)
            if role is not None:
                roles[name] = role
        return roles

    def _role(self, name: str, covariates: Mapping[str, Covariate]) -> Role | None:
        place: Place = ("parameters", name)
        item = self.faults.root.at(place)
        assert item is not None
        words = ("shared", "free", "varying")
        if not item.is_mapping:
            if item.value in words:
                return FREE if item.value == "free" else Role(item.value)  # type: ignore[arg-type]
            hint = did_you_mean(str(item.value), words)
            problem = f"{format_value(plain_values(item))} is not a role."
            accepted = "shared, free, varying; or {law: NAME, over: COVARIATE}"
            self.faults.add(place, problem, accepted, hint)
            return None
        section = validate(_Role, place, self.faults, f"the role of '{name}'")
        if section is None:
            return None
        kind = section.role or ("law" if section.law is not None else "varying" if section.scatter else None)
        if kind is None or (kind == "law") != (section.law is not None and kind != "varying"):
            problem = f"the role of '{name}' needs 'law'." if kind == "law" else f"'{kind or 'role'}' takes no 'law'."
            problem = "it says neither a role nor a law." if kind is None else problem
            self.faults.add(place, problem, "role: shared, free or varying; or law and over", key=True)
            return None
        if section.scatter is not None and kind != "varying":
            self.faults.add((*place, "scatter"), f"'{kind}' takes no 'scatter'.", remedy="Use it with 'role: varying'.")
            return None
        law, over = None, ""
        if section.law is not None:
            law, over = self._law(place, section.law), self._over(place, section.over, covariates)
            if law is None or not over:
                return None
        scatter = Role.scatter if section.scatter is None else self._scatter((*place, "scatter"), section.scatter)
        return None if scatter is None else Role(kind, law, over, scatter)

    def _law(self, place: Place, law: object) -> Any:
        where: Place = (*place, "law")
        if isinstance(law, str):
            if law not in self.registry.names("law") and ":" not in law:
                known = self.registry.names("law")
                self.faults.add(where, f"there is no law '{law}'.", listing(known), did_you_mean(law, known))
                return None
            return self.registry.create("law", law)
        made = build_component("law", where, self.faults, self.registry)
        return None if made is None else made.component

    def _over(self, place: Place, over: str | None, covariates: Mapping[str, Covariate]) -> str:
        if over is None and len(covariates) == 1:
            return next(iter(covariates))
        if over is not None and over in covariates:
            return over
        problem = "the law does not say over which covariate." if over is None else f"'{over}' is not a covariate."
        hint = "" if over is None else did_you_mean(over, covariates)
        accepted = listing(covariates) or "a name that 'covariates:' lists with its unit"
        self.faults.add((*place, "over"), problem, accepted, hint)
        return ""

    def _scatter(self, place: Place, ends: Iterable[Any]) -> tuple[float, float] | None:
        try:
            low, high = (to_fraction(end) for end in ends)
        except UnitError as error:
            self.faults.add(place, error.faults[0].problem, "two parts of the range's width, such as [0.1 %, 30 %]")
            return None
        if not 0.0 < low < high <= _WIDEST_SCATTER:
            accepted = "two increasing parts of the range's width, more than 0 and at most 1"
            self.faults.add(place, f"the scatter cannot range from {low:g} to {high:g}.", accepted)
            return None
        return low, high
