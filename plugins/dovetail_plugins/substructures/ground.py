"""The ground, to which other parts can be attached."""

from __future__ import annotations

from functools import cached_property
from typing import Annotated

from pydantic import Field

from dovetail import ComponentConfig, InUnit, Node, StructuralMatrices, SubstructureModel


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
        """

        positions: Annotated[tuple[Annotated[float, InUnit("m")], ...], Field(min_length=1)] = (0.0,)

    @cached_property
    def nodes(self) -> tuple[Node, ...]:
        """One node for each position."""
        return tuple(Node(f"g{index + 1}", position) for index, position in enumerate(self.config.positions))

    def matrices(self) -> StructuralMatrices:
        """Return zeros, since held DOFs do not move."""
        return StructuralMatrices.zeros(2 * len(self.nodes))
