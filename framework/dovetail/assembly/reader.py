"""From a description as it is written to one that an assembly can be made of."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.assembly.component_sections import build, read_property
from dovetail.assembly.description import Description, IdentificationSettings, JointEntry, Response
from dovetail.assembly.joints import Substructures, check_connected, find_node, read_joint
from dovetail.assembly.sections import (
    FORMAT,
    DescriptionSection,
    DescriptionSectionOfSeveral,
    FrequencySection,
    IdentificationSection,
    ResponseSection,
)
from dovetail.documents.extends import read_source
from dovetail.documents.fault_list import Findings
from dovetail.documents.tree import Path, dotted, plain, shown
from dovetail.documents.validation import validate
from dovetail.errors import did_you_mean, listing
from dovetail.interfaces import SubstructureModel, node_faults, source_file
from dovetail.registry import Registry

__all__ = ["MOST_LINES", "read_description", "read_frequency", "read_responses"]

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
        problem = "the description does not say which format it has."
        findings.add(("dovetail",), problem, remedy=f"Begin it with 'dovetail: {FORMAT}'.")
    elif item.value != FORMAT or isinstance(item.value, bool):
        problem = f"{shown(plain(item))} is not a format that this version of dovetail reads."
        findings.add(("dovetail",), problem, str(FORMAT))


def _names(section: str, noun: str, findings: Findings) -> list[str]:
    """Return the names that the user made in a section, and report those that are no identifiers."""
    item = findings.root.at((section,))
    names = list(item.entries) if item is not None else []
    for name in names:
        if not name.isidentifier():
            problem = f"{shown(name)} cannot be the name of a {noun}."
            accepted = "letters, digits and '_', not beginning with a digit"
            findings.add((section, name), problem, accepted, key=True)
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
            findings.add(path, f"{built.label} {fault.problem}", fault.accepted, remedy, key=True)
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
        problem = (
            f"{tested} of {section.samples} samples would be for testing, {section.samples - tested} for training."
        )
        remedy = f"Each needs {_LEAST_OF_A_PART} at least."
        findings.add((*path, "test_fraction"), problem, remedy=remedy)
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


MOST_LINES = 1_000_000
_OFF_GRID = 1e-6
"""How far `stop` may be from a line, in steps."""
_PATH = ("frequency",)


def read_frequency(findings: Findings) -> NDArray[np.float64] | None:
    """Return the (n_freq,) lines in Hz, read-only, or None with faults."""
    if findings.root.at(_PATH) is None:
        return None
    section = validate(FrequencySection, _PATH, findings, "'frequency'")
    if section is None:
        return None
    start, stop = section.start, section.stop
    if stop <= start:
        findings.add((*_PATH, "stop"), f"stop ({stop:.10g} Hz) must be greater than start ({start:.10g} Hz).")
        return None
    if (section.step is None) == (section.lines is None):
        problem = "the frequency has a step and a number of lines." if section.step else "the frequency has no step."
        findings.add(_PATH, problem, "step or lines", key=True)
        return None
    steps = (stop - start) / section.step if section.step else float((section.lines or 0) - 1)
    if steps + 1 > MOST_LINES:
        findings.add((*_PATH, "step"), f"{steps + 1:.4g} lines are more than {MOST_LINES}.")
        return None
    if abs(steps - round(steps)) > _OFF_GRID or steps < _OFF_GRID:
        before = start + np.floor(steps) * (section.step or 0.0)
        problem = f"stop ({stop:.10g} Hz) is not on a line: from {start:.10g} Hz in steps of {section.step:.10g} Hz"
        remedy = f"The lines nearest to it are {before:.10g} Hz and {before + (section.step or 0.0):.10g} Hz."
        findings.add((*_PATH, "stop"), f"{problem}.", remedy=remedy)
        return None
    frequency = np.linspace(start, stop, round(steps) + 1)
    frequency.setflags(write=False)
    return frequency


_ONE: Path = ("response",)
_SEVERAL: Path = ("responses",)


def read_responses(substructures: Substructures, findings: Findings) -> tuple[Response, ...]:
    """Return the responses in their order; those with faults are left out.

    Parameters
    ----------
    substructures : mapping of str to SubstructureModel or None
        None where one has faults of its own.
    findings : Findings
    """
    one, several = findings.root.at(_ONE), findings.root.at(_SEVERAL)
    if several is None:
        response = None if one is None else _read_response(_ONE, substructures, findings)
        return () if response is None else (response,)
    if one is not None:
        remedy = "Keep one of them: a single response, or the list of all."
        findings.add(_ONE, "the description has 'response' and 'responses'.", remedy=remedy, key=True)
    if not isinstance(several.value, tuple):
        remedy = "Begin each entry with '- at:'."
        findings.add(_SEVERAL, f"{shown(several.value)} is not a list of responses.", remedy=remedy, key=True)
        return ()
    if not several.value:
        findings.add(_SEVERAL, "there are no responses.", key=True)
    return _read_all(len(several.value), substructures, findings)


def _read_all(count: int, substructures: Substructures, findings: Findings) -> tuple[Response, ...]:
    places: dict[tuple[str, int, str], Path] = {}
    read = []
    for index in range(count):
        path = (*_SEVERAL, index)
        response = _read_response(path, substructures, findings)
        if response is None:
            continue
        read.append(response)
        first = places.setdefault((response.substructure, response.node, response.direction), path)
        if first != path:
            remedy = "Average measurements of the same point, or remove one of the two."
            findings.add(path, f"this is the same point as {dotted(first)}.", remedy=remedy, key=True)
    return tuple(read)


def _read_response(path: Path, substructures: Substructures, findings: Findings) -> Response | None:
    section = validate(ResponseSection, path, findings, f"'{dotted(path)}'")
    if section is None:
        return None
    if section.at not in substructures:
        if substructures:
            hint = did_you_mean(section.at, substructures)
            findings.add((*path, "at"), f"there is no substructure {shown(section.at)}.", listing(substructures), hint)
        return None
    substructure = substructures[section.at]
    if substructure is None:
        return None
    if substructure.grounded:
        moving = listing(name for name, part in substructures.items() if part is not None and not part.grounded)
        problem = f"the response cannot be at '{section.at}', which does not move."
        findings.add((*path, "at"), problem, moving)
        return None
    node = find_node(section.at, substructure, section.position, (*path, "position"), findings)
    return None if node is None else Response(section.at, node, section.direction, section.quantity)
