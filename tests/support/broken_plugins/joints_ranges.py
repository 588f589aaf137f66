"""Joints with a fault in part of their ranges, in their derivatives, or in the ranges that they declare."""

from __future__ import annotations

import itertools
import math

import numpy as np

from dovetail import JointPort, Parameter, StructuralMatrices
from support.broken_plugins.joints import TILT, SoundJoint
from support.broken_plugins.lists import also_breaks, breaks


def fractions(joint, theta):
    """Return where vectors lie in the ranges, (n, n_params) from 0 to 1."""
    return np.stack([each.to_unit(theta[:, column]) for column, each in enumerate(joint.parameters)], axis=1)


@also_breaks("stiffness_is_positive_semidefinite")
class NegativeInOneCorner(SoundJoint):
    """Negative stiffness where springs are soft and tilting springs stiff."""

    def matrices(self, theta):
        """Subtract in one corner."""
        joint, share = super().matrices(theta), fractions(self, theta)
        corner = (share[:, 0] < 0.02) & (share[:, 1] > 0.98) & (share[:, 2] < 0.02) & (share[:, 3] > 0.98)
        joint.K[:] -= 2.0 * (corner * theta[:, 1])[:, None, None] * TILT
        joint.D[:] = 0.0
        return joint


@also_breaks("matrices_are_finite")
class UndefinedInOneCorner(SoundJoint):
    """It divides by what vanishes in one corner."""

    def matrices(self, theta):
        """Divide."""
        joint, share = super().matrices(theta), fractions(self, theta)
        with np.errstate(divide="ignore", invalid="ignore"):
            joint.C[:, 1, 1] /= (share[:, 0] < 0.999) | (share[:, 1] > 0.001) | (share[:, 2] < 0.999)
        return joint


@also_breaks("matrices_are_finite")
class UndefinedInASliver(SoundJoint):
    """Undefined in one per cent of the volume."""

    def matrices(self, theta):
        """Take the root of what is negative there."""
        joint, share = super().matrices(theta), fractions(self, theta)
        sliver = (abs(share[:, 0] - 0.62) < 0.02) & (abs(share[:, 1] - 0.45) < 0.15)
        joint.M[sliver, 3, 3] = np.nan
        return joint


@also_breaks("matrices_are_symmetric")
class SkewInOneCorner(SoundJoint):
    """Circulatory forces in one corner."""

    def matrices(self, theta):
        """Add a skew part."""
        joint, share = super().matrices(theta), fractions(self, theta)
        corner = (share[:, 0] > 0.95) & (share[:, 1] < 0.05)
        joint.K[corner, 0, 1] += 1.0
        return joint


@also_breaks("mass_is_positive_semidefinite")
class NegativeMassInASliver(SoundJoint):
    """A polynomial for the inertia that dips below zero."""

    def matrices(self, theta):
        """Fit badly."""
        joint, share = super().matrices(theta), fractions(self, theta)
        joint.M[:, 3, 3] *= np.where((share[:, 3] - 0.955) ** 2 < 1e-4, -1.0, 1.0)
        return joint


@also_breaks("damping_is_positive_semidefinite")
class FeedingInASliver(SoundJoint):
    """Damping of the wrong sign for some values of it."""

    def matrices(self, theta):
        """Turn the sign."""
        joint, share = super().matrices(theta), fractions(self, theta)
        joint.C[:] *= np.where(abs(share[:, 2] - 0.41) < 0.01, -1.0, 1.0)[:, None, None]
        return joint


@also_breaks("translation_costs_nothing")
class GroundedInOneCorner(SoundJoint):
    """A spring against the ground, for soft and long joints only."""

    def matrices(self, theta):
        """Hold side a."""
        joint, share = super().matrices(theta), fractions(self, theta)
        joint.K[:, 0, 0] += 0.01 * theta[:, 0] * ((share[:, 0] < 0.05) & (share[:, 1] > 0.95))
        return joint


@also_breaks("rotation_costs_nothing")
class TiltHeldInOneCorner(SoundJoint):
    """A tilting spring against the ground in one corner."""

    def matrices(self, theta):
        """Hold side b."""
        joint, share = super().matrices(theta), fractions(self, theta)
        joint.K[:, 3, 3] += 0.01 * theta[:, 1] * ((share[:, 1] > 0.97) & (share[:, 2] < 0.03))
        return joint


def scaled(matrices, factor):
    """Return matrices times a factor for each of the batch."""
    values = (getattr(matrices, part) for part in "MKCD")
    return StructuralMatrices(*(factor[:, None, None] * value for value in values))


@also_breaks("jacobian_meets_differences")
class WrongDerivativeAtTheEnds(SoundJoint):
    """A derivative that is off near both ends of a range."""

    def matrices_jacobian(self, theta):
        """Scale one there."""
        jacobian, share = list(super().matrices_jacobian(theta)), fractions(self, theta)
        jacobian[1] = scaled(jacobian[1], 1.0 + 0.01 * (abs(share[:, 1] - 0.5) > 0.48))
        return jacobian


@also_breaks("jacobian_meets_differences")
class WrongDerivativeInOneCorner(SoundJoint):
    """A derivative that is off in one corner."""

    def matrices_jacobian(self, theta):
        """Scale one there."""
        jacobian, share = list(super().matrices_jacobian(theta)), fractions(self, theta)
        jacobian[3] = scaled(jacobian[3], 1.0 + 0.01 * ((share[:, 0] < 0.1) & (share[:, 3] > 0.9)))
        return jacobian


@also_breaks("jacobian_meets_differences")
class ForgottenDerivative(SoundJoint):
    """D depends on the stiffness; its derivative does not."""

    def matrices_jacobian(self, theta):
        """Leave D out."""
        return [StructuralMatrices(each.M, each.K, each.C) for each in super().matrices_jacobian(theta)]


@breaks("jacobian_treats_each_vector_alone")
class DerivativeOfTheFirst(SoundJoint):
    """In a large batch every vector has the derivative of the first; it bends with k."""

    def matrices(self, theta):
        """Add a spring in series with the layer."""
        joint, (k, kr) = super().matrices(theta), theta.T[:2]
        arm = k * self.config.thickness**2
        joint.K[:] += (kr * arm / (kr + arm))[:, None, None] * TILT
        return joint

    def matrices_jacobian(self, theta):
        """Repeat the first where there are more than a hundred."""
        if len(theta) <= 100:
            return super().matrices_jacobian(theta)
        first = super().matrices_jacobian(theta[:1])
        return [scaled(each, np.ones(len(theta))) for each in first]


@breaks("parameters_are_distinguishable")
class Product(SoundJoint):
    """Stiffness is pressure times area, and nothing else distinguishes them."""

    parameters = (
        Parameter("p", "Pa/m", 1e8, 1e9, "log", "stiffness per area"),
        Parameter("area", "m^2", 1e-3, 1e-2, "log", "area of contact"),
        *SoundJoint.parameters[1:],
    )

    def matrices(self, theta):
        """Multiply."""
        return super().matrices(np.column_stack([theta[:, 0] * theta[:, 1], theta[:, 2:]]))


@also_breaks("parameters_are_distinguishable")
class Parallel(SoundJoint):
    """Two dampers side by side."""

    parameters = (*SoundJoint.parameters, Parameter("c2", "N s/m", 1.0, 100.0, "log", "damping of the seal"))

    def matrices(self, theta):
        """Add both."""
        return super().matrices(np.column_stack([theta[:, :2], theta[:, 2] + theta[:, 4], theta[:, 3]]))


@breaks("small_steps_show")
class Staircase(SoundJoint):
    """The damping ratio from a table in steps of one per cent, not interpolated."""

    def matrices(self, theta):
        """Round the ratio."""
        critical = np.sqrt(theta[:, 0] * theta[:, 3])
        c = critical * np.exp(np.round(np.log(theta[:, 2] / critical), 2))
        return super().matrices(np.column_stack([theta[:, :2], c, theta[:, 3]]))


@also_breaks("small_steps_show", "jacobian_meets_differences")
class SinglePrecision(SoundJoint):
    """Computed in single precision, as graphics cards like it."""

    def matrices(self, theta):
        """Lose nine digits."""
        return super().matrices(theta.astype(np.float32).astype(np.float64))


@also_breaks("small_steps_show")
class WholeNewtons(SoundJoint):
    """Integer division."""

    def matrices(self, theta):
        """Drop what is behind the point."""
        return super().matrices(np.column_stack([theta[:, :1] // 1000 * 1000, theta[:, 1:]]))


@breaks("parts_of_default_ranges_are_accepted")
class RefusesPoints(SoundJoint):
    """It calls a known parameter an empty range."""

    def range_objections(self, lower, upper):
        """Object where both ends are the same."""
        same = {name: "the range is empty." for name in lower if lower[name] == upper[name]}
        return same or super().range_objections(lower, upper)


@also_breaks("parts_of_default_ranges_are_accepted")
class RefusesTheLowerHalf(SoundJoint):
    """It wants stiff springs to be possible."""

    def range_objections(self, lower, upper):
        """Object where none is stiff."""
        return {"k": "k must reach 1e6 N/m."} if upper["k"] < 1e6 else super().range_objections(lower, upper)


@also_breaks("parts_of_default_ranges_are_accepted")
class DividesByTheWidth(SoundJoint):
    """It fails where a parameter is known."""

    def range_objections(self, lower, upper):
        """Take decades, and count them."""
        1.0 / math.log10(upper["kr"] / lower["kr"])
        return super().range_objections(lower, upper)


@breaks("impossible_ranges_are_refused")
class AcceptsAnything(SoundJoint):
    """It forgot what the base class objects to."""

    def range_objections(self, lower, upper):
        """Object to a mass of more than a tonne alone."""
        return {"m": "m is in kg."} if upper["m"] > 1000.0 else {}


@also_breaks("impossible_ranges_are_refused")
class ObjectsToAStranger(SoundJoint):
    """It objects to a parameter that there is not."""

    def range_objections(self, lower, upper):
        """Use the long names."""
        return {f"parameter {name}": text for name, text in super().range_objections(lower, upper).items()}


@also_breaks("impossible_ranges_are_refused")
class ObjectsWithoutAWord(SoundJoint):
    """It answers yes in place of a sentence."""

    def range_objections(self, lower, upper):
        """Return truth values."""
        return dict.fromkeys(super().range_objections(lower, upper), True)


@breaks("every_port_and_dof_is_used")
class IdlePort(SoundJoint):
    """A port that nothing is attached to."""

    ports = (*SoundJoint.ports, JointPort("c", 1))
    contact_dofs = ((0, 2), (1, 3))

    def matrices(self, theta):
        """Leave the third side alone."""
        inner, joint = SoundJoint(self.config).matrices(theta), StructuralMatrices.zeros(len(theta), 6)
        for part in "MKCD":
            getattr(joint, part)[:, :4, :4] = getattr(inner, part)
        return joint


@also_breaks("every_port_and_dof_is_used")
class IdleInternalDof(SoundJoint):
    """A DOF of its own that was left over."""

    internal_dofs = 1

    def matrices(self, theta):
        """Leave the fifth alone."""
        inner, joint = SoundJoint(self.config).matrices(theta), StructuralMatrices.zeros(len(theta), 5)
        for part in "MKCD":
            getattr(joint, part)[:, :4, :4] = getattr(inner, part)
        return joint


@also_breaks("every_port_and_dof_is_used")
class Adrift(SoundJoint):
    """Two DOFs of its own with a spring between them, tied to nothing and without mass."""

    internal_dofs = 2

    def matrices(self, theta):
        """Tie them to each other."""
        inner, joint = SoundJoint(self.config).matrices(theta), StructuralMatrices.zeros(len(theta), 6)
        for part in "MKCD":
            getattr(joint, part)[:, :4, :4] = getattr(inner, part)
        joint.add_contact_layer([(4, 5)], theta[:, 0])
        return joint


@also_breaks("contact_dofs_are_pairs")
class CrossedContacts(SoundJoint):
    """The displacement of one side meets the rotation of the other."""

    contact_dofs = ((0, 3), (1, 2))


@breaks("merged_dofs_have_one_direction")
class CrossedMerging(SoundJoint):
    """A displacement that is a rotation."""

    merged_dofs = ((0, 3),)


class Chained(SoundJoint):
    """A sound joint with a rod of masses between its sides, which can be meshed finer."""

    elements = 1

    @property
    def internal_dofs(self):
        """Displacements within the rod."""
        return self.elements - 1

    @property
    def contact_dofs(self):
        """Side a meets side b."""
        return (0, 2), (1, 3)

    def matrices(self, theta):
        """Put springs in a row, with the mass spread over them."""
        joint = StructuralMatrices.zeros(len(theta), self.size)
        k, kr, c, m = theta.T
        chain = [0, *range(4, self.size), 2]
        for first, second in itertools.pairwise(chain):
            joint.add_contact_layer([(first, second)], k * self.elements, c * self.elements)
            joint.M[:, first, first] += 0.5 * m / self.elements
            joint.M[:, second, second] += 0.5 * m / self.elements
        joint.add_contact_layer([(1, 3)], kr)
        return joint

    def refined(self, factor):
        """Return more elements."""
        finer = type(self)(self.config)
        finer.elements = factor * self.elements
        return finer


@breaks("a_finer_mesh_is_the_same_joint")
class LosesMassWhenRefined(Chained):
    """A finer mesh forgets how many elements share the mass."""

    def matrices(self, theta):
        """Divide once too often."""
        joint = super().matrices(theta)
        joint.M[:] /= self.elements
        return joint


@also_breaks("a_finer_mesh_is_the_same_joint")
class RenamedWhenRefined(Chained):
    """A finer mesh has other names for its parameters."""

    def refined(self, factor):
        """Number them."""
        finer = super().refined(factor)
        finer.parameters = tuple(
            Parameter(f"{p.name}{factor}", p.unit, p.lower, p.upper, p.scale, p.description) for p in self.parameters
        )
        return finer


@also_breaks("a_finer_mesh_is_the_same_joint")
class SofterWhenRefined(Chained):
    """A finer mesh forgets that springs in a row are softer."""

    def matrices(self, theta):
        """Divide the stiffness by the number of springs."""
        return super().matrices(theta / np.array([self.elements, 1.0, 1.0, 1.0]))
