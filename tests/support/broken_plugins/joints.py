"""A sound joint, and one with a single fault for each check of the kit that joints have."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from pydantic import ConfigDict, Field

from dovetail import ComponentConfig, InUnit, JointModel, JointPort, Parameter, StructuralMatrices
from support.broken_plugins.lists import breaks

BETWEEN = np.outer([1.0, 0.0, -1.0, 0.0], [1.0, 0.0, -1.0, 0.0])
TILT = np.outer([0.0, 1.0, 0.0, -1.0], [0.0, 1.0, 0.0, -1.0])


class SoundJoint(JointModel):
    """Springs and dampers in x and in rz, with masses."""

    name = "sound_joint"
    summary = "Springs and dampers"
    parameters = (
        Parameter("k", "N/m", 1e5, 1e7, "log", "stiffness"),
        Parameter("kr", "N m/rad", 1e2, 1e4, "log", "tilting stiffness"),
        Parameter("c", "N s/m", 1.0, 100.0, "log", "damping"),
        Parameter("m", "kg", 0.1, 0.2, "linear", "mass on side b"),
    )
    ports = (JointPort("a", 1), JointPort("b", 1))

    class Config(ComponentConfig):
        """One option.

        Attributes
        ----------
        thickness : float
            Of the layer [m].
        """

        thickness: Annotated[float, Field(gt=0), InUnit("m")] = 1e-2

    def matrices(self, theta):
        """Return the (n, 4, 4) matrices."""
        joint = StructuralMatrices.zeros(len(theta), self.size)
        k, kr, c, m = theta.T[:, :, None, None]
        joint.K[:] = k * BETWEEN + kr * TILT
        joint.C[:] = c * (BETWEEN + self.config.thickness**2 * TILT)
        joint.D[:] = 0.01 * joint.K
        joint.M[:, 2, 2] = m[:, 0, 0]
        joint.M[:, 3, 3] = self.config.thickness**2 * m[:, 0, 0]
        return joint


@breaks("name_summary_and_references_are_texts")
class BadReferences(SoundJoint):
    """References that are one text, not a tuple of texts."""

    references = "Somebody, 2001"


@breaks("public_code_is_documented")
class Undocumented(SoundJoint):
    """A method without a docstring."""

    def stretch(self):
        return 1.0


@breaks("options_are_described_with_their_units")
class UnitsForgotten(SoundJoint):
    """An option described in metres that cannot be written with a unit."""

    class Config(ComponentConfig):
        """One option.

        Attributes
        ----------
        thickness : float
            Of the layer [m].
        depth : float
            Of the groove [m].
        """

        thickness: Annotated[float, Field(gt=0), InUnit("m")] = 1e-2
        depth: float = 1e-3


@breaks("options_have_a_schema")
class NoSchema(SoundJoint):
    """A default that JSON cannot hold."""

    class Config(ComponentConfig):
        """One option.

        Attributes
        ----------
        thickness : float
            Of the layer [m].
        """

        thickness: Annotated[float, InUnit("m"), Field(json_schema_extra={"limit": float("inf")})] = 1e-3


@breaks("config_is_frozen_and_refuses_unknown_keys")
class Lax(SoundJoint):
    """Options that take any key."""

    class Config(SoundJoint.Config):
        """The same option, and whatever else is written.

        Attributes
        ----------
        thickness : float
            Of the layer [m].
        """

        model_config = ConfigDict(extra="allow")


@breaks("examples_make_components")
class RaisesWhenMade(SoundJoint):
    """A constructor that raises."""

    def __init__(self, config=None):
        super().__init__(config)
        raise RuntimeError("no licence")


@breaks("ports_parameters_and_dofs_are_declared")
class SamePortTwice(SoundJoint):
    """Two ports of one name."""

    ports = (JointPort("a", 1), JointPort("a", 1))


@breaks("matrices_have_the_shape_of_the_dofs")
class WrongReturn(SoundJoint):
    """An array in place of StructuralMatrices."""

    def matrices(self, theta):
        """Return the stiffness alone."""
        return super().matrices(theta).K


@breaks("matrices_are_finite")
class Infinite(SoundJoint):
    """A singularity at an end of a range."""

    def matrices(self, theta):
        """Divide by zero at the upper end of k."""
        joint = super().matrices(theta)
        with np.errstate(divide="ignore"):
            joint.K[:, 0, 0] /= theta[:, 0] < 9.99e6
        return joint


@breaks("parameters_are_described")
class Taciturn(SoundJoint):
    """A parameter without a description."""

    parameters = (*SoundJoint.parameters[:3], Parameter("m", "kg", 0.1, 0.2))


@breaks("default_ranges_are_accepted")
class Contradiction(SoundJoint):
    """An objection to its own range."""

    def range_objections(self, lower, upper):
        """Object to ranges that were not narrowed."""
        own = {each.name: (each.lower, each.upper) for each in self.parameters}
        asked = {name: (lower[name], upper[name]) for name in lower}
        return {"k": "narrow the range."} if asked == own else super().range_objections(lower, upper)


@breaks("matrices_are_symmetric")
class OneSided(SoundJoint):
    """Circulatory forces."""

    def matrices(self, theta):
        """Add a skew part."""
        joint = super().matrices(theta)
        joint.K[:, 0, 1] += 1e-4 * theta[:, 0] * self.config.thickness
        joint.K[:, 1, 0] -= 1e-4 * theta[:, 0] * self.config.thickness
        return joint


@breaks("stiffness_is_positive_semidefinite")
class NegativeSpring(SoundJoint):
    """A wrong sign in the stiffness in rotation."""

    def matrices(self, theta):
        """Subtract in place of adding."""
        joint = super().matrices(theta)
        joint.K[:] -= 2.0 * theta[:, 1, None, None] * TILT
        joint.D[:] = 0.0
        return joint


@breaks("mass_is_positive_semidefinite")
class NegativeMass(SoundJoint):
    """A wrong sign in the rotary inertia."""

    def matrices(self, theta):
        """Turn the sign of one mass."""
        joint = super().matrices(theta)
        joint.M[:, 3, 3] *= -1.0
        return joint


@breaks("damping_is_positive_semidefinite")
class Feeding(SoundJoint):
    """A damper that feeds the motion."""

    def matrices(self, theta):
        """Turn the sign of the damping."""
        joint = super().matrices(theta)
        joint.C[:] *= -1.0
        return joint


@breaks("each_vector_of_a_batch_is_treated_alone")
class LargeBatches(SoundJoint):
    """A fast path for large batches, with the mean of the masses for all."""

    def matrices(self, theta):
        """Mix the vectors where there are many."""
        joint = super().matrices(theta)
        if len(theta) > 700:
            joint.M[:, 3, 3] = self.config.thickness**2 * theta[:, 3].mean()
        return joint


@breaks("every_parameter_acts")
class Idle(SoundJoint):
    """A parameter that changes nothing."""

    parameters = (*SoundJoint.parameters, Parameter("z", "1", 0.0, 1.0, "linear", "forgotten"))

    def matrices(self, theta):
        """Leave the last column out."""
        return super().matrices(theta[:, :4])


@breaks("jacobian_meets_differences")
class WrongDerivative(SoundJoint):
    """A derivative that is off by half a percent."""

    def matrices_jacobian(self, theta):
        """Scale one of them."""
        jacobian = list(super().matrices_jacobian(theta))
        first = jacobian[0]
        jacobian[0] = StructuralMatrices(first.M, 1.005 * first.K, first.C, first.D)
        return jacobian


class Bent(SoundJoint):
    """Sound, with more damping where it is stiff in tilting."""

    def matrices(self, theta):
        """Let the stiffness act on the damping."""
        joint = super().matrices(theta)
        part = theta[:, 1] / (theta[:, 1] + theta[:, 0] * self.config.thickness**2)
        joint.C[:] *= 1.0 + 0.1 * part[:, None, None]
        return joint


@breaks("declared_matrices_are_true")
class LinearInName(SoundJoint):
    """It declares parameters as linear whose slopes depend on others."""

    linear_parameters = ("k", "kr", "c", "m")

    def matrices(self, theta):
        """Return those of the bent one."""
        return Bent(self.config).matrices(theta)

    def matrices_jacobian(self, theta):
        """Return right derivatives."""
        return Bent(self.config).matrices_jacobian(theta)


@breaks("translation_costs_nothing")
class Grounded(SoundJoint):
    """A spring against the ground."""

    def matrices(self, theta):
        """Hold side a."""
        joint = super().matrices(theta)
        joint.K[:, 0, 0] += 0.01 * theta[:, 0]
        return joint


@breaks("rotation_costs_nothing")
class HeldInRotation(SoundJoint):
    """A tilting spring against the ground."""

    def matrices(self, theta):
        """Hold side a."""
        joint = super().matrices(theta)
        joint.K[:, 1, 1] += 0.01 * theta[:, 1]
        return joint


@breaks("contact_dofs_are_pairs")
class NoContacts(SoundJoint):
    """A DOF that there is not among those that meet."""

    contact_dofs = ((0, 2), (1, 4))


class StopJoint(SoundJoint):
    """A sound joint with a stop that bears only above 97 % of the range of its stiffness, and then in tilt too."""

    class Config(SoundJoint.Config):
        """The layer, and where the stop is.

        Attributes
        ----------
        thickness : float
            Of the layer [m].
        gap : float
            Stiffness above which the stop bears [N/m].
        """

        gap: Annotated[float, Field(gt=0), InUnit("N/m")] = 0.97 * 1e7

    def matrices(self, theta):
        """Couple x with rz above the gap."""
        joint = super().matrices(theta)
        arm = np.array([1.0, self.config.thickness, -1.0, -self.config.thickness])
        beyond = np.maximum(theta[:, 0] - self.config.gap, 0.0)
        joint.K[:] += beyond[:, None, None] * np.outer(arm, arm)
        return joint


class LossySpring(SoundJoint):
    """A law of its own: the same, with a loss that depends on frequency."""

    parameters = SoundJoint.parameters[:2]

    class Config(SoundJoint.Config):
        """The layer, and where the loss is given.

        Attributes
        ----------
        thickness : float
            Of the layer [m].
        reference : float
            Frequency at which the loss factor is 0.1 [Hz].
        """

        reference: Annotated[float, Field(gt=0), InUnit("Hz")] = 1000.0

    def matrices(self, theta):
        """Return what holds at rest."""
        joint = StructuralMatrices.zeros(len(theta), self.size)
        joint.K[:] = theta[:, 0, None, None] * BETWEEN + theta[:, 1, None, None] * TILT
        return joint

    def dynamic_stiffness(self, frequency, theta):
        """Return K (1 + i eta f / (1 kHz))."""
        loss = 1.0 + 0.1j * frequency[None, :, None, None] / self.config.reference
        return self.matrices(theta).K[:, None] * loss


@breaks("dynamic_stiffness_has_its_shape")
class Transposed(LossySpring):
    """Frequencies and vectors in each other's place."""

    def dynamic_stiffness(self, frequency, theta):
        """Return (n_freq, n, d, d)."""
        return np.swapaxes(super().dynamic_stiffness(frequency, theta), 0, 1)


@breaks("dynamic_stiffness_is_symmetric_and_passive")
class WrongConvention(LossySpring):
    """The other sign of time."""

    def dynamic_stiffness(self, frequency, theta):
        """Return the complex conjugate."""
        return super().dynamic_stiffness(frequency, theta).conj()


@breaks("dynamic_stiffness_jacobian_meets_differences")
class WrongSensitivity(LossySpring):
    """A derivative of the law that is off by half a percent."""

    def dynamic_stiffness_jacobian(self, frequency, theta):
        """Scale them all."""
        return (1.005 * part for part in super().dynamic_stiffness_jacobian(frequency, theta))


@breaks("dynamic_stiffness_treats_lines_and_vectors_alone")
class RelativeFrequency(LossySpring):
    """A law in terms of the greatest frequency asked for."""

    def dynamic_stiffness(self, frequency, theta):
        """Scale by the last line."""
        return super().dynamic_stiffness(self.config.reference * frequency / frequency[-1], theta)


@breaks("inputs_are_left_unchanged")
class Overwriting(LossySpring):
    """It uses the caller's array for its own purposes."""

    def dynamic_stiffness(self, frequency, theta):
        """Leave zeros behind."""
        Z = super().dynamic_stiffness(frequency, theta)
        if theta.flags.writeable:
            theta[:] = 0.0
        return Z


@breaks("results_are_new_arrays")
class Cached(SoundJoint):
    """It hands out the matrices that it keeps."""

    def matrices(self, theta):
        """Look up what was computed before."""
        key = theta.tobytes()
        kept = self.__dict__.setdefault("kept", {})
        if key not in kept:
            kept[key] = super().matrices(theta)
        return kept[key]


class Noted(SoundJoint):
    """A sound joint with a note."""

    class Config(SoundJoint.Config):
        """One option, and a note.

        Attributes
        ----------
        thickness : float
            Of the layer [m].
        note : str
            For the reader.
        """

        note: str = ""

    @classmethod
    def examples(cls, folder):
        """Return a note."""
        return ({"note": " as built "},)


@breaks("config_survives_json")
class LostInJson(Noted):
    """An option that is not written."""

    class Config(Noted.Config):
        """One option, and a note.

        Attributes
        ----------
        thickness : float
            Of the layer [m].
        note : str
            For the reader.
        """

        note: Annotated[str, Field(exclude=True)] = ""


@breaks("a_component_keeps_its_config")
class OwnOptions(Noted):
    """It changes the options that it was given."""

    def __init__(self, config=None):
        config = config or self.Config()
        super().__init__(config.model_copy(update={"note": config.note.strip()}))
