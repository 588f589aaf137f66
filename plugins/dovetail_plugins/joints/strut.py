"""A strut: a spring and a damper along the line between two nodes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dovetail import DIRECTIONS, JointModel, JointPort, Parameter, StructuralMatrices


class Strut(JointModel):
    """A massless spring and damper along the line between two nodes that lie apart in space.

    Its ends turn freely, as those of a rod with ball joints or of a shock absorber. The line is that between the nodes
    as the description places them. Its initial tension and large rotations are not modelled.
    """

    name = "strut"
    summary = "Strut in space: stiffness and damping along the line between two nodes that lie apart"
    spans_a_distance = True
    acts_along_its_nodes = True
    parameters = (
        Parameter("k", "N/m", 1e4, 1e10, "log", "stiffness along the line"),
        Parameter("c", "N s/m", 1.0, 1e5, "log", "damping along the line"),
    )
    linear_parameters = ("k", "c")
    ports = (JointPort("a", 1, directions=DIRECTIONS[:3]), JointPort("b", 1, directions=DIRECTIONS[:3]))

    def matrices(self, theta: NDArray[np.float64]) -> StructuralMatrices:
        """Return the (n, 6, 6) matrices for theta (n, 2), along its own x."""
        joint = StructuralMatrices.zeros(len(theta), self.size)
        joint.add_contact_layer([self.contact_dofs[0]], theta[:, 0], theta[:, 1])
        return joint
