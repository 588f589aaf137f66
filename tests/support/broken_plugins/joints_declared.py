"""Joints with a fault in what they declare: names of methods, units, types."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from pydantic import Field

from dovetail import ComponentConfig, InUnit, Parameter
from support.broken_plugins.joints import LossySpring, SoundJoint
from support.broken_plugins.lists import also_breaks, breaks


@breaks("overrides_are_spelt_as_in_the_contract")
class Misspelt(LossySpring):
    """A derivative that nobody calls."""

    def dynamic_stifness_jacobian(self, frequency, theta):
        """Return nothing of use."""
        return ()


@also_breaks("overrides_are_spelt_as_in_the_contract")
class Singular(SoundJoint):
    """One letter is missing."""

    contact_dof = ((0, 2),)


@also_breaks("overrides_are_spelt_as_in_the_contract")
class Private(SoundJoint):
    """A method that was hidden."""

    def _range_objections(self, lower, upper):
        return {"k": "never seen."}


@also_breaks("overrides_are_spelt_as_in_the_contract")
class American(SoundJoint):
    """Another spelling."""

    def matrix_jacobian(self, theta):
        """Return nothing of use."""
        return ()


@also_breaks("overrides_are_spelt_as_in_the_contract")
class RunTogether(SoundJoint):
    """Capital letters in place of underscores."""

    def internalDofs(self):
        """Return nothing of use."""
        return 1


def renamed(index, name, unit, factor=1.0):
    """Return the parameters of the sound joint with another unit for one of them."""
    parameters = list(SoundJoint.parameters)
    old = parameters[index]
    parameters[index] = Parameter(name, unit, old.lower * factor, old.upper * factor, old.scale, old.description)
    return tuple(parameters)


@breaks("parameters_are_in_si_units")
class Kilonewtons(SoundJoint):
    """A stiffness in kN/m."""

    parameters = renamed(0, "k", "kN/m", 1e-3)

    def matrices(self, theta):
        """Convert."""
        return super().matrices(theta * np.array([1e3, 1.0, 1.0, 1.0]))


@also_breaks("parameters_are_in_si_units")
class Degrees(SoundJoint):
    """A stiffness per degree."""

    parameters = renamed(1, "kr", "N m/deg")

    def matrices(self, theta):
        """Convert."""
        return super().matrices(theta * np.array([1.0, 180.0 / np.pi, 1.0, 1.0]))


@also_breaks("options_are_described_with_their_units")
class Millimetres(SoundJoint):
    """An option in millimetres."""

    class Config(ComponentConfig):
        """One option.

        Attributes
        ----------
        thickness : float
            Of the layer [mm].
        """

        thickness: Annotated[float, Field(gt=0), InUnit("mm")] = 10.0

    def matrices(self, theta):
        """Convert."""
        return SoundJoint(SoundJoint.Config(thickness=1e-3 * self.config.thickness)).matrices(theta)


@breaks("units_agree_with_the_matrices")
class TiltInNewtonsPerMetre(SoundJoint):
    """A tilting stiffness in the unit of a stiffness."""

    parameters = renamed(1, "kr", "N/m")


@also_breaks("units_agree_with_the_matrices")
class DamperInNewtonsPerMetre(SoundJoint):
    """A damper in the unit of a spring."""

    parameters = renamed(2, "c", "N/m")


@also_breaks("units_agree_with_the_matrices")
class MassAsInertia(SoundJoint):
    """A mass in the unit of an inertia."""

    parameters = renamed(3, "m", "kg m^2")


@also_breaks("units_agree_with_the_matrices")
class LossWithAUnit(SoundJoint):
    """A loss factor in N/m."""

    parameters = (*SoundJoint.parameters, Parameter("eta", "N/m", 0.01, 0.1, "log", "loss factor"))

    def matrices(self, theta):
        """Let it be the loss factor."""
        joint = super().matrices(theta[:, :4])
        joint.D[:] = theta[:, 4, None, None] * joint.K
        return joint


@also_breaks("units_agree_with_the_matrices")
class PerLength(SoundJoint):
    """A stiffness per length that is never multiplied with the length."""

    parameters = renamed(0, "k", "N/m^2")


@also_breaks("units_agree_with_the_matrices")
class ArmForgotten(SoundJoint):
    """An inertia from a mass and the arm, not its square."""

    def matrices(self, theta):
        """Multiply once."""
        joint = super().matrices(theta)
        joint.M[:, 3, 3] = theta[:, 3] * self.config.thickness
        return joint


@also_breaks("units_agree_with_the_matrices")
class HiddenLength(SoundJoint):
    """A length that is written into the code."""

    def matrices(self, theta):
        """Use an arm of 0.7 mm."""
        joint = super().matrices(theta)
        joint.M[:, 3, 3] = theta[:, 3] * 0.0007**2
        return joint


@also_breaks("units_agree_with_the_matrices")
class FrequencyWithoutUnit(LossySpring):
    """A reference frequency that is an option without a unit."""

    class Config(ComponentConfig):
        """One option.

        Attributes
        ----------
        reference : float
            Frequency of the loss.
        """

        reference: Annotated[float, Field(gt=0)] = 1000.0

    def dynamic_stiffness(self, frequency, theta):
        """Return K (1 + eta i f / reference)."""
        return self.matrices(theta).K[:, None] * (1.0 + 0.1j * frequency / self.config.reference)[None, :, None, None]


@also_breaks("matrices_have_the_shape_of_the_dofs")
class ComplexStiffness(SoundJoint):
    """A loss written into the stiffness, of which NumPy drops the imaginary part."""

    def matrices(self, theta):
        """Assign complex numbers."""
        joint = super().matrices(theta)
        joint.K[:] = (1.0 + 0.01j) * joint.K
        return joint


@also_breaks("matrices_have_the_shape_of_the_dofs")
class ComplexArrays(SoundJoint):
    """A loss written into the stiffness that is returned."""

    def matrices(self, theta):
        """Return complex numbers."""
        joint = super().matrices(theta)
        return type(joint)(joint.M, (1.0 + 0.01j) * joint.K, joint.C)


@also_breaks("matrices_have_the_shape_of_the_dofs")
class BatchLast(SoundJoint):
    """The batch in the last axis."""

    def matrices(self, theta):
        """Turn the axes."""
        joint = super().matrices(theta)
        return type(joint)(*(np.moveaxis(getattr(joint, part), 0, -1) for part in "MKCD"))


@also_breaks("ports_parameters_and_dofs_are_declared")
class StrangeUnit(SoundJoint):
    """A unit that there is not."""

    parameters = renamed(0, "k", "N/fathomless")


@also_breaks("every_parameter_acts")
class CancelsOut(SoundJoint):
    """A parameter that is added and taken away."""

    parameters = (*SoundJoint.parameters, Parameter("k2", "N/m", 1e5, 1e7, "log", "of the second spring"))

    def matrices(self, theta):
        """Add and subtract."""
        k = theta[:, 0] + 0.0 * theta[:, 4]
        return super().matrices(np.column_stack([k, theta[:, 1:4]]))
