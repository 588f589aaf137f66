"""The joints of a description: their models, the nodes to which their ports attach, and their parameters.

Also the search for a node by its position or label, and the check that every part is connected to the response.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from dovetail.description.carrying_joints import carrying
from dovetail.description.checked import JointEntry, ParameterEntry, Response
from dovetail.description.component_sections import LabelledComponent, build_component
from dovetail.description.damping import DampingSection, has_dampers
from dovetail.description.oriented_joints import AxesSection, oriented
from dovetail.description.parameter_sections import check_ranges, ends_of, read_parameters
from dovetail.description.placed_parts import PlacedPart
from dovetail.description.sections import AttachmentSection, NodePosition
from dovetail.documents.fault_list import FaultList
from dovetail.documents.tree import Path, format_path, format_value
from dovetail.documents.validation import validate
from dovetail.errors import Fault, ParameterError, did_you_mean, listing
from dovetail.interfaces import JointModel, JointPort, PartNode, SubstructureModel, joint_faults, source_file
from dovetail.registry import Registry
from dovetail.synthesis import Attachment, Connection
from dovetail.units import format_point, format_quantity

_KEYS = ("connect", "parameters", "structural_damping", "axes")
"""Keys of a joint in addition to the options of its model."""

_ALONG = "acts along the line between its nodes"
_ACROSS = "leads from one node to another"

Substructures = Mapping[str, SubstructureModel | None]
"""Substructures by name; None instead of one with faults."""


def read_joint(name: str, substructures: Substructures, faults: FaultList, registry: Registry) -> JointEntry | None:
    """Return the joint of this name, or None if it has faults."""
    path = ("joints", name)
    before = len(faults)
    model = build_component("joint", path, faults, registry, reserved=_KEYS)
    if model is None:
        return None
    add_model_faults(model, joint_faults(model.component), path, faults)
    if len(faults) > before:
        return None
    model = _with_axes(model, path, faults)
    if model is None:
        return None
    attachments = _Connect(model, path, substructures, faults).read(model.component.ports)
    described = read_parameters(model, path, model.component.parameters, faults)
    if len(faults) == before and not described.ties:  # those of tied ones are known when all has been read
        entries = {name: ParameterEntry(**described.entry)}
        check_ranges(model, path, {p: ends_of(entries, name, p) for p in described.known}, faults)
    if len(faults) > before or None in attachments:
        return None
    complete = tuple(attachment for attachment in attachments if attachment is not None)
    model = _at_points(model, path, complete, substructures, faults)
    if model is None:
        return None
    joint = JointEntry(connection=Connection(model.component, complete), **described.entry)
    return _with_damping(joint, model, path, faults)


def _with_axes(model: LabelledComponent, path: Path, faults: FaultList) -> LabelledComponent | None:
    """Return the joint's model along axes of its own, if its section gives them; None if they have faults."""
    place = (*path, "axes")
    if "axes" in model.component.Config.model_fields or faults.root.at(place) is None:
        return model  # an option of the model, or absent
    if model.component.acts_along_its_nodes:
        faults.add(place, f"{model.label} {_ALONG}.", remedy="Leave out 'axes'.", key=True)
        return None
    section = validate(AxesSection, place, faults, f"'{format_path(place)}'")
    if section is None:
        return None
    component: JointModel = model.component
    if len(section.known_axes) == 1:
        (axis,) = section.known_axes
        if others := {d for port in component.ports for d in port.directions} - {axis, f"r{axis}"}:
            problem = f"{model.label} acts in {', '.join(sorted(others))} too, so two axes are needed."
            faults.add(place, problem, "two of x, y, z")
            return None
    return replace(model, component=oriented(component, section.rotation))


def _at_points(
    model: LabelledComponent,
    path: Path,
    attachments: Sequence[Attachment],
    substructures: Substructures,
    faults: FaultList,
) -> LabelledComponent | None:
    """Return the joint's model along the line between its nodes, or across their distance, if it acts so.

    None if the points of the nodes are not known, or there is no line between them.
    """
    component: JointModel = model.component
    if not (component.acts_along_its_nodes or component.carries_its_nodes):
        return model
    points = _points(model, path, attachments, substructures, faults)
    if points is None:
        return None
    if component.carries_its_nodes:
        return replace(model, component=carrying(component, points))
    line = points[1] - points[0]
    length = float(np.linalg.norm(line))
    if length < 1e-9:
        problem = f"{model.label} {_ALONG}, and both are at {format_point(tuple(points[0]))}."
        faults.add((*path, "connect"), problem, remedy="Attach it to nodes at two points, or use a bushing.")
        return None
    section = AxesSection(x=tuple((line / length).tolist()))
    return replace(model, component=oriented(component, section.rotation))


def _points(
    model: LabelledComponent,
    path: Path,
    attachments: Sequence[Attachment],
    substructures: Substructures,
    faults: FaultList,
) -> list[NDArray[np.float64]] | None:
    """Return where the first nodes of a joint's ports are in the assembly [m]; None, with a fault, if unknown."""
    how, points, moving = _ALONG if model.component.acts_along_its_nodes else _ACROSS, [], dict[str, None]()
    for attachment in attachments:
        name = attachment.substructure
        part = substructures[name]
        assert part is not None
        node = part.nodes[attachment.nodes[0]]
        if part.grounded and node.point is None:
            problem = f"{model.label} {how}, and '{name}' is everywhere."
            remedy = "Say where its points are: 'points: [[0 mm, 0 mm, 0 mm]]' instead of positions."
            faults.add((*path, "connect"), problem, remedy=remedy)
            return None
        moving |= {} if part.grounded else {f"'{name}'": None}
        points.append(np.asarray(node.coordinates))
    if len(moving) > 1 and not any(isinstance(part, PlacedPart) and part.in_space for part in substructures.values()):
        problem = f"{model.label} {how}, and nothing says how {' and '.join(moving)} lie in space."
        faults.add((*path, "connect"), problem, remedy="Give the parts a 'place', one of them at least.")
        return None
    return points


def _with_damping(joint: JointEntry, model: LabelledComponent, path: Path, faults: FaultList) -> JointEntry | None:
    """Return a joint with structural damping if its section gives it, or None if that has faults."""
    if not DampingSection.model_fields.keys().isdisjoint(model.component.Config.model_fields):
        return joint  # the model has an option of that name
    keys = [*model.component.Config.model_fields, "model", *_KEYS]
    reserved = [key for key in keys if key not in DampingSection.model_fields]
    section = validate(DampingSection, path, faults, model.label, reserved=reserved)
    if section is None or section.structural_damping is None:
        return None if section is None else joint
    if not has_dampers(joint):
        problem = f"{model.label} has no dampers that could act as structural damping."
        faults.add((*path, "structural_damping"), problem, remedy="Leave it out.")
        return None
    return replace(joint, structural_damping=section.structural_damping)


def add_model_faults(model: LabelledComponent, model_faults: Sequence[Fault], path: Path, faults: FaultList) -> None:
    """Report the faults of a model's code, which no description can correct."""
    remedy = f"Correct it in {source_file(model.component)}." if source_file(model.component) else ""
    for fault in model_faults:
        faults.add(path, f"{model.label} {fault.problem}", fault.accepted, remedy, key=True)


class _Connect:
    """The section ``connect:`` of a joint."""

    def __init__(self, model: LabelledComponent, joint: Path, substructures: Substructures, faults: FaultList) -> None:
        self._model = model
        self._path: Path = (*joint, "connect")
        self._substructures = substructures
        self._faults = faults

    def read(self, ports: tuple[JointPort, ...]) -> tuple[Attachment | None, ...]:
        section = self._faults.root.at(self._path)
        names = [port.name for port in ports]
        if section is None and not names:
            return ()
        if section is None or not section.is_mapping:
            problem = f"{self._model.label} lacks 'connect'."
            if section is not None:
                problem = f"{format_value(section.value)} is not a section of keys and values."
            self._faults.add(self._path, problem, f"a section with the ports {listing(names)}", key=True)
            return (None,) * len(ports)
        misspelt = [self._unknown(key, names) for key in section.entries if key not in names]
        for name in names:
            if name not in section.entries and not any(f"'{name}'" in hint for hint in misspelt):
                problem = f"the port '{name}' of {self._model.label} is not connected."
                accepted = f"{name}: {{to: SUBSTRUCTURE, at: [POSITION, ...]}}"
                self._faults.add((*self._path, name), problem, accepted, key=True)
        attachments = tuple(self._attachment(port) if port.name in section.entries else None for port in ports)
        self._check_distinct(ports, attachments)
        return attachments

    def _unknown(self, key: str, names: list[str]) -> str:
        """Report a port that the model does not have, and return a hint at the port that was probably meant."""
        hint = did_you_mean(key, names)
        problem = f"{format_value(key)} is not a port of {self._model.label}."
        self._faults.add((*self._path, key), problem, listing(names), hint, key=True)
        return hint

    def _attachment(self, port: JointPort) -> Attachment | None:
        path: Path = (*self._path, port.name)
        section = validate(AttachmentSection, path, self._faults, f"the port '{port.name}'")
        if section is None:
            return None
        if section.to not in self._substructures:
            names = list(self._substructures)
            if names:
                problem = f"there is no substructure {format_value(section.to)}."
                self._faults.add((*path, "to"), problem, listing(names), did_you_mean(section.to, names))
            return None
        if len(section.at) != port.nodes:
            takes = f"takes {port.nodes} node{'' if port.nodes == 1 else 's'}, not {len(section.at)}"
            self._faults.add((*path, "at"), f"the port '{port.name}' of {self._model.label} {takes}.")
            return None
        substructure = self._substructures[section.to]
        return None if substructure is None else self._on_nodes(section, substructure, port, path)

    def _on_nodes(
        self, section: AttachmentSection, substructure: SubstructureModel, port: JointPort, path: Path
    ) -> Attachment | None:
        nodes = [
            find_node(section.to, substructure, position, (*path, "at", index), self._faults)
            for index, position in enumerate(section.at)
        ]
        complete = tuple(node for node in nodes if node is not None)
        if len(complete) < len(nodes):
            return None
        for index, node in enumerate(complete):
            directions = substructure.nodes[node].directions
            if lacking := [direction for direction in port.directions if direction not in directions]:
                problem = (
                    f"{self._model.label} acts in {', '.join(port.directions)}, but this node of '{section.to}' does "
                    f"not move in {', '.join(lacking)}."
                )
                self._faults.add((*path, "at", index), problem, f"a node with {', '.join(port.directions)}")
                return None
        return Attachment(section.to, complete)

    def _check_distinct(self, ports: tuple[JointPort, ...], attachments: tuple[Attachment | None, ...]) -> None:
        taken: set[tuple[str, int]] = set()
        for port, attachment in zip(ports, attachments, strict=True):
            substructure = self._substructures.get(attachment.substructure) if attachment is not None else None
            if attachment is None or substructure is None or substructure.grounded:
                continue
            for index, node in enumerate(attachment.nodes):
                if (attachment.substructure, node) in taken:
                    position = format_quantity(substructure.nodes[node].position, "m")
                    problem = f"the node of '{attachment.substructure}' at {position} is already taken by this joint."
                    self._faults.add((*self._path, port.name, "at", index), problem)
                taken.add((attachment.substructure, node))


def check_connected(
    substructures: Mapping[str, SubstructureModel],
    joints: Mapping[str, JointEntry],
    responses: Sequence[Response],
    faults: FaultList,
) -> None:
    """Report parts and joints without any path to the first response; the ground transmits no motion."""
    response = responses[0].substructure
    neighbours = {
        name: {attachment.substructure for attachment in joint.connection.attachments} for name, joint in joints.items()
    }
    reached, waiting = {response}, [response]
    while waiting:
        substructure = waiting.pop()
        for attached in neighbours.values():
            if substructure in attached and not substructures[substructure].grounded:
                waiting.extend(attached - reached)
                reached |= attached
    for name in substructures:
        if name not in reached:
            problem = f"no joint connects '{name}' with '{response}', where the response is."
            faults.add(("substructures", name), problem, remedy="Connect it or remove it.", key=True)
    for name, attached in neighbours.items():
        if attached and all(substructures[neighbour].grounded for neighbour in attached):
            problem = f"the joint '{name}' attaches to nothing that moves."
            faults.add(("joints", name), problem, remedy="Connect it to a part that moves, or remove it.", key=True)


def find_node(
    name: str, substructure: SubstructureModel, position: NodePosition, path: Path, faults: FaultList
) -> int | None:
    """Return the index of the node at a position or point [m] or with a label; None, with a fault, if there is none."""
    if isinstance(position, str):
        return _find_label(name, substructure, position, path, faults)
    if isinstance(position, tuple):
        return _find_coordinates(name, substructure, position, path, faults)
    nodes = substructure.nodes
    indices = [index for index, node in enumerate(nodes) if _is_at(node.position, position)]
    text = format_quantity(position, "m", 8)
    if len(indices) == 1 or (indices and substructure.grounded):
        return indices[0]
    if indices:
        labels = listing(nodes[index].label for index in indices)
        faults.add(path, f"{text} of substructure '{name}' could be any of its nodes {labels}.")
    else:
        positions = dict.fromkeys(format_quantity(node.position, "m") for node in nodes)
        accepted, remedy = listing(positions), _nearest(nodes, position)
        if len(positions) == 1 < len(nodes):
            accepted, remedy = f"{listing(node.label for node in nodes)}, or coordinates", ""
        if any(_is_at(node.position, scale * position) for node in nodes if position for scale in (1e-3, 1e3)):
            remedy = f"{remedy} A number without a unit is in metres.".strip()
        if any(node.label == f"{position:g}" for node in nodes):
            remedy = f"A number is a position; for the node with this label write 'node {position:g}'."
        faults.add(path, f"substructure '{name}' has no node at {text}.", accepted, remedy)
    return None


def find_point(
    substructures: Mapping[str, SubstructureModel], name: str, position: float, direction: str
) -> tuple[str, int]:
    """Return the DOF of a substructure at a node's position [m].

    Raises
    ------
    ParameterError
        No such substructure, node or direction.
    """
    if name not in substructures:
        problem, hint = f"there is no substructure '{name}'.", did_you_mean(name, substructures)
        raise ParameterError(Fault("point", problem, listing(substructures), hint))
    nodes, dofs = [node.position for node in substructures[name].nodes], substructures[name].node_dofs
    nearest = min(range(len(nodes)), key=lambda index: abs(nodes[index] - position))
    if not _is_at(nodes[nearest], position):
        problem = f"'{name}' has no node at {position * 1e3:g} mm."
        raise ParameterError(Fault("point", problem, f"the nearest is at {nodes[nearest] * 1e3:g} mm"))
    if (dof := dofs.find(nearest, direction)) is None:
        problem = f"'{direction}' is not a direction of '{name}' there."
        raise ParameterError(Fault("point", problem, listing(dofs.directions[nearest])))
    return name, dof


def _is_at(node: float, position: float) -> bool:
    """Return whether a node is at a position, both in m, up to rounding in the description."""
    return abs(node - position) <= 1e-9 + 1e-6 * abs(position)


def _find_label(name: str, substructure: SubstructureModel, label: str, path: Path, faults: FaultList) -> int | None:
    labels = [node.label for node in substructure.nodes]
    if label in labels:
        return labels.index(label)
    problem = f"substructure '{name}' has no node '{label}'."
    faults.add(path, problem, f"{listing(labels)}; or a position", did_you_mean(label, labels))
    return None


def _find_coordinates(
    name: str, substructure: SubstructureModel, point: tuple[float, float, float], path: Path, faults: FaultList
) -> int | None:
    """Return the index of the node at a point of the assembly [m]."""
    distances = np.linalg.norm([np.subtract(node.coordinates, point) for node in substructure.nodes], axis=1)
    span = float(np.ptp([node.coordinates for node in substructure.nodes], axis=0).max())
    near = np.flatnonzero(distances <= 1e-9 + 1e-6 * span)
    if len(near) == 1 or (len(near) and substructure.grounded):
        return int(near[0])
    if len(near):
        labels = listing(substructure.nodes[index].label for index in near)
        faults.add(path, f"several nodes of '{name}' are there: {labels}.", "the label of one of them")
        return None
    closest = substructure.nodes[int(np.argmin(distances))]
    remedy = f"The nearest is '{closest.label}' at {format_point(closest.coordinates)}."
    faults.add(path, f"substructure '{name}' has no node at {format_point(point)}.", remedy=remedy)
    return None


def _nearest(nodes: Sequence[PartNode], position: float) -> str:
    distinct = sorted({node.position for node in nodes}, key=lambda other: abs(other - position))
    nearest = [format_quantity(other, "m", 8) for other in sorted(distinct[:2])]
    if len(nearest) == 1:
        return f"The only node is at {nearest[0]}."
    return f"The nearest nodes are at {nearest[0]} and {nearest[1]}."
