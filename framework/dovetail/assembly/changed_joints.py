"""Joints with structural damping."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import overload

import numpy as np

from dovetail.description.changed_joint import MappedJoint
from dovetail.description.checked import JointEntry
from dovetail.interfaces import JointModel, SparseMatrices, StructuralMatrices


class _StructurallyDamped(MappedJoint):
    """A joint with structural damping instead of its viscous damping C, equally strong at one frequency [Hz].

    A damper c becomes the structural damping 2 pi f c, which gives a parallel spring k the loss factor 2 pi f c / k.
    """

    def __init__(self, model: JointModel, frequency: float) -> None:
        super().__init__(model)
        self._omega = 2.0 * np.pi * frequency

    @overload
    def mapped(self, matrices: StructuralMatrices) -> StructuralMatrices: ...
    @overload
    def mapped(self, matrices: SparseMatrices) -> SparseMatrices: ...
    def mapped(self, matrices: StructuralMatrices | SparseMatrices) -> StructuralMatrices | SparseMatrices:
        """Return the matrices with D instead of C."""
        return type(matrices)(matrices.M, matrices.K, D=matrices.D + self._omega * matrices.C)


_model_with_damping = lru_cache(maxsize=64)(_StructurallyDamped)
"""The model for a joint's model and a frequency, made once, so that its superposition is derived and checked once."""


def structurally_damped(joint: JointEntry) -> JointEntry:
    """Return a joint whose model has the joint's structural damping."""
    assert joint.structural_damping is not None
    model = _model_with_damping(joint.connection.model, joint.structural_damping)
    return replace(joint, connection=replace(joint.connection, model=model))
