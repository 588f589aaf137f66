"""Condensation of a large substructure on a reduced basis: fixed-interface modes and residual vectors."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dovetail.errors import DovetailError
from dovetail.synthesis.partition import Partition

__all__ = ["ReducedCondensation", "condense_on_basis"]

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
