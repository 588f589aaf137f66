"""What checks of joints and substructures ask of matrices."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["asymmetry", "least_effort", "least_eigenvalue", "relative_difference"]


def least_eigenvalue(matrices: NDArray[np.float64]) -> float:
    """Return the least eigenvalue of (..., d, d) matrices scaled to a unit diagonal, since DOFs differ in their units.

    -1 where a row is filled and its diagonal entry is not positive.
    """
    symmetric = 0.5 * (matrices + np.swapaxes(matrices, -1, -2))
    diagonal = np.diagonal(symmetric, axis1=-2, axis2=-1)
    filled = (symmetric != 0).any(axis=-1)
    if (filled & (diagonal <= 0)).any():
        return -1.0
    scale = np.where(filled, 1.0 / np.sqrt(np.where(filled, diagonal, 1.0)), 0.0)
    scaled = scale[..., :, None] * symmetric * scale[..., None, :]
    return float(np.linalg.eigvalsh(scaled).min(initial=0.0))


def least_effort(matrix: NDArray[np.float64], held: NDArray[np.intp], motion: NDArray[np.float64]) -> float:
    """Return the least effort of a motion of some DOFs, the others free, over the sum of what each would take alone.

    Parameters
    ----------
    matrix : (d, d) array
        Symmetric and positive semi-definite.
    held : (n,) int array
        DOFs whose motion is given.
    motion : (n,) array
    """
    free = np.setdiff1d(np.arange(len(matrix)), held)
    alone = float(motion**2 @ np.diag(matrix)[held])
    if alone <= 0.0:
        return 0.0
    scale = 1.0 / np.sqrt(np.where(np.diag(matrix)[free] > 0, np.diag(matrix)[free], 1.0))
    inner = scale[:, None] * matrix[np.ix_(free, free)] * scale
    coupled = scale * (matrix[np.ix_(free, held)] @ motion)
    effort = motion @ matrix[np.ix_(held, held)] @ motion
    if len(free):
        effort -= coupled @ np.linalg.lstsq(inner, coupled, rcond=None)[0]
    return float(effort) / alone


def asymmetry(matrices: NDArray[np.complex128] | NDArray[np.float64]) -> float:
    """Return the greatest difference of (..., d, d) matrices from their transposes, over the greatest entry."""
    greatest = np.abs(matrices).max(initial=0.0)
    if not greatest:
        return 0.0
    return float(np.abs(matrices - np.swapaxes(matrices, -1, -2)).max() / greatest)


def relative_difference(values: NDArray[Any], reference: NDArray[Any]) -> float:
    """Return the greatest difference of two arrays over the greatest entry of the reference."""
    if values.size == 0:
        return 0.0
    greatest = float(np.abs(reference).max()) or 1.0
    return float(np.abs(values - reference).max()) / greatest
