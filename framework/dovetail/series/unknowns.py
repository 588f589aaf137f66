"""The unknowns of a series, and the parameters of each test as functions of them.

All unknowns are normal quantiles z of their priors. Those of the series come first (shared values, unknowns of laws,
means and standard deviations), then those of each test (free values, deviations from a mean or a law).
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr, ndtri

from dovetail.inference.posterior.likelihood import normal_density, unit_from_normal
from dovetail.interfaces import Law, LawUnknown, Parameter, plugin_errors
from dovetail.interfaces.component import component_label
from dovetail.series.description import Role, SeriesDescription, SeriesTest

Values: TypeAlias = tuple[NDArray[np.float64], NDArray[np.float64]]
"""Values (n,) and their derivatives (n, k) by some unknowns."""

_LEAST_INSIDE = 1e-300
"""Smallest probability that is divided by."""


@dataclass(frozen=True)
class Unknown:
    """One unknown of a series.

    Parameters
    ----------
    definition : Parameter
        Its name, unit, range, scale and prior.
    parameter : str
        The parameter of the assemblies to which it belongs.
    kind : str
        "value", "number" of a law, "scatter", or "deviation" of one test.
    """

    definition: Parameter
    parameter: str
    kind: str


@dataclass(frozen=True)
class ScalePosition:
    """Positions of a parameter's values on its scale: 0 at the lower end of its range, 1 at the upper end."""

    parameter: Parameter

    @cached_property
    def _even(self) -> Parameter:
        p = self.parameter
        return Parameter(p.name, p.unit, p.lower, p.upper, p.scale)

    @property
    def is_even(self) -> bool:
        """Whether positions are fractions of the range: the prior is uniform."""
        return self.parameter.prior == "uniform"

    def value_and_slope(self, z: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the positions (n,) of normal quantiles of the prior, and their derivatives (n,)."""
        fraction, slope = unit_from_normal(z), normal_density(z)
        if self.is_even:
            return fraction, slope
        value = self.parameter.from_unit(fraction)
        return self._even.to_unit(value), slope * self.parameter.slope(value) / self._even.slope(value)

    def to_fraction(self, position: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the quantiles of the prior (n,) at positions, and their derivatives (n,)."""
        if self.is_even:
            return position, np.ones_like(position)
        value = self._even.from_unit(position)
        return self.parameter.to_unit(value), self._even.slope(value) / self.parameter.slope(value)


def within_range(
    mean: NDArray[np.float64], deviation: NDArray[np.float64], z: NDArray[np.float64]
) -> tuple[NDArray[np.float64], tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]]:
    """Return positions (n,) that scatter normally within the range, and their derivatives.

    Parameters
    ----------
    mean, deviation : (n,) arrays
        Of the normal distribution, which is cut off at the ends of the range, 0 and 1.
    z : (n,) array
        Standard normal; a quantile of the distribution that is cut off.

    Returns
    -------
    (n,) array
    tuple of (n,) arrays
        Derivatives by mean, deviation and z.
    """
    low, high = -mean / deviation, (1.0 - mean) / deviation
    below, above = ndtr(low), ndtr(-high)
    inside = np.maximum(1.0 - below - above, _LEAST_INSIDE)
    lower_half = z <= 0.0  # the tail that keeps its digits
    share = np.where(lower_half, below + inside * ndtr(z), above + inside * ndtr(-z))
    quantile = np.where(lower_half, 1.0, -1.0) * ndtri(np.clip(share, _LEAST_INSIDE, 1.0 - 1e-16))
    density, at = normal_density(quantile), np.clip(ndtr(z), 0.0, 1.0)
    density = np.maximum(density, _LEAST_INSIDE)
    by_low = normal_density(low) * (1.0 - at) / density
    by_high = normal_density(high) * at / density
    position = mean + deviation * quantile
    by_mean = 1.0 - by_low - by_high
    by_deviation = quantile - low * by_low - high * by_high
    by_z = deviation * inside * normal_density(z) / density
    return position, (by_mean, by_deviation, by_z)


@dataclass(frozen=True)
class LawTerms:
    """A law's position as a function of the normal quantiles of its unknowns.

    Parameters
    ----------
    law : Law
    position : ScalePosition
    ends : (float, float)
        Of the covariate.
    """

    law: Law
    position: ScalePosition
    ends: tuple[float, float]

    def at(self, covariate: float, z: NDArray[np.float64]) -> Values:
        """Return positions (n,) at a covariate and their derivatives (n, k) by z (n, k)."""
        columns = [self._unknown(unknown, z[:, k]) for k, unknown in enumerate(self.law.unknowns)]
        values, slopes = (np.stack(part, axis=1) for part in zip(*columns, strict=True))
        with plugin_errors(self.law, component_label(self.law)):
            positions, derivatives = self.law.evaluate(covariate, self.ends, values)
        return positions, derivatives * slopes

    def _unknown(self, unknown: LawUnknown, z: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        if unknown.is_value:
            return self.position.value_and_slope(z)
        number = _number(unknown, unknown.name)
        value = number.from_unit(unit_from_normal(z))
        return value, number.slope(value) * normal_density(z)


def _number(unknown: LawUnknown, name: str) -> Parameter:
    assert unknown.lower is not None
    assert unknown.upper is not None
    return Parameter(name, unknown.unit, unknown.lower, unknown.upper, unknown.scale, unknown.description)


@dataclass(frozen=True)
class _Term:
    """One parameter of one test: the columns of its unknowns, and the function of their quantiles z."""

    columns: NDArray[np.intp]
    fraction: Callable[[NDArray[np.float64]], Values]


class TestMap:
    """The parameters of one test, in fractions of their ranges, as functions of the unknowns that they depend on.

    Parameters
    ----------
    terms : list of _Term
        With columns among the unknowns of the series, followed by those of the test.
    shared, own : int
        Numbers of these.
    """

    __test__ = False

    def __init__(self, terms: list[_Term], shared: int, own: int) -> None:
        self._terms, self.shared, self.own = terms, shared, own

    def fractions(self, z: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return fractions of the ranges (n, p) at the unknowns z (n, shared + own)."""
        return np.stack([term.fraction(z[:, term.columns])[0] for term in self._terms], axis=1)

    def linearise(self, z: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the fractions (n, p), and their derivatives (n, p, shared + own)."""
        fractions = np.empty((len(z), len(self._terms)))
        jacobian = np.zeros((len(z), len(self._terms), self.shared + self.own))
        for row, term in enumerate(self._terms):
            fractions[:, row], jacobian[:, row, term.columns] = term.fraction(z[:, term.columns])
        return fractions, jacobian


class SeriesUnknowns:
    """All unknowns of a series.

    Parameters
    ----------
    series : SeriesDescription

    Attributes
    ----------
    shared : list of Unknown
        Those of the series.
    own : list of list of Unknown
        Those of each test.
    maps : list of TestMap
    """

    def __init__(self, series: SeriesDescription) -> None:
        self.series = series
        self.shared: list[Unknown] = []
        self._first: dict[str, int] = {}
        for name, parameter in self._common().items():
            self._first[name] = len(self.shared)
            self.shared += _shared_unknowns(parameter, series.role_of(name))
        made = [self._test(test, test.covariates) for test in series.tests]
        self.maps = [test_map for test_map, _ in made]
        self.own = [own for _, own in made]

    def _common(self) -> dict[str, Parameter]:
        """Return the parameters that are not free, by name."""
        every = [parameter for test in self.series.tests for parameter in test.assembly.parameters]
        common = {p.name: p for p in reversed(every) if self.series.role_of(p.name).name != "free"}
        return dict(sorted(common.items(), key=lambda pair: [p.name for p in every].index(pair[0])))

    @property
    def count(self) -> int:
        """Number of all unknowns."""
        return len(self.shared) + sum(map(len, self.own))

    @cached_property
    def columns(self) -> list[slice]:
        """The columns of each test's own unknowns among all."""
        ends = np.cumsum([len(self.shared), *map(len, self.own)]).tolist()
        return [slice(first, last) for first, last in itertools.pairwise(ends)]

    @cached_property
    def scatter_columns(self) -> list[int]:
        """The columns of the standard deviations from test to test."""
        return [column for column, one in enumerate(self.shared) if one.kind == "scatter"]

    def deviation_columns(self, scatter: int) -> list[int]:
        """Return the columns of the tests' deviations whose standard deviation is in the column `scatter`."""
        parameter = self.shared[scatter].parameter
        pairs = zip(self.columns, self.own, strict=True)
        return [
            columns.start + place
            for columns, own in pairs
            for place, one in enumerate(own)
            if one.kind == "deviation" and one.parameter == parameter
        ]

    def for_test(self, index: int, z: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the unknowns (n, shared + own) on which a test depends, of all (n, count)."""
        return np.concatenate([z[:, : len(self.shared)], z[:, self.columns[index]]], axis=1)

    def elsewhere(self, test: SeriesTest, covariates: Mapping[str, float]) -> tuple[TestMap, list[Unknown]]:
        """Return the map of a test that is not in the series, and the unknowns of its own.

        A law is extrapolated from the ends of the series.
        """
        return self._test(test, covariates)

    def _test(self, test: SeriesTest, covariates: Mapping[str, float]) -> tuple[TestMap, list[Unknown]]:
        terms, unshared = [], list[Unknown]()
        for parameter in test.assembly.parameters:
            role = self.series.role_of(parameter.name)
            first = self._first.get(parameter.name)
            if first is None:
                role = Role("free")
            if role.name in ("free", "varying"):
                unshared.append(Unknown(parameter, parameter.name, "value" if role.name == "free" else "deviation"))
            last = len(self.shared) + len(unshared) - 1
            terms.append(self._term(parameter, role, first or 0, last, covariates))
        return TestMap(terms, len(self.shared), len(unshared)), unshared

    def _term(self, parameter: Parameter, role: Role, first: int, last: int, covariates: Mapping[str, float]) -> _Term:
        if role.name == "free":
            return _Term(np.array([last]), _direct)
        if role.name == "shared":
            return _Term(np.array([first]), _direct)
        position = ScalePosition(parameter)
        law = None if role.law is None else LawTerms(role.law, position, self.series.ends(role.over))
        covariate = covariates[role.over] if role.over else 0.0
        count = 1 if role.law is None else len(role.law.unknowns)
        if role.name == "law":
            assert law is not None
            return _Term(np.arange(first, first + count), _by_law(law, covariate))
        columns = np.append(np.arange(first, first + count + 1), last)
        return _Term(columns, _scattered(position, law, covariate, _scatter(parameter, role)))


def _shared_unknowns(parameter: Parameter, role: Role) -> list[Unknown]:
    """Return the unknowns of the series that belong to a parameter."""
    name, p = parameter.name, parameter
    if role.law is None:
        unknowns = [Unknown(parameter, name, "value")]
    else:
        unknowns = []
        for unknown in role.law.unknowns:
            full = f"{name}.{unknown.name}"
            value = Parameter(full, p.unit, p.lower, p.upper, p.scale, unknown.description, p.prior)
            definition = value if unknown.is_value else _number(unknown, full)
            unknowns.append(Unknown(definition, name, "value" if unknown.is_value else "number"))
    if role.name == "varying":
        unknowns.append(Unknown(_scatter(parameter, role), name, "scatter"))
    return unknowns


def _scatter(parameter: Parameter, role: Role) -> Parameter:
    """Return the standard deviation of a parameter, as a part of the width of its range on its scale."""
    what = "Standard deviation from test to test, over the width of the range"
    return Parameter(f"{parameter.name}.scatter", "1", *role.scatter, "log", what)


def _direct(z: NDArray[np.float64]) -> Values:
    return unit_from_normal(z[:, 0]), normal_density(z)


def _by_law(law: LawTerms, covariate: float) -> Callable[[NDArray[np.float64]], Values]:
    def fraction(z: NDArray[np.float64]) -> Values:
        positions, derivatives = law.at(covariate, z)
        fractions, slopes = law.position.to_fraction(positions)
        return fractions, derivatives * slopes[:, np.newaxis]

    return fraction


def _scattered(
    position: ScalePosition, law: LawTerms | None, covariate: float, scatter: Parameter
) -> Callable[[NDArray[np.float64]], Values]:
    """Return the function of the quantiles of the mean's unknowns, the standard deviation and the own deviation."""

    def fraction(z: NDArray[np.float64]) -> Values:
        if law is None:
            mean, slope = position.value_and_slope(z[:, 0])
            mean_slope = slope[:, np.newaxis]
        else:
            mean, mean_slope = law.at(covariate, z[:, :-2])
        deviation = scatter.from_unit(unit_from_normal(z[:, -2]))
        deviation_slope = scatter.slope(deviation) * normal_density(z[:, -2])
        positions, (by_mean, by_deviation, by_z) = within_range(mean, deviation, z[:, -1])
        derivatives = np.column_stack([by_mean[:, np.newaxis] * mean_slope, by_deviation * deviation_slope, by_z])
        fractions, slopes = position.to_fraction(positions)
        return fractions, derivatives * slopes[:, np.newaxis]

    return fraction
