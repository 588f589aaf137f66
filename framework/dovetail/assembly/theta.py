"""Parameter values in every form that functions take: arrays, mappings, identified parameters and whole results."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Protocol, TypeAlias, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from dovetail.errors import Fault, ParameterError, UnitError, listing
from dovetail.interfaces import Parameter
from dovetail.units import to_si


@runtime_checkable
class IdentifiedValue(Protocol):
    """The value of a parameter, such as an `IdentifiedParameter`."""

    @property
    def value(self) -> float:
        """SI."""
        ...

    @property
    def unit(self) -> str:
        """The SI unit."""
        ...

    @property
    def joint(self) -> str:
        """The joint, substructure or response that has the parameter."""
        ...


@runtime_checkable
class HoldsParameters(Protocol):
    """What holds identified parameters by their names, such as an `Identification`."""

    @property
    def parameters(self) -> Mapping[str, IdentifiedValue]:
        """By name."""
        ...


Theta: TypeAlias = ArrayLike | Mapping[str, float | str] | Mapping[str, IdentifiedValue] | HoldsParameters | None
"""Parameter values: a vector, a batch, a mapping of names to values, the result of an identification, or None.

The values of a mapping are numbers in SI, texts with units, or identified parameters. Parameters that a mapping of
numbers or texts does not name take the middle of their ranges, and so do all of them for None. A result, or a mapping
of identified parameters alone, must hold every parameter."""


def are_identified(values: Mapping[str, object]) -> bool:
    """Return whether all values are those of an identification, which must be complete."""
    return bool(values) and all(isinstance(value, IdentifiedValue) for value in values.values())


def si_value(value: object, unit: str) -> float:
    """Return a number, a text with a unit or an identified parameter in SI.

    Raises
    ------
    UnitError
        It is none of them, or has another unit.
    """
    if isinstance(value, IdentifiedValue):
        if value.unit != unit:
            raise UnitError(f"it was identified in {value.unit}, and its unit is {unit} here.")
        value = value.value
    return to_si(value.item() if isinstance(value, np.generic) else value, unit)


def values_by_name(
    theta: Mapping[str, object],
    parameters: Sequence[Parameter],
    aliases: Mapping[str, str],
    unknown: Callable[[str], Fault],
) -> dict[str, float]:
    """Return the SI values of a mapping by the names of the parameters, which may be given with their owners' names.

    Parameters
    ----------
    theta : mapping of str to value
    parameters : sequence of Parameter
    aliases : mapping of str to str
        The name of each parameter by its name with its owner.
    unknown : callable
        Returns what is wrong with a name that no parameter has.

    Raises
    ------
    ParameterError
        Unknown names, other units, negative values where the range is not; an identification lacks parameters.
    """
    faults, values = [], {}
    units = {parameter.name: parameter.unit for parameter in parameters}
    positive = {parameter.name for parameter in parameters if parameter.lower >= 0.0}
    for key, value in theta.items():
        with_owner = f"{value.joint}.{key}" if isinstance(value, IdentifiedValue) else key
        name = aliases.get(key, aliases.get(with_owner, key))
        if name not in units:
            faults.append(unknown(key))
            continue
        if name in values:
            faults.append(Fault(f"parameter {key}", "it is given with and without the name of its joint.", "once"))
            continue
        try:
            values[name] = si_value(value, units[name])
        except UnitError as error:
            faults.append(Fault(f"parameter {key}", error.faults[0].problem))
            continue
        if values[name] < 0.0 and name in positive:
            problem = f"it is {values[name]:g} {units[name]}, and its range in the description is not negative."
            faults.append(Fault(f"parameter {key}", problem))
    missing = [name for name in units if name not in values] if are_identified(theta) else []
    if missing and not faults:
        problem = f"the identified parameters lack {listing(missing)}."
        remedy = "For a joint in another assembly use 'dovetail.predict'; values by name leave others in the middle."
        faults.append(Fault("theta", problem, listing(units, 20), remedy))
    if faults:
        raise ParameterError(*faults)
    return values
