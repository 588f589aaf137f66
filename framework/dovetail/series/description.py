"""A series of tests as it was described: assemblies, measured files, covariates, and the role of each parameter."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal, TypeAlias

from dovetail.assembly import Assembly
from dovetail.errors import Fault, ParameterError, listing
from dovetail.interfaces import Law

RoleName: TypeAlias = Literal["shared", "free", "law", "varying"]


@dataclass(frozen=True)
class Role:
    """How the values of one parameter in several tests are related.

    Parameters
    ----------
    name : {"shared", "free", "law", "varying"}
        One value for all tests; one for each test; a function of a covariate; or values that scatter about a mean, or
        about a law, with an unknown standard deviation.
    law : Law or None
        For "law", and for "varying" about a law.
    over : str
        The covariate of the law.
    scatter : (float, float)
        For "varying": range of the standard deviation, as a part of the width of the parameter's range on its scale.
    """

    name: RoleName
    law: Law | None = None
    over: str = ""
    scatter: tuple[float, float] = (1e-3, 0.3)

    def describe(self) -> str:
        """Return the role in words."""
        law = "" if self.law is None else f"{self.law.name} over {self.over}"
        if self.name == "varying":
            return f"varying about {law}" if law else "varying"
        return law or self.name


FREE = Role("free")


@dataclass(frozen=True)
class Covariate:
    """A quantity in which tests differ, such as a torque."""

    name: str
    unit: str


@dataclass(frozen=True)
class SeriesTest:
    """One test of a series.

    Parameters
    ----------
    name : str
    assembly : Assembly
    measured : tuple of (Path, mapping)
        Files, one for each response, and the options of `dovetail.read_frf` with which they are read.
    covariates : mapping of str to float
        SI.
    """

    name: str
    assembly: Assembly
    measured: tuple[tuple[Path, Mapping[str, Any]], ...]
    covariates: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class SeriesDescription:
    """A series of tests.

    Parameters
    ----------
    name : str
    tests : tuple of SeriesTest
    covariates : mapping of str to Covariate
    roles : mapping of str to Role
        By the parameters' names in the assemblies; those of `other_parameters` for all that are not named.
    other_parameters : Role
    seed : int
    candidates : tuple of SeriesTest
        Tests that might be made next; they have no measured files.
    """

    name: str
    tests: tuple[SeriesTest, ...]
    covariates: Mapping[str, Covariate]
    roles: Mapping[str, Role]
    other_parameters: Role = FREE
    seed: int = 0
    candidates: tuple[SeriesTest, ...] = ()

    def role_of(self, parameter: str) -> Role:
        """Return the role of a parameter."""
        return self.roles.get(parameter, self.other_parameters)

    def with_roles(self, roles: Mapping[str, Role]) -> SeriesDescription:
        """Return the series with other roles of some parameters."""
        return replace(self, roles={**self.roles, **roles})

    def without(self, test: str) -> SeriesDescription:
        """Return the series without one of its tests.

        Raises
        ------
        ParameterError
            There is no such test, or no other.
        """
        others = tuple(one for one in self.tests if one.name != test)
        if len(others) == len(self.tests) or not others:
            names = listing(one.name for one in self.tests)
            raise ParameterError(Fault("test", f"the test '{test}' cannot be left out.", names))
        return replace(self, tests=others)

    def ends(self, covariate: str) -> tuple[float, float]:
        """Return the smallest and the largest value of a covariate among the tests."""
        values = [test.covariates[covariate] for test in self.tests if covariate in test.covariates]
        return min(values), max(values)
