"""The JSON Schema of a description, with the options of every registered model, for completion in editors."""

from __future__ import annotations

import inspect
import tempfile
from collections.abc import Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from dovetail.description.calibration import CHAIN, SIGN
from dovetail.description.damping import DampingSection
from dovetail.description.oriented_joints import AxesSection
from dovetail.description.placed_parts import OrientationSection
from dovetail.description.sections import (
    FORMAT,
    AttachmentSection,
    DescriptionSection,
    ForceSection,
    FrequencySection,
    IdentificationSection,
    ParameterSection,
    ResponseSection,
    SensorSection,
)
from dovetail.description.study_section import StudySection
from dovetail.interfaces import (
    KINDS,
    Component,
    JointModel,
    JointPort,
    Kind,
    Parameter,
    SubstructureModel,
    option_schema,
)
from dovetail.registry import Offer, Registry
from dovetail.units import format_quantity

Schema = dict[str, Any]

_DIALECT = "https://json-schema.org/draft/2020-12/schema"
_PARTIAL = "+"
"""Suffix of a definition in which nothing is required, for a description that overrides another one."""
_NO_EXAMPLES = inspect.getattr_static(Component, "examples")
_QUANTITY: Schema = {"type": ["number", "string"]}


def description_schema(registry: Registry) -> Schema:
    """Return the JSON Schema of a description.

    Parameters
    ----------
    registry : Registry
        The models that a description may name.

    Returns
    -------
    dict
        A description with ``extends`` may omit what the other description states.

    Notes
    -----
    ``dovetail check`` tests what depends on another part of the description: that a position is a node, that a range
    is not empty. The keys at the top are repeated outside of `if` and `then`, since editors complete only those. If
    the parameters or ports of a joint depend on its options, the schema has those of its examples, or allows any if it
    has no examples.
    """
    definitions: dict[str, Schema] = {}
    sections = (FrequencySection, ForceSection, ResponseSection, SensorSection, AttachmentSection, ParameterSection)
    for model in (*sections, DampingSection, OrientationSection, AxesSection, IdentificationSection, StudySection):
        _define(definitions, model.__name__.removesuffix("Section").lower(), option_schema(model))
    _complete_sections(definitions)
    for kind in (kind for kind in KINDS if kind not in ("reader", "matrix_reader", "law")):  # no assembly names these
        for offer in registry.offers(kind):
            _define(definitions, f"{kind}.{offer.component.name}", _component_schema(offer))
        definitions[kind] = _choice(kind, registry.offers(kind))
    _name_options(definitions, registry)
    definitions["description"] = _description()
    partial = {f"{name}{_PARTIAL}": _without_required(definition) for name, definition in definitions.items()}
    return {
        "$schema": _DIALECT,
        "title": "Dovetail assembly description",
        "type": "object",
        "properties": partial[f"description{_PARTIAL}"]["properties"],
        "if": {"required": ["extends"]},
        "then": {"$ref": f"#/$defs/description{_PARTIAL}"},
        "else": {"$ref": "#/$defs/description"},
        "$defs": {**definitions, **partial},
    }


def _description() -> Schema:
    schema = option_schema(DescriptionSection)
    properties: Schema = {
        "dovetail": {"const": FORMAT},
        "extends": {"type": "string", "description": "Another description, which this one overrides key by key."},
        "name": {"type": ["string", "number"]},
        "frequency": {"anyOf": [{"$ref": "#/$defs/frequency"}, {"type": "array", "items": _QUANTITY, "minItems": 2}]},
        "substructures": {"type": "object", "additionalProperties": {"$ref": "#/$defs/substructure"}},
        "joints": {"type": "object", "additionalProperties": {"$ref": "#/$defs/joint"}},
        "response": {"anyOf": [{"$ref": "#/$defs/response"}, {"type": "null"}]},
        "responses": {"type": ["array", "null"], "items": {"$ref": "#/$defs/response"}, "minItems": 1},
        "calibration": {"$ref": "#/$defs/shared_calibration"},
        "identification": {"$ref": "#/$defs/identification"},
        "study": {"$ref": "#/$defs/study"},
    }
    for name, entry in properties.items():
        entry.setdefault("description", schema["properties"].get(name, {}).get("description", ""))
    required = [name for name in properties if name in schema["required"] and name != "response"]
    return {
        "type": "object",
        "properties": properties,
        "required": ["dovetail", *required],
        "anyOf": [{"required": ["response"]}, {"required": ["responses"]}],
        "dependentSchemas": {
            "response": {"anyOf": [{"properties": {key: {"type": "null"}}} for key in ("response", "responses")]}
        },
        "additionalProperties": False,
    }


def _complete_sections(definitions: dict[str, Schema]) -> None:
    """Add what the validators of the sections demand, which pydantic does not write into the schema."""
    position = definitions["attachment"]["properties"]["at"]
    position["anyOf"] = [position.pop("items"), {"type": "array", "items": _QUANTITY, "minItems": 1}]
    for key in ("type", "x-unit"):
        position.pop(key, None)
    parameter = definitions["parameter"]["properties"]
    parameter["range"] |= {"type": "array", "items": _QUANTITY, "minItems": 2, "maxItems": 2}
    parameter["value"] |= _QUANTITY
    for key in ("about", "sd"):
        parameter[key] |= _QUANTITY
    definitions["calibration"] = _calibration()
    places = {
        "type": "array",
        "items": {"$ref": "#/$defs/sensor"},
        "description": "Of sensors; those of the responses.",
    }
    properties = {**definitions["calibration"]["properties"], "at": places}
    definitions["shared_calibration"] = {**definitions["calibration"], "properties": properties}
    response = definitions["response"]["properties"]
    response["force"] = {**response["force"], "$ref": "#/$defs/force"}
    response["calibration"] = {**response["calibration"], "$ref": "#/$defs/calibration"}
    identification = definitions["identification"]["properties"]
    identification["reducer"]["$ref"] = "#/$defs/reducer"
    identification["regressor"]["$ref"] = "#/$defs/regressor"
    identification["method"]["$ref"] = "#/$defs/method"


def _name_options(definitions: dict[str, Schema], registry: Registry) -> None:
    """Restrict the options that a study may name to those of the registered models."""
    options = {"augmentation": set(definitions["identification.AugmentationSection"]["properties"])}
    for kind in ("reducer", "regressor"):
        schemas = (definitions[f"{kind}.{offer.component.name}"] for offer in registry.offers(kind))
        options[kind] = {name for schema in schemas for name in schema["properties"]} - {"model"}
    patterns = [rf"{kind}(\.({'|'.join(sorted(names))})(\.\w+)*)?" for kind, names in options.items()]
    for section, key in (("study", "sweeps"), ("study.SearchSection", "options")):
        definitions[section]["properties"][key]["propertyNames"] = {"pattern": f"^({'|'.join(patterns)})$"}


def _calibration() -> Schema:
    """Return the schema of a response's measurement chain."""
    sign = {"enum": [1, -1, "unknown"], "description": SIGN.description}
    known = {parameter.name: _parameter(parameter) for parameter in CHAIN}
    return {"type": "object", "properties": {**known, "sign": sign}, "additionalProperties": False}


def _choice(kind: Kind, offers: Iterable[Offer]) -> Schema:
    """Return the schema of a section that names a model, on which the other keys depend."""
    models = {offer.component.name: offer.qualified_name for offer in offers}
    if not models:
        return {"type": "object", "required": ["model"]}
    known = {"anyOf": [{"enum": sorted(models)}, {"pattern": "^[^:]+:[^:]+$"}], "description": f"Which {kind} model."}
    return {
        "type": "object",
        "properties": {"model": known},
        "required": ["model"],
        "allOf": [
            {
                "if": {"properties": {"model": {"enum": [name, models[name]]}}, "required": ["model"]},
                "then": {"$ref": f"#/$defs/{kind}.{name}"},
            }
            for name in sorted(models)
        ],
    }


def _component_schema(offer: Offer) -> Schema:
    component = offer.component
    try:
        schema = option_schema(component.Config)
    except Exception:  # options of a type that JSON does not know: the schema allows any
        schema = {"type": "object", "properties": {}, "additionalProperties": True}
    schema["title"] = f"{component.kind} {component.name}"
    schema["description"] = f"{component.summary} ({offer.source})"
    names = [component.name, offer.qualified_name]
    schema["properties"]["model"] = {"enum": names, "description": component.summary}
    schema.setdefault("required", []).append("model")
    if issubclass(component, SubstructureModel):
        schema |= {key: _with_unknowns(schema[key]) for key in ("properties", "$defs") if key in schema}
        schema["properties"] = _references(OrientationSection) | schema["properties"]
    if issubclass(component, JointModel):
        schema["properties"]["connect"] = _connect(component)
        schema["properties"]["parameters"] = _parameters(component)
        axes = {"$ref": "#/$defs/axes", "description": "Its axes, if they are not those of the assembly."}
        schema["properties"] = {**_references(DampingSection), "axes": axes, **schema["properties"]}
        schema["required"].append("connect")
    return schema


def _references(model: type[BaseModel]) -> Schema:
    """Return the properties of a section whose own sections are defined under its name."""
    schema, name = option_schema(model), model.__name__.removesuffix("Section").lower()
    references = {f"#/$defs/{key}": f"#/$defs/{name}.{key}" for key in schema.get("$defs", {})}
    properties: Schema = _redirect(schema["properties"], references)
    return properties


def _with_unknowns(node: Any) -> Any:
    """Return the schema of options in which each number may be a section that says what is known of it."""
    section = {"$ref": "#/$defs/parameter"}
    if isinstance(node, list):
        return [_with_unknowns(entry) for entry in node]
    if not isinstance(node, dict):
        return node
    if "x-unit" in node and "anyOf" in node:
        return {**node, "anyOf": [*node["anyOf"], section]}
    if node.get("type") == "number":
        about = {key: node[key] for key in ("title", "description", "default") if key in node}
        return {**about, "anyOf": [{key: value for key, value in node.items() if key not in about}, section]}
    return {key: _with_unknowns(value) for key, value in node.items()}


def _connect(model: type[JointModel]) -> Schema:
    ports, complete = _declared(model, "ports")
    static = inspect.getattr_static(model, "ports")
    return {
        "type": "object",
        "description": "Where each port attaches.",
        "properties": {port.name: {"$ref": "#/$defs/attachment"} for port in ports},
        "additionalProperties": False if complete else {"$ref": "#/$defs/attachment"},
        **({"required": [port.name for port in ports]} if isinstance(static, tuple) else {}),
    }


def _parameters(model: type[JointModel]) -> Schema:
    parameters, complete = _declared(model, "parameters")
    known = {parameter.name: _parameter(parameter) for parameter in parameters}
    entry = {"anyOf": [{"$ref": "#/$defs/parameter"}, _QUANTITY]}
    return {
        "type": "object",
        "description": "What is known of the parameters: ranges or values.",
        "properties": known,
        "additionalProperties": False if complete else entry,
    }


def _parameter(parameter: Parameter) -> Schema:
    low, high = (format_quantity(end, parameter.unit) for end in (parameter.lower, parameter.upper))
    text = f"{parameter.description} [{parameter.unit}]; {low} to {high}, {parameter.scale}".lstrip()
    return {
        "description": text,
        "x-unit": parameter.unit,
        "anyOf": [{"$ref": "#/$defs/parameter"}, _QUANTITY],
    }


def _declared(model: type[JointModel], name: str) -> tuple[tuple[Any, ...], bool]:
    """Return a joint's parameters or ports, and whether it can have no others.

    If they depend on options, those of its examples are returned; they are all if the joint defines examples.
    """
    value = inspect.getattr_static(model, name)
    if isinstance(value, tuple):
        return tuple(entry for entry in value if isinstance(entry, (Parameter, JointPort))), True
    by_name: dict[str, Any] = {}
    with tempfile.TemporaryDirectory() as folder, suppress(Exception):  # a plugin may raise anything
        for options in model.examples(Path(folder)):
            joint = model(model.Config.model_validate(dict(options)))
            by_name.update({entry.name: entry for entry in getattr(joint, name)})
        return tuple(by_name.values()), inspect.getattr_static(model, "examples") is not _NO_EXAMPLES
    return tuple(by_name.values()), False


def _define(definitions: dict[str, Schema], name: str, schema: Schema) -> None:
    """Add a schema of pydantic, and the definitions to which it refers, under names that begin with `name`."""
    inner = schema.pop("$defs", {})
    references = {f"#/$defs/{key}": f"#/$defs/{name}.{key}" for key in inner}
    definitions[name] = _redirect(_with_units(schema), references)
    for key, section in inner.items():
        definitions[f"{name}.{key}"] = _redirect(_with_units(section), references)


def _redirect(node: Any, references: Mapping[str, str]) -> Any:
    if isinstance(node, dict):
        return {
            key: references.get(value, value) if key == "$ref" else _redirect(value, references)
            for key, value in node.items()
        }
    return [_redirect(entry, references) for entry in node] if isinstance(node, list) else node


def _with_units(section: Schema) -> Schema:
    """Append the unit to the description of each option that has a unit and does not state it."""
    for entry in section.get("properties", {}).values():
        units = sorted(set(_units(entry)))
        text = entry.get("description", "")
        if units and not any(f"[{unit}]" in text for unit in units):
            entry["description"] = f"{text} [{', '.join(units)}]".lstrip()
    return section


def _units(node: Any) -> Iterable[str]:
    if isinstance(node, dict):
        if isinstance(node.get("x-unit"), str):
            yield node["x-unit"]
        node = list(node.values())
    if isinstance(node, list):
        for entry in node:
            yield from _units(entry)


def _without_required(definition: Schema) -> Schema:
    """Return a definition in which nothing is required; a section without a model must fit one of the models."""
    partial: Schema = _partial(definition)
    rules = partial.pop("allOf", ())
    if rules:
        has_model = {"required": ["model"]}
        partial["allOf"] = [{"if": {**rule["if"], **has_model}, "then": rule["then"]} for rule in rules]
        partial |= {"if": has_model, "else": {"anyOf": [rule["then"] for rule in rules]}}
    return partial


def _partial(node: Any) -> Any:
    if isinstance(node, dict):
        kept = {key: _partial(value) for key, value in node.items() if key != "required" or not isinstance(value, list)}
        if isinstance(kept.get("$ref"), str):
            kept["$ref"] += _PARTIAL
        return kept
    return [_partial(entry) for entry in node] if isinstance(node, list) else node
