"""The ground, to which other parts can be attached."""

from __future__ import annotations

from functools import cached_property
from typing import Annotated

from pydantic import Field, model_validator

from dovetail import DIRECTIONS, ComponentConfig, InUnit, PartNode, StructuralMatrices, SubstructureModel

_Length = Annotated[float, InUnit("m")]


class Ground(SubstructureModel):
    """Points that do not move."""

    name = "ground"
    summary = "Points that do not move"
    grounded = True

    class Config(ComponentConfig):
        """The points to which joints may attach.

        Attributes
        ----------
        positions : sequence of float
            Positions of the points [m].
        points : sequence of three lengths each
            Their coordinates [m], instead of positions.
        """

        alternatives = ((("positions",), ("points",)),)
        positions: Annotated[tuple[_Length, ...], Field(min_length=1)] = (0.0,)
        points: tuple[tuple[_Length, _Length, _Length], ...] = ()

        @model_validator(mode="after")
        def _one_kind(self) -> Ground.Config:
            if self.points and "positions" in self.model_fields_set:
                raise ValueError("give either 'positions' or 'points'")
            return self

    @cached_property
    def nodes(self) -> tuple[PartNode, ...]:
        """One node for each position or point, which could move in all directions."""
        if self.config.points:
            return tuple(PartNode(f"g{i + 1}", 0.0, DIRECTIONS, point) for i, point in enumerate(self.config.points))
        return tuple(PartNode(f"g{i + 1}", position, DIRECTIONS) for i, position in enumerate(self.config.positions))

    def matrices(self) -> StructuralMatrices:
        """Return zeros, since held DOFs do not move."""
        return StructuralMatrices.zeros(len(DIRECTIONS) * len(self.nodes))
