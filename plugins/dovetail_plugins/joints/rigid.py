"""Rigid connections: two nodes move as one, in all directions, as a ball joint, as a hinge, or across a distance."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from dovetail import (
    DIRECTIONS,
    PLANAR,
    ComponentConfig,
    Direction,
    JointModel,
    JointPort,
    Parameter,
    StructuralMatrices,
)


class Rigid(JointModel):
    """Facing nodes share displacement and rotation, or only some directions, as in a hinge or a ball joint.

    Two bars that lie on each other and are joined at several nodes bend with the sum of their own stiffnesses: nothing
    resists the sliding of their faces, see `bolted`.
    """

    name = "rigid"
    summary = "Rigid connection, hinge or ball joint: facing nodes share their DOFs"
    parameters: tuple[Parameter, ...] = ()

    class Config(ComponentConfig):
        """Number of facing nodes, and the directions that they share.

        Attributes
        ----------
        nodes : int
            Number of facing nodes of each part.
        direction : 'x', 'rz', 'both', 'all', or a sequence of directions
            Shared directions. In a plane: the displacement (a hinge), the rotation, or both. In space: all six, or
            some of x, y, z, rx, ry, rz, in this order; [x, y, z] is a ball joint, [x, y, z, rx, ry] a hinge about z.
        """

        nodes: Annotated[int, Field(ge=1, le=1000)] = 1
        direction: Literal["x", "rz", "both", "all"] | Annotated[tuple[Direction, ...], Field(min_length=1)] = "both"

    @classmethod
    def examples(cls, folder: Path) -> Sequence[Mapping[str, Any]]:  # noqa: ARG003
        """Return a rigid connection and a hinge in a plane, and a ball joint in space."""
        return {}, {"nodes": 2, "direction": "x"}, {"direction": ["x", "y", "z"]}

    @property
    def ports(self) -> tuple[JointPort, ...]:
        """The two sides, a and b."""
        nodes, directions = self.config.nodes, self._directions
        return JointPort("a", nodes, directions=directions), JointPort("b", nodes, directions=directions)

    @property
    def _directions(self) -> tuple[str, ...]:
        """The directions of the ports' nodes, of which all are shared, or one in a plane."""
        if isinstance(self.config.direction, tuple):
            return tuple(self.config.direction)
        return DIRECTIONS if self.config.direction == "all" else PLANAR

    @property
    def merged_dofs(self) -> tuple[tuple[int, int], ...]:
        """Facing DOFs in the connected directions."""
        half = self.node_dofs.size // 2
        shared = [dof for dof in range(half) if self.config.direction not in PLANAR or self._is_shared(dof)]
        return tuple((dof, half + dof) for dof in shared)

    def _is_shared(self, dof: int) -> bool:
        return bool(self.node_dofs[dof][1] == self.config.direction)

    def matrices(self, theta: NDArray[np.float64]) -> StructuralMatrices:
        """Return zeros: a rigid connection only merges DOFs."""
        return StructuralMatrices.zeros(len(theta), self.size)


class BallJoint(Rigid):
    """Two nodes in space share their displacements and turn freely."""

    name = "ball_joint"
    summary = "Ball joint in space: two nodes share x, y and z"

    class Config(ComponentConfig):
        """It has no options."""

    @classmethod
    def examples(cls, folder: Path) -> Sequence[Mapping[str, Any]]:  # noqa: ARG003
        """Return the joint."""
        return ({},)

    @property
    def ports(self) -> tuple[JointPort, ...]:
        """The two sides, a and b."""
        return JointPort("a", 1, directions=self._directions), JointPort("b", 1, directions=self._directions)

    @property
    def merged_dofs(self) -> tuple[tuple[int, int], ...]:
        """All DOFs of the two nodes in its directions."""
        return self.contact_dofs

    @property
    def _directions(self) -> tuple[str, ...]:
        return DIRECTIONS[:3]


class Hinge(BallJoint):
    """Two nodes in space share all motions but the rotation about an axis.

    The axis is one of the assembly's, or with `axes` another one.
    """

    name = "hinge"
    summary = "Hinge in space: two nodes share all motions but the rotation about an axis"

    class Config(ComponentConfig):
        """Its axis.

        Attributes
        ----------
        axis : 'x', 'y' or 'z'
            About which it turns freely.
        """

        axis: Literal["x", "y", "z"] = "z"

    @classmethod
    def examples(cls, folder: Path) -> Sequence[Mapping[str, Any]]:  # noqa: ARG003
        """Return a hinge about z and one about x."""
        return {}, {"axis": "x"}

    @property
    def _directions(self) -> tuple[str, ...]:
        return tuple(direction for direction in DIRECTIONS if direction != f"r{self.config.axis}")


class RigidLink(Rigid):
    """Two nodes that lie apart move as points of one rigid body, as if a rigid arm without mass led from a to b.

    u_b = u_a + theta_a x r with the way r from a to b, and theta_b = theta_a. Large rotations are not modelled.
    """

    name = "rigid_link"
    summary = "Rigid link in space: two nodes that lie apart move as points of one rigid body"
    carries_its_nodes = True

    class Config(ComponentConfig):
        """What it holds at its end.

        Attributes
        ----------
        direction : 'all', or a sequence of directions
            Motions of b that follow those of the arm's end; [x, y, z] leaves b free to turn, as a ball joint does.
        """

        direction: Literal["all"] | Annotated[tuple[Direction, ...], Field(min_length=1)] = "all"

    @classmethod
    def examples(cls, folder: Path) -> Sequence[Mapping[str, Any]]:  # noqa: ARG003
        """Return a link that holds all motions, and one with a ball joint at its end."""
        return {}, {"direction": ["x", "y", "z"]}

    @property
    def ports(self) -> tuple[JointPort, ...]:
        """The node a, in all directions, and b."""
        return JointPort("a", 1, directions=DIRECTIONS), JointPort("b", 1, directions=self._directions)

    @property
    def merged_dofs(self) -> tuple[tuple[int, int], ...]:
        """The directions of b, with those of the arm's end."""
        return tuple((DIRECTIONS.index(each), len(DIRECTIONS) + dof) for dof, each in enumerate(self._directions))
