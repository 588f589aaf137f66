"""Checks of units: a component described in other units of length, mass and time has the same physics."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import chain, repeat
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.interfaces import option_schema
from dovetail.testing.answers import PARTS
from dovetail.testing.linear_algebra import condensed, unit_free
from dovetail.testing.outcomes import Nonconformity, NotApplicable, Reservation
from dovetail.testing.specimen import Specimen
from dovetail.testing.specimens import FREQUENCY, WIDE, JointSpecimen, SubstructureSpecimen, specimen_of
from dovetail.units import dimension


@dataclass(frozen=True)
class Settings:
    """How units are checked.

    Attributes
    ----------
    factor : float
        Of the unit of length, of mass or of time; near 1, so that options stay within their limits.
    wrong : float
        Difference, relative to the diagonal, above which it is not due to rounding.
    vectors : int
        Number of parameter vectors, near the middle of the ranges.
    pure : tuple of float
        Factors with which a parameter may directly be an entry, such as half of a mass on each of two nodes.
    """

    factor: float = 1.07
    wrong: float = 1e-7
    vectors: int = 8
    pure: tuple[float, ...] = (1.0, 0.5, 1 / 3, 0.25, 2.0, 3.0, 4.0)


SETTINGS = Settings()
_ENTRY = {"M": "kg", "K": "N/m", "C": "N s/m", "D": "N/m"}
"""Unit of an entry between two displacements; each rotation multiplies it by a length."""
_DIMENSIONS = ("length", "mass", "time")


def check_units_agree_with_the_matrices(specimen: Specimen) -> None:
    """In other units of length, mass and time, options and parameters give the same matrices in those units."""
    schema = option_schema(type(specimen.component.config))
    known = isinstance(specimen, JointSpecimen) and bool(specimen.component.parameters)
    broken, looked = [], False
    for name in _DIMENSIONS:
        options = specimen.component.config.model_dump(mode="json", by_alias=True)
        rescaled = _rescaled(options, schema, schema.get("$defs", {}), name)
        if rescaled == options and not known:
            continue
        itself = specimen_of(specimen.model, specimen.options)
        before = _port_dynamics(itself, "")
        try:
            other = specimen_of(specimen.model, rescaled)
        except Exception:  # limits of options may forbid it
            continue
        looked = True
        if not _agree(itself, before, _port_dynamics(other, name), name):
            broken.append(name)
    if not looked:
        raise NotApplicable("no option has a unit, or options with units cannot be changed.")
    if isinstance(specimen, JointSpecimen) and broken:
        _check_parameter_units(specimen)
    if broken:
        problem = f"in another unit of {' or '.join(broken)} its physics changes: a unit is wrong or missing."
        remedy = 'Give constants as options with their units, by dovetail.InUnit("m"), and check those of parameters.'
        raise Reservation(problem, remedy)


def _port_dynamics(specimen: Specimen, name: str) -> NDArray[np.complex128]:
    """Return a joint's dynamic stiffness at its ports, or a part's receptance, in the changed unit."""
    if isinstance(specimen, SubstructureSpecimen):
        if not specimen.has_receptance:
            raise NotApplicable("the uncoupled part has no receptance.")
        lines = FREQUENCY * _factor("Hz", name)
        return np.array(specimen.component.receptance(lines, list(specimen.dofs)))
    assert isinstance(specimen, JointSpecimen)
    parameters = specimen.component.parameters
    fractions = np.random.default_rng(0).uniform(0.35, 0.65, (SETTINGS.vectors, len(parameters)))
    theta = specimen.vectors(fractions) * np.array([_factor(parameter.unit, name) for parameter in parameters])
    on_ports = specimen.component.size - specimen.component.internal_dofs
    return condensed(specimen.stiffness(WIDE * _factor("Hz", name), theta), on_ports)


def _agree(specimen: Specimen, before: NDArray[np.complex128], after: NDArray[np.complex128], name: str) -> bool:
    """Compare the result in the changed unit with the converted result in the original unit."""
    dofs = np.array(specimen.dofs if isinstance(specimen, SubstructureSpecimen) else range(before.shape[-1]))
    assert isinstance(specimen, (SubstructureSpecimen, JointSpecimen))
    rotations = specimen.component.node_dofs.rotations[dofs].astype(np.intp)
    stiffness = _factor("N/m", name) * _factor("m", name) ** np.add.outer(rotations, rotations)
    converted = before * (1.0 / stiffness if isinstance(specimen, SubstructureSpecimen) else stiffness)
    scale = np.abs(np.diagonal(converted, axis1=-2, axis2=-1))
    return bool(np.abs(unit_free(after - converted, scale)).max(initial=0.0) <= SETTINGS.wrong)


def _check_parameter_units(specimen: JointSpecimen) -> None:
    """Look for a parameter that is an entry of a matrix, perhaps times a simple fraction, but has another unit."""
    component = specimen.component
    on_ports = component.size - component.internal_dofs
    jacobian = component.matrices_jacobian(specimen.some(2).copy())
    for parameter, derivative in zip(component.parameters, jacobian, strict=True):
        units: dict[str, tuple[str, int]] = {}
        for part, unit in _ENTRY.items():
            slopes = np.diagonal(getattr(derivative, part), axis1=1, axis2=2)[:, :on_ports]
            pure = np.isclose(np.abs(slopes)[..., None], SETTINGS.pure, rtol=1e-9, atol=0.0).any(axis=(-1)).all(axis=0)
            for dof in np.flatnonzero(pure).tolist():
                units[f"{unit} m^2" if component.node_dofs.rotations[dof] else unit] = (PARTS[part], dof)
        if units and not any(dimension(unit) == dimension(parameter.unit) for unit in units):
            wanted, (noun, at) = next(iter(units.items()))
            problem = f"'{parameter.name}' in {parameter.unit} is entry ({at}, {at}) of the {noun} matrix, in {wanted}."
            raise Nonconformity(problem, f"Give the parameter the unit {wanted}, or the entry its missing factor.")


def _rescaled(value: Any, entry: Mapping[str, Any], definitions: Mapping[str, Any], name: str) -> Any:
    """Return options in which all numbers with units are converted to the changed unit."""
    if "$ref" in entry:
        entry = definitions[entry["$ref"].rpartition("/")[2]]
    if "x-unit" in entry and isinstance(value, (int, float)):
        return value * _factor(entry["x-unit"], name)
    if isinstance(value, dict):
        properties, others = entry.get("properties", {}), entry.get("additionalProperties")
        inner = {key: properties.get(key, others if isinstance(others, dict) else {}) for key in value}
        value = {key: _rescaled(member, inner[key], definitions, name) for key, member in value.items()}
    if isinstance(value, list):
        each = chain(entry.get("prefixItems", ()), repeat(entry.get("items", {})))
        value = [_rescaled(member, inside, definitions, name) for member, inside in zip(value, each, strict=False)]
    for choice in (*entry.get("anyOf", ()), *entry.get("allOf", ())):
        if (changed := _rescaled(value, choice, definitions, name)) != value:
            return changed
    return value


def _factor(unit: str, name: str) -> float:
    """Return the factor of a number with a unit when the unit of length, mass or time is changed."""
    return float(SETTINGS.factor ** dimension(unit)[1].get(name, 0.0))
