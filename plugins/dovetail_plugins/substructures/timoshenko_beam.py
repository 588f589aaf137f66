"""A straight beam of stepped, hollow or tapered round sections."""

from __future__ import annotations

from functools import cached_property
from typing import Annotated

import numpy as np
from pydantic import Field, model_validator

from dovetail import ComponentConfig, InUnit, Node, StructuralMatrices, SubstructureModel
from dovetail_plugins.timoshenko import Material, chain, element_matrices

__all__ = ["Section", "TimoshenkoBeam"]

_Diameter = Annotated[float, Field(gt=0), InUnit("m")]
_Bore = Annotated[float, Field(ge=0), InUnit("m")]


class Section(ComponentConfig):
    """A length of beam; with `outer_end` or `inner_end` its diameters change linearly along it."""

    length: Annotated[float, Field(gt=0), InUnit("m")]
    outer: _Diameter
    inner: _Bore = 0.0
    outer_end: _Diameter | None = None
    inner_end: _Bore | None = None
    elements: Annotated[int, Field(ge=1, le=1000)] = 1

    @model_validator(mode="after")
    def _bore_inside(self) -> Section:
        if self.inner >= self.outer or self.end_inner >= self.end_outer:
            raise ValueError("the inner diameter must be smaller than the outer one")
        return self

    @property
    def end_outer(self) -> float:
        """Outer diameter at the far end [m]."""
        return self.outer if self.outer_end is None else self.outer_end

    @property
    def end_inner(self) -> float:
        """Inner diameter at the far end [m]."""
        return self.inner if self.inner_end is None else self.inner_end

    def diameters(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the outer and inner diameters [m] at the middle of each element."""
        middle = (np.arange(self.elements) + 0.5) / self.elements
        outer = self.outer + middle * (self.end_outer - self.outer)
        inner = self.inner + middle * (self.end_inner - self.inner)
        return outer, inner


class TimoshenkoBeam(SubstructureModel):
    """A chain of two-node Timoshenko elements along the sections, free at both ends."""

    name = "timoshenko_beam"
    summary = "Beam of stepped, hollow or tapered round sections (Timoshenko elements)"
    references = (
        "Z. Friedman, J. B. Kosmatka, An improved two-node Timoshenko beam finite element, Comput. Struct. 47 (1993)",
        "G. R. Cowper, The shear coefficient in Timoshenko's beam theory, J. Appl. Mech. 33 (1966)",
    )

    class Config(ComponentConfig):
        """Material and sections; position 0 is where the first section begins."""

        material: Material
        sections: Annotated[tuple[Section, ...], Field(min_length=1)]

    @cached_property
    def nodes(self) -> tuple[Node, ...]:
        """The ends of the elements."""
        lengths = [s.length / s.elements for s in self.config.sections for _ in range(s.elements)]
        positions = np.concatenate([[0.0], np.cumsum(lengths)])
        return tuple(Node(f"n{index + 1}", float(position)) for index, position in enumerate(positions))

    def matrices(self) -> StructuralMatrices:
        """Return the (d, d) matrices of the free beam, d = 2 (n_elements + 1)."""
        parts = []
        for section in self.config.sections:
            outer, inner = section.diameters()
            parts.append(element_matrices(section.length / section.elements, outer, inner, self.config.material))
        elements = StructuralMatrices(
            *(np.concatenate([getattr(part, name) for part in parts]) for name in ("M", "K", "C", "D"))
        )
        return chain(elements)
