"""Joints with their own frequency-dependent stiffness and a single fault in it."""

from __future__ import annotations

import numpy as np

from support.broken_plugins.joints import LossySpring, SoundJoint
from support.broken_plugins.lists import also_breaks, breaks


def law(joint, frequency, theta, loss):
    """Return K (1 + loss) for a complex loss of (n_freq,) values."""
    return joint.matrices(theta).K[:, None] * (1.0 + np.asarray(loss))[None, :, None, None]


@breaks("the_law_has_a_limit_at_rest")
class InfiniteAtRest(LossySpring):
    """A loss that grows without limit as the frequency falls."""

    def dynamic_stiffness(self, frequency, theta):
        """Return K (1 + 1e-4 i (1 kHz / f))."""
        return law(self, frequency, theta, 1e-4j * self.config.reference / frequency)


@also_breaks("the_law_has_a_limit_at_rest")
class Logarithmic(LossySpring):
    """Stiffness that changes by the same amount in each decade."""

    def dynamic_stiffness(self, frequency, theta):
        """Return K (1 + 0.05 log10(f / 1 kHz)) with some loss."""
        return law(self, frequency, theta, 0.05 * np.log10(frequency / 1000.0) + 0.05j)


@also_breaks("the_law_has_a_limit_at_rest")
class UndefinedAtRest(LossySpring):
    """Nothing times infinity below a thousandth of a hertz."""

    def dynamic_stiffness(self, frequency, theta):
        """Return K (1 + 0.1 i tanh(f) coth(f) ...), which is undefined for small f."""
        small = frequency < 1e-3
        return law(self, frequency, theta, np.where(small, np.nan, 0.1j))


@also_breaks("dynamic_stiffness_is_symmetric_and_passive")
class ActiveAtHighFrequency(LossySpring):
    """A loss that was fitted up to 5 kHz."""

    def dynamic_stiffness(self, frequency, theta):
        """Return a parabola that is negative above 10 kHz."""
        ratio = frequency / 10000.0
        return law(self, frequency, theta, 0.1j * ratio * (1.0 - ratio))


@also_breaks("dynamic_stiffness_is_symmetric_and_passive")
class ActiveAtLowFrequency(LossySpring):
    """A loss that was fitted from 20 Hz on."""

    def dynamic_stiffness(self, frequency, theta):
        """Return a loss that is negative below 10 Hz."""
        return law(self, frequency, theta, 0.1j * (frequency - 10.0) / (frequency + 10.0))


@also_breaks("dynamic_stiffness_is_symmetric_and_passive")
class ActiveInOneCorner(LossySpring):
    """A loss of the wrong sign for soft springs that are stiff in tilt."""

    def dynamic_stiffness(self, frequency, theta):
        """Turn the sign."""
        Z = super().dynamic_stiffness(frequency, theta)
        corner = (theta[:, 0] < 1.1e5) & (theta[:, 1] > 9.5e3)
        Z[corner] = Z[corner].conj()
        return Z


@also_breaks("dynamic_stiffness_has_its_shape")
class Overflow(LossySpring):
    """An exponential that overflows above some kilohertz."""

    def dynamic_stiffness(self, frequency, theta):
        """Return exp(f / 25 Hz) in some place."""
        with np.errstate(over="ignore", invalid="ignore"):
            growth = np.exp(frequency / 25.0)
            return law(self, frequency, theta, 0.1j * growth / growth)


@also_breaks("dynamic_stiffness_has_its_shape")
class OneVector(LossySpring):
    """It forgets the axis of the vectors where there is one."""

    def dynamic_stiffness(self, frequency, theta):
        """Squeeze."""
        Z = super().dynamic_stiffness(frequency, theta)
        return Z[0] if len(theta) == 1 else Z


@also_breaks("dynamic_stiffness_treats_lines_and_vectors_alone")
class SortsLines(LossySpring):
    """It sorts the lines, and answers in its own order."""

    def dynamic_stiffness(self, frequency, theta):
        """Sort."""
        return super().dynamic_stiffness(np.sort(frequency), theta)


@also_breaks("dynamic_stiffness_treats_lines_and_vectors_alone")
class InterpolatesLines(LossySpring):
    """Many lines are interpolated between a few."""

    def dynamic_stiffness(self, frequency, theta):
        """Take every tenth of many."""
        if len(frequency) < 200:
            return super().dynamic_stiffness(frequency, theta)
        return super().dynamic_stiffness(frequency[np.arange(len(frequency)) // 10 * 10], theta)


@also_breaks("dynamic_stiffness_treats_lines_and_vectors_alone")
class MeanLossOfMany(LossySpring):
    """Many vectors share a stiffness in tilt."""

    def dynamic_stiffness(self, frequency, theta):
        """Take the mean."""
        if len(theta) > 100:
            theta = np.column_stack([theta[:, 0], np.full(len(theta), theta[:, 1].mean())])
        return super().dynamic_stiffness(frequency, theta)


@also_breaks("frequency_may_be_any_array")
class WholeHertz(LossySpring):
    """It computes in an array of the same type as the frequencies."""

    def dynamic_stiffness(self, frequency, theta):
        """Drop what is behind the point of whole numbers."""
        ratio = np.zeros_like(frequency)
        ratio[:] = frequency / 1000.0
        return law(self, frequency, theta, 0.1j * ratio)


@breaks("frequency_may_be_any_array")
class StrictFrequencies(LossySpring):
    """It changes the frequencies, and changes them back."""

    def dynamic_stiffness(self, frequency, theta):
        """Turn hertz into radians and back."""
        frequency *= 2.0
        Z = super().dynamic_stiffness(0.5 * frequency, theta)
        frequency /= 2.0
        return Z


@also_breaks("dynamic_stiffness_jacobian_meets_differences")
class WrongSensitivityAtHighFrequency(LossySpring):
    """A derivative without the loss above 5 kHz."""

    def dynamic_stiffness_jacobian(self, frequency, theta):
        """Leave it out."""
        high = (frequency > 5000.0)[None, :, None, None]
        return (np.where(high, part.real, part) for part in super().dynamic_stiffness_jacobian(frequency, theta))


@also_breaks("dynamic_stiffness_jacobian_meets_differences")
class WrongSensitivityInOneCorner(LossySpring):
    """A derivative that is off in one corner."""

    def dynamic_stiffness_jacobian(self, frequency, theta):
        """Scale there."""
        corner = ((theta[:, 0] < 1.2e5) & (theta[:, 1] > 8e3))[:, None, None, None]
        return (part * np.where(corner, 1.01, 1.0) for part in super().dynamic_stiffness_jacobian(frequency, theta))


@also_breaks("dynamic_stiffness_jacobian_meets_differences")
class SensitivityOfNoLaw(SoundJoint):
    """A wrong derivative of a dynamic stiffness that is the usual one."""

    def dynamic_stiffness_jacobian(self, frequency, theta):
        """Scale it."""
        return (1.01 * part for part in super().dynamic_stiffness_jacobian(frequency, theta))


@also_breaks("dynamic_stiffness_jacobian_meets_differences")
class InertiaOnTheFly(SoundJoint):
    """A dynamic stiffness without inertia, faster than that of the base class."""

    def dynamic_stiffness_jacobian(self, frequency, theta):
        """Leave - omega^2 dM/dp out, which shows where the frequency is high."""
        parts = []
        for each in self.matrices_jacobian(theta):
            omega = 2.0 * np.pi * frequency[:, None, None]
            parts.append(each.K[:, None] + 1j * (each.D[:, None] + omega * each.C[:, None]))
        return parts


@also_breaks("translation_costs_nothing")
class LawAgainstTheGround(LossySpring):
    """A spring against the ground that the matrices do not show."""

    def dynamic_stiffness(self, frequency, theta):
        """Hold side a."""
        Z = super().dynamic_stiffness(frequency, theta)
        Z[..., 0, 0] += 0.01 * theta[:, 0, None]
        return Z


@also_breaks("earlier_results_are_kept")
class BufferOfTheLaw(LossySpring):
    """It computes in an array that it keeps."""

    def dynamic_stiffness(self, frequency, theta):
        """Fill it."""
        Z = super().dynamic_stiffness(frequency, theta)
        kept = self.__dict__.setdefault("kept", {}).setdefault(Z.shape, np.empty_like(Z))
        kept[:] = Z
        return kept


@also_breaks("repeated_calls_agree")
class Normalised(LossySpring):
    """It is relative to the highest frequency it was ever asked for."""

    def dynamic_stiffness(self, frequency, theta):
        """Remember the highest."""
        self.highest = max(self.__dict__.get("highest", 1000.0), float(frequency.max()))
        return law(self, frequency, theta, 0.1j * frequency / self.highest)


@also_breaks("dynamic_stiffness_has_its_shape")
class RealWithoutLoss(LossySpring):
    """Real where nothing is lost."""

    def dynamic_stiffness(self, frequency, theta):
        """Return real numbers."""
        return super().dynamic_stiffness(frequency, theta).real


@also_breaks("small_steps_show")
class TableOfStiffnesses(LossySpring):
    """A law for each stiffness in steps of one per cent, not interpolated."""

    def dynamic_stiffness(self, frequency, theta):
        """Round the logarithms."""
        return super().dynamic_stiffness(frequency, np.exp(np.round(np.log(theta), 2)))
