"""A straight beam that moves in space."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from dovetail import (
    DIRECTIONS,
    ComponentConfig,
    Coordinates,
    InUnit,
    PartNode,
    SectionOutline,
    StructuralMatrices,
    SubstructureModel,
    carried,
)
from dovetail_plugins.spatial_beam import SpatialSection, spatial_chain, spatial_element_matrices
from dovetail_plugins.substructures.timoshenko_beam import TimoshenkoBeam
from dovetail_plugins.timoshenko import Material, Section

_Length = Annotated[float, InUnit("m")]
_FARTHEST = 20.0
"""Offset over the size of the section above which it is hardly meant."""


class OffsetSection(Section):
    """A length of beam whose centroid may lie off the line of the nodes.

    Attributes
    ----------
    length : float
        Length along the beam [m].
    outer, inner : float
        Diameters of a round section [m].
    outer_end, inner_end : float
        Diameters at the far end [m]; with them the diameters change linearly along the section.
    width, height : float
        Sides of a rectangular section [m]: along the beam's z, and along its x.
    elements : int
        Number of elements, of equal length.
    offset : two lengths
        Coordinates x and z of the centroid from the line of the nodes [m].
    """

    offset: tuple[_Length, _Length] = (0.0, 0.0)


class SpatialBeam(SubstructureModel):
    """A chain of beam elements that bend in two planes, extend and twist, free at both ends.

    Bending in each plane is that of `timoshenko_beam`. Warping of rectangular sections is not resisted, and bending and
    torsion are not coupled within a section, whose centroid and shear centre coincide. With an `offset` the nodes lie
    away from the centroids, as on the face of a bar, and their extension then bends it.
    """

    name = "spatial_beam"
    summary = "Beam in space: bending in two planes (Timoshenko), extension and torsion; round or rectangular sections"
    references = TimoshenkoBeam.references

    class Config(ComponentConfig):
        """Material and sections; position 0 is the start of the first section.

        Attributes
        ----------
        material : Material
            Of the whole beam.
        sections : sequence of OffsetSection
            The sections in order along the beam; `height` is the side along the beam's x, `width` that along its z.
        """

        material: Material
        sections: Annotated[tuple[OffsetSection, ...], Field(min_length=1)]

    @classmethod
    def examples(cls, folder: Path) -> Sequence[Mapping[str, Any]]:  # noqa: ARG003
        """Return a stepped tube, and a rectangular bar with its nodes on a face."""
        steel = {"young": "200 GPa", "density": "7850 kg/m^3", "loss_factor": 0.003}
        tube = {"length": "60 mm", "outer": "40 mm", "inner": "20 mm", "elements": 3}
        bar = {"length": "200 mm", "width": "30 mm", "height": "10 mm", "elements": 2, "offset": ["5 mm", "0 mm"]}
        return {"material": steel, "sections": [tube, {**tube, "outer": "30 mm"}]}, {
            "material": steel,
            "sections": [bar],
        }

    @cached_property
    def _planar(self) -> TimoshenkoBeam:
        """The same beam in the plane of x."""
        return TimoshenkoBeam(TimoshenkoBeam.Config(material=self.config.material, sections=self.config.sections))

    def warnings(self, frequency: float) -> list[str]:
        """Report what `timoshenko_beam` does for the plane of x, and offsets many times larger than the section."""
        far = []
        for number, section in enumerate(self.config.sections):
            offset = max(map(abs, section.offset))
            size = max(section.outer or 0.0, section.width or 0.0, section.height or 0.0)
            if offset > _FARTHEST * size:
                far.append(
                    f"sections.{number}.offset is {offset:g} m, and the section {size:g} m wide. Were {offset:g} mm "
                    "meant? A number without a unit is in SI."
                )
        return [*far, *self._planar.warnings(frequency)]

    def refined(self, factor: int) -> SpatialBeam:
        """Return the same beam with `factor` times as many elements in each section."""
        finer = self._planar.refined(factor).config.sections
        return SpatialBeam(self.config.model_copy(update={"sections": finer}))

    @cached_property
    def nodes(self) -> tuple[PartNode, ...]:
        """The ends of the elements."""
        return tuple(replace(node, directions=DIRECTIONS) for node in self._planar.nodes)

    @property
    def outline(self) -> list[tuple[float, float, float, float]]:
        """The sections, by their sides along x."""
        return self._planar.outline

    def section_at(self, position: float) -> SectionOutline:
        """Return the outline of the cross-section at a position [m], with its offset."""
        section, _ = self._planar.place_in_section(position)
        assert isinstance(section, OffsetSection)
        return replace(self._planar.section_at(position), center=section.offset)

    def stretch_at(self, position: float) -> tuple[float, float]:
        """Return the axial stiffness E A [N] at a position [m], and the size in the direction of x [m] there."""
        return self._planar.stretch_at(position)

    def matrices(self) -> StructuralMatrices:
        """Return the (d, d) matrices of the free beam: 6 DOFs of each node, then 2 inner ones of each element."""
        material, elements = self.config.material, list[StructuralMatrices]()
        for section in self.config.sections:
            shape = SpatialSection.from_section(section, material.poisson)
            at_centroids = spatial_element_matrices(section.length / section.elements, shape, material)
            x, z = section.offset
            both_ends = Coordinates(np.asarray(np.kron(np.eye(2), carried(np.array([x, 0.0, z])))))
            elements.append(both_ends.transformed(at_centroids) if x or z else at_centroids)
        joined = StructuralMatrices(*(np.concatenate([getattr(e, name) for e in elements]) for name in "MKCD"))
        return spatial_chain(joined)
