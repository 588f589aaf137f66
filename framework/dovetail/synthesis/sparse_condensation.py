"""Sparse matrices of a substructure, parted into boundary and inner DOFs, and their exact condensation."""

from __future__ import annotations

import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array, diags_array
from scipy.sparse.linalg import splu

from dovetail.errors import DovetailError
from dovetail.interfaces import SparseMatrices

__all__ = ["Partition", "ReducedCondensation", "condense_on_basis"]

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


_BEYOND = 1.2
"""Modes are taken up to this multiple of the highest frequency."""
_AGREEMENTS = 2
"""Exact lines in a row that a basis must meet before it is trusted."""
_DEPENDENT = 1e-10
"""Part of a vector that must be new to the basis."""
_LINES_AT_ONCE = 256


@dataclass(frozen=True, eq=False)
class ReducedCondensation:
    """What the basis gives, and how far it was found to be off.

    Parameters
    ----------
    stiffness : (n_freq, n, n) complex array
        The boundary dynamic stiffness.
    error : float
        Largest relative difference found in the last comparisons: with exact lines that the basis did not know, and
        with the basis before at every line.
    vectors : int
        Size of the basis.
    exact_lines : int
        Lines that were factorised.
    """

    stiffness: NDArray[np.complex128]
    error: float
    vectors: int
    exact_lines: int


def condense_on_basis(partition: Partition, frequency: NDArray[np.float64], tolerance: float) -> ReducedCondensation:
    """Condense at every frequency on one basis.

    Parameters
    ----------
    partition : Partition
    frequency : (n_freq,) array
        Hz.
    tolerance : float
        Of `relative_difference`.

    Returns
    -------
    ReducedCondensation

    Notes
    -----
    Galerkin projection of M, K, C and D on undamped modes with the boundary held, up to 1.2 times the highest
    frequency, and on residual vectors for what these leave out: the exact motion at single frequencies under motion of
    the boundary. The projection is symmetric, so that the error of the stiffness is the square of the error of the
    motion. The next exact line is the one that the last vectors changed most; its exact stiffness shows the
    error of the basis that did not know it. The end is when two such lines in a row, and the change at all
    others, are within the tolerance.
    """
    projection = _Projection(partition)
    projection.add(_modes(partition, _BEYOND * float(frequency.max())))
    known: list[int] = []
    agreements, error = 0, np.inf
    stiffness, change = projection.condensed(frequency), np.full(len(frequency), np.inf)
    while agreements < _AGREEMENTS and len(known) < len(frequency):
        line = _next_line(change, known)
        exact, motion = partition.solve(float(frequency[line]))
        error = float(relative_difference(stiffness[line : line + 1], exact[None])[0])
        projection.add(np.concatenate([motion.real, motion.imag], axis=1))
        before, stiffness = stiffness, projection.condensed(frequency)
        change = relative_difference(before, stiffness)
        known.append(line)
        error = max(error, float(change.max()))
        agreements = agreements + 1 if error <= tolerance else 0
    return ReducedCondensation(stiffness, error, projection.size, len(known))


def relative_difference(found: NDArray[np.complex128], truth: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Return the largest difference of two boundary stiffnesses (n_freq, n, n) at each frequency, (n_freq,).

    Each entry is related to the geometric mean of the largest entries of its row and of its column.
    """
    size = np.abs(truth).max(axis=2)
    scale = np.sqrt(size[:, :, None] * size[:, None, :])
    ratio = np.abs(found - truth) / np.where(scale > 0, scale, 1.0)
    worst: NDArray[np.float64] = ratio.max(axis=(1, 2), initial=0.0)
    return worst


def _next_line(change: NDArray[np.float64], known: list[int]) -> int:
    """Return the unknown line that changed most; to begin with the highest, the lowest and the middle one."""
    first = (len(change) - 1, 0, len(change) // 2)
    if len(known) < len(first) and first[len(known)] not in known:
        return first[len(known)]
    open_lines = change.copy()
    open_lines[known] = -1.0
    return int(np.argmax(open_lines))


class _Projection:
    """The matrices in coordinates of a growing orthonormal basis of the inner DOFs."""

    def __init__(self, partition: Partition) -> None:
        self._partition = partition
        diagonal = partition.inner.K.diagonal()
        self._scale = 1.0 / np.sqrt(np.where(diagonal > 0, diagonal, diagonal.max(initial=0.0) or 1.0))
        self._basis = np.empty((partition.inner.size, 0))

    @property
    def size(self) -> int:
        return int(self._basis.shape[1])

    def add(self, vectors: NDArray[np.float64]) -> None:
        """Take in what is new in some vectors (n_inner, k)."""
        for vector in (vectors / self._scale[:, None]).T:
            length = float(np.linalg.norm(vector))
            if not length:
                continue
            new = vector / length
            for _ in range(2):
                new = new - self._basis @ (self._basis.T @ new)
            remains = float(np.linalg.norm(new))
            if remains > _DEPENDENT:
                self._basis = np.column_stack([self._basis, new / remains])

    def condensed(self, frequency: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Return the boundary dynamic stiffness on the basis, (n_freq, n, n)."""
        parts = self._partition
        V = self._scale[:, None] * self._basis
        inner = [V.T @ (part @ V) for part in (parts.inner.M, parts.inner.K, parts.inner.C, parts.inner.D)]
        coupling = [V.T @ part.toarray() for part in parts.coupling]
        own = parts.boundary
        boundary = [part.toarray() for part in (own.M, own.K, own.C, own.D)]
        blocks = [frequency[first : first + _LINES_AT_ONCE] for first in range(0, len(frequency), _LINES_AT_ONCE)]
        return np.concatenate([_schur(boundary, coupling, inner, block) for block in blocks])


def _schur(
    boundary: list[NDArray[np.float64]],
    coupling: list[NDArray[np.float64]],
    inner: list[NDArray[np.float64]],
    frequency: NDArray[np.float64],
) -> NDArray[np.complex128]:
    omega = (2.0 * np.pi * frequency)[:, None, None]
    Z_bb, Z_ib, Z_ii = (
        np.asarray((K - omega**2 * M) + 1j * (D + omega * C), dtype=np.complex128)
        for M, K, C, D in (boundary, coupling, inner)
    )
    reduced = Z_bb - np.swapaxes(Z_ib, 1, 2) @ np.linalg.solve(Z_ii, Z_ib)
    return np.asarray(0.5 * (reduced + np.swapaxes(reduced, 1, 2)), dtype=np.complex128)


def _modes(partition: Partition, highest: float) -> NDArray[np.float64]:
    """Return the undamped modes (n_inner, k) up to a frequency [Hz], the boundary held."""
    from scipy.sparse.linalg import ArpackError, eigsh

    M, K = partition.inner.M, partition.inner.K
    limit = (2.0 * np.pi * highest) ** 2
    most = partition.inner.size - 2
    count = min(20, most)
    while count > 0:
        try:
            values, shapes = eigsh(K, count, M, sigma=-0.01 * limit, which="LM")
        except (ArpackError, RuntimeError) as error:
            raise DovetailError(f"the modes of a substructure with its boundary held are not found: {error}") from None
        if values.max() > limit or count == most:
            return np.asarray(shapes[:, values <= limit])
        count = min(2 * count, most)
    return np.empty((partition.inner.size, 0))
