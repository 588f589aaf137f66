"""Joints between DOFs that are linear functions of others: along other axes, or of the bodies that carry nodes."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterable
from functools import cached_property
from typing import overload

import numpy as np
from numpy.typing import NDArray

from dovetail.description.changed_joint import MappedJoint, pair_functions
from dovetail.interfaces import DIRECTIONS, Coordinates, JointPort, SparseMatrices, StructuralMatrices


class JointInCoordinates(MappedJoint):
    """A joint whose model acts on linear functions of its nodes' DOFs."""

    @property
    @abstractmethod
    def blocks(self) -> list[NDArray[np.float64]]:
        """The model's DOFs at each node of its ports by those of this joint."""

    @cached_property
    def coordinates(self) -> Coordinates:
        """The model's DOFs at its ports by those of this joint."""
        return Coordinates.node_by_node(self.blocks)

    def pair_functions(self, *, contacts: bool = False) -> NDArray[np.float64]:
        """Return the linear functions (k, d) of the DOFs that are zero."""
        functions, count = pair_functions(self.model, contacts=contacts), len(self.coordinates.L)
        return np.concatenate([functions[:, :count] @ self.coordinates.L, functions[:, count:]], axis=1)

    @overload
    def mapped(self, matrices: StructuralMatrices) -> StructuralMatrices: ...
    @overload
    def mapped(self, matrices: SparseMatrices) -> SparseMatrices: ...
    def mapped(self, matrices: StructuralMatrices | SparseMatrices) -> StructuralMatrices | SparseMatrices:
        """Return the matrices for the DOFs of this joint."""
        return self.coordinates.transformed(matrices)


class JointOfCarriedPoints(JointInCoordinates):
    """A joint whose model acts at points that nodes carry, as those of rigid bodies.

    Points that face each other were compared before, and not DOFs are the same, but functions of them.
    """

    facing_ports = merged_dofs = contact_dofs = ()

    @property
    @abstractmethod
    def motions(self) -> list[NDArray[np.float64]]:
        """The model's directions (n, 6) at each point by the motion of the node that carries it."""

    @cached_property
    def blocks(self) -> list[NDArray[np.float64]]:
        """The model's DOFs at each point by those DOFs of its node that move it."""
        return [motion[:, motion.any(axis=0)] for motion in self.motions]

    def ports_named(self, names: Iterable[str]) -> tuple[JointPort, ...]:
        """Return a port for each node, in the directions in which the joint acts there."""
        acts = [np.flatnonzero(motion.any(axis=0)) for motion in self.motions]
        return tuple(
            JointPort(name, 1, directions=tuple(DIRECTIONS[axis] for axis in axes))
            for name, axes in zip(names, acts, strict=True)
        )


class LawInCoordinates(JointInCoordinates):
    """Such a joint with a dynamic stiffness of its own dependence on frequency."""

    def dynamic_stiffness(self, frequency: NDArray[np.float64], theta: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Return the dynamic stiffness (n, n_freq, d, d) for the DOFs of this joint."""
        return self.coordinates.transformed_stiffness(self.model.dynamic_stiffness(frequency, theta))

    def dynamic_stiffness_jacobian(
        self, frequency: NDArray[np.float64], theta: NDArray[np.float64]
    ) -> Iterable[NDArray[np.complex128]]:
        """Return its derivatives by each parameter, (n, n_freq, d, d) each."""
        derivatives = self.model.dynamic_stiffness_jacobian(frequency, theta)
        return (self.coordinates.transformed_stiffness(derivative) for derivative in derivatives)
