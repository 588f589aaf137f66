"""A joint whose stiffness and loss grow with frequency."""

from typing import Annotated

import numpy as np
from pydantic import Field

from dovetail import ComponentConfig, InUnit, JointModel, JointPort, Parameter, StructuralMatrices

ACROSS = np.outer([1, 0, -1, 0], [1, 0, -1, 0])
"""Between the displacements of both sides; local DOFs are a x, a rz, b x, b rz."""


class RubberMount(JointModel):
    """Rubber between two nodes: k (1 + g (i f / f0)^alpha), the fractional Kelvin-Voigt model.

    The real part grows with frequency and the loss with it, over decades, by three parameters; a spring and a viscous
    damper meet neither. Amplitude (the Payne effect), temperature, preload and the mass of the rubber are not modelled.
    """

    name = "rubber_mount"
    summary = "Rubber mount: stiffness and loss grow with a power of the frequency"
    references = (
        "R. L. Bagley, P. J. Torvik, A theoretical basis for the application of fractional calculus to "
        "viscoelasticity, J. Rheol. 27 (1983) 201-210",
    )
    parameters = (
        Parameter("k", "N/m", 1e5, 1e7, "log", "stiffness at rest"),
        Parameter("g", "1", 0.02, 1.0, "log", "growth: dynamic part over k at the reference frequency"),
        Parameter("alpha", "1", 0.1, 0.9, "linear", "order of the derivative: 0 a spring, 1 a damper"),
    )
    ports = (JointPort("a", 1), JointPort("b", 1))

    class Config(ComponentConfig):
        """The reference frequency of the growth.

        Attributes
        ----------
        reference : float
            Frequency at which the dynamic part is g k in magnitude [Hz].
        """

        reference: Annotated[float, Field(gt=0), InUnit("Hz")] = 100.0

    @classmethod
    def examples(cls, folder):
        """Return options with which the conformance kit tries the joint."""
        return {}, {"reference": "1 kHz"}

    def matrices(self, theta):
        """Return the (n, 4, 4) matrices at rest for theta (n, 3)."""
        joint = StructuralMatrices.zeros(len(theta), self.size)
        joint.K[:] = theta[:, 0, None, None] * ACROSS
        return joint

    def dynamic_stiffness(self, frequency, theta):
        """Return the (n, n_freq, 4, 4) dynamic stiffness."""
        k, g, alpha = theta.T[:, :, None]
        law = k * (1.0 + g * (1j * frequency / self.config.reference) ** alpha)
        return law[:, :, None, None] * ACROSS
