"""Matrices in other coordinates of their DOFs: rotated axes, the opposite sense, another order, a distant point."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import overload

import numpy as np
import scipy  # loads a part of it when that is first used
from numpy.typing import NDArray

from dovetail.interfaces.matrices import DIRECTIONS, SparseMatrices, StructuralMatrices, carried
from dovetail.interfaces.substructure import PartNode

_EXACT = 1e-12
"""Distance from 0, 1 or -1 within which an entry of a rotation is that number."""
_PERPENDICULAR = 1e-9
"""Cosine of the angle between directions that are perpendicular."""


def exact_rotation(rotation: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a rotation (3, 3) without the rounding of right angles."""
    nearest = np.round(rotation)
    return np.where(np.abs(rotation - nearest) < _EXACT, nearest, rotation) + 0.0


def are_perpendicular(one: NDArray[np.float64], other: NDArray[np.float64]) -> bool:
    """Return whether two unit vectors are perpendicular but for rounding."""
    return abs(float(one @ other)) <= _PERPENDICULAR


def six_directions(rotation: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the rotation (3, 3) for displacements and rotations, (6, 6), in the order of `DIRECTIONS`."""
    both = np.zeros((len(DIRECTIONS), len(DIRECTIONS)))
    both[:3, :3] = both[3:, 3:] = rotation
    return both


def rigid_body_motions(nodes: Sequence[PartNode]) -> NDArray[np.float64]:
    """Return the six motions (n_dofs, 6) of the nodes' DOFs with a rigid body: along x, y, z, and about them."""
    rows = [
        carried(np.asarray(node.coordinates))[[DIRECTIONS.index(direction) for direction in node.directions]]
        for node in nodes
        if node.carrier is None
    ]
    return np.concatenate(rows) if rows else np.zeros((0, len(DIRECTIONS)))


class Coordinates:
    """The DOFs of matrices as linear functions of other coordinates, u = L q.

    Parameters
    ----------
    L : (d_u, d_q) array
        For the first DOFs. Further DOFs of the matrices, the inner ones, are coordinates themselves.
    """

    def __init__(self, L: NDArray[np.float64]) -> None:
        self.L = np.asarray(L, dtype=np.float64)

    @classmethod
    def node_by_node(cls, blocks: Sequence[NDArray[np.float64]]) -> Coordinates:
        """Return coordinates from L for the DOFs of each node; without any, of no DOFs."""
        return cls(scipy.linalg.block_diag(*blocks) if blocks else np.zeros((0, 0)))

    @cached_property
    def _signed(self) -> tuple[NDArray[np.intp], NDArray[np.float64]] | None:
        """DOF and sign of each coordinate, if each coordinate is a DOF or its opposite."""
        filled = self.L != 0.0
        one_to_one = filled.shape[0] == filled.shape[1] and (filled.sum(axis=0) == 1).all()
        if not one_to_one or not (filled.sum(axis=1) == 1).all() or not (np.abs(self.L[filled]) == 1.0).all():
            return None
        dofs = np.argmax(filled, axis=0)
        return dofs, self.L[dofs, np.arange(len(dofs))]

    @property
    def is_signed(self) -> bool:
        """Whether each coordinate is a DOF or its opposite."""
        return self._signed is not None

    def _with_inner(self, size: int) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
        assert self._signed is not None
        dofs, signs = self._signed
        inner = np.arange(len(dofs), size)
        return np.concatenate([dofs, inner]), np.concatenate([signs, np.ones(len(inner))])

    @overload
    def transformed(self, matrices: StructuralMatrices) -> StructuralMatrices: ...
    @overload
    def transformed(self, matrices: SparseMatrices) -> SparseMatrices: ...
    def transformed(self, matrices: StructuralMatrices | SparseMatrices) -> StructuralMatrices | SparseMatrices:
        """Return L^T M L of the matrices (..., d, d)."""
        inner = matrices.size - len(self.L)
        if isinstance(matrices, SparseMatrices):
            L = scipy.sparse.block_diag([scipy.sparse.csr_array(self.L), scipy.sparse.eye_array(inner)], "csr")
            return SparseMatrices(*(L.T @ getattr(matrices, name) @ L for name in "MKCD"))
        if self.is_signed:
            dofs, signs = self._with_inner(matrices.size)
            both = np.outer(signs, signs)
            moved = (getattr(matrices, name)[..., dofs[:, None], dofs] for name in "MKCD")
            return StructuralMatrices(*(matrix * both for matrix in moved))
        dense = scipy.linalg.block_diag(self.L, np.eye(inner))
        return StructuralMatrices(*(_both_sides(getattr(matrices, name), dense) for name in "MKCD"))

    def transformed_stiffness(self, Z: NDArray[np.complex128]) -> NDArray[np.complex128]:
        """Return L^T Z L of a dynamic stiffness (..., d, d)."""
        dense = scipy.linalg.block_diag(self.L, np.eye(Z.shape[-1] - len(self.L)))
        return np.asarray(dense.T @ Z @ dense)

    def dofs_of(self, coordinates: list[int]) -> list[int]:
        """Return the DOFs on which some coordinates depend, and which depend on them."""
        filled = self.L[:, coordinates] != 0.0
        return [int(dof) for dof in np.flatnonzero(filled.any(axis=1))]


def _both_sides(matrix: NDArray[np.float64], L: NDArray[np.float64]) -> NDArray[np.float64]:
    product = L.T @ matrix @ L
    return (product + np.swapaxes(product, -1, -2)) / 2.0
