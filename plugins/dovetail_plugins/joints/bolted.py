"""The bolted lap: two parts pressed together over an overlap."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from dovetail import (
    DIRECTIONS,
    PLANAR,
    ComponentConfig,
    InUnit,
    JointModel,
    JointPort,
    Omission,
    Parameter,
    StructuralMatrices,
    SubstructureModel,
)
from dovetail_plugins.substructures.timoshenko_beam import TimoshenkoBeam

_LAYER = (
    Parameter("kt", "N/m", 1e6, 1e10, "log", "translational stiffness, per node"),
    Parameter("kr", "N m/rad", 1e2, 1e7, "log", "rotational stiffness, per node"),
    Parameter("ct", "N s/m", 0.1, 1e4, "log", "translational damping, per node"),
    Parameter("cr", "N m s/rad", 1e-4, 1e2, "log", "rotational damping, per node"),
)
_SLIDING = (
    Parameter("ks", "N/m", 1e6, 1e10, "log", "stiffness against sliding, per node"),
    Parameter("cs", "N s/m", 0.1, 1e4, "log", "damping of sliding, per node"),
)
_MASS = Parameter("mb", "kg", 1e-3, 0.5, "linear", "mass of bolt, nut and washers")


_MOST_TIGHTENED = 200.0
"""Largest ratio of two tensions of one bolt."""


class Preload(ComponentConfig):
    """Dependence of the stiffness on the bolt's tension: (force / reference)^exponent.

    Attributes
    ----------
    force : float
        The tension of this assembly [N].
    reference : float
        The tension at which kt and kr are given [N].
    exponent : float
        0.5 to 1 for rough surfaces; 1 where contact spots grow in number, not in size.
    """

    force: Annotated[float, Field(gt=0), InUnit("N")]
    reference: Annotated[float, Field(gt=0), InUnit("N")]
    exponent: Annotated[float, Field(ge=0, le=2)] = 1.0

    @model_validator(mode="after")
    def _in_one_unit(self) -> Preload:
        if not 1.0 / _MOST_TIGHTENED <= self.force / self.reference <= _MOST_TIGHTENED:
            ends = f"{self.force:g} N, the reference {self.reference:g} N"
            raise ValueError(f"the force is {ends}; a number without a unit is in N")
        return self


class Bolted(JointModel):
    """A contact layer over the lap, with the bolt's mass on the two nodes at its middle.

    Facing nodes of the two parts meet through a spring and a damper in translation and in rotation, equal for all
    nodes. With `preload`, kt and kr are those at the reference tension, so that a joint identified at one
    tension can be predicted at another. Micro-slip, the growth of damping with amplitude, an uneven pressure under the
    bolt's head and the offset of the two mid-planes are not modelled.

    Nothing resists the sliding of the faces on each other, since parts have no axial motion: kr acts on the difference
    of two rotations. However stiff its springs, the lap of two equal bars bends with at most a quarter of the stiffness
    of a solid bar of their height. ``dovetail check`` shows the natural frequencies with free and with no sliding;
    those of the structure lie between. ``dovetail check assemblies/bolted_lap_beam.yaml``: 448.1 and 481.8 Hz, 7.5 %.

    With ``motion: space`` the layer acts in all directions between nodes at the faces, such as those of a
    `spatial_beam` with an `offset`: ks and cs resist their sliding. With stiff springs the lap then is a solid bar
    (``pytest tests/synthesis/test_laps_in_space.py``).
    """

    name = "bolted"
    free_options = ("preload.force",)
    summary = "Bolted lap: a contact layer over the lap, the bolt's mass, stiffness by preload on request"
    references = (
        "R. A. Ibrahim, C. L. Pettit, Uncertainties and dynamic problems of bolted joints and other fasteners, "
        "J. Sound Vib. 279 (2005) 857-936",
        "J. A. Greenwood, J. B. P. Williamson, Contact of nominally flat surfaces, Proc. R. Soc. A 295 (1966) 300-319",
    )

    class Config(ComponentConfig):
        """Number of contact nodes, whether the bolt has a mass, and its tension.

        Attributes
        ----------
        nodes : int
            Number of facing nodes of each part.
        bolt_mass : bool
            Add the parameter mb, the mass of the bolt.
        preload : Preload, optional
            Dependence of the stiffness on the bolt's tension; by default it is that of this assembly.
        motion : 'plane' or 'space'
            Whether the layer acts in x and rz, or in all six directions: x is normal to the faces, y and z along them.
        """

        nodes: Annotated[int, Field(ge=1, le=1000)] = 3
        bolt_mass: bool = False
        preload: Preload | None = None
        motion: Literal["plane", "space"] = "plane"

    def __init__(self, config: Any = None) -> None:
        super().__init__(config)
        self.spans_a_distance = self.config.motion == "plane"  # between the axes of the bars, not their faces
        self.faces_meet = self.config.motion == "space"
        self.nodes_along = ("y",) if self.config.motion == "plane" else ("y", "z")

    @classmethod
    def examples(cls, folder: Path) -> Sequence[Mapping[str, Any]]:  # noqa: ARG003
        """Return the default lap, one with a bolt of known tension, and one in space."""
        preload = {"force": "8 kN", "reference": "10 kN", "exponent": 0.5}
        return {}, {"nodes": 4, "bolt_mass": True, "preload": preload}, {"motion": "space", "bolt_mass": True}

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Those of the layer, and mb if the bolt has a mass."""
        layer = _LAYER if self.config.motion == "plane" else (*_LAYER, *_SLIDING)
        return (*layer, _MASS) if self.config.bolt_mass else layer

    @property
    def linear_parameters(self) -> tuple[str, ...]:
        """All of them."""
        return tuple(parameter.name for parameter in self.parameters)

    @property
    def ports(self) -> tuple[JointPort, ...]:
        """The two parts, a and b."""
        directions = PLANAR if self.config.motion == "plane" else DIRECTIONS
        return tuple(JointPort(name, self.config.nodes, directions=directions) for name in "ab")

    def matrices(self, theta: NDArray[np.float64]) -> StructuralMatrices:
        """Return the matrices for theta (n, n_params)."""
        joint = StructuralMatrices.zeros(len(theta), self.size)
        values = dict(zip([parameter.name for parameter in self.parameters], theta.T, strict=True))
        tightness = self._tightness()
        for name, directions in (("t", ("x",)), ("r", DIRECTIONS[3:]), ("s", ("y", "z"))):
            pairs = [pair for pair in self.contact_dofs if self.node_dofs[pair[0]][1] in directions]
            if f"k{name}" in values:
                joint.add_contact_layer(pairs, tightness * values[f"k{name}"], values[f"c{name}"])
        for dof, share in self._bolt() if self.config.bolt_mass else ():
            joint.M[:, dof, dof] += share * values["mb"]
        return joint

    def omission(self, substructures: Sequence[SubstructureModel], nodes: Sequence[Sequence[int]]) -> Omission | None:
        """Return the bending stiffness of faces that cannot slide, over that of faces that slide freely.

        Bent together, two bars of heights h1 and h2 stretch and shrink at their faces by (h1 rz1 + h2 rz2) / 2 between
        two sections. If the faces do not slide, the bars themselves have to stretch by that, against
        E1 A1 E2 A2 / (E1 A1 + E2 A2).
        """
        if self.config.nodes < 2 or self.config.motion == "space":
            return None
        problem = "nothing in the model resists the sliding of the two faces, since parts have no axial motion."
        beams = [beam for beam in substructures if isinstance(beam, TimoshenkoBeam)]
        if len(beams) < len(substructures):
            return Omission(problem)
        count = int(self.config.nodes)
        K = np.zeros((4 * count, 4 * count))
        for first in range(count - 1):
            stretch, axial, length = np.zeros(4 * count), np.empty(2), 0.0
            for side, (beam, at) in enumerate(zip(beams, nodes, strict=True)):
                start, stop = (beam.nodes[at[node]].position for node in (first, first + 1))
                axial[side], height = beam.stretch_at((start + stop) / 2.0)
                dof, length = 2 * (side * count + first) + 1, abs(stop - start)
                stretch[[dof, dof + 2]] = -height / 2.0, height / 2.0
            K += axial.prod() / axial.sum() / length * np.outer(stretch, stretch)
        return Omission(problem, K)

    def _tightness(self) -> float:
        preload = self.config.preload
        return 1.0 if preload is None else (preload.force / preload.reference) ** preload.exponent

    def _bolt(self) -> list[tuple[int, float]]:
        """Return the displacements at the middle of the lap that carry the bolt, with the share of its mass on each."""
        nodes = int(self.config.nodes)
        middle = sorted({(nodes - 1) // 2, nodes // 2})
        return [
            (dof, 0.5 / len(middle))
            for side in (0, 1)
            for node in middle
            for dof in self.node_dofs.at_node(side * nodes + node)
            if self.node_dofs[dof][1] in DIRECTIONS[:3]
        ]
