"""The response of a description, or its several responses: where force and response are measured."""

from __future__ import annotations

from dovetail.assembly.description import Response
from dovetail.assembly.findings import Findings
from dovetail.assembly.joints import Substructures
from dovetail.assembly.nodes import find_node
from dovetail.assembly.sections import ResponseSection
from dovetail.assembly.tree import Path, dotted, shown
from dovetail.assembly.validation import validate
from dovetail.errors import did_you_mean, listing

__all__ = ["read_responses"]

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
        found = f"the response cannot be at '{section.at}', which does not move."
        findings.add((*path, "at"), found, moving)
        return None
    node = find_node(section.at, substructure, section.position, (*path, "position"), findings)
    return None if node is None else Response(section.at, node, section.direction, section.quantity)
