"""A roller that supports a beam anywhere between its nodes: a joint whose position is a parameter."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

import dovetail
from dovetail import ComponentConfig, InUnit, JointModel, JointPort, Parameter, StructuralMatrices


class MovingSupport(JointModel):
    """A spring between the ground and a point of a beam; between its nodes the beam is a cubic, as in its elements.

    The roller's mass, its play, and friction are not modelled.
    """

    name = "moving_support"
    summary = "Roller under a beam, anywhere between its nodes"

    class Config(ComponentConfig):
        """The nodes of the beam between which the roller moves.

        Attributes
        ----------
        nodes : int
            Number of nodes, at equal distances.
        first : float
            Position of the first one on the beam [m].
        distance : float
            Between two nodes [m].
        """

        nodes: Annotated[int, Field(ge=2, le=1000)] = 11
        first: Annotated[float, InUnit("m")] = 0.04
        distance: Annotated[float, Field(gt=0), InUnit("m")] = 0.02

    @classmethod
    def examples(cls, folder: Path) -> Sequence[Mapping[str, Any]]:
        """Return the default and a short one."""
        return {}, {"nodes": 3, "first": "0 mm", "distance": "30 mm"}

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Where the roller is, and the stiffness of its contact."""
        last = self.config.first + self.config.distance * (self.config.nodes - 1)
        return (
            Parameter("position", "m", self.config.first, last, "linear", "of the roller on the beam"),
            Parameter("k", "N/m", 1e5, 1e9, "log", "stiffness of the contact"),
        )

    @property
    def ports(self) -> tuple[JointPort, ...]:
        """The beam and the ground."""
        return (JointPort("beam", int(self.config.nodes)), JointPort("ground", 1))

    def matrices(self, theta: NDArray[np.float64]) -> StructuralMatrices:
        """Return the matrices for theta (n, 2)."""
        joint, length = StructuralMatrices.zeros(len(theta), self.size), self.config.distance
        elements = (theta[:, 0] - self.config.first) / length
        element = np.clip(np.floor(elements).astype(int), 0, self.config.nodes - 2)
        s, shape = elements - element, np.zeros((len(theta), self.size))
        hermite = (
            1 - 3 * s**2 + 2 * s**3,
            length * (s - 2 * s**2 + s**3),
            3 * s**2 - 2 * s**3,
            length * (s**3 - s**2),
        )
        for dof, values in enumerate(hermite):
            shape[np.arange(len(theta)), 2 * element + dof] = values
        shape[:, -2] = -1.0
        joint.K[:] = theta[:, 1, np.newaxis, np.newaxis] * shape[:, :, np.newaxis] * shape[:, np.newaxis, :]
        return joint


@dovetail.hookimpl
def dovetail_components() -> list[type[MovingSupport]]:
    """Return the joint."""
    return [MovingSupport]
