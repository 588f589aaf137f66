"""Condensation of a substructure to the dynamic stiffness of its boundary, once per frequency."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from dovetail.interfaces import SubstructureModel
from dovetail.synthesis.elimination import eliminate, run

__all__ = ["boundary_dynamic_stiffness"]


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
    """
    matrices = substructure.matrices()
    if matrices is None:
        return np.asarray(np.linalg.inv(substructure.receptance(frequency, dofs)), dtype=np.complex128)
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
