"""A bearing between a shaft and a housing."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from dovetail import PLANAR, ComponentConfig, JointModel, JointPort, Parameter, StructuralMatrices
from dovetail_plugins.joints.bushing import add_cross_stiffness

_RING = (
    Parameter("k", "N/m", 1e6, 1e10, "log", "radial stiffness"),
    Parameter("kr", "N m/rad", 1e2, 1e7, "log", "tilting stiffness"),
    Parameter("c", "N s/m", 1.0, 1e5, "log", "radial damping"),
    Parameter("cr", "N m s/rad", 1e-3, 1e3, "log", "tilting damping"),
    Parameter("m", "kg", 0.01, 1.0, "linear", "mass of the inner ring and of what turns with it"),
    Parameter("J", "kg m^2", 1e-6, 1e-3, "log", "rotary inertia of the same about a diameter"),
)
_AXIAL = (
    Parameter("ka", "N/m", 1e6, 1e10, "log", "axial stiffness"),
    Parameter("ca", "N s/m", 1.0, 1e5, "log", "axial damping"),
)
_INCLINED = Parameter("r", "1", -0.9, 0.9, "linear", "stiffness between radial motion and tilting, over sqrt(k kr)")
_SPATIAL = ("x", "y", "z", "rx", "rz")
"""Five directions: nothing resists the rotation about the axis, which is y."""
_PLANES = (("x", "rz", 1.0), ("z", "rx", -1.0))
"""Radial and tilting motion in each plane, and the sign of the one by a turn of the other's plane about the axis."""


class Bearing(JointModel):
    """A spring and a damper in the radial and in the tilting direction, with the inertia of the ring on the shaft.

    With ``motion: space`` it acts in five directions: radially along x and z, axially along y, and against tilting
    about x and z. The shaft turns freely about y, the axis of beams; `axes` gives another axis. With `inclined`, the
    contacts couple radial motion and tilting, as in an angular contact bearing. The ring's inertia about its axis, the
    speed of rotation (gyroscopic moments, softening of the ball contacts) and the axial load are not modelled.
    """

    name = "bearing"
    summary = "Bearing: radial, tilting and in space axial stiffness and damping, with the inertia of its inner ring"
    references = ("T. A. Harris, M. N. Kotzalas, Essential Concepts of Bearing Technology, 5th ed., CRC Press, 2006",)

    class Config(ComponentConfig):
        """Whether it acts in a plane or in space.

        Attributes
        ----------
        motion : 'plane' or 'space'
            In x and rz, or in the five directions x, y, z, rx and rz.
        inclined : bool
            Add the parameter r, the coupling of radial motion and tilting.
        """

        motion: Literal["plane", "space"] = "plane"
        inclined: Annotated[bool, Field(strict=True)] = False

        @model_validator(mode="after")
        def _in_space(self) -> Bearing.Config:
            if self.inclined and self.motion == "plane":
                raise ValueError("'inclined' is for 'motion: space'")
            return self

    def __init__(self, config: Any = None) -> None:
        super().__init__(config)
        self.nested_ports = (("shaft", "housing", None),)
        self.nodes_along = ("y",) if self.config.motion == "space" else ()

    @classmethod
    def examples(cls, folder: Path) -> Sequence[Mapping[str, Any]]:  # noqa: ARG003
        """Return a bearing in a plane, one in space, and an angular contact bearing."""
        return {}, {"motion": "space"}, {"motion": "space", "inclined": True}

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Those in a plane; then the axial ones, and the ratio r if the contacts are inclined."""
        axial = _AXIAL if self.config.motion == "space" else ()
        return (*_RING, *axial, *((_INCLINED,) if self.config.inclined else ()))

    @property
    def linear_parameters(self) -> tuple[str, ...]:
        """All but r and the stiffnesses that it couples."""
        coupled = ("k", "kr", "r") if self.config.inclined else ()
        return tuple(parameter.name for parameter in self.parameters if parameter.name not in coupled)

    @property
    def ports(self) -> tuple[JointPort, ...]:
        """The shaft and the housing."""
        directions = PLANAR if self.config.motion == "plane" else _SPATIAL
        return JointPort("shaft", 1, directions=directions), JointPort("housing", 1, directions=directions)

    def range_objections(self, lower: Mapping[str, float], upper: Mapping[str, float]) -> Mapping[str, str]:
        """Object also to a coupling with which a deformation could release energy."""
        objections = dict(super().range_objections(lower, upper))
        if self.config.inclined and max(abs(lower["r"]), abs(upper["r"])) > 1.0:
            objections["r"] = "r is beyond -1 or 1, so that a deformation of the bearing releases energy."
        return objections

    def matrices(self, theta: NDArray[np.float64]) -> StructuralMatrices:
        """Return the (n, d, d) matrices for theta (n, n_params)."""
        joint = StructuralMatrices.zeros(len(theta), self.size)
        values = dict(zip([parameter.name for parameter in self.parameters], theta.T, strict=True))
        pair_of = {self.node_dofs[shaft][1]: (shaft, housing) for shaft, housing in self.contact_dofs}
        for radial, tilting, sign in _PLANES:
            if radial not in pair_of:
                continue
            joint.add_contact_layer([pair_of[radial]], values["k"], values["c"])
            joint.add_contact_layer([pair_of[tilting]], values["kr"], values["cr"])
            joint.M[:, pair_of[tilting][0], pair_of[tilting][0]] = values["J"]
            if self.config.inclined:
                coupling = sign * values["r"] * np.sqrt(np.abs(values["k"] * values["kr"]))
                add_cross_stiffness(joint, pair_of[radial], pair_of[tilting], coupling)
        for direction in ("x", "y", "z"):
            if direction in pair_of:
                joint.M[:, pair_of[direction][0], pair_of[direction][0]] = values["m"]
        if "y" in pair_of:
            joint.add_contact_layer([pair_of["y"]], values["ka"], values["ca"])
        return joint
