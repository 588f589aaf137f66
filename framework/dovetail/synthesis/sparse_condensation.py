"""Condensation of sparse matrices: exactly, by a factorisation at each frequency, or on a reduced basis.

The reduced basis consists of the modes with the boundary held and of the exact motion at a few frequencies. Its error
is measured with exact condensations at further frequencies.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy  # loads a part of it when that is first used
from numpy.typing import NDArray

from dovetail.errors import DovetailError
from dovetail.interfaces import SparseMatrices
from dovetail.parallel import cores


@dataclass(frozen=True)
class Settings:
    """How inner DOFs are eliminated, and how the reduced basis grows."""

    diagonal_preference: float = 0.01
    """Diagonal entry, over the column's largest one, from which it is the pivot, so that the sparse order is kept."""
    residual: float = 1e-11
    """Residual of the inner equations, over their terms, above which the line is solved again with full pivoting."""
    frequency_margin: float = 1.2
    """Multiple of the highest frequency up to which modes are used."""
    agreements: int = 2
    """Number of successive exact lines with which a basis must agree before it is accepted."""
    independence: float = 1e-10
    """Smallest part of a vector outside the basis, relative to its length, with which it is added to the basis."""
    lines_at_once: int = 256
    """Number of lines at a time, which limits the memory of the projected matrices."""


SETTINGS = Settings()


class PartitionedMatrices:
    """Inner and boundary blocks of sparse matrices; the inner DOFs are in the order of elimination.

    Parameters
    ----------
    matrices : SparseMatrices
    dofs : sequence of int
        The n boundary DOFs. Inner DOFs without entries are left out.

    Attributes
    ----------
    boundary, inner : SparseMatrices
        The blocks bb and ii.
    coupling : tuple of csc_array
        The blocks ib of M, K, C and D.
    """

    def __init__(self, matrices: SparseMatrices, dofs: Sequence[int]) -> None:
        MKCD = (matrices.M, matrices.K, matrices.C, matrices.D)
        pattern = sum(abs(matrix) for matrix in MKCD).tocsc()
        kept = np.asarray(dofs, dtype=np.intp)
        inner = np.setdiff1d(np.flatnonzero(pattern.sum(axis=0)), kept)
        if len(inner):
            inner = inner[_elimination_order(pattern[inner][:, inner])]
        self.boundary = SparseMatrices(*(matrix[kept][:, kept] for matrix in MKCD))
        self.coupling = tuple(scipy.sparse.csc_array(matrix[inner][:, kept]) for matrix in MKCD)
        self.inner = SparseMatrices(*(matrix[inner][:, inner] for matrix in MKCD))

    @property
    def size(self) -> int:
        """Number of boundary DOFs."""
        return self.boundary.size

    def coupling_stiffness(self, frequency: float) -> NDArray[np.complex128]:
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
            With its boundary held, the substructure has an undamped resonance at exactly this frequency.
        """
        Z_bb = self.boundary.dynamic_stiffness(frequency).toarray()
        Z_ib = self.coupling_stiffness(frequency)
        if not len(Z_ib):
            return Z_bb, Z_ib
        motion = _solve(self.inner.dynamic_stiffness(frequency).tocsc(), Z_ib)
        if motion is None:
            raise DovetailError(
                f"a substructure cannot be condensed at {frequency:g} Hz, where it resonates without damping while its "
                "boundary is held. Give it damping, or move the frequencies."
            )
        stiffness = Z_bb - Z_ib.T @ motion
        return 0.5 * (stiffness + stiffness.T), motion

    def condense(self, frequency: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Return the exact stiffness (n_freq, n, n) at each frequency (n_freq,) [Hz], by one factorisation each."""
        with ThreadPoolExecutor(cores()) as pool:
            lines = list(pool.map(lambda line: self.solve(line)[0], [float(line) for line in frequency]))
        return np.stack(lines)


def _elimination_order(pattern: scipy.sparse.csc_array) -> NDArray[np.intp]:
    """Return a minimum-degree order, from a diagonally dominant matrix of this pattern, which needs no pivoting."""
    dominant = scipy.sparse.csc_array(pattern + scipy.sparse.diags_array(2.0 * np.asarray(pattern.sum(axis=0))))
    factors = scipy.sparse.linalg.splu(
        dominant, permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True}, diag_pivot_thresh=0.0
    )
    return np.asarray(np.argsort(factors.perm_c), dtype=np.intp)


def _solve(Z: scipy.sparse.csc_array, load: NDArray[np.complex128]) -> NDArray[np.complex128] | None:
    """Solve by LU in the order of the DOFs or, if that loses digits, with pivoting; None if Z is singular."""
    threshold = SETTINGS.diagonal_preference
    attempts: tuple[dict[str, Any], ...] = (
        {"permc_spec": "NATURAL", "options": {"SymmetricMode": True}, "diag_pivot_thresh": threshold},
        {"permc_spec": "COLAMD", "diag_pivot_thresh": 1.0},
    )
    norm = abs(Z).max()
    for attempt in attempts:
        try:
            factors = scipy.sparse.linalg.splu(Z, **attempt)
        except RuntimeError:  # "Factor is exactly singular"
            continue
        motion: NDArray[np.complex128] = factors.solve(load)
        motion += factors.solve(load - Z @ motion)
        residual = np.abs(load - Z @ motion).max(initial=0.0)
        if residual <= SETTINGS.residual * (norm * np.abs(motion).max() + np.abs(load).max()):
            return motion
    return None


@dataclass(frozen=True, eq=False)
class ReducedCondensation:
    """The condensation on a reduced basis, and its measured error.

    Parameters
    ----------
    stiffness : (n_freq, n, n) complex array
        The boundary dynamic stiffness.
    error : float
        Largest relative difference in the last comparison: from an exact line that was not in the basis, and from the
        previous basis at every line.
    vectors : int
        Size of the basis.
    exact_lines : int
        Number of lines that were factorised.
    """

    stiffness: NDArray[np.complex128]
    error: float
    vectors: int
    exact_lines: int


def condense_on_basis(
    matrices: PartitionedMatrices, frequency: NDArray[np.float64], tolerance: float
) -> ReducedCondensation:
    """Condense at every frequency on one basis.

    Parameters
    ----------
    matrices : PartitionedMatrices
    frequency : (n_freq,) array
        Hz.
    tolerance : float
        Largest `relative_difference`.

    Returns
    -------
    ReducedCondensation

    Notes
    -----
    Galerkin projection of M, K, C and D. The basis consists of the undamped modes with the boundary held, up to 1.2
    times the highest frequency, and of residual vectors for the higher modes: the exact motion at single frequencies
    under motion of the boundary. The projection is symmetric, so that the error of the stiffness is the square of the
    error of the motion. The next exact line is the one that the last vectors changed most; its exact stiffness gives
    the error of the basis before it. The basis is accepted when, twice in succession, this error and the change at all
    lines are within the tolerance.
    """
    projection = _Projection(matrices)
    projection.add(_fixed_boundary_modes(matrices, SETTINGS.frequency_margin * float(frequency.max())))
    exact_lines: list[int] = []
    agreements, error = 0, np.inf
    stiffness, change = projection.condense(frequency), np.full(len(frequency), np.inf)
    while agreements < SETTINGS.agreements and len(exact_lines) < len(frequency):
        line = _next_line(change, exact_lines)
        exact, motion = matrices.solve(float(frequency[line]))
        error = float(relative_difference(stiffness[line : line + 1], exact[None])[0])
        projection.add(np.concatenate([motion.real, motion.imag], axis=1))
        before, stiffness = stiffness, projection.condense(frequency)
        change = relative_difference(before, stiffness)
        exact_lines.append(line)
        error = max(error, float(change.max()))
        agreements = agreements + 1 if error <= tolerance else 0
    return ReducedCondensation(stiffness, error, projection.size, len(exact_lines))


def extended_basis(
    basis: NDArray[np.float64], vectors: NDArray[np.float64], independence: float
) -> NDArray[np.float64]:
    """Return an orthonormal basis (d, m) extended by the components outside it of some vectors (d, k).

    Parameters
    ----------
    basis, vectors : arrays
    independence : float
        Smallest such component, relative to the vector's length, that is added.
    """
    for vector in vectors.T:
        length = float(np.linalg.norm(vector))
        if not length:
            continue
        new = vector / length
        for _ in range(2):
            new = new - basis @ (basis.T @ new)
        norm = float(np.linalg.norm(new))
        if norm > independence:
            basis = np.column_stack([basis, new / norm])
    return basis


def relative_difference(approximation: NDArray[np.complex128], truth: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Return the largest difference of two boundary stiffnesses (n_freq, n, n) at each frequency, (n_freq,).

    Each entry is divided by the geometric mean of the largest entries of its row and of its column.
    """
    size = np.abs(truth).max(axis=2)
    scale = np.sqrt(size[:, :, None] * size[:, None, :])
    ratio = np.abs(approximation - truth) / np.where(scale > 0, scale, 1.0)
    worst: NDArray[np.float64] = ratio.max(axis=(1, 2), initial=0.0)
    return worst


def _next_line(change: NDArray[np.float64], exact_lines: list[int]) -> int:
    """Return the line, not yet exact, that changed most; first the highest, the lowest and the middle line."""
    initial = (len(change) - 1, 0, len(change) // 2)
    if len(exact_lines) < len(initial) and initial[len(exact_lines)] not in exact_lines:
        return initial[len(exact_lines)]
    inexact_change = change.copy()
    inexact_change[exact_lines] = -1.0
    return int(np.argmax(inexact_change))


class _Projection:
    """The matrices in coordinates of a growing orthonormal basis of the inner DOFs."""

    def __init__(self, matrices: PartitionedMatrices) -> None:
        self._matrices = matrices
        diagonal = matrices.inner.K.diagonal()
        self._scale = 1.0 / np.sqrt(np.where(diagonal > 0, diagonal, diagonal.max(initial=0.0) or 1.0))
        self._basis = np.empty((matrices.inner.size, 0))

    @property
    def size(self) -> int:
        return int(self._basis.shape[1])

    def add(self, vectors: NDArray[np.float64]) -> None:
        """Extend the basis by the independent components of some vectors (n_inner, k)."""
        self._basis = extended_basis(self._basis, vectors / self._scale[:, None], SETTINGS.independence)

    def condense(self, frequency: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Return the boundary dynamic stiffness (n_freq, n, n), condensed on the basis."""
        V = self._scale[:, None] * self._basis
        inner, outer = self._matrices.inner, self._matrices.boundary
        projected = [V.T @ (matrix @ V) for matrix in (inner.M, inner.K, inner.C, inner.D)]
        coupling = [V.T @ matrix.toarray() for matrix in self._matrices.coupling]
        boundary = [matrix.toarray() for matrix in (outer.M, outer.K, outer.C, outer.D)]
        size = SETTINGS.lines_at_once
        blocks = [frequency[first : first + size] for first in range(0, len(frequency), size)]
        return np.concatenate([_schur_complement(boundary, coupling, projected, block) for block in blocks])


def _schur_complement(
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


def _fixed_boundary_modes(matrices: PartitionedMatrices, highest: float) -> NDArray[np.float64]:
    """Return the undamped modes (n_inner, k) up to a frequency [Hz], with the boundary held."""
    from scipy.sparse.linalg import ArpackError, eigsh

    M, K = matrices.inner.M, matrices.inner.K
    limit = (2.0 * np.pi * highest) ** 2
    most = matrices.inner.size - 2
    count = min(20, most)
    while count > 0:
        try:
            values, shapes = eigsh(K, count, M, sigma=-0.01 * limit, which="LM")
        except (ArpackError, RuntimeError) as error:
            raise DovetailError(f"the modes of a substructure with its boundary held are not found: {error}") from None
        if values.max() > limit or count == most:
            return np.asarray(shapes[:, values <= limit])
        count = min(2 * count, most)
    return np.empty((matrices.inner.size, 0))
