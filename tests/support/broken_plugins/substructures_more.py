"""Substructures with a fault at other lines, in other processes, or in what they declare."""

from __future__ import annotations

import itertools
import os
import random
import warnings
from typing import Annotated

import numpy as np
from pydantic import Field

from dovetail import ComponentConfig, InUnit, PartNode, StructuralMatrices
from support.broken_plugins.lists import also_breaks, breaks
from support.broken_plugins.substructures import SoundSubstructure, Unmeshed, euler_beam


class Bar(Unmeshed):
    """A beam whose options have units, sound."""

    class Config(ComponentConfig):
        """Dimensions and properties.

        Attributes
        ----------
        length : float
            Of the beam [m].
        mass : float
            Of the beam [kg].
        bending : float
            Bending stiffness EI [N m^2].
        """

        length: Annotated[float, Field(gt=0), InUnit("m")] = 0.4
        mass: Annotated[float, Field(gt=0), InUnit("kg")] = 2.0
        bending: Annotated[float, Field(gt=0), InUnit("N m^2")] = 200.0

    @property
    def nodes(self):
        """Ends of three elements."""
        positions = np.linspace(0.0, self.config.length, 4)
        return tuple(PartNode(f"n{index}", float(position)) for index, position in enumerate(positions))

    def matrices(self):
        """Return the matrices."""
        return euler_beam(3, self.config.length, self.config.mass, self.config.bending)


@also_breaks("receptance_meets_the_matrices")
class Truncated(Unmeshed):
    """Modes above some kilohertz are left out of its receptance."""

    def receptance(self, frequency, dofs):
        """Be wrong where they matter."""
        return super().receptance(frequency, dofs) * (1.0 + (frequency / 1e5) ** 4)[:, None, None]


@also_breaks("receptance_meets_the_matrices")
class WrongBelowTwentyHertz(Unmeshed):
    """A measuring chain with a high-pass."""

    def receptance(self, frequency, dofs):
        """Be wrong at low frequency."""
        return super().receptance(frequency, dofs) * (1.0 + 0.01 * (frequency < 15.0))[:, None, None]


@also_breaks("each_line_is_treated_alone")
class NeedsTwoLines(Unmeshed):
    """It takes the step between lines."""

    def receptance(self, frequency, dofs):
        """Use the step."""
        assert np.gradient(frequency).size
        return super().receptance(frequency, dofs)


@also_breaks("each_line_is_treated_alone")
class SortsLines(Unmeshed):
    """It sorts the lines, and answers in its own order."""

    def receptance(self, frequency, dofs):
        """Sort."""
        return super().receptance(np.sort(frequency), dofs)


@also_breaks("each_line_is_treated_alone")
class EachLineOnce(Unmeshed):
    """A line that is asked for twice is answered once."""

    def receptance(self, frequency, dofs):
        """Fill the rest with zeros."""
        H = super().receptance(frequency, dofs)
        _, first = np.unique(frequency, return_index=True)
        answer = np.zeros_like(H)
        answer[np.sort(first)] = H[np.sort(first)]
        return answer


@also_breaks("dofs_can_be_asked_for_in_any_order")
class EachDofOnce(Unmeshed):
    """A DOF that is asked for twice is answered once."""

    def receptance(self, frequency, dofs):
        """Go through the different ones."""
        return super().receptance(frequency, list(dict.fromkeys(dofs)))


@also_breaks("dofs_can_be_asked_for_in_any_order")
class OneDof(Unmeshed):
    """For a single DOF it drops the axes."""

    def receptance(self, frequency, dofs):
        """Squeeze."""
        H = super().receptance(frequency, dofs)
        return H[:, 0, 0] if len(dofs) == 1 else H


@breaks("dofs_and_frequencies_may_be_any_sequence")
class ListOfDofs(Unmeshed):
    """It wants a list."""

    def receptance(self, frequency, dofs):
        """Append to the list."""
        return super().receptance(frequency, dofs + [0])[:, :-1, :-1]  # noqa: RUF005


@also_breaks("dofs_and_frequencies_may_be_any_sequence")
class WholeHertz(Unmeshed):
    """It computes in an array of the same type as the frequencies."""

    def receptance(self, frequency, dofs):
        """Drop what is behind the point."""
        lines = np.zeros_like(frequency)
        lines[:] = 0.99 * frequency
        return super().receptance(lines / 0.99, dofs)


@breaks("earlier_results_are_kept")
class ReusedBuffer(Unmeshed):
    """It computes in an array that it keeps."""

    def receptance(self, frequency, dofs):
        """Fill it."""
        H = super().receptance(frequency, dofs)
        kept = self.__dict__.setdefault("kept", {}).setdefault(H.shape, np.empty_like(H))
        kept[:] = H
        return kept


@breaks("repeated_calls_agree")
class Adaptive(Unmeshed):
    """It keeps the modes up to the highest line it was ever asked for."""

    def receptance(self, frequency, dofs):
        """Remember the highest, and be off by what is above."""
        self.highest = max(self.__dict__.get("highest", 1e4), float(np.max(frequency)))
        return super().receptance(frequency, dofs) * (1.0 + 1e-9 * self.highest / 1e4)


@also_breaks("repeated_calls_agree")
class StiffenedByReceptance(Unmeshed):
    """Its matrices change once a receptance was asked for."""

    def matrices(self):
        """Scale."""
        whole, factor = super().matrices(), 1.0 + 1e-9 * len(self.__dict__.get("asked", ()))
        return StructuralMatrices(whole.M, factor * whole.K, D=factor * whole.D)

    def receptance(self, frequency, dofs):
        """Remember."""
        H = super().receptance(frequency, dofs)
        self.__dict__.setdefault("asked", []).append(len(dofs))
        return H


@also_breaks("declarations_do_not_change", "a_component_keeps_its_config")
class PopsItsOptions(Unmeshed):
    """It takes its options to pieces while it answers."""

    class Config(SoundSubstructure.Config):
        """A list.

        Attributes
        ----------
        elements : int
            Of equal length.
        layers : list of float
            Names of layers.
        """

        layers: list[float] = Field(default_factory=lambda: [3.0, 1.0] + 50 * [2.0])

    def receptance(self, frequency, dofs):
        """Pop one."""
        self.config.layers.pop()
        return super().receptance(frequency, dofs)


@breaks("other_instances_change_nothing")
class TheLastOptionsCount(Bar):
    """Options are kept in the class."""

    shared = None

    def __init__(self, config=None):
        super().__init__(config)
        type(self).shared = self.config

    def matrices(self):
        """Use those of the last that was made."""
        return euler_beam(3, self.config.length, self.shared.mass, self.config.bending)


@also_breaks("a_fresh_process_gives_the_same_results")
class CacheOfTheClass(Bar):
    """The first matrices serve all instances."""

    kept: dict = {}  # noqa: RUF012

    def matrices(self):
        """Look them up, whatever the options are."""
        first = self.kept.setdefault("first", super().matrices())
        return StructuralMatrices(*(getattr(first, part).copy() for part in "MKCD"))


@breaks("a_fresh_process_gives_the_same_results")
class Hashed(Unmeshed):
    """Its mass depends on a hash."""

    def matrices(self):
        """Scale with a hash, which Python salts anew in each process."""
        whole = super().matrices()
        return StructuralMatrices(whole.M * (1.0 + 1e-4 * (hash("mass") % 1000)), whole.K, D=whole.D)


@also_breaks("a_fresh_process_gives_the_same_results")
class LabelsFromASet(Unmeshed):
    """Its labels come out of a set."""

    @property
    def nodes(self):
        """Name nodes in the order of a set, which is so large that no two processes agree by chance."""
        labels = {f"n{number}" for number in range(100)}
        return tuple(PartNode(label, node.position) for label, node in zip(labels, super().nodes, strict=False))


@breaks("global_state_is_left_unchanged")
class SeedsNumpy(Unmeshed):
    """It draws its masses from the global generator, which it seeds first."""

    def matrices(self):
        """Always draw the same."""
        np.random.seed(0)  # noqa: NPY002
        whole = super().matrices()
        return StructuralMatrices(whole.M * (1.0 + 0.01 * np.random.random()), whole.K, D=whole.D)  # noqa: NPY002


@also_breaks("global_state_is_left_unchanged")
class SilencesAll(Unmeshed):
    """It turns warnings off, NumPy's too."""

    def receptance(self, frequency, dofs):
        """Set and filter."""
        np.seterr(all="ignore")
        warnings.filterwarnings("ignore")
        return super().receptance(frequency, dofs)


@also_breaks("global_state_is_left_unchanged")
class SetsThreads(Unmeshed):
    """It sets an environment variable when it is made."""

    def __init__(self, config=None):
        super().__init__(config)
        os.environ["OPENBLAS_NUM_THREADS"] = "97"


@also_breaks("global_state_is_left_unchanged")
class DrawsFromPython(Unmeshed):
    """It draws numbers of the module random, and uses none."""

    @property
    def nodes(self):
        """Draw."""
        random.random()
        return super().nodes


@also_breaks("declarations_do_not_change", "a_fresh_process_gives_the_same_results")
class CountsNodes(Unmeshed):
    """Labels go on counting."""

    counter = itertools.count()

    @property
    def nodes(self):
        """Number them anew each time."""
        return tuple(PartNode(f"n{next(self.counter) % 100000}", node.position) for node in super().nodes)


@breaks("declarations_do_not_change")
class HeldLater(Unmeshed):
    """It says that it cannot be condensed after it was asked."""

    asked = 0

    def receptance(self, frequency, dofs):
        """Remember."""
        self.asked = 1
        return super().receptance(frequency, dofs)

    @property
    def condensation_tolerance(self):
        """Depend on what was asked."""
        return 1e-6 * self.asked


@breaks("every_node_and_dof_is_used")
class NodeInTheAir(Unmeshed):
    """A node that nothing is attached to."""

    @property
    def nodes(self):
        """Add one."""
        return (*super().nodes, PartNode("air", 0.5))

    def matrices(self):
        """Leave it empty."""
        whole, larger = super().matrices(), StructuralMatrices.zeros(10)
        for part in "MKCD":
            getattr(larger, part)[:8, :8] = getattr(whole, part)
        return larger


@also_breaks("every_node_and_dof_is_used")
class EmptyInnerDof(Unmeshed):
    """An inner DOF with neither mass nor stiffness."""

    def matrices(self):
        """Leave it empty."""
        whole, larger = super().matrices(), StructuralMatrices.zeros(9)
        for part in "MKCD":
            getattr(larger, part)[:8, :8] = getattr(whole, part)
        return larger


@also_breaks("receptance_has_its_shape")
class DriftingInnerDofs(Unmeshed):
    """Two inner DOFs with a spring between them, tied to nothing and without mass."""

    def matrices(self):
        """Tie them to each other."""
        whole, larger = super().matrices(), StructuralMatrices.zeros(10)
        for part in "MKCD":
            getattr(larger, part)[:8, :8] = getattr(whole, part)
        larger.add_contact_layer([(8, 9)], 1e6)
        return larger


class TipMass(SoundSubstructure):
    """A sound beam with a mass at one end."""

    tip = 0.5

    class Config(ComponentConfig):
        """The mesh.

        Attributes
        ----------
        elements : int
            Of equal length.
        """

        elements: Annotated[int, Field(ge=1)] = 10

    def matrices(self):
        """Add the mass."""
        whole = super().matrices()
        whole.M[0, 0] += self.tip
        return whole


@breaks("refinement_keeps_the_mass")
class DropsTheTip(TipMass):
    """A finer mesh has no mass at its end."""

    def refined(self, factor):
        """Forget it."""
        finer = super().refined(factor)
        finer.tip = 0.0
        return finer


@also_breaks("refinement_keeps_the_mass")
class LosesAPerCent(SoundSubstructure):
    """Each refinement loses one per cent of the mass."""

    kept = 1.0

    def matrices(self):
        """Scale the mass."""
        whole = super().matrices()
        return StructuralMatrices(self.kept * whole.M, whole.K, D=whole.D)

    def refined(self, factor):
        """Lose some."""
        finer = super().refined(factor)
        finer.kept = 0.99 * self.kept
        return finer


@also_breaks("refinement_keeps_the_mass")
class ShorterWhenRefined(SoundSubstructure):
    """A finer mesh ends before the end."""

    short = 1.0

    @property
    def nodes(self):
        """Leave a bit out."""
        return tuple(PartNode(node.label, self.short * node.position) for node in super().nodes)

    def refined(self, factor):
        """Leave it out once."""
        finer = super().refined(factor)
        finer.short = 0.98
        return finer


@breaks("outline_is_sections_in_order")
class OutlineInAnyOrder(Unmeshed):
    """Its sections are not in the order in which they follow each other."""

    outline = ((0.1, 0.2, 0.02, 0.0), (0.0, 0.1, 0.03, 0.0))


@also_breaks("outline_is_sections_in_order")
class OutlineWithoutBore(Unmeshed):
    """Three numbers a section, though more than one of them."""

    outline = ((0.0, 0.1, 0.02), (0.1, 0.2, 0.03))


@breaks("absent_dofs_and_tolerance_are_in_range")
class AbsentElsewhere(Unmeshed):
    """It names a DOF that there is not."""

    absent_dofs = frozenset({99})


@also_breaks("absent_dofs_and_tolerance_are_in_range")
class AbsentList(Unmeshed):
    """A list in place of a set, of a DOF that has matrices."""

    absent_dofs = [1]  # noqa: RUF012


@also_breaks("absent_dofs_and_tolerance_are_in_range")
class TolerantInPerCent(Unmeshed):
    """A tolerance in per cent."""

    condensation_tolerance = 5


@also_breaks("absent_dofs_and_tolerance_are_in_range")
class NegativeTolerance(Unmeshed):
    """A tolerance below zero."""

    condensation_tolerance = -1e-9


@breaks("constraints_are_of_a_part_with_frfs")
class ConstraintsOfABeam(Unmeshed):
    """A beam whose nodes move by fewer motions than its matrices have."""

    @property
    def constraints(self):
        """Hold the difference of its first and its last DOF."""
        row = np.zeros((1, self.node_dofs.size))
        row[0, [0, -1]] = 1.0, -1.0
        return row


@also_breaks("constraints_are_of_a_part_with_frfs")
class ConstraintsOfNodes(Unmeshed):
    """A column for each node in place of one for each DOF."""

    @property
    def constraints(self):
        """Return no rows."""
        return np.zeros((0, len(self.nodes)))


@also_breaks("constraints_are_of_a_part_with_frfs")
class EndlessConstraints(Unmeshed):
    """An infinite number."""

    @property
    def constraints(self):
        """Return one row."""
        return np.full((1, self.node_dofs.size), np.inf)


@breaks("units_agree_with_the_matrices")
class DensityAsMass(Bar):
    """Its mass is per length, the option in kg."""

    def matrices(self):
        """Multiply with the length."""
        return euler_beam(3, self.config.length, 1.0 * self.config.mass * self.config.length, self.config.bending)


@also_breaks("units_agree_with_the_matrices")
class HiddenModulus(Bar):
    """Its bending stiffness is written into the code."""

    def matrices(self):
        """Use 210 GPa times a second moment of area."""
        return euler_beam(3, self.config.length, self.config.mass, 210e9 * 1e-9)


@also_breaks("overrides_are_spelt_as_in_the_contract")
class LabelsOfDofs(Unmeshed):
    """A plural too many."""

    def dofs_label(self, dof):
        """Return nothing of use."""
        return ""


@also_breaks("overrides_are_spelt_as_in_the_contract")
class IsHeld(Unmeshed):
    """Nearly the word of the contract."""

    absent_dof = frozenset({1})


@also_breaks("matrices_have_the_shape_of_the_nodes")
class ComplexStiffness(Unmeshed):
    """A loss written into the stiffness, of which the imaginary part is dropped."""

    def matrices(self):
        """Return complex numbers."""
        whole = super().matrices()
        return StructuralMatrices(whole.M, (1.0 + 0.01j) * whole.K)


@also_breaks("rigid_body_modes")
class PositionsInMillimetres(Unmeshed):
    """Its nodes are in millimetres."""

    @property
    def nodes(self):
        """Multiply."""
        return tuple(PartNode(node.label, 1000.0 * node.position) for node in super().nodes)


@also_breaks("receptance_has_its_shape")
class UndefinedAtHighFrequency(Unmeshed):
    """Undefined above 10 kHz."""

    def receptance(self, frequency, dofs):
        """Leave it open."""
        H = super().receptance(frequency, dofs)
        H[frequency > 1e4] = np.nan
        return H


@also_breaks("options_are_described_with_their_units")
class GramOption(Bar):
    """An option in grams."""

    class Config(Bar.Config):
        """Dimensions and properties.

        Attributes
        ----------
        length : float
            Of the beam [m].
        mass : float
            Of the beam [g].
        bending : float
            Bending stiffness EI [N m^2].
        """

        mass: Annotated[float, Field(gt=0), InUnit("g")] = 2000.0

    def matrices(self):
        """Convert."""
        return euler_beam(3, self.config.length, 1e-3 * self.config.mass, self.config.bending)


@breaks("batched_matrices_are_those_of_each_value")
class BatchOfTheMiddle(Bar):
    """Whatever the values of an option, its batch has the matrices of the part itself."""

    def batched_matrices(self, options):
        """Repeat."""
        [values] = options.values()
        matrices = self.matrices()
        return StructuralMatrices(*(np.repeat(getattr(matrices, name)[np.newaxis], len(values), 0) for name in "MKCD"))


@breaks("declared_matrices_are_those_of_each_value")
class LinearInLength(Bar):
    """It declares its length as a linear option."""

    linear_options = ("length",)

    def matrices(self):
        """Return those of the bar."""
        return super().matrices()


class LossyBar(Bar):
    """Sound, with a loss factor, which has no unit."""

    class Config(Bar.Config):
        """Dimensions and properties.

        Attributes
        ----------
        loss_factor : float
            Of the bending stiffness.
        """

        loss_factor: Annotated[float, Field(ge=0)] = 0.01

    def matrices(self):
        """Add the loss."""
        matrices = super().matrices()
        matrices.D[:] = self.config.loss_factor * matrices.K
        return matrices

    def made_with(self, options):
        """Return the matrices of a part for each of the values."""
        rows = (dict(zip(options, values, strict=True)) for values in zip(*options.values(), strict=True))
        parts = [type(self)(self.config.with_options(row)).matrices() for row in rows]
        return StructuralMatrices(*(np.stack([getattr(part, name) for part in parts]) for name in "MKCD"))


@also_breaks("batched_matrices_are_those_of_each_value")
class BatchWithoutLoss(LossyBar):
    """Its batch forgets the loss factor."""

    def batched_matrices(self, options):
        """Leave it out."""
        return self.made_with({**options, "loss_factor": np.full(len(next(iter(options.values()))), 0.01)})


@also_breaks("batched_matrices_are_those_of_each_value")
class BatchOfOneOption(LossyBar):
    """Of several options its batch heeds the first alone."""

    def batched_matrices(self, options):
        """Take one."""
        return self.made_with(dict([next(iter(options.items()))]))
