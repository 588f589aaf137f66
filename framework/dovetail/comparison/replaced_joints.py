"""Assemblies with another model for one of their joints."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any, cast

from pydantic import ValidationError

from dovetail.assembly import Assembly, load
from dovetail.documents.extends import read_source
from dovetail.documents.fault_list import FaultList
from dovetail.documents.tree import plain_values
from dovetail.errors import DescriptionError, Fault, ParameterError, argument, did_you_mean, listing
from dovetail.interfaces import JointModel
from dovetail.registry import PluginPaths, components

_KEPT = ("structural_damping",)
"""Keys of a joint, in addition to the options that both models have, that another model keeps."""


def with_joint(
    path: str | os.PathLike[str], model: str, joint: str | None = None, plugins: PluginPaths = ()
) -> Assembly:
    """Return an assembly with another model for a joint, between the same nodes.

    Parameters
    ----------
    path : path
        Of the description.
    model : str
        With the options that it shares with the described model, and the parameters of the same name; the others have
        the ranges that the model gives them.
    joint : str, optional
        Needed if there are several joints.
    plugins : path or iterable of paths
        As in `dovetail.load`.

    Raises
    ------
    ParameterError
        There is no such joint or model, or the model does not fit between the same nodes.
    """
    faults = FaultList()
    _, root = read_source(path, faults)
    content: Any = plain_values(root)
    name = _joint_name(content.get("joints") or {}, joint)
    described = content["joints"][name]
    if described.get("model") == model:
        return load(path, plugins=plugins)
    registry = components(plugins)
    if "joint" not in registry.kinds_of(model):
        known = registry.names("joint")
        raise ParameterError(
            Fault("joints", f"there is no joint model '{model}'.", listing(known), did_you_mean(model, known))
        )
    component = registry.find("joint", model).component
    section = _section(described, component.Config.model_fields, model)
    try:
        made = cast("JointModel", component(component.Config(**_options(section))))
        section["connect"] = _connected(described.get("connect") or {}, made)
        wanted = {parameter.name for parameter in made.parameters}
        same = {key: value for key, value in (described.get("parameters") or {}).items() if key in wanted}
        return load(
            {"extends": os.path.abspath(path), "joints": {name: section | ({"parameters": same} if same else {})}},
            plugins=plugins,
        )
    except (DescriptionError, ValueError) as error:
        reason = _reason(error)
        remedy = f"Describe the assembly with this joint in a file, and compare with it: {argument('against', 'FILE')}."
        raise ParameterError(
            Fault("joints", f"'{model}' cannot take the place of '{described.get('model')}': {reason}", remedy=remedy)
        ) from None


def _reason(error: DescriptionError | ValueError) -> str:
    """Return the first fault of a description, or of a model's options."""
    if isinstance(error, DescriptionError):
        return error.faults[0].problem
    if isinstance(error, ValidationError):
        first = error.errors()[0]
        return f"its option '{'.'.join(map(str, first['loc']))}': {first['msg'].lower()}."
    return str(error)


def _joint_name(joints: Mapping[str, Any], joint: str | None) -> str:
    if joint is not None and joint in joints:
        return joint
    if joint is None and len(joints) == 1:
        return next(iter(joints))
    problem = "the assembly has several joints." if joint is None else f"there is no joint '{joint}'."
    problem = problem if joints else "the assembly has no joint."
    hint = "" if joint is None else did_you_mean(joint, joints)
    raise ParameterError(Fault("joint", problem, listing(joints), hint or f"Say which: {argument('joint', 'NAME')}."))


def _section(described: Mapping[str, Any], fields: Mapping[str, Any], model: str) -> dict[str, Any]:
    """Return the section of the new joint with the options that both models have."""
    kept = {key: described[key] for key in (*_KEPT, *fields) if key in described}
    if "nodes" in fields and "nodes" not in kept:
        ports = list((described.get("connect") or {}).values())
        at = ports[0].get("at") if ports else None
        kept["nodes"] = len(at) if isinstance(at, list) else 1
    return {"model": model, **kept}


def _options(section: Mapping[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in section.items() if key not in ("model", "connect", *_KEPT)}


def _connected(connect: Mapping[str, Any], model: JointModel) -> dict[str, Any]:
    """Return the nodes of the old ports, in their order, by the names of the new ones."""
    names = [port.name for port in model.ports]
    if len(names) != len(connect):
        raise ValueError(f"it has {len(names)} ports instead of {len(connect)}.")
    return dict(zip(names, connect.values(), strict=True))
