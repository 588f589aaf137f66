"""Rigid bodies as lumped masses."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from dovetail import ComponentConfig, InUnit, PartNode, StructuralMatrices, SubstructureModel

_WIDEST = 2.0
"""Radius of gyration [m] above which a unit is hardly right."""


class LumpedMass(ComponentConfig):
    """A mass, with or without rotary inertia, at a position.

    Attributes
    ----------
    position : float
        Position [m], by which a description refers to the mass.
    mass : float
        Mass in translation [kg].
    inertia : float
        Rotary inertia about the axis of rz [kg m^2].
    """

    position: Annotated[float, InUnit("m")] = 0.0
    mass: Annotated[float, Field(ge=0), InUnit("kg")]
    inertia: Annotated[float, Field(ge=0), InUnit("kg m^2")] = 0.0


class Lumped(SubstructureModel):
    """Masses that are connected only by joints; without rotary inertia, a rotation needs no moment."""

    name = "lumped"
    summary = "Lumped masses and rotary inertias"

    class Config(ComponentConfig):
        """The masses, at different positions.

        Attributes
        ----------
        masses : sequence of LumpedMass
            One or more masses.
        """

        masses: Annotated[tuple[LumpedMass, ...], Field(min_length=1)]

        @model_validator(mode="after")
        def _positions_differ(self) -> Lumped.Config:
            positions = [entry.position for entry in self.masses]
            if len(set(positions)) < len(positions):
                raise ValueError("two masses have the same position")
            return self

    @classmethod
    def examples(cls, folder: Path) -> Sequence[Mapping[str, Any]]:  # noqa: ARG003
        """Return a mass without rotary inertia, and two with it."""
        body = {"mass": "200 g", "inertia": "1e-4 kg m^2"}
        return {"masses": [{"mass": "1 kg"}]}, {"masses": [body, {**body, "position": "10 mm"}]}

    def warnings(self, frequency: float) -> list[str]:  # noqa: ARG002
        """Report rotary inertias that belong to a body much larger than its mass lets expect."""
        return [
            f"masses.{number}: {entry.mass:g} kg with {entry.inertia:g} kg m^2 is a ring with a radius of "
            f"{np.sqrt(entry.inertia / entry.mass):.3g} m. Are the units right? A number without a unit is in SI."
            for number, entry in enumerate(self.config.masses)
            if entry.mass > 0 and entry.inertia > _WIDEST**2 * entry.mass
        ]

    @cached_property
    def nodes(self) -> tuple[PartNode, ...]:
        """One node for each mass."""
        return tuple(PartNode(f"m{index + 1}", entry.position) for index, entry in enumerate(self.config.masses))

    def matrices(self) -> StructuralMatrices:
        """Return the (d, d) matrices: a diagonal mass matrix and no stiffness."""
        values = np.broadcast_arrays(*(value for entry in self.config.masses for value in (entry.mass, entry.inertia)))
        mass = np.stack(values, axis=-1)[..., np.newaxis] * np.eye(len(values))
        return StructuralMatrices(mass, np.zeros_like(mass))

    @property
    def linear_options(self) -> tuple[str, ...]:
        """All masses and inertias."""
        return tuple(f"masses.{i}.{key}" for i in range(len(self.config.masses)) for key in ("mass", "inertia"))

    def batched_matrices(self, options: Mapping[str, NDArray[np.float64]]) -> StructuralMatrices:
        """Return the (n, d, d) matrices for many values of some options."""
        return Lumped(self.config.with_options(options)).matrices()
