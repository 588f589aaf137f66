"""Assemblies that differ from a described one: other points, responses, damping, ranges and measurement chains."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from dovetail.assembly.model import Assembly
from dovetail.description import ParameterEntry, Place, Response, has_dampers, with_damping
from dovetail.interfaces import Parameter
from dovetail.synthesis import Point
from dovetail.synthesis.graph import HELD

NodePlace = tuple[str, int]
"""Substructure and number of a node."""


def at_drive_point(assembly: Assembly) -> Assembly:
    """Return an assembly of one response with the force where the response is measured."""
    response = assembly.description.response
    if response.is_drive_point:
        return assembly
    return _with_responses(assembly, replace(response, force=None))


def measured_at(assembly: Assembly, node: NodePlace, *, with_force: bool) -> Assembly:
    """Return an assembly of one response that is measured at another node, with the force there too or as described."""
    described = assembly.description.response
    force = described.force or Place(described.substructure, described.node, described.direction, described.dofs)
    moved = assembly.description.moved(described, *node)
    return _with_responses(assembly, replace(moved, force=None if with_force else force))


def _with_responses(assembly: Assembly, *responses: Response) -> Assembly:
    return assembly.with_description(replace(assembly.description, responses=responses))


def at_drive_points(assembly: Assembly) -> tuple[Assembly, Assembly]:
    """Return the assembly with the drive points at the output and at the input of its response."""
    response = assembly.description.response
    at = response.force or response
    moved = replace(
        response, substructure=at.substructure, node=at.node, direction=at.direction, dofs=at.dofs, force=None
    )
    return at_drive_point(assembly), _with_responses(assembly, moved)


def movable_nodes(assembly: Assembly) -> list[NodePlace]:
    """Return all nodes that can move in the direction of the response, except the response's own."""
    response, substructures = assembly.description.response, assembly.description.substructures.items()
    nodes = [(name, node) for name, model in substructures for node in range(len(model.nodes))]
    nodes.remove((response.substructure, response.node))
    return [node for node in nodes if _can_move(assembly, node)]


def motion_at(assembly: Assembly, node: NodePlace) -> Point:
    """Return the DOF of a node in the direction of the response."""
    return assembly.description.moved(assembly.description.response, *node).point


def _can_move(assembly: Assembly, node: NodePlace) -> bool:
    description = assembly.description
    placed_node = description.placed_parts[node[0]].nodes[node[1]]
    if placed_node.carrier is not None or description.response.direction not in placed_node.directions:
        return False
    substructure, dof = motion_at(assembly, node)
    return bool(assembly.graph.substructure_dofs(substructure)[dof] != HELD)


def repetitions(assembly: Assembly) -> NDArray[np.intp]:
    """Return for each response how many earlier ones are the same FRF of the same structure.

    A calibration's mass or window changes the structure.
    """
    description, seen = assembly.description, list[tuple[object, ...]]()
    for response in description.responses:
        chain = description.chain_of(response)
        mass, window = (chain.fixed.get(name, 0.0) for name in ("mass", "window"))
        seen.append((response.terms, response.force_terms, mass, window))
    return np.array([seen[:number].count(place) for number, place in enumerate(seen)])


def with_responses_exchanged(assembly: Assembly, former: int, latter: int) -> Assembly | None:
    """Return the assembly with two responses exchanged; None if they are equal, or of different kinds."""
    description, responses = assembly.description, list(assembly.description.responses)
    first, second = responses[former], responses[latter]
    ends = [(response.terms, response.force_terms, description.chain_of(response)) for response in (first, second)]
    if ends[0] == ends[1] or (first.rotation, first.moment) != (second.rotation, second.moment):
        return None
    responses[former] = replace(second, quantity=first.quantity)
    responses[latter] = replace(first, quantity=second.quantity)
    return _with_responses(assembly, *responses)


def with_viscous_joints(assembly: Assembly) -> Assembly | None:
    """Return the assembly with viscous damping in all joints; None if all are described so."""
    joints = assembly.description.joints.values()
    if all(joint.structural_damping is None for joint in joints):
        return None
    return assembly.with_description(with_damping(assembly.description, None))


def with_structural_joints(assembly: Assembly, frequency: float) -> Assembly | None:
    """Return the assembly with structural damping in all joints, as strong as viscous damping at a frequency [Hz].

    None if no joint has dampers that are described as viscous.
    """
    joints = assembly.description.joints.values()
    if not any(joint.structural_damping is None and has_dampers(joint) for joint in joints):
        return None
    return assembly.with_description(with_damping(assembly.description, frequency))


def with_range(assembly: Assembly, number: int, lower: float, upper: float) -> Assembly:
    """Return the assembly with another range of a parameter, by its number."""
    owner, name = assembly.description.identified_parameters[number]
    return assembly.with_description(assembly.description.with_range(owner, name, lower, upper))


def with_unknown_chains(assembly: Assembly, parameters: Sequence[Parameter]) -> tuple[Assembly, tuple[str, ...]]:
    """Return the assembly with further parameters of each measurement chain, and the names of those that it lacked."""
    description = assembly.description
    chains, added = dict(description.calibrations), list[str]()
    for response in description.responses:
        entry = chains.get(response.name, ParameterEntry())
        present = {parameter.name for parameter in entry.parameters}
        lacking = tuple(parameter for parameter in parameters if parameter.name not in present)
        chains[response.name] = replace(entry, parameters=(*entry.parameters, *lacking))
        added += [f"{response.name}.{parameter.name}" for parameter in lacking]
    return assembly.with_description(replace(description, calibrations=chains)), tuple(added)
