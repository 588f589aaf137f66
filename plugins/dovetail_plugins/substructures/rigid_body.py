"""A rigid body in space."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from dovetail import DIRECTIONS, ComponentConfig, InUnit, PartNode, StructuralMatrices, SubstructureModel, carried

_Length = Annotated[float, InUnit("m")]
_Inertia = Annotated[float, Field(ge=0), InUnit("kg m^2")]
_Product = Annotated[float, InUnit("kg m^2")]
_Point = tuple[_Length, _Length, _Length]
_ROUNDING = 1e-9
"""Violation of the triangle inequality, over the sum of the moments, that is due to rounding."""

_APART = 30.0
"""Radius of gyration over the distance of the farthest node, or the reverse, above which one is hardly meant."""
_LARGEST = 20.0
"""Radius of gyration [m] that is hardly meant of a body whose node is at its centre of mass."""


def _at_origin() -> dict[str, tuple[float, float, float]]:
    return {"center": (0.0, 0.0, 0.0)}


class RigidBody(SubstructureModel):
    """A body that does not deform, with nodes at any of its points.

    Its motion is that of its first node, which carries the others: joints, forces and sensors may be at all of them.
    """

    name = "rigid_body"
    summary = "Rigid body in space: mass, inertia tensor, and any number of nodes"

    class Config(ComponentConfig):
        """Mass, inertia and nodes, in the body's own axes.

        Attributes
        ----------
        mass : float
            Mass [kg].
        inertia : three moments
            About axes through the centre of mass along x, y and z [kg m^2].
        products : three products
            Entries xy, xz and yz of the inertia tensor [kg m^2], minus the integrals of x y, x z and y z.
        center : three lengths
            Coordinates of the centre of mass [m].
        nodes : mapping of names to three lengths
            Coordinates of the nodes [m].
        """

        mass: Annotated[float, Field(gt=0), InUnit("kg")]
        inertia: tuple[_Inertia, _Inertia, _Inertia]
        products: tuple[_Product, _Product, _Product] = (0.0, 0.0, 0.0)
        center: _Point = (0.0, 0.0, 0.0)
        nodes: Annotated[dict[str, _Point], Field(min_length=1, default_factory=_at_origin)]

        @model_validator(mode="after")
        def _is_a_body(self) -> RigidBody.Config:
            moments = np.linalg.eigvalsh(_tensor(self.inertia, self.products))
            if moments[0] + moments[1] < moments[2] - _ROUNDING * moments.sum() or moments[0] < -_ROUNDING * moments[2]:
                listed = ", ".join(f"{moment:.4g}" for moment in moments)
                raise ValueError(f"no body has the principal moments {listed} kg m^2: one exceeds the others' sum")
            return self

    @classmethod
    def examples(cls, folder: Path) -> Sequence[Mapping[str, Any]]:  # noqa: ARG003
        """Return a body with one node, and one with two nodes away from its centre of mass."""
        cube = {"mass": "2 kg", "inertia": ["3e-3 kg m^2", "3e-3 kg m^2", "3e-3 kg m^2"]}
        ends = {"left": ["-30 mm", "0 mm", "10 mm"], "right": ["30 mm", "0 mm", "10 mm"]}
        return cube, {**cube, "nodes": ends, "products": ["1e-4 kg m^2", "0 kg m^2", "0 kg m^2"]}

    def warnings(self, frequency: float) -> list[str]:  # noqa: ARG002
        """Report a mass, moments of inertia and nodes that hardly belong to one body."""
        points = np.array([self.config.center, *self.config.nodes.values()])
        size = float(np.linalg.norm(points[1:] - points[0], axis=1).max())
        moment = float(np.linalg.eigvalsh(_tensor(self.config.inertia, self.config.products))[-1])
        radius = np.sqrt(moment / self.config.mass)
        if radius == 0.0 or (radius < _LARGEST if size == 0.0 else size / _APART < radius < _APART * size):
            return []
        return [
            f"its mass of {self.config.mass:g} kg and its moment of inertia of {moment:g} kg m^2 are those of a ring "
            f"with a radius of {radius:.3g} m, and its nodes are at most {size:.3g} m from its centre of mass. Are the "
            "units right? A number without a unit is in SI."
        ]

    @cached_property
    def nodes(self) -> tuple[PartNode, ...]:
        """Those of the description; the first one carries the others."""
        return tuple(
            PartNode(name, 0.0, DIRECTIONS, point, carrier=None if number == 0 else 0)
            for number, (name, point) in enumerate(self.config.nodes.items())
        )

    def matrices(self) -> StructuralMatrices:
        """Return the (6, 6) mass matrix for the motion of the first node, and no stiffness."""
        mass = np.zeros((6, 6))
        mass[:3, :3] = self.config.mass * np.eye(3)
        mass[3:, 3:] = _tensor(self.config.inertia, self.config.products)
        to_center = carried(np.subtract(self.config.center, self.nodes[0].coordinates))
        M = to_center.T @ mass @ to_center
        return StructuralMatrices((M + M.T) / 2.0, np.zeros((6, 6)))


def _tensor(moments: Sequence[float], products: Sequence[float]) -> NDArray[np.float64]:
    """Return the inertia tensor (3, 3)."""
    xy, xz, yz = products
    x, y, z = moments
    return np.array([[x, xy, xz], [xy, y, yz], [xz, yz, z]], dtype=np.float64)
