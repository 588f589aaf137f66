"""Joints at nodes that other nodes carry, as the points of a rigid body do."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from dovetail.description.joint_coordinates import JointOfCarriedPoints, LawInCoordinates
from dovetail.interfaces import DIRECTIONS, JointModel, JointPort, NodeDofs, SubstructureModel
from dovetail.synthesis import Attachment, Connection
from dovetail.synthesis.joint_evaluation import depends_on_frequency

_Node = tuple[NodeDofs, int]
"""The DOFs of a part's nodes, and one of the nodes."""


class CarriedJoint(JointOfCarriedPoints):
    """A joint that acts at the nodes that carry those to which its model attaches.

    Parameters
    ----------
    model : JointModel
    nodes : sequence of (NodeDofs, int)
        The nodes of its ports, port by port.
    """

    def __init__(self, model: JointModel, nodes: tuple[_Node, ...]) -> None:
        super().__init__(model)
        self._nodes = nodes

    @cached_property
    def motions(self) -> list[NDArray[np.float64]]:
        """The model's directions (n, 6) at each node by those of the node that carries it, or of the node itself."""
        motions = []
        for (dofs, node), directions in zip(self._nodes, self.model.node_dofs.directions, strict=True):
            carrier, _ = dofs.carriers.get(node, (node, None))
            axis_of = {dof: DIRECTIONS.index(dofs[dof][1]) for dof in dofs.at_node(carrier)}
            motion = np.zeros((len(directions), len(DIRECTIONS)))
            for row, direction in enumerate(directions):
                for weight, dof in dofs.terms(node, {direction: 1.0}):
                    motion[row, axis_of[dof]] = weight
            motions.append(motion)
        return motions

    @cached_property
    def ports(self) -> tuple[JointPort, ...]:
        """One for each node, in the directions in which the joint acts there."""
        return self.ports_named(f"node_{number}" for number in range(len(self._nodes)))


class CarriedLaw(LawInCoordinates, CarriedJoint):
    """A `CarriedJoint` with a dynamic stiffness of its own dependence on frequency."""


def at_carriers(connection: Connection, parts: Mapping[str, SubstructureModel]) -> Connection:
    """Return a connection at the nodes that carry those to which it attaches; itself if nothing carries these."""
    dofs = {at.substructure: NodeDofs.from_nodes(parts[at.substructure].nodes) for at in connection.attachments}
    if not any(node in dofs[at.substructure].carriers for at in connection.attachments for node in at.nodes):
        return connection
    every = [(dofs[at.substructure], node) for at in connection.attachments for node in at.nodes]
    model = (CarriedLaw if depends_on_frequency(connection.model) else CarriedJoint)(connection.model, tuple(every))
    return replace(connection, model=model, attachments=tuple(_carriers(connection, dofs)))


def _carriers(connection: Connection, dofs: Mapping[str, NodeDofs]) -> Iterator[Attachment]:
    for at in connection.attachments:
        for node in at.nodes:
            carrier, _ = dofs[at.substructure].carriers.get(node, (node, None))
            yield Attachment(at.substructure, (carrier,))
