"""A model as plain values: options from its Config, a joint's parameters and ports."""

from __future__ import annotations

import inspect
from collections.abc import Iterator, Mapping
from dataclasses import asdict
from typing import Any

from dovetail.errors import Fault, PluginError
from dovetail.interfaces import KINDS, JointModel, Law, option_schema, parameter_faults, port_faults, source_file
from dovetail.registry.catalogue import Offer, Registry, create_with_defaults
from dovetail.units import format_quantity

_DEEPEST = 8
"""Largest depth of options that are listed; a Config that contains itself has no end."""


def list_models(registry: Registry) -> dict[str, Any]:
    """Return all models by kind, what could not be loaded, what is slow and what is offered twice, as plain values."""
    return {
        "components": [
            {
                "kind": offer.component.kind,
                "name": offer.component.name,
                "summary": offer.component.summary,
                "source": offer.source,
            }
            for kind in KINDS
            for offer in registry.offers(kind)
        ],
        "failures": [{"source": failure.source, "reason": failure.reason} for failure in registry.failures],
        "slow": registry.slow,
        "conflicts": [
            {"kind": kind, "name": name, "sources": list(sources)}
            for (kind, name), sources in registry.conflicts.items()
        ],
    }


def as_plain(entry: dict[str, Any]) -> dict[str, Any]:
    """Return what `describe_offer` returns with plain values throughout."""
    listed = {name: entry[name] for name in ("parameters", "ports") if entry.get(name) is not None}
    return {**entry, **{name: [asdict(item) for item in items] for name, items in listed.items()}}


def describe_offer(offer: Offer) -> dict[str, Any]:
    """Return a model's summary, references, options and, for a joint, parameters and ports.

    Parameters
    ----------
    offer : Offer

    Returns
    -------
    dict
        Plain values, and the joint's ``parameters`` and ``ports`` themselves, or None if they depend on options without
        a default; ``valid_for`` states the options for which they are valid, if not for all.

    Raises
    ------
    PluginError
        The joint's parameters or ports are invalid.
    """
    component = offer.component
    described: dict[str, Any] = {
        "kind": component.kind,
        "name": component.name,
        "source": offer.source,
        "summary": component.summary,
        "references": list(component.references),
        "options": list(_options(component.Config)),
    }
    if issubclass(component, JointModel):
        joint = _joint(component)
        _check(offer, joint)
        described |= joint
    if issubclass(component, Law):
        described["unknowns"] = [asdict(unknown) for unknown in _law(offer).unknowns]
    return described


def _law(offer: Offer) -> Law:
    law = create_with_defaults(offer)
    assert isinstance(law, Law)
    return law


def _check(offer: Offer, joint: Mapping[str, Any]) -> None:
    """Raise an error if the declarations of a joint are invalid."""
    faults = []
    for name, faults_of in (("parameters", parameter_faults), ("ports", port_faults)):
        if joint[name] is not None:
            faults += faults_of(joint[name])
    label = f"joint model '{offer.component.name}'"
    if faults:
        remedy = f"Correct it in {source_file(offer.component)}."
        raise PluginError(*(Fault(offer.source, f"{label} {f.problem}", f.accepted, remedy) for f in faults))


def _joint(model: type[JointModel]) -> dict[str, Any]:
    fixed = {name: _class_attribute(model, name) for name in ("parameters", "ports")}
    valid_for = ""
    if None in fixed.values():
        try:  # options without a default may not matter for them
            default = model(model.Config.model_construct())
            fixed = {"parameters": default.parameters, "ports": default.ports}
            valid_for = "with the default options"
        except Exception:  # they do, or it is a stranger's own objection
            pass
    return {**fixed, "valid_for": valid_for}


def _class_attribute(model: type[JointModel], name: str) -> Any:
    """Return an attribute that is the same for every Config, or None if it is computed."""
    value = inspect.getattr_static(model, name)
    return value if isinstance(value, tuple) else None


def _options(config: Any) -> Iterator[dict[str, Any]]:
    try:
        schema = option_schema(config)
    except Exception:  # options of a type that JSON does not know
        for name, field in config.model_fields.items():
            text = getattr(field.annotation, "__name__", str(field.annotation))
            required = field.is_required()
            yield _row(name, text, "", "required" if required else str(field.default), field.description or "")
        return
    yield from _walk(schema, schema.get("$defs", {}), "", 0)


def _walk(
    schema: Mapping[str, Any], definitions: Mapping[str, Any], prefix: str, depth: int
) -> Iterator[dict[str, Any]]:
    for name, entry in schema.get("properties", {}).items():
        whole = f"{prefix}{name}"
        choice, optional = _without_null(_resolved(entry, definitions))
        plain = _resolved(choice, definitions)
        inner, inner_prefix = plain, f"{whole}."
        if plain.get("type") == "array" and isinstance(plain.get("items"), dict):
            inner, inner_prefix = _resolved(plain["items"], definitions), f"{whole}[]."
        elif plain.get("type") == "object" and isinstance(plain.get("additionalProperties"), dict):
            inner, inner_prefix = _resolved(plain["additionalProperties"], definitions), f"{whole}.NAME."
        unit = plain.get("x-unit", "")
        required = name in schema.get("required", ())
        default = "required" if required else _default(entry.get("default"), unit, optional)
        nested = "properties" in inner
        description = entry.get("description") or (_first_line(inner) if nested else "")
        yield _row(whole, _type_text(plain), unit, default, description)
        if nested and depth < _DEEPEST:
            yield from _walk(inner, definitions, inner_prefix, depth + 1)


def _row(name: str, kind: str, unit: str, default: str, description: str) -> dict[str, Any]:
    return {"name": name, "type": kind, "unit": unit, "default": default, "description": description}


def _resolved(entry: Mapping[str, Any], definitions: Mapping[str, Any]) -> Mapping[str, Any]:
    reference = entry.get("$ref")
    if reference is None and len(entry.get("allOf", ())) == 1:
        reference = entry["allOf"][0].get("$ref")
    return definitions[reference.rpartition("/")[2]] if reference else entry


def _without_null(entry: Mapping[str, Any]) -> tuple[Mapping[str, Any], bool]:
    """Return an entry without the alternative null, and whether it had this alternative."""
    choices = entry.get("anyOf", ())
    filled = [choice for choice in choices if choice.get("type") != "null"]
    if len(filled) == len(choices):
        return entry, False
    return (filled[0] if len(filled) == 1 else {**entry, "anyOf": filled}), True


def _type_text(entry: Mapping[str, Any]) -> str:
    if "x-unit" in entry and "anyOf" in entry:
        return _type_text(entry["anyOf"][0])
    if "enum" in entry:
        return " | ".join(str(choice) for choice in entry["enum"])
    if "const" in entry:
        return str(entry["const"])
    if "anyOf" in entry:
        return " or ".join(_type_text(choice) for choice in entry["anyOf"])
    if "prefixItems" in entry:
        return f"list of {len(entry['prefixItems'])}: {_type_text(entry['prefixItems'][0])}"
    name = entry.get("type", "any")
    if name == "array":
        fewest = entry.get("minItems", 0)
        return f"list of {fewest} or more" if fewest else "list"
    spelled = {"object": "mapping", "string": "text", "boolean": "true | false"}.get(name, name)
    return f"{spelled} {_bounds(entry)}".rstrip()


def _bounds(entry: Mapping[str, Any]) -> str:
    """Write bounds as ``> 0`` or, if there are two, as the interval ``[0, 0.5)``."""
    low, high = entry.get("exclusiveMinimum", entry.get("minimum")), entry.get("exclusiveMaximum", entry.get("maximum"))
    open_low, open_high = "exclusiveMinimum" in entry, "exclusiveMaximum" in entry
    if low is not None and high is not None:
        return f"{'(' if open_low else '['}{low:g}, {high:g}{')' if open_high else ']'}"
    if low is not None:
        return f"{'>' if open_low else '>='} {low:g}"
    return "" if high is None else f"{'<' if open_high else '<='} {high:g}"


def _default(value: Any, unit: str, optional: bool) -> str:
    if value is None:
        return "none" if optional else ""
    if unit and isinstance(value, (int, float)) and not isinstance(value, bool):
        return format_quantity(value, unit)
    return str(value)


def _first_line(schema: Mapping[str, Any]) -> str:
    return str(schema.get("description", "")).partition("\n")[0]
