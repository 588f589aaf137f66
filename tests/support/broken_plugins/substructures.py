"""A sound substructure, and one with a single fault for each check of the kit that substructures alone have."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from pydantic import Field

from dovetail import ComponentConfig, PartNode, StructuralMatrices, SubstructureModel
from support.broken_plugins.lists import breaks

_LENGTH, _MASS, _BENDING = 0.4, 2.0, 200.0


def euler_beam(
    elements: int, length: float = _LENGTH, mass: float = _MASS, bending: float = _BENDING
) -> StructuralMatrices:
    """A free Euler-Bernoulli beam with lumped masses."""
    size = 2 * (elements + 1)
    M, K = np.zeros((size, size)), np.zeros((size, size))
    h = length / elements
    element = np.array([[12, 6 * h, -12, 6 * h], [6 * h, 4 * h**2, -6 * h, 2 * h**2]])
    element = bending / h**3 * np.vstack([element, [-12, -6 * h, 12, -6 * h], [6 * h, 2 * h**2, -6 * h, 4 * h**2]])
    for index in range(elements):
        here = slice(2 * index, 2 * index + 4)
        K[here, here] += element
        M[here, here] += mass / elements * np.diag([0.5, h**2 / 24, 0.5, h**2 / 24])
    return StructuralMatrices(M, K, D=0.02 * K)


class SoundSubstructure(SubstructureModel):
    """A free beam."""

    name = "sound_substructure"
    summary = "A free beam"

    class Config(ComponentConfig):
        """The mesh.

        Attributes
        ----------
        elements : int
            Of equal length.
        """

        elements: Annotated[int, Field(ge=1)] = 3

    @property
    def nodes(self):
        """Ends of the elements."""
        positions = np.linspace(0.0, _LENGTH, self.config.elements + 1)
        return tuple(PartNode(f"n{index}", float(position)) for index, position in enumerate(positions))

    def matrices(self):
        """Return the matrices."""
        return euler_beam(self.config.elements)

    def refined(self, factor):
        """Return more elements."""
        return type(self)(self.config.model_copy(update={"elements": factor * self.config.elements}))


class Unmeshed(SoundSubstructure):
    """Without a mesh to refine, so that a fault is seen once."""

    def refined(self, factor):
        """Return None."""
        return


@breaks("nodes_are_distinct")
class SameLabel(Unmeshed):
    """All nodes have one label."""

    @property
    def nodes(self):
        """Nodes called n."""
        return tuple(PartNode("n", node.position) for node in super().nodes)


@breaks("matrices_have_the_shape_of_the_nodes")
class OneDofANode(Unmeshed):
    """Displacements only."""

    def matrices(self):
        """Return every other DOF."""
        whole = super().matrices()
        return StructuralMatrices(whole.M[::2, ::2], whole.K[::2, ::2])


@breaks("receptance_has_its_shape")
class AmplitudesOnly(Unmeshed):
    """A receptance without phase."""

    def receptance(self, frequency, dofs):
        """Return amplitudes."""
        return np.abs(super().receptance(frequency, dofs))


@breaks("mass_is_symmetric_and_positive")
class NegativeInertia(Unmeshed):
    """A wrong sign in a rotary inertia."""

    def matrices(self):
        """Turn a sign."""
        whole = super().matrices()
        whole.M[1, 1] *= -1.0
        return whole


@breaks("stiffness_is_symmetric_and_positive")
class NegativeStiffness(Unmeshed):
    """A wrong sign between two nodes, in a way that rigid-body motions do not show."""

    def matrices(self):
        """Take three times a part of the energy away."""
        whole = super().matrices()
        bend = np.zeros(8)
        bend[[1, 3, 5]] = 1.0, -2.0, 1.0
        whole.K[:] -= 3.0 * _BENDING / _LENGTH * 10 * np.outer(bend, bend)
        return whole


@breaks("damping_is_symmetric_and_positive")
class OneSidedDamping(Unmeshed):
    """A gyroscopic term among the dampers."""

    def matrices(self):
        """Add a skew part that is too small to show in a receptance."""
        whole = super().matrices()
        whole.C[0, 2], whole.C[2, 0] = 1e-6, -1e-6
        return whole


@breaks("rigid_body_modes")
class HeldInSecret(Unmeshed):
    """A spring against the ground."""

    def matrices(self):
        """Hold the first node."""
        whole = super().matrices()
        whole.K[0, 0] += 1000.0
        return whole


@breaks("receptance_is_reciprocal")
class Known(Unmeshed):
    """Known by FRFs that depend on where one strikes."""

    def matrices(self):
        """Return None."""
        return

    def receptance(self, frequency, dofs):
        """Add one per cent to the upper triangle."""
        H = np.stack([_beam().receptance(frequency, range(8))])[0]
        H = H * (1.0 + 0.01 * np.triu(np.ones((8, 8)), 1) - 0.01 * np.tril(np.ones((8, 8)), -1))
        return H[:, np.asarray(dofs)[:, None], np.asarray(dofs)]


@breaks("receptance_is_passive")
class Active(Known):
    """Known by FRFs in the other convention of time."""

    def receptance(self, frequency, dofs):
        """Return the complex conjugate."""
        return _beam().receptance(frequency, dofs).conj()


@breaks("receptance_meets_the_matrices")
class Softer(Unmeshed):
    """Its receptance is another part's."""

    def receptance(self, frequency, dofs):
        """Return two per cent more."""
        return 1.02 * super().receptance(frequency, dofs)


@breaks("dofs_can_be_asked_for_in_any_order")
class Sorted(Known):
    """It gives DOFs in its own order."""

    def receptance(self, frequency, dofs):
        """Sort them."""
        return _beam().receptance(frequency, sorted(dofs))


@breaks("each_line_is_treated_alone")
class Smoothed(Known):
    """It smooths over neighbouring lines."""

    def receptance(self, frequency, dofs):
        """Mix each line with the last one."""
        H = _beam().receptance(frequency, dofs)
        return 0.9 * H + 0.1 * H[-1:]


@breaks("refinement_converges")
class MeshDependent(SoundSubstructure):
    """Its stiffness depends on the number of elements."""

    def matrices(self):
        """Grow stiffer with every element."""
        whole = super().matrices()
        stiffer = 1.0 + 0.1 * self.config.elements
        return StructuralMatrices(whole.M, stiffer * whole.K, D=stiffer * whole.D)


@breaks("dofs_have_labels")
class Nameless(Unmeshed):
    """All DOFs have one name."""

    def dof_label(self, dof):
        """Return one name."""
        return "x"


@breaks("inputs_are_left_unchanged")
class Overwriting(Unmeshed):
    """It turns frequencies into radians in place."""

    def receptance(self, frequency, dofs):
        """Change the caller's array."""
        H = super().receptance(frequency, dofs)
        if frequency.flags.writeable and frequency.dtype.kind == "f":
            frequency *= 2.0 * np.pi
        return H


@breaks("results_are_new_arrays")
class Cached(Unmeshed):
    """It hands out the matrices that it keeps."""

    def matrices(self):
        """Return the kept ones."""
        if "kept" not in vars(self):
            self.kept = super().matrices()
        return self.kept


def _beam() -> SoundSubstructure:
    return SoundSubstructure()


class HeldBeam(Unmeshed):
    """A beam on a spring against the ground, which it says."""

    held = True

    def matrices(self):
        """Hold the first node."""
        whole = super().matrices()
        whole.K[0, 0] += 1000.0
        return whole


class HeldInNameOnly(Unmeshed):
    """A free beam that says it is held."""

    held = True


class WithInnerDofs(Unmeshed):
    """The same beam, of which only the ends are nodes."""

    @property
    def nodes(self):
        """The ends."""
        every = super().nodes
        return every[0], every[-1]

    def matrices(self):
        """Put the inner nodes behind the ends."""
        whole = super().matrices()
        order = [0, 1, 6, 7, 2, 3, 4, 5]
        return StructuralMatrices(*(getattr(whole, part)[np.ix_(order, order)] for part in "MKCD"))
