"""The same assembly with a finer mesh: a truth from which the model differs by a realistic error."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from dovetail import Assembly, Fault, ParameterError, SubstructureModel
from dovetail.evaluation import Attachment, Connection

_SAME_PLACE = 1e-9
"""m within which a node of the finer mesh is that of the coarser one."""


def finer(assembly: Assembly, factor: int) -> Assembly:
    """Return the assembly with `factor` elements in the place of each, in every part and joint that has a mesh.

    Parameters
    ----------
    assembly : Assembly
    factor : int
        1 for the assembly itself.

    Raises
    ------
    ParameterError
        The factor is less than 1, or nothing has a mesh that can be refined.
    """
    if factor < 1:
        raise ParameterError(Fault("finer_mesh", f"{factor} is not a number of elements.", "1 or more"))
    if factor == 1:
        return assembly
    description = assembly.description
    refined = {
        name: substructure.refined(factor) or substructure for name, substructure in description.substructures.items()
    }
    unknown_parts = {
        name: replace(entry, connection=_refined_part(entry.connection, name, factor))
        for name, entry in description.unknown_parts.items()
    }
    joints = {}
    for name, joint in description.joints.items():
        connection = joint.connection
        attachments = tuple(
            _moved(attachment, description.substructures, refined) for attachment in connection.attachments
        )
        model = connection.model.refined(factor) or connection.model
        joints[name] = replace(joint, connection=replace(connection, model=model, attachments=attachments))
    same_joints = all(
        joints[name].connection.model is joint.connection.model for name, joint in description.joints.items()
    )
    if same_joints and all(refined[name] is substructure for name, substructure in description.substructures.items()):
        raise ParameterError(Fault(assembly.name, "none of its parts has a mesh that can be made finer."))

    def moved(place: Any) -> Any:
        name = place.substructure
        node = _node(description.substructures[name], place.node, refined[name])
        return whole.moved(place, name, node)

    whole = replace(description, substructures=refined, joints=joints, unknown_parts=unknown_parts)
    responses = tuple(replace(moved(r), force=r.force and moved(r.force)) for r in description.responses)
    return assembly.with_description(
        replace(whole, responses=responses, sensors=tuple(map(moved, description.sensors)))
    )


def _refined_part(connection: Connection, name: str, factor: int) -> Connection:
    """Return a substructure with unknown options with a finer mesh."""
    model = connection.model.refined(factor)
    if model is None:
        return connection
    return Connection(model, tuple(Attachment(name, (node,)) for node in range(len(model.ports))))


def _moved(
    attachment: Attachment, coarse: Mapping[str, SubstructureModel], fine: Mapping[str, SubstructureModel]
) -> Attachment:
    name = attachment.substructure
    return replace(attachment, nodes=tuple(_node(coarse[name], node, fine[name]) for node in attachment.nodes))


def _node(coarse: SubstructureModel, node: int, fine: SubstructureModel) -> int:
    """Return the node of the finer substructure at the position of a node of the coarser one."""
    if fine is coarse:
        return node
    position = coarse.nodes[node].position
    coarse_nodes, fine_nodes = (
        [index for index, other in enumerate(part.nodes) if abs(other.position - position) <= _SAME_PLACE]
        for part in (coarse, fine)
    )
    if len(coarse_nodes) != len(fine_nodes):  # of nodes at one place, each is that of the same rank among them
        counts = len(fine_nodes), len(coarse_nodes)
        problem = f"its finer mesh has {counts[0]} nodes at {position:g} m, where the coarser one has {counts[1]}."
        raise ParameterError(Fault(f"substructure model '{coarse.name}'", problem))
    return fine_nodes[coarse_nodes.index(node)]
