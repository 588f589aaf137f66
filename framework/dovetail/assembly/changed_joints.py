"""Joints with structural damping."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import overload

import numpy as np
from numpy.typing import NDArray

from dovetail.description.changed_joint import ChangedJoint
from dovetail.description.checked import JointEntry
from dovetail.interfaces import (
    JointModel,
    ScaledMatrices,
    SparseMatrices,
    StructuralMatrices,
    describes_matrices,
)


class _StructurallyDamped(ChangedJoint):
    """A joint with structural damping instead of its viscous damping C, equally strong at one frequency [Hz].

    A damper c becomes the structural damping 2 pi f c, which gives a parallel spring k the loss factor 2 pi f c / k.
    """

    def __init__(self, model: JointModel, frequency: float) -> None:
        super().__init__(model)
        self._omega = 2.0 * np.pi * frequency

    @property
    def linear_parameters(self) -> tuple[str, ...]:
        """Those of the model."""
        return self.model.linear_parameters if describes_matrices(self.model, "linear_parameters") else ()

    @property
    def scaled_matrices(self) -> ScaledMatrices | None:
        """Those of the model, with D instead of C."""
        scaled = self.model.scaled_matrices if describes_matrices(self.model, "scaled_matrices") else None
        return None if scaled is None else scaled.changed(self._structural)

    def matrices(self, theta: NDArray[np.float64]) -> StructuralMatrices:
        """Return the model's matrices (n, d, d), with D instead of C."""
        return self._structural(self.model.matrices(theta))

    def matrices_jacobian(self, theta: NDArray[np.float64]) -> Sequence[StructuralMatrices]:
        """Return their derivatives by each parameter, per unit of it."""
        return [self._structural(derivative) for derivative in self.model.matrices_jacobian(theta)]

    @overload
    def _structural(self, viscous: StructuralMatrices) -> StructuralMatrices: ...
    @overload
    def _structural(self, viscous: SparseMatrices) -> SparseMatrices: ...
    def _structural(self, viscous: StructuralMatrices | SparseMatrices) -> StructuralMatrices | SparseMatrices:
        return type(viscous)(viscous.M, viscous.K, D=viscous.D + self._omega * viscous.C)


def structurally_damped(joint: JointEntry) -> JointEntry:
    """Return a joint whose model has the joint's structural damping."""
    assert joint.structural_damping is not None
    model = _StructurallyDamped(joint.connection.model, joint.structural_damping)
    return replace(joint, connection=replace(joint.connection, model=model))
