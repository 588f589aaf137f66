"""The sides of a joint: the parts that it connects, and where their nodes lie."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from dovetail.description.changed_joint import axes_of
from dovetail.description.placed_parts import Placement
from dovetail.interfaces import JointPort, SubstructureModel
from dovetail.synthesis import Attachment, Connection
from dovetail.units import format_quantity


@dataclass(frozen=True)
class Side:
    """The nodes of a part to which a port attaches.

    Parameters
    ----------
    port : JointPort
    part : str
        Name of the substructure.
    model : SubstructureModel
    nodes : tuple of int
        In the port's order.
    placement : Placement or None
        How the part lies in the assembly, if its axes are not the assembly's.
    in_space : bool
        Whether the assembly's parts have places in space.
    axis : (3,) array or None
        Along which the joint counts positions, in the assembly; None for one whose nodes lie on no line of its own.
    """

    port: JointPort
    part: str
    model: SubstructureModel
    nodes: tuple[int, ...]
    placement: Placement | None = None
    in_space: bool = False
    axis: NDArray[np.float64] | None = None

    @property
    def points(self) -> NDArray[np.float64]:
        """Coordinates (n, 3) of the nodes in the assembly [m]."""
        chosen = [self.model.nodes[node] for node in self.nodes]
        placed_nodes = [node if self.placement is None else self.placement.node(node) for node in chosen]
        return np.array([node.coordinates for node in placed_nodes])

    @property
    def all_points(self) -> NDArray[np.float64]:
        """Coordinates (n, 3) of all nodes of the part in the assembly [m]."""
        return replace(self, nodes=tuple(range(len(self.model.nodes)))).points

    @property
    def has_points(self) -> bool:
        """Whether the coordinates of the part are known."""
        return has_points(self.model)

    @property
    def reversed(self) -> bool:
        """Whether the part is described from its other end."""
        return self.placement is not None and self.placement.reversed

    @property
    def positions(self) -> NDArray[np.float64]:
        """Of the nodes along the part [m], as the description counts them."""
        return np.array([self.model.nodes[node].position for node in self.nodes], dtype=np.float64)

    @property
    def along(self) -> NDArray[np.float64]:
        """The positions along the assembly's axis, or the joint's in space [m], from an unknown origin."""
        if self.axis is not None:
            return np.asarray(self.points @ self.axis)
        return -self.positions if self.reversed else self.positions

    @property
    def sense(self) -> float:
        """1 or -1 for nodes that run along that axis or against it; 0 if they are all at one position."""
        return float(np.sign(self.along[-1] - self.along[0]))

    @property
    def ends(self) -> str:
        """The first and the last position in words."""
        return f"from {mm(self.positions[0])} to {mm(self.positions[-1])}"


def sides_of(
    connection: Connection, substructures: Mapping[str, SubstructureModel], placements: Mapping[str, Placement]
) -> dict[str, Side]:
    """Return the sides of a joint by the names of its ports."""
    pairs: Iterator[tuple[JointPort, Attachment]] = zip(connection.model.ports, connection.attachments, strict=True)
    in_space = any(placement.in_space for placement in placements.values())
    on_a_line = in_space and connection.model.nodes_along == ("y",)
    axis = -axes_of(connection.model)[:, 1] if on_a_line else None
    return {
        port.name: Side(port, name, substructures[name], at.nodes, placements.get(name), in_space, axis)
        for port, at in pairs
        for name in (at.substructure,)
    }


def has_points(part: SubstructureModel) -> bool:
    """Return whether coordinates are known: not those of a ground that only says how its points lie on a line."""
    return not part.grounded or any(node.point is not None for node in part.nodes)


def has_positions(part: SubstructureModel) -> bool:
    """Return whether a part's positions say where its nodes are, unlike those of imported matrices without any."""
    return not part.grounded and len({node.position for node in part.nodes}) > 1


def declared_gap(side: Side, other: Side) -> float:
    """Return how far the first node of another port lies along the joint's model from that of a port [m]."""
    if side.port.positions is None or other.port.positions is None:
        return 0.0
    return other.port.positions[0] - side.port.positions[0]


def mm(position: float) -> str:
    """Return a length [m] in words."""
    return format_quantity(float(position), "m", 8)
