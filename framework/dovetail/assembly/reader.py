"""From a description as it is written to one that an assembly can be made of."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from dovetail.assembly.component_sections import build, read_property
from dovetail.assembly.connectivity import check_connected
from dovetail.assembly.description import Description, IdentificationSettings, JointEntry
from dovetail.assembly.findings import Findings
from dovetail.assembly.frequencies import read_frequency
from dovetail.assembly.inheritance import read_source
from dovetail.assembly.joints import Substructures, read_joint
from dovetail.assembly.responses import read_responses
from dovetail.assembly.sections import FORMAT, DescriptionSection, DescriptionSectionOfSeveral, IdentificationSection
from dovetail.assembly.tree import plain, shown
from dovetail.assembly.validation import validate
from dovetail.interfaces import SubstructureModel, node_faults, source_file
from dovetail.registry import Registry

__all__ = ["read_description"]

_LEAST_OF_A_PART = 2
"""Samples that training and testing have at least."""


def read_description(source: str | os.PathLike[str] | Mapping[str, Any], registry: Registry) -> Description:
    """Read and check an assembly description.

    Parameters
    ----------
    source : path or mapping
        A YAML file, or the same as a dict.
    registry : Registry
        The components that the description may name.

    Returns
    -------
    Description

    Raises
    ------
    DescriptionError
        Every fault of the description, in the order of its text.
    """
    findings = Findings()
    name, findings.root = read_source(source, findings)
    _check_format(findings)
    several = findings.root.at(("responses",)) is not None
    top = validate(DescriptionSectionOfSeveral if several else DescriptionSection, (), findings, "the description")
    frequency = read_frequency(findings)
    substructures = _read_substructures(findings, registry)
    joints = _read_joints(substructures, findings, registry)
    responses = read_responses(substructures, findings)
    identification = _read_identification(findings, registry)
    findings.raise_if_any()
    parts = {key: part for key, part in substructures.items() if part is not None}
    joined = {key: joint for key, joint in joints.items() if joint is not None}
    assert top is not None
    assert frequency is not None
    assert identification is not None
    check_connected(parts, joined, responses[0].substructure, findings)
    findings.raise_if_any()
    return Description(
        name=top.name,
        source=name,
        text=json.dumps(plain(findings.root), indent=2, ensure_ascii=False, allow_nan=False),
        frequency=frequency,
        substructures=MappingProxyType(parts),
        joints=MappingProxyType(joined),
        responses=responses,
        identification=identification,
    )


def _check_format(findings: Findings) -> None:
    item = findings.root.at(("dovetail",))
    if item is None:
        found = "the description does not say which format it has."
        findings.add(("dovetail",), found, remedy=f"Begin it with 'dovetail: {FORMAT}'.")
    elif item.value != FORMAT or isinstance(item.value, bool):
        found = f"{shown(plain(item))} is not a format that this version of dovetail reads."
        findings.add(("dovetail",), found, str(FORMAT))


def _names(section: str, noun: str, findings: Findings) -> list[str]:
    """Return the names that the user made in a section, and report those that are no identifiers."""
    item = findings.root.at((section,))
    names = list(item.entries) if item is not None else []
    for name in names:
        if not name.isidentifier():
            found = f"{shown(name)} cannot be the name of a {noun}."
            accepted = "letters, digits and '_', not beginning with a digit"
            findings.add((section, name), found, accepted, key=True)
    return names


def _read_substructures(findings: Findings, registry: Registry) -> Substructures:
    section = findings.root.at(("substructures",))
    if section is not None and section.is_mapping and not section.entries:
        findings.add(("substructures",), "there are no substructures.", key=True)
    return {
        name: _read_substructure(name, findings, registry) for name in _names("substructures", "substructure", findings)
    }


def _read_substructure(name: str, findings: Findings, registry: Registry) -> SubstructureModel | None:
    path = ("substructures", name)
    built = build("substructure", path, findings, registry)
    if built is None:
        return None
    before = len(findings)
    nodes = read_property(built, "nodes", path, findings)
    if len(findings) == before:
        remedy = f"Mend it in {source_file(built.component)}." if source_file(built.component) else ""
        for fault in node_faults(nodes):
            findings.add(path, f"{built.label} {fault.found}", fault.accepted, remedy, key=True)
    if len(findings) == before and not nodes:
        findings.add(path, f"{built.label} has no nodes.", key=True)
    substructure: SubstructureModel = built.component
    return substructure if len(findings) == before else None


def _read_joints(substructures: Substructures, findings: Findings, registry: Registry) -> dict[str, JointEntry | None]:
    return {name: read_joint(name, substructures, findings, registry) for name in _names("joints", "joint", findings)}


def _read_identification(findings: Findings, registry: Registry) -> IdentificationSettings | None:
    path = ("identification",)
    section = validate(IdentificationSection, path, findings, "'identification'", data={})
    reducer = build("reducer", (*path, "reducer"), findings, registry, default="umap")
    regressor = build("regressor", (*path, "regressor"), findings, registry, default="mlp")
    if section is None or reducer is None or regressor is None:
        return None
    tested = round(section.samples * section.test_fraction)
    if min(tested, section.samples - tested) < _LEAST_OF_A_PART:
        found = f"{tested} of {section.samples} samples would be for testing, {section.samples - tested} for training."
        remedy = f"Each needs {_LEAST_OF_A_PART} at least."
        findings.add((*path, "test_fraction"), found, remedy=remedy)
        return None
    return IdentificationSettings(
        section.samples,
        section.seed,
        section.test_fraction,
        section.features,
        reducer.component,
        regressor.component,
        section.augmentation,
    )
