"""A straight beam with stepped, hollow or tapered round sections, or rectangular ones."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import Field

from dovetail import (
    ComponentConfig,
    PartNode,
    ScaledMatrices,
    SectionOutline,
    StructuralMatrices,
    SubstructureModel,
)
from dovetail_plugins.substructures.scaled_beam import ScaledBeam
from dovetail_plugins.timoshenko import CrossSection, Material, Section, chain, element_matrices

_NO_PLASTIC = 2500.0
"""Density [kg/m^3] of metals, ceramics and concrete, but not of plastics."""
_SOFTEST_METAL = 5e9
"""Smallest modulus [Pa] of such materials: lead has 16 GPa."""
_LEAST = 10.0
"""Density [kg/m^3] below which it is reported as such."""
_LIGHTEST = 1.4e4
"""Largest speed of sound sqrt(E / rho) [m/s] of materials other than diamond: boron carbide has 13 500."""
_DIAMOND = 7e11
"""Modulus [Pa] above which a material is diamond."""
_STIFF, _LARGEST_LOSS = 1e10, 0.1
"""Modulus [Pa] from which no material has a loss factor like that: damping alloys have 0.05."""
_FLATTEST = 20.0
"""Size of a cross-section over the length of the whole beam above which one of the two is hardly meant."""


class TimoshenkoBeam(SubstructureModel):
    """A chain of two-node Timoshenko elements along the sections, free at both ends.

    A tapered section is divided into uniform elements with the diameters at their middles.
    """

    name = "timoshenko_beam"
    summary = "Beam of stepped, hollow or tapered round sections, or rectangular ones (Timoshenko elements)"
    references = (
        "Z. Friedman, J. B. Kosmatka, An improved two-node Timoshenko beam finite element, Comput. Struct. 47 (1993)",
        "G. R. Cowper, The shear coefficient in Timoshenko's beam theory, J. Appl. Mech. 33 (1966)",
    )

    class Config(ComponentConfig):
        """Material and sections; position 0 is the start of the first section.

        Attributes
        ----------
        material : Material
            Of the whole beam.
        sections : sequence of Section
            The sections in order along the beam.
        """

        material: Material
        sections: Annotated[tuple[Section, ...], Field(min_length=1)]

    @classmethod
    def examples(cls, folder: Path) -> Sequence[Mapping[str, Any]]:  # noqa: ARG003
        """Return a stepped and tapered tube, and a bar of rectangular section."""
        steel = {"young": "200 GPa", "density": "7850 kg/m^3", "loss_factor": 0.003}
        tube = {"length": "60 mm", "outer": "40 mm", "inner": "20 mm", "elements": 3}
        taper = {"length": "60 mm", "outer": "40 mm", "outer_end": "30 mm", "elements": 3}
        bar = {"length": "200 mm", "width": "30 mm", "height": "10 mm", "elements": 2}
        return {"material": steel, "sections": [tube, taper]}, {"material": steel, "sections": [bar]}

    def warnings(self, frequency: float) -> list[str]:
        """Report a modulus too small for the density, and elements longer than a sixth of a bending wave."""
        young, density = self.config.material.young, self.config.material.density
        if density > _NO_PLASTIC and 1e6 <= young < _SOFTEST_METAL:
            return [
                f"material.young is {1e-6 * young:.4g} MPa; nothing of {density:.4g} kg/m^3 is as soft. "
                f"Was {1e-6 * young:.4g} GPa meant?"
            ]
        too_long = [*self._unusual_material(), *self._out_of_proportion()]
        for number, section in enumerate(self.config.sections):
            shape, material = section.cross_section(self.config.material.poisson), self.config.material
            stiffness, mass = material.young * shape.inertia, material.density * shape.area
            wave = float(np.min(2.0 * np.pi * (stiffness / (mass * (2.0 * np.pi * frequency) ** 2)) ** 0.25))
            length = section.length / section.elements
            if length > wave / 6.0:
                too_long.append(
                    f"sections.{number} has elements of {length * 1e3:.3g} mm; a bending wave at {frequency:g} Hz is "
                    f"{wave * 1e3:.3g} mm long. Take {int(np.ceil(6.0 * section.length / wave))} elements or more."
                )
        return too_long

    def _unusual_material(self) -> list[str]:
        """Report a density too small for the modulus, and a loss factor in percent."""
        material = self.config.material
        said = []
        if _LIGHTEST**2 * material.density < material.young < _DIAMOND and material.density >= _LEAST:
            said.append(
                f"material.density is {material.density:.4g} kg/m^3; nothing of {1e-9 * material.young:.4g} GPa is as "
                "light. Is a digit missing?"
            )
        if material.young > _STIFF and material.loss_factor > _LARGEST_LOSS:
            said.append(
                f"material.loss_factor is {material.loss_factor:g}, and metals have less than {_LARGEST_LOSS:g}. "
                f"Were {material.loss_factor:g} % meant? Write {0.01 * material.loss_factor:g}."
            )
        return said

    def _out_of_proportion(self) -> list[str]:
        """Report a cross-section many times larger than the whole beam is long."""
        length = sum(section.length for section in self.config.sections)
        for number, section in enumerate(self.config.sections):
            sizes = {name: getattr(section, name) for name in ("outer", "outer_end", "width", "height")}
            for name, size in sizes.items():
                if size is not None and size > _FLATTEST * length:
                    return [
                        f"sections.{number}.{name} is {size:g} m, and the whole beam {length:g} m long. "
                        f"Were {size:g} mm meant? A number without a unit is in SI."
                    ]
        return []

    def refined(self, factor: int) -> TimoshenkoBeam:
        """Return the same beam with `factor` times as many elements in each section."""
        finer = [section.model_copy(update={"elements": factor * section.elements}) for section in self.config.sections]
        return TimoshenkoBeam(self.config.model_copy(update={"sections": tuple(finer)}))

    @cached_property
    def nodes(self) -> tuple[PartNode, ...]:
        """The ends of the elements."""
        lengths = [s.length / s.elements for s in self.config.sections for _ in range(s.elements)]
        positions = np.concatenate([[0.0], np.cumsum(lengths)])
        return tuple(PartNode(f"n{index + 1}", float(position)) for index, position in enumerate(positions))

    @property
    def outline(self) -> list[tuple[float, float, float, float]]:
        """The sections, tapered ones divided into elements; for rectangular ones the side in the direction of x."""
        pieces, start = list[tuple[float, float, float, float]](), 0.0
        for section in self.config.sections:
            step = section.length / section.elements
            for outer, inner in zip(*section.diameters(), strict=True):
                pieces.append((start, start + step, float(outer), float(inner)))
                start += step
        return pieces

    def stretch_at(self, position: float) -> tuple[float, float]:
        """Return the axial stiffness E A [N] at a position [m], and the size in the direction of x [m] there."""
        section, share = self.place_in_section(position)
        element = min(int(share * section.elements), section.elements - 1)
        area = section.cross_section(self.config.material.poisson).area
        outer, _ = section.diameters()
        return float(self.config.material.young * area[element]), float(outer[element])

    def section_at(self, position: float) -> SectionOutline:
        """Return the outline of the cross-section at a position [m]."""
        section, share = self.place_in_section(position)
        if section.width is not None and section.height is not None:
            return SectionOutline(section.height, section.width)
        outer, inner = section.diameters_at(share)
        return SectionOutline(outer, outer, inner, is_round=True)

    def place_in_section(self, position: float) -> tuple[Section, float]:
        """Return the section at a position [m], and the share of its length up to there."""
        start = 0.0
        for section in self.config.sections[:-1]:
            if position < start + section.length:
                break
            start += section.length
        else:
            section = self.config.sections[-1]
        return section, float(np.clip((position - start) / section.length, 0.0, 1.0))

    def matrices(self) -> StructuralMatrices:
        """Return the (d, d) matrices of the free beam, d = 2 (n_elements + 1)."""
        material, sections = self.config.material, list[tuple[ArrayLike, ...]]()
        for section in self.config.sections:
            shape = section.cross_section(material.poisson)
            sections.append((section.length / section.elements, shape.area, shape.inertia, shape.shear))
        counts = [section.elements for section in self.config.sections]
        length, area, inertia, shear = (_joined(values, counts) for values in zip(*sections, strict=True))
        return chain(element_matrices(length, CrossSection(area, inertia, shear), material))

    def scaled_matrices(self, options: Sequence[str]) -> ScaledMatrices:
        """Return the matrices by the coefficients of the elements that depend on these options."""
        return ScaledBeam(self.config.material, self.config.sections, options).scaled_matrices

    def batched_matrices(self, options: Mapping[str, NDArray[np.float64]]) -> StructuralMatrices:
        """Return the (n, d, d) matrices for many values of some options."""
        columns = {place: values[:, np.newaxis] for place, values in options.items()}
        return TimoshenkoBeam(self.config.with_options(columns)).matrices()


def _joined(values: Sequence[ArrayLike], counts: Sequence[int]) -> NDArray[np.float64]:
    """Concatenate the values of sections, scalars or arrays (..., count) with a batch axis, to (..., n_elements)."""
    batch = np.broadcast_shapes(*(np.shape(value)[:-1] for value in values))
    return np.concatenate([np.broadcast_to(value, (*batch, n)) for value, n in zip(values, counts, strict=True)], -1)
