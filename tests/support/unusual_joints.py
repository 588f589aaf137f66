"""A plugin file with two joints unlike any shipped one: three ports, merged and inner DOFs, a frequency law."""

from __future__ import annotations

import numpy as np

import dovetail
from dovetail import ComponentConfig, JointModel, JointPort, Parameter, StructuralMatrices


class Tripod(JointModel):
    """A hub that is one with x of the port `top`, and two inclined lossy struts from it to the port `feet`.

    A strut at the angle phi takes up cos(phi) of the displacement and 20 mm sin(phi) of the rotation of its foot. A
    third port `absorber` hangs by a spring and a damper on an inner mass, which a spring of the same stiffness ties to
    the hub.
    """

    name, summary = "tripod", "Test joint with three ports, two inner DOFs and a merged one"
    parameters = (
        Parameter("k", "N/m", 1e5, 1e9, "log", "stiffness of each strut and of the two springs"),
        Parameter("phi", "rad", 0.1, 1.4, "linear", "angle of the struts"),
        Parameter("eta", "1", 0.0, 0.2, "linear", "loss factor of the struts"),
        Parameter("c", "N s/m", 1.0, 1e4, "log", "damper of the absorber"),
        Parameter("m", "kg", 1e-3, 1.0, "log", "inner mass"),
    )
    ports = (JointPort("top", 1), JointPort("feet", 2), JointPort("absorber", 1))
    internal_dofs = 2
    merged_dofs = ((0, 8),)
    contact_dofs = ((0, 2), (6, 9))

    class Config(ComponentConfig):
        """No options."""

    def matrices(self, theta):
        k, phi, eta, c, m = theta.T
        joint = StructuralMatrices.zeros(len(theta), self.size)
        for foot in (2, 4):
            reach = np.zeros((len(theta), self.size))
            reach[:, 8], reach[:, foot], reach[:, foot + 1] = 1.0, -np.cos(phi), -0.02 * np.sin(phi)
            strut = k[:, None, None] * reach[:, :, None] * reach[:, None, :]
            joint.K[:] += strut
            joint.D[:] += eta[:, None, None] * strut
        joint.add_contact_layer([(8, 9)], k)
        joint.add_contact_layer([(9, 6)], k, c)
        joint.M[:, 9, 9] = m
        return joint


class Rubber(JointModel):
    """k (1 + g (i f / 100 Hz)^alpha) in x and 1e-4 m^2 times as much in rz, halved by a mass on an inner DOF of x."""

    name, summary = "rubber", "Test joint that gives its own dynamic stiffness"
    parameters = (
        Parameter("k", "N/m", 1e5, 1e8, "log", "stiffness at rest"),
        Parameter("g", "1", 0.02, 1.0, "log", "growth"),
        Parameter("alpha", "1", 0.1, 0.9, "linear", "order of the derivative"),
        Parameter("m", "kg", 1e-3, 0.1, "log", "mass of the rubber"),
    )
    ports = (JointPort("a", 1), JointPort("b", 1))
    internal_dofs = 1

    class Config(ComponentConfig):
        """No options."""

    def matrices(self, theta):
        return StructuralMatrices.zeros(len(theta), self.size)

    def dynamic_stiffness(self, frequency, theta):
        k, g, alpha, m = (column[:, None] for column in theta.T)
        law = k * (1.0 + g * (1j * frequency / 100.0) ** alpha)
        Z = np.zeros((*law.shape, self.size, self.size), dtype=np.complex128)
        for first, second, share in ((0, 4, 2.0), (2, 4, 2.0), (1, 3, 1e-4)):
            for row, column, sign in ((first, first, 1), (second, second, 1), (first, second, -1), (second, first, -1)):
                Z[..., row, column] += sign * share * law
        Z[..., 4, 4] -= (2.0 * np.pi * frequency) ** 2 * m
        return Z


@dovetail.hookimpl
def dovetail_components():
    """Return what this plugin offers."""
    return [Tripod, Rubber]
