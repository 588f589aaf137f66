"""Joints with axes of their own, along which their springs act."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from pydantic import model_validator

from dovetail.description.joint_coordinates import JointInCoordinates, LawInCoordinates
from dovetail.description.placed_parts import TurnSection, Vector, turned
from dovetail.interfaces import (
    DIRECTIONS,
    ComponentConfig,
    JointModel,
    JointPort,
    are_perpendicular,
    exact_rotation,
    six_directions,
)
from dovetail.synthesis.joint_evaluation import depends_on_frequency


class AxesSection(ComponentConfig):
    """The axes of a joint in the assembly; the third follows from two, by the right-hand rule.

    Attributes
    ----------
    x, y, z : direction
        Two of them, perpendicular; one is enough for a joint that acts only along it or about it.
    rotate : sequence of rotations
        Instead: rotations one after the other, each as {about: z, angle: 90 deg}.
    """

    x: Vector | None = None
    y: Vector | None = None
    z: Vector | None = None
    rotate: tuple[TurnSection, ...] = ()

    @model_validator(mode="after")
    def _one_orientation(self) -> AxesSection:
        axes = self.known_axes
        if bool(axes) == bool(self.rotate):
            raise ValueError("give either 'rotate', or one or two of 'x', 'y' and 'z'")
        if len(axes) == 3:
            raise ValueError("give two of 'x', 'y' and 'z'; the third follows")
        if any(not np.linalg.norm(vector) > 0.0 for vector in axes.values()):
            raise ValueError("a direction has no length")
        if len(axes) == 2 and not are_perpendicular(*axes.values()):
            raise ValueError("'{}' and '{}' are not perpendicular".format(*axes))
        return self

    @property
    def known_axes(self) -> dict[str, NDArray[np.float64]]:
        """The axes in this section, as unit vectors by their names."""
        named = {"x": self.x, "y": self.y, "z": self.z}
        vectors = {name: np.asarray(vector) for name, vector in named.items() if vector is not None}
        return {name: vector / (np.linalg.norm(vector) or 1.0) for name, vector in vectors.items()}

    @property
    def rotation(self) -> NDArray[np.float64]:
        """The axes in columns (3, 3)."""
        if self.rotate:
            return turned(self.rotate)
        axes, order = self.known_axes, "xyz"
        first = next(iter(axes))
        second = next((name for name in axes if name != first), order[(order.index(first) + 1) % 3])
        if second not in axes:  # any perpendicular one
            least = np.eye(3)[int(np.argmin(np.abs(axes[first])))]
            across = np.cross(axes[first], least)
            axes[second] = across / np.linalg.norm(across)
        (third,) = {*order} - {first, second}
        sense = 1.0 if (order.index(second) - order.index(first)) % 3 == 1 else -1.0
        axes[third] = sense * np.cross(axes[first], axes[second])
        return exact_rotation(np.column_stack([axes[name] for name in order]))


class OrientedJoint(JointInCoordinates):
    """A joint that acts along axes of its own, between nodes with DOFs along the assembly's axes.

    Parameters
    ----------
    model : JointModel
    rotation : (3, 3) array
        The joint's axes in the assembly, in columns.
    """

    def __init__(self, model: JointModel, rotation: NDArray[np.float64]) -> None:
        super().__init__(model)
        self._rotation = rotation

    @property
    def axes(self) -> NDArray[np.float64]:
        """The joint's axes in the assembly, in columns (3, 3)."""
        return self._rotation

    def _along(self, directions: Sequence[str]) -> NDArray[np.float64]:
        """Return the joint's directions (n, 6) by those of the assembly."""
        return six_directions(self._rotation).T[[DIRECTIONS.index(direction) for direction in directions]]

    @cached_property
    def ports(self) -> tuple[JointPort, ...]:
        """Those of the model, with the directions of the assembly in which it acts."""
        ports = []
        for port in self.model.ports:
            acts = np.flatnonzero(self._along(port.directions).any(axis=0))
            ports.append(JointPort(port.name, port.nodes, port.positions, tuple(DIRECTIONS[axis] for axis in acts)))
        return tuple(ports)

    @cached_property
    def blocks(self) -> list[NDArray[np.float64]]:
        """The directions of the model at each node by those of this joint."""
        pairs = zip(self.model.node_dofs.directions, self.node_dofs.directions, strict=True)
        return [self._along(of_model)[:, [DIRECTIONS.index(each) for each in of_joint]] for of_model, of_joint in pairs]

    @property
    def merged_dofs(self) -> tuple[tuple[int, int], ...]:
        """Those of the model along the assembly's axes; none if some are not along them (see `pair_functions`)."""
        return self._pairs(self.model.merged_dofs)

    @property
    def contact_dofs(self) -> tuple[tuple[int, int], ...]:
        """Those of the model along the assembly's axes; none if some are not along them."""
        return self._pairs(self.model.contact_dofs)

    def _pairs(self, pairs: Iterable[tuple[int, int]]) -> tuple[tuple[int, int], ...]:
        """Return pairs of DOFs that are the same as those of the model; none if these are not all along axes."""
        between: dict[tuple[int, int], list[tuple[int, int]]] = {}
        dofs = self.model.node_dofs
        for first, second in pairs:
            if max(first, second) >= dofs.size:
                return ()  # an inner DOF, along an axis of the joint
            between.setdefault((dofs[first][0], dofs[second][0]), []).append((first, second))
        found = [self._between(nodes, some) for nodes, some in between.items()]
        return tuple(pair for some in found for pair in some) if all(found) else ()

    def _between(self, nodes: tuple[int, int], pairs: Sequence[tuple[int, int]]) -> list[tuple[int, int]]:
        acts = np.flatnonzero(self._along([self.model.node_dofs[first][1] for first, _ in pairs]).any(axis=0))
        if len(acts) != len(pairs):
            return []
        return [
            (
                self.node_dofs.among([nodes[0]], [DIRECTIONS[axis]])[0],
                self.node_dofs.among([nodes[1]], [DIRECTIONS[axis]])[0],
            )
            for axis in acts
        ]


class OrientedLaw(LawInCoordinates, OrientedJoint):
    """An `OrientedJoint` with a dynamic stiffness of its own dependence on frequency."""


def oriented(model: JointModel, rotation: NDArray[np.float64]) -> OrientedJoint:
    """Return a joint with axes of its own.

    Parameters
    ----------
    model : JointModel
    rotation : (3, 3) array
        The joint's axes in the assembly, in columns.
    """
    return (OrientedLaw if depends_on_frequency(model) else OrientedJoint)(model, rotation)
