"""How the joint of another assembly differs from the joint as it was identified."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from typing import Any

from pydantic import BaseModel, ValidationError

from dovetail.assembly import Assembly
from dovetail.errors import Fault
from dovetail.identification.result import Identification
from dovetail.interfaces import JointModel
from dovetail.units import format_quantity, to_si

_KEYS = ("model", "connect", "parameters", "structural_damping", "axes")
"""Keys of a joint that are not options of its model."""
_SAME = 1e-6
"""Relative difference of two values that is rounding."""


def joint_faults(assembly: Assembly, result: Identification, sources: Mapping[str, str | None]) -> Iterator[Fault]:
    """Yield a fault for each joint or response for which the identified parameters mean something else.

    Parameters
    ----------
    assembly : Assembly
    result : Identification
    sources : mapping of str to str or None
        The identified joint from which each owner of parameters takes its values.
    """
    for name, model, section in _pairs(assembly, result, sources):
        before = section["model"].rpartition(":")[2]
        if before != model.name:
            problem = f"it is a '{model.name}' here, and the joint was identified as a '{before}'."
            yield Fault(f"joint {name}", problem, remedy="Describe the joint by the same model, or identify this one.")
            continue
        described = section.get("structural_damping")
        damping = None if described is None else to_si(described, "Hz")
        if assembly.description.joints[name].structural_damping != damping:
            kinds = [
                "none" if at is None else f"{at:g} Hz"
                for at in (damping, assembly.description.joints[name].structural_damping)
            ]
            problem = f"its structural damping was {kinds[0]} where it was identified, and is {kinds[1]} here."
            yield Fault(f"joint {name}", problem, remedy="State the same 'structural_damping' here.")
    yield from _exchanged_responses(assembly, result, sources)


def joint_warnings(assembly: Assembly, result: Identification, sources: Mapping[str, str | None]) -> Iterator[str]:
    """Yield a sentence for each option and each known value in which a joint differs from the identified one."""
    for name, model, section in _pairs(assembly, result, sources):
        if section["model"].rpartition(":")[2] != model.name:
            continue
        used, before = _options(model.config), _options_of_section(model, section)
        options = sorted({*used, *before} - {*model.free_options}) if before else []
        differing = [each for each in options if not _equal(used.get(each), before.get(each))]
        if differing:
            texts = "; ".join(f"{each} is {used.get(each)} here, and was {before.get(each)}" for each in differing)
            yield f"joint {name}: {texts} where it was identified. The identified values are those of the latter."
        known = {**{f"{p.joint}.{p.bare_name}": p.value for p in result.parameters.values()}, **result.known}
        units = {parameter.name: parameter.unit for parameter in model.parameters}
        for parameter, value in assembly.description.joints[name].fixed.items():
            identified = known.get(f"{sources[name]}.{parameter}")
            if identified is not None and not math.isclose(value, identified, rel_tol=_SAME):
                now, then = (format_quantity(each, units[parameter]) for each in (value, identified))
                yield f"joint {name}: {parameter} is {now} here, and was {then} where it was identified."


def _pairs(
    assembly: Assembly, result: Identification, sources: Mapping[str, str | None]
) -> Iterator[tuple[str, JointModel, Mapping[str, Any]]]:
    """Yield name and model of each joint here, and its section where it was identified."""
    described = json.loads(result.provenance.get("description", "{}")).get("joints") or {}
    for name, source in sources.items():
        if name in assembly.description.joints and source in described:
            yield name, assembly.description.joints[name].connection.model, described[source]


def _options(config: BaseModel) -> dict[str, Any]:
    """Return all options, those of sections by ``section.option``."""
    flat: dict[str, Any] = {}
    for name, value in config:
        inner = {f"{name}.{key}": each for key, each in _options(value).items()} if isinstance(value, BaseModel) else {}
        flat |= inner or {name: value}
    return flat


def _options_of_section(model: JointModel, section: Mapping[str, Any]) -> dict[str, Any]:
    """Return the options in a joint's section; none if another version of the model wrote it."""
    own = {key: value for key, value in section.items() if key not in _KEYS or key in type(model.config).model_fields}
    own.pop("model", None)
    try:
        return _options(type(model.config).model_validate(own))
    except ValidationError:
        return {}


def _equal(one: Any, other: Any) -> bool:
    if isinstance(one, float) and isinstance(other, float):
        return math.isclose(one, other, rel_tol=_SAME)
    return bool(one == other)


def _exchanged_responses(
    assembly: Assembly, result: Identification, sources: Mapping[str, str | None]
) -> Iterator[Fault]:
    """Yield a fault for each response whose chain was identified at the point of another one."""
    before, now = [result.point, *(at.point for at in result.further)], assembly.description.response_labels
    names = [response.name for response in assembly.description.responses]
    for name in {*sources} & {*names} if len(before) > 1 else ():
        number = names.index(name)
        if number < len(before) and now[number] != before[number] and now[number] in before:
            problem = f"it is at {now[number]} here, and its measurement chain was identified at {before[number]}."
            yield Fault(f"response {name}", problem, remedy="List the responses in the order of the identification.")
