"""Components from the sections that name their model."""

from __future__ import annotations

import os
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any

from pydantic import BaseModel

from dovetail.documents.extends import resolve_alternatives
from dovetail.documents.fault_list import FaultList
from dovetail.documents.tree import Mark, Path, Scalar, format_value, replace_item, replace_value
from dovetail.documents.validation import validate
from dovetail.errors import DovetailError, Fault, PluginError, listing
from dovetail.interfaces import FileName, Kind
from dovetail.registry import Offer, Registry


@dataclass(frozen=True)
class LabelledComponent:
    """A component, and its label in messages: ``"joint model 'collet' (dovetail-frf 0.1.0)"``."""

    component: Any
    label: str


def build_component(
    kind: Kind, path: Path, faults: FaultList, registry: Registry, *, reserved: Collection[str] = ()
) -> LabelledComponent | None:
    """Make the component that the section at `path` describes; None if the section has faults.

    Parameters
    ----------
    kind : str
    path, faults, reserved
        As in `make_component`.
    registry : Registry
    """
    offer = find_model(kind, path, faults, registry)
    return None if offer is None else make_component(offer, path, faults, reserved=reserved)


def find_model(kind: Kind, path: Path, faults: FaultList, registry: Registry) -> Offer | None:
    """Return the model that a section names, and remove options of a base that the section replaces by others.

    Parameters
    ----------
    kind : str
    path : Path
    faults : FaultList
        Collects the faults.
    registry : Registry

    Returns
    -------
    Offer or None
        None if the section has faults.
    """
    offer = _offer(kind, path, faults, registry)
    for choice in offer.component.Config.alternatives if offer is not None else ():
        section = faults.root.at(path)
        assert section is not None
        faults.root = replace_item(faults.root, path, resolve_alternatives(section, choice))
    return offer


def make_component(
    offer: Offer,
    path: Path,
    faults: FaultList,
    *,
    reserved: Collection[str] = (),
    instead: Mapping[Path, Scalar] = MappingProxyType({}),
) -> LabelledComponent | None:
    """Make a component with the options of a section.

    Parameters
    ----------
    offer : Offer
        The model that the section names.
    path : Path
    faults : FaultList
        Collects the faults.
    reserved : collection of str
        Keys of the section, besides ``model``, that are not options of the component, unless it has one of that name.
    instead : mapping of Path to scalar
        Values to use instead of those of the section, by their places in it.

    Returns
    -------
    LabelledComponent or None
        None if the section has faults.
    """
    label = f"{offer.component.kind} model '{offer.component.name}' ({offer.source})"
    keys = ("model", *(key for key in reserved if key not in offer.component.Config.model_fields))
    if not locate_files(offer.component.Config, path, faults):
        return None
    config = validate(offer.component.Config, path, faults, label, reserved=keys, data={}, instead=instead)
    if config is None:
        return None
    try:
        return LabelledComponent(offer.component(config), label)
    except (Exception, SystemExit) as error:  # a plugin's constructor may raise anything
        fault = error.faults[0] if isinstance(error, DovetailError) and len(error.faults) == 1 else Fault("", "")
        problem = f"{label} cannot be made from this section: {_reason(error)}"
        faults.add(path, problem, fault.accepted, fault.remedy, key=True)
        return None


def locate_files(config: type[BaseModel], path: Path, faults: FaultList) -> bool:
    """Make the file names of the section absolute; return whether they may be named."""
    for name, field in config.model_fields.items():
        item = faults.root.at((*path, name))
        if item is None or not any(isinstance(mark, FileName) for mark in field.metadata):
            continue
        listed = enumerate(item.value) if isinstance(item.value, tuple) else ()
        for place, one in [((*path, name), item), *(((*path, name, number), one) for number, one in listed)]:
            if isinstance(one.value, str) and one.value and not _locate_file(place, one.value, one.mark, faults):
                return False
    return True


def _locate_file(place: Path, name: str, mark: Mark, faults: FaultList) -> bool:
    folder = os.path.dirname(os.path.abspath(mark.file)) if mark.line else os.getcwd()
    file = os.path.normpath(os.path.join(faults.files_in or folder, name))
    inside = os.path.join(os.path.realpath(faults.files_in or folder), name)
    if faults.files_in and (os.path.isabs(name) or os.path.realpath(file) != inside):
        faults.add(place, f"the file '{name}' is not in '{faults.files_in}'.")
        return False
    faults.files[place] = file
    faults.root = replace_value(faults.root, place, file)
    return True


def _offer(kind: Kind, path: Path, faults: FaultList, registry: Registry) -> Offer | None:
    section = faults.root.at(path)
    if section is None:
        problem = f"the description names no {kind}, and no plugin gives a default."
        faults.add(path, problem, listing(registry.names(kind)))
        return None
    if not section.is_mapping:
        problem = f"{format_value(section.value)} is not a section of keys and values."
        faults.add(path, problem, "a section that begins with 'model:'")
        return None
    if "model" not in section.entries:
        faults.add((*path, "model"), f"the {kind} lacks 'model'.", listing(registry.names(kind)), key=True)
        return None
    name = section.entries["model"].item.value
    if not isinstance(name, str):
        faults.add((*path, "model"), f"{format_value(name)} is not the name of a model.", listing(registry.names(kind)))
        return None
    try:
        return registry.find(kind, name)
    except PluginError as error:
        fault = error.faults[0]
        other_kinds = registry.kinds_of(name)
        if other_kinds and kind not in other_kinds:
            problem = f"'{name}' is a {other_kinds[0]} model; a {kind} model is needed here."
            fault = replace(fault, problem=problem, remedy="")
        faults.add((*path, "model"), fault.problem, fault.accepted, fault.remedy)
        return None


def read_property(model: LabelledComponent, name: str, path: Path, faults: FaultList) -> Any:
    """Return a property of a component; where it raises, add a fault and return None."""
    try:
        return getattr(model.component, name)
    except (Exception, SystemExit) as error:  # a plugin's property may raise anything
        faults.add(path, f"{model.label} cannot give its {name}: {_reason(error)}", key=True)
        return None


def _reason(error: BaseException) -> str:
    """Return what a component raised as a sentence."""
    if isinstance(error, DovetailError):
        text = " ".join(f"{fault.where}: {fault.problem}" if fault.where else fault.problem for fault in error.faults)
    elif isinstance(error, ValueError):
        text = str(error)
    else:
        text = f"{type(error).__name__}: {error}"
    return text if text.endswith((".", "!", "?")) else f"{text}."
