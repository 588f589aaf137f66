"""Properties of matrices for the checks of joints and substructures."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

_SINGULAR = 1e-12
"""Eigenvalue of a scaled matrix below which a motion needs no effort."""


def least_eigenvalue(matrices: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the smallest eigenvalue of (..., d, d) matrices, scaled to a unit diagonal since the DOFs' units differ.

    It is at most 0, and -1 if a row is filled and its diagonal entry is not positive.
    """
    symmetric = 0.5 * (matrices + np.swapaxes(matrices, -1, -2))
    diagonal = np.diagonal(symmetric, axis1=-2, axis2=-1)
    filled = (symmetric != 0).any(axis=-1)
    wrong = (filled & (diagonal <= 0)).any(axis=-1)
    scale = np.where(filled & (diagonal > 0), 1.0 / np.sqrt(np.where(diagonal > 0, diagonal, 1.0)), 0.0)
    scaled = scale[..., :, None] * symmetric * scale[..., None, :]
    return np.asarray(np.where(wrong, -1.0, np.linalg.eigvalsh(scaled).min(axis=-1, initial=0.0)))


def least_effort(
    matrices: NDArray[np.float64], held: NDArray[np.intp], motion: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the least effort of a motion of some DOFs, with others free, over the sum of the efforts of single DOFs.

    Parameters
    ----------
    matrices : (..., d, d) array
        Symmetric and positive semi-definite.
    held : (n,) int array
        DOFs with prescribed motion.
    motion : (n,) array

    Returns
    -------
    (...) array
    """
    diagonal = np.diagonal(matrices, axis1=-2, axis2=-1)
    free = np.setdiff1d(np.arange(matrices.shape[-1]), held)
    separate = diagonal[..., held] @ motion**2
    scale = 1.0 / np.sqrt(np.where(diagonal[..., free] > 0, diagonal[..., free], 1.0))
    effort = np.einsum("i,...ij,j->...", motion, matrices[..., held[:, None], held], motion)
    if len(free):
        inner = scale[..., :, None] * matrices[..., free[:, None], free] * scale[..., None, :]
        coupled = scale * (matrices[..., free[:, None], held] @ motion)
        followed = np.linalg.pinv(inner, rcond=_SINGULAR, hermitian=True) @ coupled[..., None]
        effort = effort - np.einsum("...i,...i->...", coupled, followed[..., 0])
    return np.asarray(np.where(separate > 0, effort / np.where(separate > 0, separate, 1.0), 0.0))


def condensed(Z: NDArray[np.complex128], count: int) -> NDArray[np.complex128]:
    """Return the dynamic stiffness (..., count, count) of the first DOFs, with no forces on the others."""
    if count == Z.shape[-1]:
        return Z
    outer, inner = Z[..., :count, count:], Z[..., count:, count:]
    return np.asarray(Z[..., :count, :count] - outer @ np.linalg.solve(inner, Z[..., count:, :count]))


def loosest(Z: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Return the smallest singular value of (..., d, d) matrices with scaled rows and columns; 1 for d = 0."""
    scaled = unit_free(Z, np.abs(Z).max(axis=-1, initial=0.0))
    return np.asarray(np.linalg.svd(scaled, compute_uv=False).min(axis=-1, initial=1.0))


def unit_free(matrices: NDArray[Any], scale: NDArray[np.float64]) -> NDArray[Any]:
    """Divide rows and columns of (..., d, d) matrices by the square roots of a positive scale (..., d)."""
    root = 1.0 / np.sqrt(np.where(scale > 0, scale, 1.0))
    return np.asarray(root[..., :, None] * matrices * root[..., None, :])


def has_idle_motion(*matrices: NDArray[np.float64]) -> bool:
    """Return whether some motion needs no effort by any of several (d, d) matrices, ignoring DOFs without entries."""
    scale = np.zeros(len(matrices[0]))
    for matrix in matrices:
        scale = np.where(scale > 0, scale, np.diag(matrix))
    shares = [unit_free(matrix, scale) for matrix in matrices]
    total = np.sum([share / (np.abs(share).max(initial=0.0) or 1.0) for share in shares], axis=0)
    filled = np.flatnonzero(total.any(axis=0))
    return bool(loosest(total[np.ix_(filled, filled)]) < _SINGULAR)


def dense(matrix: Any) -> NDArray[np.float64]:
    """Return a matrix as an array, whether it is sparse or not."""
    return np.asarray(matrix.toarray() if hasattr(matrix, "toarray") else matrix, dtype=np.float64)


def asymmetry(matrices: NDArray[np.complex128] | NDArray[np.float64]) -> float:
    """Return the largest difference of (..., d, d) matrices from their transposes, over the largest entry."""
    greatest = np.abs(matrices).max(initial=0.0)
    if not greatest:
        return 0.0
    return float(np.abs(matrices - np.swapaxes(matrices, -1, -2)).max() / greatest)


def relative_difference(values: NDArray[Any], reference: NDArray[Any]) -> float:
    """Return the largest difference of two arrays over the largest entry of the reference."""
    if values.size == 0:
        return 0.0
    greatest = float(np.abs(reference).max()) or 1.0
    return float(np.abs(values - reference).max()) / greatest
