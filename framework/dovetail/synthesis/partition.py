"""Sparse matrices of a substructure, parted into boundary and inner DOFs, and their exact condensation."""

from __future__ import annotations

import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array, diags_array
from scipy.sparse.linalg import splu

from dovetail.errors import DovetailError
from dovetail.interfaces import SparseMatrices

__all__ = ["Partition"]

_FAVOUR_DIAGONAL = 0.01
"""Part of a column's largest entry from which the diagonal serves as pivot, so that the order is kept."""
_LARGEST_RESIDUAL = 1e-11
"""Of the inner equations, over the size of their terms; beyond it the line is solved again with full pivoting."""


class Partition:
    """Inner and boundary blocks of sparse matrices; the order of elimination is found once for all frequencies.

    Parameters
    ----------
    matrices : SparseMatrices
    dofs : sequence of int
        The n boundary DOFs. DOFs without any entry take no part.

    Attributes
    ----------
    boundary, inner : SparseMatrices
        The blocks bb and ii.
    coupling : tuple of csc_array
        The blocks ib of M, K, C and D. The inner DOFs stand in the order of their elimination.
    """

    def __init__(self, matrices: SparseMatrices, dofs: Sequence[int]) -> None:
        parts = (matrices.M, matrices.K, matrices.C, matrices.D)
        pattern = sum(abs(part) for part in parts).tocsc()
        kept = np.asarray(dofs, dtype=np.intp)
        inner = np.setdiff1d(np.flatnonzero(pattern.sum(axis=0)), kept)
        if len(inner):
            inner = inner[_elimination_order(pattern[inner][:, inner])]
        self.boundary = SparseMatrices(*(part[kept][:, kept] for part in parts))
        self.coupling = tuple(csc_array(part[inner][:, kept]) for part in parts)
        self.inner = SparseMatrices(*(part[inner][:, inner] for part in parts))

    @property
    def size(self) -> int:
        """Number of boundary DOFs."""
        return self.boundary.size

    def load(self, frequency: float) -> NDArray[np.complex128]:
        """Return Z_ib (n_inner, n) at one frequency [Hz]."""
        M, K, C, D = self.coupling
        omega = 2.0 * np.pi * frequency
        return np.asarray(((K - omega**2 * M) + 1j * (D + omega * C)).toarray(), dtype=np.complex128)

    def solve(self, frequency: float) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
        """Condense at one frequency.

        Parameters
        ----------
        frequency : float
            Hz.

        Returns
        -------
        stiffness : (n, n) complex array
            Z_bb - Z_bi Z_ii^-1 Z_ib.
        motion : (n_inner, n) complex array
            Z_ii^-1 Z_ib.

        Raises
        ------
        DovetailError
            The part has an undamped resonance, its boundary held, exactly there.
        """
        Z_bb = self.boundary.dynamic_stiffness(frequency).toarray()
        load = self.load(frequency)
        if not len(load):
            return Z_bb, load
        motion = _solved(self.inner.dynamic_stiffness(frequency).tocsc(), load)
        if motion is None:
            raise DovetailError(
                f"a substructure cannot be condensed at {frequency:g} Hz, where it resonates without damping while its "
                "boundary is held. Give it damping, or move the frequencies."
            )
        stiffness = Z_bb - load.T @ motion
        return 0.5 * (stiffness + stiffness.T), motion

    def condensed(self, frequency: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Condense exactly at every frequency (n_freq,) [Hz], a factorisation each: (n_freq, n, n)."""
        with ThreadPoolExecutor(_cores()) as pool:
            lines = list(pool.map(lambda line: self.solve(line)[0], [float(line) for line in frequency]))
        return np.stack(lines)


def _elimination_order(pattern: csc_array) -> NDArray[np.intp]:
    """Return a fill-reducing order: minimum degree on a dominant matrix of this pattern, which needs no pivoting."""
    dominant = csc_array(pattern + diags_array(2.0 * np.asarray(pattern.sum(axis=0))))
    factors = splu(dominant, permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True}, diag_pivot_thresh=0.0)
    return np.asarray(np.argsort(factors.perm_c), dtype=np.intp)


def _solved(Z: csc_array, load: NDArray[np.complex128]) -> NDArray[np.complex128] | None:
    """Solve by LU in the given order; with full pivoting where the order costs digits; None where Z is singular."""
    attempts: tuple[dict[str, Any], ...] = (
        {"permc_spec": "NATURAL", "options": {"SymmetricMode": True}, "diag_pivot_thresh": _FAVOUR_DIAGONAL},
        {"permc_spec": "COLAMD", "diag_pivot_thresh": 1.0},
    )
    norm = abs(Z).max()
    for attempt in attempts:
        try:
            factors = splu(Z, **attempt)
        except RuntimeError:  # "Factor is exactly singular"
            continue
        motion: NDArray[np.complex128] = factors.solve(load)
        motion += factors.solve(load - Z @ motion)
        residual = np.abs(load - Z @ motion).max(initial=0.0)
        if residual <= _LARGEST_RESIDUAL * (norm * np.abs(motion).max() + np.abs(load).max()):
            return motion
    return None


def _cores() -> int:
    """Return how many cores this process may use."""
    affinity = getattr(os, "sched_getaffinity", None)
    return len(affinity(0)) if affinity else os.cpu_count() or 1
