"""Joints between DOFs that are linear functions of others: along other axes, or of the bodies that carry nodes."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterable, Sequence
from functools import cached_property

import numpy as np
import scipy  # loads a part of it when that is first used
from numpy.typing import NDArray

from dovetail.description.changed_joint import ChangedJoint
from dovetail.interfaces import Coordinates, ScaledMatrices, StructuralMatrices, describes_matrices


class JointInCoordinates(ChangedJoint):
    """A joint whose model acts on linear functions of its nodes' DOFs."""

    @property
    @abstractmethod
    def blocks(self) -> list[NDArray[np.float64]]:
        """The model's DOFs at each node of its ports by those of this joint."""

    @cached_property
    def coordinates(self) -> Coordinates:
        """The model's DOFs at its ports by those of this joint."""
        return Coordinates(scipy.linalg.block_diag(*self.blocks))

    @property
    def linear_parameters(self) -> tuple[str, ...]:
        """Those of the model."""
        return self.model.linear_parameters if describes_matrices(self.model, "linear_parameters") else ()

    @cached_property
    def scaled_matrices(self) -> ScaledMatrices | None:
        """Those of the model, for the DOFs of this joint."""
        scaled = self.model.scaled_matrices if describes_matrices(self.model, "scaled_matrices") else None
        return None if scaled is None else scaled.changed(self.coordinates.transformed)

    def matrices(self, theta: NDArray[np.float64]) -> StructuralMatrices:
        """Return the matrices (n, d, d) for the DOFs of this joint."""
        return self.coordinates.transformed(self.model.matrices(theta))

    def matrices_jacobian(self, theta: NDArray[np.float64]) -> Sequence[StructuralMatrices]:
        """Return their derivatives by each parameter, per unit of it."""
        return [self.coordinates.transformed(derivative) for derivative in self.model.matrices_jacobian(theta)]


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
