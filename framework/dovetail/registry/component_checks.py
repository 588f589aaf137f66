"""Whether a class can be used as a component."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from dovetail.errors import PluginError, contained
from dovetail.interfaces import (
    INTERFACE_VERSION,
    OLDEST_INTERFACE,
    ComponentConfig,
    FileReader,
    FrfReader,
    IdentificationMethod,
    JointModel,
    Law,
    MatrixReader,
    Reducer,
    Regressor,
    SubstructureModel,
)
from dovetail.interfaces.method import RESERVED_NAMES, RESERVED_OPTIONS

_CONTRACTS = (
    SubstructureModel,
    JointModel,
    Reducer,
    Regressor,
    FrfReader,
    MatrixReader,
    IdentificationMethod,
    Law,
)


def reason_against(component: Any) -> str:
    """Return why an object that a hook returned cannot be used, or an empty text; examining it may raise."""
    try:
        with contained("", "a class that it offers cannot be examined: "):
            return _why_unusable(component)
    except PluginError as error:
        return error.faults[0].problem


def _why_unusable(component: Any) -> str:
    """Return why a class cannot be used as a component, or an empty text."""
    if not isinstance(component, type) or not issubclass(component, _CONTRACTS):
        contracts = ", ".join(contract.__name__ for contract in _CONTRACTS)
        return f"{component!r} is not a component class (a subclass of {contracts})."
    label = component.__qualname__
    if problem := _version_problem(component.interface_versions):
        return f"{label} {problem}"
    for attribute in ("name", "summary"):
        if not isinstance(getattr(component, attribute, None), str) or not getattr(component, attribute):
            return f"{label} has no '{attribute}'."
    if not component.name.isidentifier():
        return f"{label} has the name '{component.name}', which is not an identifier."
    if missing := sorted(getattr(component, "__abstractmethods__", ())):
        return f"{label} does not define {', '.join(missing)}."
    if not isinstance(component.Config, type) or not issubclass(component.Config, ComponentConfig):
        return f"{label}.Config does not derive from dovetail.ComponentConfig."
    if issubclass(component, FileReader) and not _are_suffixes(getattr(component, "suffixes", None)):
        return f"{label} has no 'suffixes' such as ('.abc',), in lower case."
    if issubclass(component, IdentificationMethod) and component.name in RESERVED_NAMES:
        return f"{label} has the name '{component.name}', which is reserved; choose another name."
    contract = next(contract for contract in _CONTRACTS if issubclass(component, contract))
    if component.kind != contract.kind:
        return f"{label} has the kind {component.kind!r}; do not override '{contract.kind}' of {contract.__name__}."
    return _unfit_option(component, f"{label}.Config")


def _unfit_option(component: Any, label: str) -> str:
    """Return why the options of a component cannot be used, or an empty text."""
    fields = {field.alias or name: field for name, field in component.Config.model_fields.items()}
    keys = {"model", "connect"} if issubclass(component, JointModel) else {"model"}
    if taken := sorted(fields.keys() & keys):
        return f"{label} has the option '{taken[0]}', which is a key of descriptions; choose another name."
    if issubclass(component, IdentificationMethod) and (taken := sorted(fields.keys() & RESERVED_OPTIONS)):
        return f"{label} has the option '{taken[0]}', which is a parameter of 'identify'; choose another name."
    required = [name for name, field in fields.items() if field.is_required()]
    if issubclass(component, FileReader) and required:
        return f"{label} has no default for '{required[0]}', but the options of a reader cannot be set."
    return ""


def _are_suffixes(suffixes: object) -> bool:
    return (
        isinstance(suffixes, tuple)
        and bool(suffixes)
        and all(isinstance(one, str) and Path(f"file{one}").suffix == one == one.lower() for one in suffixes)
    )


def _version_problem(versions: Any) -> str:
    """Return why a component with this range of interface versions cannot be used, or an empty text."""
    match versions:
        case (int(lowest), int(highest)) if lowest <= highest:
            if lowest <= INTERFACE_VERSION and highest >= OLDEST_INTERFACE:
                return ""
            written = f"version {lowest}" if lowest == highest else f"versions {lowest} to {highest}"
            known = f"{OLDEST_INTERFACE} to {INTERFACE_VERSION}"
            return f"was written for {written} of the plugin interface; this dovetail-frf knows {known}."
    return f"has {versions!r:.60} for its interface_versions, not its lowest and highest version, such as (1, 1)."
