"""Rigid bodies as lumped masses."""

from __future__ import annotations

from functools import cached_property
from typing import Annotated

import numpy as np
from pydantic import Field, model_validator

from dovetail import ComponentConfig, InUnit, Node, StructuralMatrices, SubstructureModel

__all__ = ["Lumped", "LumpedMass"]


class LumpedMass(ComponentConfig):
    """A mass, with or without rotary inertia, at a position."""

    position: Annotated[float, InUnit("m")] = 0.0
    mass: Annotated[float, Field(ge=0), InUnit("kg")]
    inertia: Annotated[float, Field(ge=0), InUnit("kg m^2")] = 0.0


class Lumped(SubstructureModel):
    """Masses that nothing connects but the joints attached to them; without inertia a rotation is free of effort."""

    name = "lumped"
    summary = "Lumped masses and rotary inertias"

    class Config(ComponentConfig):
        """The masses, each at a position of its own."""

        masses: Annotated[tuple[LumpedMass, ...], Field(min_length=1)]

        @model_validator(mode="after")
        def _positions_differ(self) -> Lumped.Config:
            positions = [entry.position for entry in self.masses]
            if len(set(positions)) < len(positions):
                raise ValueError("two masses have the same position")
            return self

    @cached_property
    def nodes(self) -> tuple[Node, ...]:
        """One node for each mass."""
        return tuple(Node(f"m{index + 1}", entry.position) for index, entry in enumerate(self.config.masses))

    def matrices(self) -> StructuralMatrices:
        """Return the (d, d) matrices: a diagonal mass matrix and no stiffness."""
        diagonal = [value for entry in self.config.masses for value in (entry.mass, entry.inertia)]
        return StructuralMatrices(np.diag(diagonal), np.zeros((len(diagonal), len(diagonal))))
