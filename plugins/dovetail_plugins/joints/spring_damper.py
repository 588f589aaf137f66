"""Springs and dampers between two parts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from dovetail import ComponentConfig, JointModel, JointPort, Parameter, StructuralMatrices

_TRANSLATION = (
    Parameter("k", "N/m", 1e4, 1e10, "log", "translational stiffness, per node"),
    Parameter("c", "N s/m", 1.0, 1e4, "log", "translational damping, per node"),
)
_ROTATION = (
    Parameter("kr", "N m/rad", 1e2, 1e7, "log", "rotational stiffness, per node"),
    Parameter("cr", "N m s/rad", 1e-3, 1e2, "log", "rotational damping, per node"),
)


class SpringDamper(JointModel):
    """A massless contact layer between nodes that face each other, in translation, in rotation or in both.

    In a direction that is omitted the parts are not connected. Between bars that lie on each other nothing resists the
    sliding of their faces, see `bolted`.
    """

    name = "spring_damper"
    summary = "Massless springs and dampers between facing nodes, in translation, rotation or both"

    class Config(ComponentConfig):
        """Number of facing nodes, and the directions in which they are connected.

        Attributes
        ----------
        nodes : int
            Number of facing nodes of each part.
        direction : 'x', 'rz' or 'both'
            Connection in displacement, in rotation, or in both.
        """

        nodes: Annotated[int, Field(ge=1, le=1000)] = 1
        direction: Literal["x", "rz", "both"] = "both"

    @classmethod
    def examples(cls, folder: Path) -> Sequence[Mapping[str, Any]]:  # noqa: ARG003
        """Return one node in both directions, and several in a single direction."""
        return {}, {"nodes": 2, "direction": "x"}, {"nodes": 3, "direction": "rz"}

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """K and c in translation, kr and cr in rotation."""
        return {"x": _TRANSLATION, "rz": _ROTATION, "both": _TRANSLATION + _ROTATION}[self.config.direction]

    @property
    def linear_parameters(self) -> tuple[str, ...]:
        """All of them."""
        return tuple(parameter.name for parameter in self.parameters)

    @cached_property
    def ports(self) -> tuple[JointPort, ...]:
        """The two sides, a and b."""
        return JointPort("a", self.config.nodes), JointPort("b", self.config.nodes)

    @cached_property
    def contact_dofs(self) -> tuple[tuple[int, int], ...]:
        """Facing DOFs in the connected directions."""
        half = 2 * int(self.config.nodes)
        axes = {"x": (0,), "rz": (1,), "both": (0, 1)}[self.config.direction]
        return tuple((2 * node + axis, half + 2 * node + axis) for axis in axes for node in range(self.config.nodes))

    def matrices(self, theta: NDArray[np.float64]) -> StructuralMatrices:
        """Return the matrices for theta (n, 2) or (n, 4)."""
        joint = StructuralMatrices.zeros(len(theta), self.size)
        directions = len(self.parameters) // 2
        each = len(self.contact_dofs) // directions
        for index in range(directions):
            pairs = self.contact_dofs[index * each : (index + 1) * each]
            joint.add_contact_layer(pairs, theta[:, 2 * index], theta[:, 2 * index + 1])
        return joint
