"""Condensation of a substructure to the dynamic stiffness of its boundary, once per frequency."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from dovetail.interfaces import SparseMatrices, StructuralMatrices, SubstructureModel
from dovetail.synthesis.elimination import eliminate, run
from dovetail.synthesis.measured_boundary import inverted_receptance
from dovetail.synthesis.partition import Partition
from dovetail.synthesis.reduced_basis import condense_on_basis
from dovetail.synthesis.substructure_matrices import substructure_matrices

__all__ = ["boundary_dynamic_stiffness"]

_FEW, _MANY = 60, 1500
"""DOFs up to which matrices are eliminated symbolically however full they are, and beyond which they never are."""
_CHAIN = 16
"""Entries in a row, at most, of a chain of elements, which is eliminated symbolically between the two."""


def boundary_dynamic_stiffness(
    substructure: SubstructureModel, dofs: Sequence[int], frequency: NDArray[np.float64]
) -> NDArray[np.complex128]:
    """Condense a substructure to some of its DOFs.

    Parameters
    ----------
    substructure : SubstructureModel
    dofs : sequence of int
        The n boundary DOFs to keep.
    frequency : (n_freq,) array
        Hz.

    Returns
    -------
    (n_freq, n, n) complex array
        Z_bb - Z_bi Z_ii^-1 Z_ib, the Schur complement over the inner DOFs; the inverse of the receptance where
        there are no matrices. Inverting a receptance costs about six digits near the rigid-body modes, so matrices
        are preferred.

    Raises
    ------
    DovetailError
        The matrices are not sound, or the receptance cannot be inverted.

    Notes
    -----
    Small matrices and chains of elements are eliminated symbolically, all frequencies at once. Others are factorised
    at every frequency, unless the substructure states a tolerance: then a reduced basis serves all frequencies.
    """
    matrices = substructure_matrices(substructure)
    if matrices is None:
        return inverted_receptance(substructure, dofs, frequency)
    if isinstance(matrices, StructuralMatrices) and _is_quickly_eliminated(matrices):
        return _eliminated(matrices, dofs, frequency)
    if isinstance(matrices, StructuralMatrices):
        matrices = SparseMatrices(matrices.M, matrices.K, matrices.C, matrices.D)
    partition = Partition(matrices, dofs)
    if substructure.condensation_tolerance > 0:
        return condense_on_basis(partition, frequency, substructure.condensation_tolerance).stiffness
    return partition.condensed(frequency)


def _is_quickly_eliminated(matrices: StructuralMatrices) -> bool:
    if matrices.size <= _FEW or matrices.size > _MANY:
        return matrices.size <= _FEW
    return int(np.count_nonzero(matrices.K)) <= _CHAIN * matrices.size


def _eliminated(
    matrices: StructuralMatrices, dofs: Sequence[int], frequency: NDArray[np.float64]
) -> NDArray[np.complex128]:
    size = matrices.size
    filled = (matrices.M != 0) | (matrices.K != 0) | (matrices.C != 0) | (matrices.D != 0)
    active = np.union1d(np.flatnonzero(filled.any(axis=0)), dofs)
    place = np.full(size, -1)
    place[active] = np.arange(len(active))
    program = eliminate(filled[np.ix_(active, active)], [int(place[dof]) for dof in dofs])
    rows, columns = active[program.rows], active[program.columns]
    omega = 2.0 * np.pi * frequency
    M, K, C, D = (part[rows, columns, None] for part in (matrices.M, matrices.K, matrices.C, matrices.D))
    slots = (K - omega**2 * M) + 1j * (D + omega * C)
    run(program, slots)
    condensed = np.zeros((len(frequency), len(dofs), len(dofs)), dtype=np.complex128)
    index = {int(dof): position for position, dof in enumerate(dofs)}
    for slot, (row, column) in enumerate(zip(rows, columns, strict=True)):
        if row in index and column in index:
            condensed[:, index[row], index[column]] = condensed[:, index[column], index[row]] = slots[slot]
    return condensed
