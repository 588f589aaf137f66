"""Positions in a description, as nodes of a substructure."""

from __future__ import annotations

from collections.abc import Sequence

from dovetail.assembly.findings import Findings
from dovetail.assembly.tree import Path
from dovetail.errors import did_you_mean, listing
from dovetail.interfaces import Node, SubstructureModel
from dovetail.units import format_quantity

__all__ = ["find_node", "node_positions"]

_ABSOLUTE, _RELATIVE = 1e-9, 1e-6
"""How far a position may be from its node [m], and relative to itself."""


def find_node(
    name: str, substructure: SubstructureModel, place: float | str, path: Path, findings: Findings
) -> int | None:
    """Return the index of the node at a position [m] or of a label, or None with a fault."""
    if isinstance(place, str):
        return _find_label(name, substructure, place, path, findings)
    nodes, position = substructure.nodes, place
    tolerance = _ABSOLUTE + _RELATIVE * abs(position)
    there = [index for index, node in enumerate(nodes) if abs(node.position - position) <= tolerance]
    shown = format_quantity(position, "m", 8)
    if len(there) == 1 or (there and substructure.grounded):
        return there[0]
    if there:
        labels = listing(nodes[index].label for index in there)
        findings.add(path, f"{shown} of substructure '{name}' could be any of its nodes {labels}.")
    else:
        remedy = _nearest(nodes, position)
        findings.add(path, f"substructure '{name}' has no node at {shown}.", node_positions(nodes), remedy)
    return None


def _find_label(name: str, substructure: SubstructureModel, label: str, path: Path, findings: Findings) -> int | None:
    labels = [node.label for node in substructure.nodes]
    if label in labels:
        return labels.index(label)
    found = f"substructure '{name}' has no node '{label}'."
    findings.add(path, found, f"{listing(labels)}; or a position", did_you_mean(label, labels))
    return None


def node_positions(nodes: Sequence[Node]) -> str:
    """List where the nodes are."""
    return listing(format_quantity(node.position, "m") for node in nodes)


def _nearest(nodes: Sequence[Node], position: float) -> str:
    nearest = sorted({node.position for node in nodes}, key=lambda place: abs(place - position))[:2]
    places = [format_quantity(place, "m", 8) for place in sorted(nearest)]
    if len(places) == 1:
        return f"The only node is at {places[0]}."
    return f"The nearest nodes are at {places[0]} and {places[1]}."
