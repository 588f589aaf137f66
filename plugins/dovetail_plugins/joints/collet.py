"""The spring collet between a tool and its holder, twelve parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from dovetail import (
    ComponentConfig,
    InUnit,
    JointModel,
    JointPort,
    Parameter,
    ScaledMatrices,
    StructuralMatrices,
)
from dovetail_plugins.round_elements import RoundElements
from dovetail_plugins.timoshenko import Material, circle, element_matrices

_PARAMETERS = (
    Parameter("Dc", "m", 26e-3, 40e-3, "linear", "equivalent outer diameter of the collet"),
    Parameter("dc", "m", 10e-3, 18e-3, "linear", "equivalent inner diameter of the collet"),
    Parameter("mn1", "kg", 0.02, 0.20, "linear", "nut mass on the first collet node"),
    Parameter("mn2", "kg", 0.02, 0.20, "linear", "nut mass on the second collet node"),
    Parameter("kt_tc", "N/m", 1e8, 2e9, "log", "translational stiffness of the tool-collet layer, per node"),
    Parameter("kr_tc", "N m/rad", 2e3, 6e4, "log", "rotational stiffness of the tool-collet layer, per node"),
    Parameter("ct_tc", "N s/m", 10.0, 1000.0, "log", "translational damping of the tool-collet layer, per node"),
    Parameter("cr_tc", "N m s/rad", 0.01, 5.0, "log", "rotational damping of the tool-collet layer, per node"),
    Parameter("kt_hc", "N/m", 3e8, 5e9, "log", "translational stiffness of the holder-collet layer, per node"),
    Parameter("kr_hc", "N m/rad", 5e4, 2e6, "log", "rotational stiffness of the holder-collet layer, per node"),
    Parameter("ct_hc", "N s/m", 10.0, 1000.0, "log", "translational damping of the holder-collet layer, per node"),
    Parameter("cr_hc", "N m s/rad", 0.01, 5.0, "log", "rotational damping of the holder-collet layer, per node"),
)
_CONTACTS = 3
"""Nodes of each contact layer; the middle node of the collet belongs to both."""
_SEGMENTS = 2 * (_CONTACTS - 1)


class Collet(JointModel):
    """A beam of nodes c1 to c5 from the tool's side, with the nut's mass on c1 and c2.

    The tool's nodes meet c1, c2, c3 and the holder's c3, c4, c5, each through a spring and a damper in translation
    and in rotation. Micro-slip, preload-dependent stiffness and the slots of the collet are not modelled.

    Only kr_tc and kr_hc resist sliding along the axis. Other than in a bolted lap, this omits no stiffness:
    tool, collet and holder bend about one axis. With stiff layers the natural frequencies are those of a solid body
    within 1.1 % (``pytest tests/synthesis/test_sliding_faces.py``), the difference of the two beam models in shear.
    """

    name = "collet"
    summary = "Spring collet with nut between a tool and a holder: two contact layers, twelve parameters"
    free_options = ("elements_per_segment",)
    nodes_along = ("y",)
    nested_ports = (("tool", "holder", None),)
    references = ("Processes 14 (2026) 1875, doi:10.3390/pr14121875, section 4.1 and Eq. 9",)
    parameters = _PARAMETERS
    linear_parameters = tuple(parameter.name for parameter in _PARAMETERS[2:])

    class Config(ComponentConfig):
        """Material of the collet, distance of its contact nodes, and elements between two of them.

        Attributes
        ----------
        material : Material
            Of the collet's beam, most often the holder's.
        segment : float
            Distance of neighbouring contact nodes [m].
        elements_per_segment : int
            Beam elements between two of them.
        """

        material: Material
        segment: Annotated[float, Field(gt=0), InUnit("m")] = 10e-3
        elements_per_segment: Annotated[int, Field(ge=1, le=100)] = 1

    @classmethod
    def examples(cls, folder: Path) -> Sequence[Mapping[str, Any]]:  # noqa: ARG003
        """Return a steel collet, with the usual and with a finer mesh."""
        steel = {"young": "200 GPa", "density": "7850 kg/m^3", "loss_factor": 0.003}
        return {"material": steel}, {"material": steel, "segment": "8 mm", "elements_per_segment": 2}

    def refined(self, factor: int) -> Collet:
        """Return the same collet with `factor` times as many elements."""
        elements = factor * self.config.elements_per_segment
        return type(self)(self.config.model_copy(update={"elements_per_segment": elements}))

    @property
    def ports(self) -> tuple[JointPort, ...]:
        """The tool at c1 to c3, and the holder at c3 to c5."""
        along = [node * float(self.config.segment) for node in range(_SEGMENTS + 1)]
        return JointPort("tool", _CONTACTS, tuple(along[:_CONTACTS])), JointPort(
            "holder", _CONTACTS, tuple(along[-_CONTACTS:])
        )

    @property
    def internal_dofs(self) -> int:
        """DOFs of the collet's own nodes."""
        return 2 * (_SEGMENTS * int(self.config.elements_per_segment) + 1)

    @cached_property
    def contact_dofs(self) -> tuple[tuple[int, int], ...]:
        """Tool node i meets collet node i, and holder node i collet node i + 2, each in x and rz."""
        return tuple(
            (2 * (port * _CONTACTS + index) + axis, self._collet_dof(port * (_CONTACTS - 1) + index) + axis)
            for port in range(2)
            for index in range(_CONTACTS)
            for axis in (0, 1)
        )

    def range_objections(self, lower: Mapping[str, float], upper: Mapping[str, float]) -> Mapping[str, str]:
        """Object also to a hole as wide as the collet anywhere in the ranges of the two diameters."""
        objections = dict(super().range_objections(lower, upper))
        if upper["dc"] >= lower["Dc"]:
            widest, narrowest = upper["dc"] * 1e3, lower["Dc"] * 1e3
            objections["dc"] = (
                f"the inner diameter dc may be {widest:g} mm where the outer diameter Dc is {narrowest:g} mm; the "
                "range of dc must end below that of Dc."
            )
        return objections

    def matrices(self, theta: NDArray[np.float64]) -> StructuralMatrices:
        """Return the matrices for theta (n, 12); D = eta K of the collet's beam."""
        Dc, dc, mn1, mn2, kt_tc, kr_tc, ct_tc, cr_tc, kt_hc, kr_hc, ct_hc, cr_hc = theta.T
        joint = StructuralMatrices.zeros(len(theta), self.size)
        self._add_beam(joint, Dc, dc)
        for node, mass in ((0, mn1), (1, mn2)):
            joint.M[:, self._collet_dof(node), self._collet_dof(node)] += mass
        tool, holder = self.contact_dofs[: 2 * _CONTACTS], self.contact_dofs[2 * _CONTACTS :]
        for facing, kt, kr, ct, cr in ((tool, kt_tc, kr_tc, ct_tc, cr_tc), (holder, kt_hc, kr_hc, ct_hc, cr_hc)):
            joint.add_contact_layer(facing[0::2], kt, ct)
            joint.add_contact_layer(facing[1::2], kr, cr)
        return joint

    @cached_property
    def scaled_matrices(self) -> ScaledMatrices:
        """The collet's beam by its diameters, since all its elements are equal."""
        count = int(self.config.elements_per_segment)
        elements = RoundElements(self.config.material, self.config.segment / count)
        return elements.scaled_matrices(self.size, range(_SEGMENTS * count), self._collet_dof(0))

    def _add_beam(self, joint: StructuralMatrices, outer: NDArray[np.float64], inner: NDArray[np.float64]) -> None:
        """Add a beam of equal elements by its diameters; it has no viscous damping."""
        count = int(self.config.elements_per_segment)
        section = circle(outer, inner, self.config.material.poisson)
        element = element_matrices(self.config.segment / count, section, self.config.material)
        for first in range(self._collet_dof(0), self.size - 2, 2):
            dofs = slice(first, first + 4)
            for matrix, block in ((joint.M, element.M), (joint.K, element.K), (joint.D, element.D)):
                matrix[:, dofs, dofs] += block

    def _collet_dof(self, node: int) -> int:
        """Return the local DOF x of collet node c1 (0) to c5 (4)."""
        return 4 * _CONTACTS + 2 * node * int(self.config.elements_per_segment)
