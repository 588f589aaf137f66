"""A rigid connection: the nodes of two parts become one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from dovetail import ComponentConfig, JointModel, Parameter, Port, StructuralMatrices


class Rigid(JointModel):
    """Facing nodes share displacement and rotation, or only the displacement (a hinge).

    Two bars that lie on each other and are joined at several nodes bend with the sum of their own stiffnesses: nothing
    resists the sliding of their faces, see `bolted`.
    """

    name = "rigid"
    summary = "Rigid connection or hinge: facing nodes share their DOFs"
    parameters: tuple[Parameter, ...] = ()

    class Config(ComponentConfig):
        """Number of facing nodes, and the directions that they share.

        Attributes
        ----------
        nodes : int
            Number of facing nodes of each part.
        direction : 'x', 'rz' or 'both'
            Shared directions: the displacement (a hinge), the rotation, or both.
        """

        nodes: Annotated[int, Field(ge=1, le=1000)] = 1
        direction: Literal["x", "rz", "both"] = "both"

    @classmethod
    def examples(cls, folder: Path) -> Sequence[Mapping[str, Any]]:  # noqa: ARG003
        """Return a rigid connection and a hinge."""
        return {}, {"nodes": 2, "direction": "x"}

    @property
    def ports(self) -> tuple[Port, ...]:
        """The two sides, a and b."""
        return Port("a", self.config.nodes), Port("b", self.config.nodes)

    @property
    def merged_dofs(self) -> tuple[tuple[int, int], ...]:
        """Facing DOFs in the connected directions."""
        axes = {"x": (0,), "rz": (1,), "both": (0, 1)}[self.config.direction]
        half = 2 * int(self.config.nodes)
        return tuple((2 * node + axis, half + 2 * node + axis) for node in range(self.config.nodes) for axis in axes)

    def matrices(self, theta: NDArray[np.float64]) -> StructuralMatrices:
        """Return zeros: a rigid connection only merges DOFs."""
        return StructuralMatrices.zeros(len(theta), self.size)
