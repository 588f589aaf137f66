"""The matrices of a beam as functions of its unknown options: coefficients of its elements and their derivatives."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import scipy  # loads a part of it when that is first used
from numpy.typing import NDArray

from dovetail import ScaledMatrices, SparseMatrices
from dovetail_plugins.timoshenko import (
    CrossSection,
    Element,
    Material,
    Remembered,
    Section,
    circle,
    circle_rates,
    rectangle,
    rectangle_rates,
    unit_chains,
)

_SHAPES = {True: (circle, circle_rates), False: (rectangle, rectangle_rates)}
"""Properties of a section and their derivatives, by whether it is round."""


@dataclass(frozen=True, eq=False)
class _Numbers:
    """A number for each different element, linear in the options.

    Parameters
    ----------
    offset : (n_elements,) array
    slopes : (n_elements, p) array
    """

    offset: NDArray[np.float64]
    slopes: NDArray[np.float64]

    def at(self, options: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the numbers (n, n_elements) for options (n, p)."""
        values = np.repeat(self.offset[np.newaxis], len(options), axis=0)
        for column in np.flatnonzero(self.slopes.any(axis=0)):
            values += options[:, column, np.newaxis] * self.slopes[:, column]
        return values


class ScaledBeam:
    """A chain of elements by some options of its material and its sections.

    Equal elements are evaluated once, and sections without unknown dimensions not at all.

    Parameters
    ----------
    material : Material
    sections : sequence of Section
    options : sequence of str
        By their path in the beam's section of a description.
    """

    def __init__(self, material: Material, sections: Sequence[Section], options: Sequence[str]) -> None:
        self._material, self._options = material, tuple(options)
        count = sum(section.elements for section in sections)
        self._size = 2 * (count + 1)
        first = np.cumsum([0, *(section.elements for section in sections)]).tolist()
        every = [(number, section, first[number]) for number, section in enumerate(sections)]
        every.sort(key=lambda entry: entry[1].outer is None)  # round ones first
        self._varying = [entry for entry in every if self._varies(entry[0])]
        self._known = [entry for entry in every if not self._varies(entry[0])]

    def _varies(self, number: int) -> bool:
        dimensions = any(option.startswith(f"sections.{number}.") for option in self._options)
        return dimensions or "material.poisson" in self._options

    @cached_property
    def _geometric(self) -> NDArray[np.intp]:
        """Columns of the options that change the elements for a modulus and a density of one."""
        columns = [k for k, option in enumerate(self._options) if option.startswith(("sections.", "material.poisson"))]
        return np.array(columns, dtype=np.intp)

    def _property(self, name: str, options: NDArray[np.float64]) -> Any:
        """Return a property of the material for options (n, p): (n, 1), or a number if it is known."""
        place = f"material.{name}"
        if place in self._options:
            return options[:, self._options.index(place), np.newaxis]
        return np.asarray(getattr(self._material, name), dtype=np.float64)

    @property
    def scaled_matrices(self) -> ScaledMatrices:
        """The matrices of each coefficient, and the coefficients as functions of the options."""
        stiffness, mass = self._unit_matrices
        none = scipy.sparse.csc_array((self._size, self._size))
        if "material.loss_factor" in self._options:
            bent = [SparseMatrices(none, K) for K in stiffness]
            damped = [SparseMatrices(none, none, D=K) for K in stiffness]
        else:
            bent, damped = [SparseMatrices(none, K, D=self._material.loss_factor * K) for K in stiffness], []
        return ScaledMatrices([*bent, *(SparseMatrices(M, none) for M in mass), *damped], self._factors, self._slopes)

    @cached_property
    def _unit_matrices(self) -> tuple[list[Any], list[Any]]:
        """The matrices K and M of each coefficient; first those of all known sections, over modulus and density."""
        stiffness, mass = [], []
        for _, section, first in self._varying:
            for elements in _equal_elements(section, first):
                chains = unit_chains(self._size, elements)
                stiffness += chains[0]
                mass += chains[1]
        if self._known:
            numbers = {name: _numbers(self._known, name, ()) for name in ("length", "one", "other")}
            values = {name: number.at(np.empty((1, 0))) for name, number in numbers.items()}
            element = self._element(self._known, values, [np.asarray(self._material.poisson), 1.0, 1.0])
            groups = [elements for _, section, first in self._known for elements in _equal_elements(section, first)]
            whole = [0.0, 0.0]
            for group, elements in enumerate(groups):
                chains = unit_chains(self._size, elements)
                for place, values in enumerate((element.stiffness[0, group], element.mass[0, group])):
                    whole[place] += sum(
                        float(value) * chain for value, chain in zip(values, chains[place], strict=True)
                    )
            stiffness, mass = [whole[0], *stiffness], [whole[1], *mass]
        return stiffness, mass

    @cached_property
    def _numbers(self) -> Mapping[str, _Numbers]:
        """Length and both sides of the different elements that vary, by the geometric options."""
        options = [self._options[column] for column in self._geometric]
        return {name: _numbers(self._varying, name, options) for name in ("length", "one", "other")}

    @staticmethod
    def _round(sections: Sequence[tuple[int, Section, int]]) -> dict[bool, slice]:
        """Return which of the different elements of some sections are round and which are not."""
        round_ones = sum(len(_equal_elements(s, 0)) for _, s, _ in sections if s.outer is not None)
        every = sum(len(_equal_elements(s, 0)) for _, s, _ in sections)
        kinds = {True: slice(0, round_ones), False: slice(round_ones, every)}
        return {kind: part for kind, part in kinds.items() if part.start < part.stop}

    def _element(
        self, sections: Sequence[tuple[int, Section, int]], values: Mapping[str, Any], material: Sequence[Any]
    ) -> Element:
        """Return the different elements (n, n_elements) of some sections, with their lengths and sides."""
        properties = [
            _SHAPES[kind][0](values["one"][:, part], values["other"][:, part], material[0])
            for kind, part in self._round(sections).items()
        ]
        return Element(values["length"], _joined(properties), *material)

    @cached_property
    def _evaluated(self) -> Remembered[tuple[dict[str, NDArray[np.float64]], Element]]:
        """Lengths and sides of the different elements that vary, and these elements, for options (n, p)."""
        return Remembered(self._evaluate)

    def _evaluate(self, options: NDArray[np.float64]) -> tuple[dict[str, NDArray[np.float64]], Element]:
        values = {name: numbers.at(options[:, self._geometric]) for name, numbers in self._numbers.items()}
        material = [self._property(name, options) for name in ("poisson", "young", "density")]
        return values, self._element(self._varying, values, material)

    def _coefficients(self, options: NDArray[np.float64]) -> list[NDArray[np.float64]]:
        """Return the coefficients of K and of M, (n, n_coefficients) each."""
        count, coefficients = len(options), list[list[NDArray[np.float64]]]([[], []])
        if self._known:
            for place, name in enumerate(("young", "density")):
                coefficients[place].append(np.broadcast_to(self._property(name, options), (count, 1)))
        if self._varying:
            element = self._evaluated(options)[1]
            coefficients[0].append(element.stiffness.reshape(count, -1))
            coefficients[1].append(element.mass.reshape(count, -1))
        return [np.concatenate(each, axis=1) for each in coefficients]

    def _coefficient_slopes(self, options: NDArray[np.float64]) -> list[NDArray[np.float64]]:
        """Return their derivatives (n, n_coefficients, n_geometric) by the geometric options."""
        count, geometric = len(options), len(self._geometric)
        known = [np.zeros((count, 1, geometric))] if self._known else []
        if not self._varying:
            return [known[0], known[0]]
        values, element = self._evaluated(options)
        turned = np.array([self._options[column] == "material.poisson" for column in self._geometric], dtype=np.float64)
        rates = [
            _SHAPES[kind][1](values["one"][:, part], values["other"][:, part], element.poisson)
            for kind, part in self._round(self._varying).items()
        ]
        weights = (self._numbers["one"].slopes, self._numbers["other"].slopes, turned)
        by = [_joined(each) for each in zip(*rates, strict=True)]
        section = CrossSection(
            *(
                sum(getattr(rate, name)[..., np.newaxis] * weight for rate, weight in zip(by, weights, strict=True))
                for name in ("area", "inertia", "shear")
            )
        )
        flat = element.slopes(self._numbers["length"].slopes, section, turned)
        return [np.concatenate([*known, each.reshape(count, -1, geometric)], axis=1) for each in flat]

    def _factors(self, options: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the factors (n, m) of the matrices for options (n, p)."""
        factors = self._coefficients(options)
        if "material.loss_factor" in self._options:
            factors.append(self._property("loss_factor", options) * factors[0])
        return np.concatenate(factors, axis=1)

    def _slopes(self, options: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the derivatives (n, m, p) of the factors."""
        coefficients, blocks = self._coefficients(options), []
        for name, values, change in zip(
            ("young", "density"), coefficients, self._coefficient_slopes(options), strict=True
        ):
            slopes = np.zeros((*values.shape, len(self._options)))
            slopes[..., self._geometric] = change
            if f"material.{name}" in self._options:
                slopes[..., self._options.index(f"material.{name}")] = values / self._property(name, options)
            blocks.append(slopes)
        if "material.loss_factor" in self._options:
            damped = self._property("loss_factor", options)[..., np.newaxis] * blocks[0]
            damped[..., self._options.index("material.loss_factor")] = coefficients[0]
            blocks.append(damped)
        return np.concatenate(blocks, axis=1)


def _equal_elements(section: Section, first: int) -> list[range]:
    """Return the elements of a section in groups of equal ones; those of a tapered section all differ."""
    if section.outer_end is None and section.inner_end is None:
        return [range(first, first + section.elements)]
    return [range(number, number + 1) for number in range(first, first + section.elements)]


def _weights(section: Section, name: str) -> dict[str, NDArray[np.float64]]:
    """Return with which weights options of a section add up to the length or a side of its different elements."""
    count = len(_equal_elements(section, 0))
    if name == "length":
        return {"length": np.full(count, 1.0 / section.elements)}
    if section.outer is None:
        return {{"one": "width", "other": "height"}[name]: np.ones(count)}
    side = {"one": "outer", "other": "inner"}[name]
    if getattr(section, f"{side}_end") is None:
        return {side: np.ones(count)}
    along = (np.arange(count) + 0.5) / count
    return {side: 1.0 - along, f"{side}_end": along}


def _numbers(sections: Sequence[tuple[int, Section, int]], name: str, options: Sequence[str]) -> _Numbers:
    """Return the length or a side of the different elements of some sections as linear in some options."""
    offsets, slopes = [np.zeros(0)], [np.zeros((0, len(options)))]
    for number, section, _ in sections:
        weights = _weights(section, name)
        count = len(next(iter(weights.values())))
        offset, slope = np.zeros(count), np.zeros((count, len(options)))
        for field, weight in weights.items():
            place = f"sections.{number}.{field}"
            if place in options:
                slope[:, options.index(place)] = weight
            else:
                offset += weight * getattr(section, field)
        offsets.append(offset)
        slopes.append(slope)
    return _Numbers(np.concatenate(offsets), np.concatenate(slopes))


def _joined(sections: Sequence[CrossSection]) -> CrossSection:
    if len(sections) == 1:
        return sections[0]
    names = ("area", "inertia", "shear")
    return CrossSection(*(np.concatenate([getattr(each, name) for each in sections], axis=1) for name in names))
