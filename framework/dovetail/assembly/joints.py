"""The joints of a description: where they attach, and what is known of their parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType

from dovetail.assembly.component_sections import Built, build
from dovetail.assembly.description import JointEntry
from dovetail.assembly.parameter_sections import check_ranges, read_parameters
from dovetail.assembly.sections import AttachmentSection
from dovetail.documents.fault_list import Findings
from dovetail.documents.tree import Path, shown
from dovetail.documents.validation import validate
from dovetail.errors import did_you_mean, listing
from dovetail.interfaces import Node, Port, SubstructureModel, joint_faults, source_file
from dovetail.registry import Registry
from dovetail.synthesis import Attachment, Connection
from dovetail.units import format_quantity

__all__ = ["Substructures", "check_connected", "find_node", "node_positions", "read_joint"]

Substructures = Mapping[str, SubstructureModel | None]
"""The substructures by name; None for one that has faults."""


def read_joint(name: str, substructures: Substructures, findings: Findings, registry: Registry) -> JointEntry | None:
    """Read the joint of this name; None, with faults, where it cannot be used."""
    path = ("joints", name)
    before = len(findings)
    built = build("joint", path, findings, registry, reserved=("connect", "parameters"))
    if built is None:
        return None
    if not _check_declarations(built, path, findings):
        return None
    attachments = _Connect(built, path, substructures, findings).read(built.component.ports)
    ranges, fixed = read_parameters(built, path, built.component.parameters, findings)
    if len(findings) == before:
        check_ranges(built, path, ranges, fixed, findings)
    if len(findings) > before or None in attachments:
        return None
    attached = tuple(attachment for attachment in attachments if attachment is not None)
    return JointEntry(Connection(built.component, attached), ranges, MappingProxyType(fixed))


def _check_declarations(built: Built, path: Path, findings: Findings) -> bool:
    """Report what is wrong with the joint model itself, which no description can mend."""
    faults = joint_faults(built.component)
    remedy = f"Mend it in {source_file(built.component)}." if source_file(built.component) else ""
    for fault in faults:
        findings.add(path, f"{built.label} {fault.problem}", fault.accepted, remedy, key=True)
    return not faults


class _Connect:
    """The section ``connect:`` of a joint."""

    def __init__(self, built: Built, joint: Path, substructures: Substructures, findings: Findings) -> None:
        self._built = built
        self._path: Path = (*joint, "connect")
        self._substructures = substructures
        self._findings = findings

    def read(self, ports: tuple[Port, ...]) -> tuple[Attachment | None, ...]:
        section = self._findings.root.at(self._path)
        names = [port.name for port in ports]
        if section is None and not names:
            return ()
        if section is None or not section.is_mapping:
            problem = f"{self._built.label} lacks 'connect'."
            if section is not None:
                problem = f"{shown(section.value)} is not a section of keys and values."
            self._findings.add(self._path, problem, f"a section with the ports {listing(names)}", key=True)
            return (None,) * len(ports)
        misspelt = [self._unknown(key, names) for key in section.entries if key not in names]
        for name in names:
            if name not in section.entries and not any(f"'{name}'" in hint for hint in misspelt):
                problem = f"the port '{name}' of {self._built.label} is not connected."
                accepted = f"{name}: {{to: SUBSTRUCTURE, at: [POSITION, ...]}}"
                self._findings.add((*self._path, name), problem, accepted, key=True)
        attachments = tuple(self._attachment(port) if port.name in section.entries else None for port in ports)
        self._check_distinct(ports, attachments)
        return attachments

    def _unknown(self, key: str, names: list[str]) -> str:
        """Report a port that the model does not have, and return the hint at the one that may be meant."""
        hint = did_you_mean(key, names)
        problem = f"{shown(key)} is not a port of {self._built.label}."
        self._findings.add((*self._path, key), problem, listing(names), hint, key=True)
        return hint

    def _attachment(self, port: Port) -> Attachment | None:
        path: Path = (*self._path, port.name)
        section = validate(AttachmentSection, path, self._findings, f"the port '{port.name}'")
        if section is None:
            return None
        if section.to not in self._substructures:
            names = list(self._substructures)
            if names:
                problem = f"there is no substructure {shown(section.to)}."
                self._findings.add((*path, "to"), problem, listing(names), did_you_mean(section.to, names))
            return None
        if len(section.at) != port.nodes:
            problem = f"the port '{port.name}' of {self._built.label} takes {_counted(port.nodes, 'node')}"
            self._findings.add((*path, "at"), f"{problem}, not {len(section.at)}.")
            return None
        substructure = self._substructures[section.to]
        return None if substructure is None else self._on_nodes(section, substructure, path)

    def _on_nodes(self, section: AttachmentSection, substructure: SubstructureModel, path: Path) -> Attachment | None:
        found = [
            find_node(section.to, substructure, position, (*path, "at", index), self._findings)
            for index, position in enumerate(section.at)
        ]
        nodes = tuple(node for node in found if node is not None)
        return Attachment(section.to, nodes) if len(nodes) == len(found) else None

    def _check_distinct(self, ports: tuple[Port, ...], attachments: tuple[Attachment | None, ...]) -> None:
        taken: set[tuple[str, int]] = set()
        for port, attachment in zip(ports, attachments, strict=True):
            part = self._substructures.get(attachment.substructure) if attachment is not None else None
            if attachment is None or part is None or part.grounded:
                continue
            for index, node in enumerate(attachment.nodes):
                if (attachment.substructure, node) in taken:
                    place = format_quantity(part.nodes[node].position, "m")
                    problem = f"the node of '{attachment.substructure}' at {place} is already taken by this joint."
                    self._findings.add((*self._path, port.name, "at", index), problem)
                taken.add((attachment.substructure, node))


def _counted(count: int, noun: str) -> str:
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


def check_connected(
    substructures: Mapping[str, SubstructureModel], joints: Mapping[str, JointEntry], response: str, findings: Findings
) -> None:
    """Report substructures and joints that the response cannot feel; motion does not pass through the ground."""
    parts = {
        name: {attachment.substructure for attachment in joint.connection.attachments} for name, joint in joints.items()
    }
    reached, new = {response}, [response]
    while new:
        part = new.pop()
        for attached in parts.values():
            if part in attached and not substructures[part].grounded:
                new.extend(attached - reached)
                reached |= attached
    for name in substructures:
        if name not in reached:
            problem = f"no joint connects '{name}' with '{response}', where the response is."
            findings.add(("substructures", name), problem, remedy="Connect it or remove it.", key=True)
    for name, attached in parts.items():
        if attached and all(substructures[part].grounded for part in attached):
            problem = f"the joint '{name}' attaches to nothing that moves."
            findings.add(("joints", name), problem, remedy="Connect it to a part that moves, or remove it.", key=True)


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
    problem = f"substructure '{name}' has no node '{label}'."
    findings.add(path, problem, f"{listing(labels)}; or a position", did_you_mean(label, labels))
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
