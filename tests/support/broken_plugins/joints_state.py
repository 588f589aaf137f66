"""Joints whose answers depend on more than their arguments, or that have side effects."""

from __future__ import annotations

import itertools
import os
import random
import sys
import tempfile
import time
import warnings

import numpy as np
from pydantic import Field

from dovetail import StructuralMatrices
from support.broken_plugins.joints import SoundJoint
from support.broken_plugins.lists import also_breaks, breaks


def stiffer(joint, factor):
    """Scale the stiffness, in place."""
    joint.K[:] *= factor
    joint.D[:] *= factor
    return joint


@breaks("earlier_results_are_kept")
class ReusedBuffer(SoundJoint):
    """It computes in arrays that it keeps, one set for each size of a batch."""

    def matrices(self, theta):
        """Fill the kept arrays."""
        kept = self.__dict__.setdefault("kept", {})
        fresh = super().matrices(theta)
        buffer = kept.setdefault(len(theta), StructuralMatrices.zeros(len(theta), self.size))
        for part in "MKCD":
            getattr(buffer, part)[:] = getattr(fresh, part)
        return buffer


@also_breaks("earlier_results_are_kept")
class BufferOfTheClass(SoundJoint):
    """All instances compute in the same arrays."""

    kept = StructuralMatrices.zeros(5000, 4)

    def matrices(self, theta):
        """Return views of the arrays."""
        fresh = super().matrices(theta)
        for part in "MKCD":
            getattr(self.kept, part)[: len(theta)] = getattr(fresh, part)
        return StructuralMatrices(*(getattr(self.kept, part)[: len(theta)] for part in "MKCD"))


@also_breaks("earlier_results_are_kept")
class ReusedDerivatives(SoundJoint):
    """Its derivatives are in arrays that it keeps; they depend on the vector."""

    def matrices(self, theta):
        """Let the stiffness bend."""
        return stiffer(super().matrices(theta), 1.0 + theta[:, 1, None, None] / 1e4)

    def matrices_jacobian(self, theta):
        """Fill the kept arrays."""
        fresh = super().matrices_jacobian(theta)
        kept = self.__dict__.setdefault("kept", {}).setdefault(len(theta), fresh)
        for old, new in zip(kept, fresh, strict=True):
            for part in "MKCD":
                if getattr(old, part).flags.writeable:
                    getattr(old, part)[...] = getattr(new, part)
        return kept


@breaks("repeated_calls_agree")
class WarmStart(SoundJoint):
    """It begins an iteration with what it has from a large batch, and stops a little elsewhere."""

    large = False

    def matrices(self, theta):
        """Differ in the last digits once there was a large batch."""
        self.large = self.large or len(theta) > 700
        return stiffer(super().matrices(theta), 1.0 + 1e-12 * (self.large and len(theta) < 700))


@also_breaks("repeated_calls_agree")
class FrozenAfterTheFirst(SoundJoint):
    """It keeps one reference stiffness, that of the first vector it ever saw."""

    def matrices(self, theta):
        """Bend with the distance from the reference."""
        self.__dict__.setdefault("reference", {}).setdefault(theta.shape[1], float(theta[0, 0]))
        self.calls = self.__dict__.get("calls", 0) + 1
        if self.calls > 12:
            self.reference[theta.shape[1]] = float(theta[-1, 0])
        return stiffer(super().matrices(theta), 1.0 + 1e-12 * self.reference[theta.shape[1]])


@also_breaks("small_steps_show")
class CacheOfRoundedValues(SoundJoint):
    """It takes vectors that agree in five digits for the same."""

    def matrices(self, theta):
        """Look up each vector."""
        kept = self.__dict__.setdefault("kept", {})
        rows = np.array([kept.setdefault(tuple(f"{value:.5g}" for value in row), row) for row in theta])
        return super().matrices(rows.reshape(theta.shape))


@also_breaks("repeated_calls_agree")
class ByTheClock(SoundJoint):
    """It ages."""

    def matrices(self, theta):
        """Soften with time."""
        return stiffer(super().matrices(theta), 1.0 - 1e-3 * (time.perf_counter() % 1.0))


@also_breaks("declarations_do_not_change", "a_component_keeps_its_config")
class SortsItsOptions(SoundJoint):
    """It sorts a list of options in place when it is asked."""

    class Config(SoundJoint.Config):
        """A list.

        Attributes
        ----------
        thickness : float
            Of the layer [m].
        weights : list of float
            Of the layers.
        """

        weights: list[float] = Field(default_factory=lambda: [3.0, 1.0, 2.0])

    def matrices(self, theta):
        """Sort, and use none of it."""
        self.config.weights.sort()
        return super().matrices(theta)


@breaks("other_instances_change_nothing")
class TheLastOptionsCount(SoundJoint):
    """Options are kept in the class, at the first question after construction by the last that was made."""

    thickness = 1.0

    def __init__(self, config=None):
        super().__init__(config)
        type(self).thickness = self.config.thickness

    def matrices(self, theta):
        """Scale with what the class holds."""
        joint = super().matrices(theta)
        joint.M[:, 3, 3] = theta[:, 3] * type(self).thickness ** 2
        return joint


@also_breaks("a_fresh_process_gives_the_same_results")
class CacheOfTheClass(SoundJoint):
    """Instances with other options share answers."""

    kept: dict = {}  # noqa: RUF012

    def matrices(self, theta):
        """Look the vectors up, whatever the options are."""
        if theta.tobytes() not in self.kept:
            self.kept[theta.tobytes()] = super().matrices(theta)
        kept = self.kept[theta.tobytes()]
        return StructuralMatrices(*(getattr(kept, part).copy() for part in "MKCD"))


@also_breaks("other_instances_change_nothing")
class Numbered(SoundJoint):
    """Each new instance is a little stiffer."""

    made = itertools.count()

    def __init__(self, config=None):
        super().__init__(config)
        self.number = next(self.made)

    def matrices(self, theta):
        """Count instances."""
        return stiffer(super().matrices(theta), 1.0 + 1e-3 * self.number)


@breaks("a_fresh_process_gives_the_same_results")
class Hashed(SoundJoint):
    """It keeps its springs under the hash of their names."""

    def matrices(self, theta):
        """Scale with a hash, which Python salts anew in each process."""
        return stiffer(super().matrices(theta), 1.0 + 1e-3 * (hash("spring") % 1000))


@also_breaks("a_fresh_process_gives_the_same_results")
class OrderOfASet(SoundJoint):
    """It goes through a set of names."""

    def matrices(self, theta):
        """Let the order count."""
        order = "".join(set("abcdefgh"))
        return stiffer(super().matrices(theta), 1.0 + 1e-6 * (int.from_bytes(order.encode(), "big") % 9973))


@also_breaks("a_fresh_process_gives_the_same_results")
class ByTheProcess(SoundJoint):
    """It depends on the number of the process."""

    def matrices(self, theta):
        """Scale."""
        return stiffer(super().matrices(theta), 1.0 + 1e-9 * os.getpid())


@also_breaks("a_fresh_process_gives_the_same_results")
class ByTheFolder(SoundJoint):
    """It depends on where it is started."""

    def matrices(self, theta):
        """Scale with the name of the folder."""
        return stiffer(super().matrices(theta), 1.0 + 1e-3 * (sum(os.getcwd().encode()) % 997))


@breaks("global_state_is_left_unchanged")
class SeedsNumpy(SoundJoint):
    """It draws from the global generator, which it seeds first."""

    def matrices(self, theta):
        """Always draw the same."""
        np.random.seed(0)  # noqa: NPY002
        return stiffer(super().matrices(theta), 1.0 + 0.01 * np.random.random())  # noqa: NPY002


@also_breaks("global_state_is_left_unchanged")
class SeedsPython(SoundJoint):
    """The same with the module random."""

    def matrices(self, theta):
        """Always draw the same."""
        random.seed(0)
        return stiffer(super().matrices(theta), 1.0 + 0.01 * random.random())


@also_breaks("global_state_is_left_unchanged")
class SeedsTorch(SoundJoint):
    """The same with torch."""

    def matrices(self, theta):
        """Always draw the same."""
        import torch

        torch.manual_seed(0)
        return stiffer(super().matrices(theta), 1.0 + 0.01 * float(torch.rand(1)))


@also_breaks("global_state_is_left_unchanged")
class DoublePrecisionForAll(SoundJoint):
    """It sets torch's default dtype."""

    def matrices(self, theta):
        """Set it."""
        import torch

        torch.set_default_dtype(torch.float64)
        return super().matrices(theta)


@also_breaks("global_state_is_left_unchanged")
class ThreadsForAll(SoundJoint):
    """It sets torch's threads."""

    def matrices(self, theta):
        """Set them."""
        import torch

        torch.set_num_threads(torch.get_num_threads() + 1)
        return super().matrices(theta)


@also_breaks("global_state_is_left_unchanged")
class SilencesNumpy(SoundJoint):
    """It turns NumPy's warnings off for good when it is made."""

    def __init__(self, config=None):
        super().__init__(config)
        np.seterr(all="ignore")


@also_breaks("global_state_is_left_unchanged")
class SilencesWarnings(SoundJoint):
    """It turns all warnings off."""

    def matrices(self, theta):
        """Filter them."""
        warnings.simplefilter("ignore")
        return super().matrices(theta)


@also_breaks("global_state_is_left_unchanged")
class PrintsShort(SoundJoint):
    """It changes how arrays are printed."""

    def range_objections(self, lower, upper):
        """Print for debugging."""
        np.set_printoptions(precision=3, suppress=True)
        return super().range_objections(lower, upper)


@also_breaks("global_state_is_left_unchanged")
class OneThread(SoundJoint):
    """It sets an environment variable."""

    def matrices(self, theta):
        """Set it."""
        os.environ["OMP_NUM_THREADS"] = "97"
        return super().matrices(theta)


@also_breaks("global_state_is_left_unchanged")
class ChangesTheFolder(SoundJoint):
    """It works somewhere else."""

    def matrices(self, theta):
        """Go there."""
        os.chdir(tempfile.gettempdir())
        return super().matrices(theta)


@also_breaks("global_state_is_left_unchanged")
class DeepRecursion(SoundJoint):
    """It allows itself deep recursion."""

    def matrices_jacobian(self, theta):
        """Raise the limit."""
        sys.setrecursionlimit(54321)
        return super().matrices_jacobian(theta)


@also_breaks("other_instances_change_nothing", "a_fresh_process_gives_the_same_results")
class RandomWhenMade(SoundJoint):
    """Its asperities are drawn when it is made, without a seed."""

    def __init__(self, config=None):
        super().__init__(config)
        self.factor = 1.0 + 0.01 * np.random.default_rng().random()

    def matrices(self, theta):
        """Scale with what was drawn."""
        return stiffer(super().matrices(theta), self.factor)


@also_breaks("repeated_calls_agree", "results_are_new_arrays")
class Noisy(SoundJoint):
    """Torch's random numbers, without a seed."""

    def matrices(self, theta):
        """Draw."""
        import torch

        return stiffer(super().matrices(theta), 1.0 + 1e-6 * float(torch.rand(1)))


@breaks("theta_may_be_any_array")
class MemoryOrder(SoundJoint):
    """It reads theta in the order in which it lies in memory."""

    def matrices(self, theta):
        """Reshape."""
        return super().matrices(theta.ravel(order="K").reshape(theta.shape))


@also_breaks("theta_may_be_any_array")
class Bytes(SoundJoint):
    """It hands the bytes of theta to code in another language."""

    def matrices(self, theta):
        """Take eight bytes for each number."""
        return super().matrices(np.frombuffer(theta.tobytes(), dtype=np.float64).reshape(theta.shape))


@also_breaks("theta_may_be_any_array")
class LikeTheta(SoundJoint):
    """It computes with whole numbers if it is given some."""

    parameters = SoundJoint.parameters[:3]

    def matrices(self, theta):
        """Keep the type of theta."""
        scaled = np.zeros_like(theta)
        scaled[:] = 0.37 * theta
        return super().matrices(np.column_stack([scaled / 0.37, np.full(len(theta), 0.15)]))


@also_breaks("theta_may_be_any_array")
class Borrows(SoundJoint):
    """It computes in theta, and puts back what was there."""

    def matrices(self, theta):
        """Scale forth and back."""
        theta *= 2.0
        joint = super().matrices(0.5 * theta)
        theta /= 2.0
        return joint


@also_breaks("each_vector_of_a_batch_is_treated_alone")
class Blocks(SoundJoint):
    """A block of 256 vectors at a time, and the rest is like the last."""

    def matrices(self, theta):
        """Repeat the last of the block."""
        rows = np.minimum(np.arange(len(theta)), 255)
        return super().matrices(theta[rows])


@also_breaks("each_vector_of_a_batch_is_treated_alone")
class TurnsSquares(SoundJoint):
    """It takes a square theta for its transpose, if that is in the ranges too."""

    def matrices(self, theta):
        """Guess: as many vectors as parameters."""
        joint = super().matrices(theta)
        return stiffer(joint, 1.01) if theta.shape[0] == theta.shape[1] else joint


@also_breaks("each_vector_of_a_batch_is_treated_alone")
class OneOrMany(SoundJoint):
    """A vector alone is a special case."""

    def matrices(self, theta):
        """Forget the damping of the special case."""
        joint = super().matrices(theta)
        if len(theta) == 1:
            joint.D[:] = 0.0
        return joint


@also_breaks("each_vector_of_a_batch_is_treated_alone")
class Neighbours(SoundJoint):
    """In pairs it mixes one vector with the other."""

    def matrices(self, theta):
        """Take the mean of two."""
        joint = super().matrices(theta)
        if len(theta) == 2:
            joint.M[:] = joint.M.mean(axis=0)
        return joint


@breaks("declarations_do_not_change")
class Shuffled(SoundJoint):
    """Its contacts are in another order after a large batch."""

    largest = 0

    def matrices(self, theta):
        """Remember the largest batch."""
        self.largest = max(self.largest, len(theta))
        return super().matrices(theta)

    @property
    def contact_dofs(self):
        """Start with the other one then."""
        pairs = [(0, 2), (1, 3)]
        return tuple(pairs[:: -1 if self.largest > 400 else 1])


@also_breaks("declarations_do_not_change")
class GrowingRange(SoundJoint):
    """Its range grows when it is asked."""

    upper = 0.2

    @property
    def parameters(self):
        """Take in what was asked."""
        return (
            *SoundJoint.parameters[:3],
            type(SoundJoint.parameters[3])("m", "kg", 0.1, self.upper, "linear", "mass"),
        )

    def matrices(self, theta):
        """Learn."""
        joint = super().matrices(theta)
        self.upper = self.upper + 1e-3
        return joint
