"""Joints to which a rigid arm leads from a node."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from dovetail.description.joint_coordinates import JointOfCarriedPoints, LawInCoordinates
from dovetail.interfaces import DIRECTIONS, JointModel, JointPort, carried
from dovetail.synthesis.joint_evaluation import depends_on_frequency


class CarryingJoint(JointOfCarriedPoints):
    """A joint at a point that its nodes carry, as points of rigid bodies.

    Parameters
    ----------
    model : JointModel
        With one node at each port.
    ways : sequence of (3,) arrays
        From the node of each port to the point [m], along the assembly's axes.
    """

    def __init__(self, model: JointModel, ways: Sequence[NDArray[np.float64]]) -> None:
        super().__init__(model)
        self._ways = tuple(ways)

    @cached_property
    def motions(self) -> list[NDArray[np.float64]]:
        """The model's directions (n, 6) at the point by the motion of each node."""
        rows = [[DIRECTIONS.index(direction) for direction in port.directions] for port in self.model.ports]
        return [carried(way)[row] for way, row in zip(self._ways, rows, strict=True)]

    @cached_property
    def ports(self) -> tuple[JointPort, ...]:
        """Those of the model, with the directions of the nodes by which the point moves."""
        return self.ports_named(port.name for port in self.model.ports)


class CarryingLaw(LawInCoordinates, CarryingJoint):
    """A `CarryingJoint` with a dynamic stiffness of its own dependence on frequency."""


def carrying(model: JointModel, points: Sequence[NDArray[np.float64]]) -> CarryingJoint:
    """Return a joint at the node of its last port, to which rigid arms lead from the nodes of the others.

    Parameters
    ----------
    model : JointModel
    points : sequence of (3,) arrays
        Where the node of each port is in the assembly [m].
    """
    kind = CarryingLaw if depends_on_frequency(model) else CarryingJoint
    return kind(model, [points[-1] - point for point in points])
