"""The identified joint in another assembly."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from dovetail.assembly import Assembly
from dovetail.errors import Fault, ParameterError, listing
from dovetail.frf import Frf
from dovetail.identification.reconstruction import sought
from dovetail.identification.result import Identification

__all__ = ["joint_values", "predict"]


def predict(assembly: Assembly, result: Identification | Mapping[str, float]) -> Frf:
    """Predict the FRF of an assembly with a joint that was identified in another.

    Parameters
    ----------
    assembly : Assembly
        Another tool, say, in the same holder and joint. What its description fixes stays as it is.
    result : Identification or mapping of str to float
        The identified joint; or SI values by name, bare or as ``joint.parameter``.

    Returns
    -------
    Frf
        In the quantity and on the frequencies of `assembly`, at the first of its responses; ``assembly.at(1)`` in its
        place gives the FRF at the second.

    Raises
    ------
    ParameterError
        The assembly seeks a parameter that `result` does not hold, or holds in another unit.

    Notes
    -----
    A parameter is matched by joint and name; failing that by its name alone, if only one joint on either side has it.
    Parameters that the identified assembly's description fixed belong to the joint and go with it.
    """
    values = joint_values(assembly, result)
    response, label = assembly.description.response, f"{assembly.name}, predicted"
    return Frf(assembly.frequency, assembly.frf(values), response.quantity, label=label, rotation=response.rotation)


def joint_values(assembly: Assembly, result: Identification | Mapping[str, float]) -> dict[str, float]:
    """Return what an identified joint gives for the parameters that an assembly seeks.

    Parameters
    ----------
    assembly, result
        As in `predict`.

    Returns
    -------
    dict of str to float
        SI values by the names of ``assembly.parameters``.

    Raises
    ------
    ParameterError
        As in `predict`.
    """
    values = _values(result)
    names = sought(assembly)
    matched: dict[str, float] = {}
    faults, missing = [], []
    for parameter, (joint, name) in zip(assembly.parameters, names, strict=True):
        shared = sum(other == name for _, other in names) > 1
        value = _match(values, joint, name, shared)
        if value is None:
            missing.append(parameter.name)
        elif value.unit not in (None, parameter.unit):
            faults.append(
                Fault(f"parameter {parameter.name}", f"it was identified in {value.unit}.", f"{parameter.unit}")
            )
        else:
            matched[parameter.name] = value.value
    if missing:
        noun, them = ("parameter", "it") if len(missing) == 1 else ("parameters", "them")
        found = f"assembly '{assembly.name}' needs {them}, and the identification does not hold {them}."
        held = listing((str(value) for value in values), 20)
        where = f"{noun} {listing(missing, 20)}"
        faults.insert(0, Fault(where, found, held, f"Fix {them} in the description, or identify {them}."))
    if faults:
        raise ParameterError(*faults)
    return matched


@dataclass(frozen=True)
class _Value:
    joint: str | None
    name: str
    value: float
    unit: str | None = None

    def __str__(self) -> str:
        return f"{self.joint}.{self.name}" if self.joint else self.name


def _values(result: Identification | Mapping[str, float]) -> list[_Value]:
    if not isinstance(result, Identification):
        return [_Value(*_parted(name), float(value)) for name, value in result.items()]
    identified = [_Value(p.joint, _parted(p.name)[1], p.value, p.unit) for p in result.parameters.values()]
    return identified + [_Value(*_parted(name), value) for name, value in result.known.items()]


def _parted(name: str) -> tuple[str | None, str]:
    joint, dot, bare = name.rpartition(".")
    return (joint if dot else None), bare


def _match(values: list[_Value], joint: str, name: str, shared: bool) -> _Value | None:
    """Return the value for a joint's parameter; `shared` says that several joints sought have one of this name."""
    alike = [value for value in values if value.name == name]
    exact = [value for value in alike if value.joint == joint]
    if exact:
        return exact[0]
    return alike[0] if len(alike) == 1 and not shared else None
