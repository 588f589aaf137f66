"""Sections that name a model, as components."""

from __future__ import annotations

import os
from collections.abc import Collection
from dataclasses import replace
from typing import Any, TypeGuard

from pydantic import BaseModel

from dovetail.documents.fault_list import Findings
from dovetail.documents.tree import Path, replaced, shown
from dovetail.documents.validation import validate
from dovetail.errors import DovetailError, PluginError, listing
from dovetail.interfaces import Component, FileName, Kind
from dovetail.registry import Offer, Registry

__all__ = ["Built", "build", "read_property"]


class Built:
    """A component and how messages name it."""

    def __init__(self, component: Any, label: str) -> None:
        self.component = component
        self.label = label


def build(
    kind: Kind,
    path: Path,
    findings: Findings,
    registry: Registry,
    *,
    reserved: Collection[str] = (),
    default: str | None = None,
) -> Built | None:
    """Make the component that the section at `path` describes.

    Parameters
    ----------
    kind : str
    path : Path
    findings : Findings
        Takes in the faults.
    registry : Registry
    reserved : collection of str
        Keys of the section, beside ``model``, that are not the component's.
    default : str, optional
        The model where the section is left out.

    Returns
    -------
    Built or None
        None where there are faults.
    """
    offer = _offer(kind, path, findings, registry, default)
    if offer is None:
        return None
    label = f"{kind} model '{offer.component.name}' ({offer.source})"
    keys = ("model", *reserved)
    _locate_files(offer.component.Config, path, findings)
    config = validate(offer.component.Config, path, findings, label, reserved=keys, data={})
    if config is None:
        return None
    try:
        return Built(offer.component(config), label)
    except Exception as error:  # a plugin's constructor may raise anything
        accepted, remedy = (error.faults[0].accepted, error.faults[0].remedy) if _explained(error) else ("", "")
        findings.add(path, f"{label} cannot be made from this section: {_reason(error)}", accepted, remedy, key=True)
        return None


def _locate_files(config: type[BaseModel], path: Path, findings: Findings) -> None:
    """Take the names of files from the folder of the description that says them, so that its text stands alone."""
    for name, field in config.model_fields.items():
        item = findings.root.at((*path, name))
        if item is None or not any(isinstance(mark, FileName) for mark in field.metadata):
            continue
        if isinstance(item.value, str) and item.value:
            folder = os.path.dirname(os.path.abspath(item.mark.file)) if item.mark.line else os.getcwd()
            located = os.path.normpath(os.path.join(folder, item.value))
            findings.root = replaced(findings.root, (*path, name), located)


def _offer(kind: Kind, path: Path, findings: Findings, registry: Registry, default: str | None) -> Offer | None:
    section = findings.root.at(path)
    name: object = default
    if section is not None:
        if not section.is_mapping:
            problem = f"{shown(section.value)} is not a section of keys and values."
            findings.add(path, problem, "a section that begins with 'model:'")
            return None
        if "model" not in section.entries:
            findings.add((*path, "model"), f"the {kind} lacks 'model'.", listing(registry.names(kind)), key=True)
            return None
        name = section.entries["model"].item.value
    if not isinstance(name, str):
        findings.add((*path, "model"), f"{shown(name)} is not the name of a model.", listing(registry.names(kind)))
        return None
    try:
        return registry.find(kind, name)
    except PluginError as error:
        fault = error.faults[0]
        others = [offer.component.kind for offer in registry.named(name)]
        if others:
            fault = replace(
                fault, problem=f"'{name}' is a {others[0]} model; a {kind} model is wanted here.", remedy=""
            )
        findings.add((*path, "model"), fault.problem, fault.accepted, fault.remedy)
        return None


def read_property(built: Built, name: str, path: Path, findings: Findings) -> Any:
    """Return a property of a component, or None, with a fault, where it raises."""
    component: Component = built.component
    try:
        return getattr(component, name)
    except Exception as error:  # a plugin's property may raise anything
        findings.add(path, f"{built.label} cannot give its {name}: {_reason(error)}", key=True)
        return None


def _explained(error: Exception) -> TypeGuard[DovetailError]:
    return isinstance(error, DovetailError) and len(error.faults) == 1


def _reason(error: Exception) -> str:
    """Say what went wrong, as a sentence."""
    if isinstance(error, DovetailError):
        text = " ".join(f"{fault.where}: {fault.problem}" if fault.where else fault.problem for fault in error.faults)
    elif isinstance(error, ValueError):
        text = str(error)
    else:
        text = f"{type(error).__name__}: {error}"
    return text if text.endswith((".", "!", "?")) else f"{text}."
