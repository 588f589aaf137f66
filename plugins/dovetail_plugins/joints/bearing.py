"""A bearing between a shaft and a housing."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dovetail import JointModel, Parameter, Port, StructuralMatrices


class Bearing(JointModel):
    """A spring and a damper in the radial and in the tilting direction, with the inertia of the ring on the shaft.

    The speed of rotation (gyroscopic moments, softening of the ball contacts), the axial load and the coupling of
    radial and tilting motion in an angular contact bearing are not modelled.
    """

    name = "bearing"
    summary = "Bearing: radial and tilting stiffness and damping, with the mass and rotary inertia of its inner ring"
    references = ("T. A. Harris, M. N. Kotzalas, Essential Concepts of Bearing Technology, 5th ed., CRC Press, 2006",)
    parameters = (
        Parameter("k", "N/m", 1e6, 1e10, "log", "radial stiffness"),
        Parameter("kr", "N m/rad", 1e2, 1e7, "log", "tilting stiffness"),
        Parameter("c", "N s/m", 1.0, 1e5, "log", "radial damping"),
        Parameter("cr", "N m s/rad", 1e-3, 1e3, "log", "tilting damping"),
        Parameter("m", "kg", 0.01, 1.0, "linear", "mass of the inner ring and of what turns with it"),
        Parameter("J", "kg m^2", 1e-6, 1e-3, "log", "rotary inertia of the same about a diameter"),
    )
    linear_parameters = tuple(parameter.name for parameter in parameters)
    ports = (Port("shaft", 1), Port("housing", 1))

    def matrices(self, theta: NDArray[np.float64]) -> StructuralMatrices:
        """Return the (n, 4, 4) matrices for theta (n, 6)."""
        joint = StructuralMatrices.zeros(len(theta), self.size)
        k, kr, c, cr, m, J = theta.T
        radial, tilting = self.contact_dofs
        joint.add_contact_layer([radial], k, c)
        joint.add_contact_layer([tilting], kr, cr)
        joint.M[:, 0, 0] = m
        joint.M[:, 1, 1] = J
        return joint
