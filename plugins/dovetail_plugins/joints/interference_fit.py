"""The interference fit: a shaft pressed or shrunk into a hub."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
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
    Parameter,
    ScaledMatrices,
    StructuralMatrices,
)

_DISTRIBUTED = (
    Parameter("k", "N/m^2", 1e8, 1e12, "log", "radial stiffness per unit length"),
    Parameter("kr", "N", 1e4, 1e8, "log", "tilting stiffness per unit length (N m/rad per m)"),
    Parameter("c", "N s/m^2", 1e1, 1e6, "log", "radial damping per unit length"),
    Parameter("cr", "N s", 1e-3, 1e3, "log", "tilting damping per unit length (N m s/rad per m)"),
)
_SLIDING = (
    Parameter("ks", "N/m^2", 1e8, 1e12, "log", "stiffness against sliding, along and around, per unit length"),
    Parameter("cs", "N s/m^2", 1e1, 1e6, "log", "damping of sliding, along and around, per unit length"),
)
_GRADIENT = Parameter(
    "g", "1", -0.9, 0.9, "linear", "change of stiffness from the middle to the last node, over the mean stiffness"
)


class InterferenceFit(JointModel):
    """Radial and tilting springs and dampers, distributed over the contact length.

    Each pair of facing nodes represents the length nearest to it (half an interval at the ends), so that the layer
    converges with the square of the node distance. With ``pressure: linear`` the stiffness changes linearly along the
    contact, k (1 + g s) with s from -1 at the first node to 1 at the last; the damping stays even. Slip, lift-off at
    the edges and the stiffening of the shaft by the hub's pressure are not modelled.

    In a plane only kr resists sliding along the axis. Other than in a bolted lap, this omits no stiffness: shaft and
    hub bend about one axis. With a stiff layer the natural frequencies are those of a solid shaft within 0.5 %
    (``pytest tests/synthesis/test_sliding_faces.py``), which is the difference of the two beam models in shear.

    With ``motion: space`` the layer acts in all six directions, at the faces' distance from the axis: half of
    `diameter`. Its stiffness against sliding, ks, then resists axial motion, twist (ks d^2 / 4) and tilting
    (ks d^2 / 8) together. The axis is y, as that of beams; `axes` gives another one.
    """

    name = "interference_fit"
    summary = "Shaft in hub: distributed radial and tilting stiffness and damping over the contact length"
    free_options = ("length", "nodes")
    nodes_along = ("y",)
    references = (
        "K. Ahmadi, H. Ahmadian, Modelling machine tool dynamics using a distributed parameter tool-holder joint "
        "interface, Int. J. Mach. Tools Manuf. 47 (2007) 1916-1928",
        "T. L. Schmitz et al., Shrink fit tool holder connection stiffness/damping modeling for frequency response "
        "prediction in milling, Int. J. Mach. Tools Manuf. 47 (2007) 1368-1380",
    )

    class Config(ComponentConfig):
        """Contact length, its nodes, and the distribution of pressure along it.

        Attributes
        ----------
        length : float
            From the first contact node to the last [m]; the nodes are evenly spaced.
        nodes : int
            Number of facing nodes of each part.
        pressure : 'uniform' or 'linear'
            With 'linear' the joint has another parameter, the gradient g.
        motion : 'plane' or 'space'
            Whether the layer acts in x and rz, or in all six directions.
        diameter : float
            Of the contact [m], for motion in space.
        """

        length: Annotated[float, Field(gt=0), InUnit("m")]
        nodes: Annotated[int, Field(ge=2, le=1000)] = 3
        pressure: Literal["uniform", "linear"] = "uniform"
        motion: Literal["plane", "space"] = "plane"
        diameter: Annotated[float, Field(ge=0), InUnit("m")] = 0.0

        @model_validator(mode="after")
        def _diameter_in_space(self) -> InterferenceFit.Config:
            if (self.motion == "space") != (self.diameter > 0.0):
                raise ValueError("give 'diameter' with 'motion: space', and only then")
            return self

    def __init__(self, config: Any = None) -> None:
        super().__init__(config)
        self.nested_ports = (("shaft", "hub", self.config.diameter or None),)

    @classmethod
    def examples(cls, folder: Path) -> Sequence[Mapping[str, Any]]:  # noqa: ARG003
        """Return a fit with uniform pressure, one with linearly varying pressure, and one in space."""
        space = {"length": "40 mm", "motion": "space", "diameter": "20 mm"}
        return {"length": "40 mm"}, {"length": "40 mm", "nodes": 5, "pressure": "linear"}, space

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """The four distributed parameters, and the gradient g if the pressure is linear.

        In space, those against sliding replace those against tilting.
        """
        k, kr, c, cr = _DISTRIBUTED
        ks, cs = _SLIDING
        layer = (k, kr, c, cr) if self.config.motion == "plane" else (k, ks, c, cs)
        return (*layer, _GRADIENT) if self.config.pressure == "linear" else layer

    @property
    def linear_parameters(self) -> tuple[str, ...]:
        """The damping, and the stiffness unless a gradient changes it."""
        layer = tuple(parameter.name for parameter in self.parameters[:4])
        return layer[2:] if self.config.pressure == "linear" else layer

    @cached_property
    def scaled_matrices(self) -> ScaledMatrices | None:
        """The stiffness under a gradient: k and kr, or ks, each alone and times g."""
        if self.config.pressure == "uniform":
            return None
        shares = np.array([[1, 0, 0, 0, 0], [1, 0, 0, 0, 1], [0, 1, 0, 0, 0], [0, 1, 0, 0, 1]], dtype=np.float64)
        whole = self.matrices(shares)
        whole.K[1::2] -= whole.K[::2]
        parts = [StructuralMatrices(np.zeros_like(K), K) for K in whole.K]
        return ScaledMatrices(parts, _stiffnesses, _stiffness_slopes)

    @property
    def ports(self) -> tuple[JointPort, ...]:
        """The shaft and the hub, with nodes evenly spaced over the length."""
        nodes = int(self.config.nodes)
        along = tuple(float(position) for position in np.linspace(0.0, self.config.length, nodes))
        directions = PLANAR if self.config.motion == "plane" else DIRECTIONS
        return JointPort("shaft", nodes, along, directions), JointPort("hub", nodes, along, directions)

    def range_objections(self, lower: Mapping[str, float], upper: Mapping[str, float]) -> Mapping[str, str]:
        """Object also to a gradient beyond 1 or -1, which makes the stiffness of an end negative."""
        objections = dict(super().range_objections(lower, upper))
        if self.config.pressure == "linear" and (lower["g"] < -1.0 or upper["g"] > 1.0):
            ends = " to ".join(dict.fromkeys(f"{end:g}" for end in (lower["g"], upper["g"])))
            objections["g"] = f"g is {ends}; beyond -1 or 1 the stiffness at an end of the contact is negative."
        return objections

    def matrices(self, theta: NDArray[np.float64]) -> StructuralMatrices:
        """Return the matrices for theta (n, 4) or (n, 5)."""
        joint = StructuralMatrices.zeros(len(theta), self.size)
        k, second, c, second_c = theta[:, :4].T
        nodes = int(self.config.nodes)
        for shaft, hub in self.contact_dofs:
            node, direction = self.node_dofs[shaft]
            length = self.config.length / (nodes - 1) * (0.5 if node in (0, nodes - 1) else 1.0)
            along = 2.0 * node / (nodes - 1) - 1.0
            stiffness = length * (1.0 + along * theta[:, 4]) if self.config.pressure == "linear" else length
            arm = self._arm(direction)
            share, damping = (k, c) if direction in ("x", "z") else (arm * second, arm * second_c)
            joint.add_contact_layer([(shaft, hub)], stiffness * share, length * damping)
        return joint

    def _arm(self, direction: str) -> float:
        """Return the factor of the springs against tilting or sliding in a direction.

        Springs ks along and around the axis at a distance r from it: the mean of (r cos)^2 over the circumference
        resists tilting, r^2 twist.
        """
        if self.config.motion == "plane" or direction == "y":
            return 1.0
        return float((self.config.diameter / 2.0) ** 2 * (1.0 if direction == "ry" else 0.5))


def _stiffnesses(theta: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return k, k g, kr and kr g (n, 4) for k, kr and g (n, 3)."""
    k, kr, g = theta.T
    return np.stack([k, k * g, kr, kr * g], axis=1)


def _stiffness_slopes(theta: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return their derivatives (n, 4, 3)."""
    k, kr, g = theta.T
    slopes = np.zeros((len(theta), 4, 3))
    slopes[:, 0, 0] = slopes[:, 2, 1] = 1.0
    slopes[:, 1, 0] = slopes[:, 3, 1] = g
    slopes[:, 1, 2], slopes[:, 3, 2] = k, kr
    return slopes
