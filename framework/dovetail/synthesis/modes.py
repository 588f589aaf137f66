"""Natural frequencies of the undamped assembly."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh
from scipy.sparse.csgraph import connected_components

from dovetail.errors import DovetailError
from dovetail.interfaces import SparseMatrices, StructuralMatrices
from dovetail.synthesis.sparse_modes import sparse_elastic_frequencies

__all__ = ["elastic_frequencies"]

_STRAIN_FLOOR = 1e-11
"""A mode whose strain energy is below this part of the largest its amplitudes allow is a rigid-body mode."""


def elastic_frequencies(matrices: StructuralMatrices | SparseMatrices, count: int) -> NDArray[np.float64]:
    """Return the lowest natural frequencies of the modes that deform the structure.

    Parameters
    ----------
    matrices : StructuralMatrices or SparseMatrices
        (d, d); damping is left out.
    count : int

    Returns
    -------
    (<= count,) array
        Hz, increasing. Fewer where the model has fewer elastic modes.

    Raises
    ------
    DovetailError
        The structure is not stable: a stiffness or a mass is negative.

    Notes
    -----
    Solves M phi = mu (K + s M) phi, which takes massless DOFs and rigid-body modes without special cases.
    """
    if isinstance(matrices, SparseMatrices):
        return sparse_elastic_frequencies(matrices, count)
    _, group = connected_components((matrices.K != 0) | (matrices.M != 0), directed=False)
    active = np.flatnonzero(np.isin(group, group[np.diag(matrices.M) > 0]))  # what has no inertia has no motion
    K, M = matrices.K[np.ix_(active, active)], matrices.M[np.ix_(active, active)]
    inertia = np.diag(M) > 0
    if not inertia.any():
        return np.empty(0)
    shift = 1e-3 * float(np.median(np.diag(K)[inertia] / np.diag(M)[inertia])) or 1.0
    try:
        mu, shapes = eigh(M, K + shift * M)
    except np.linalg.LinAlgError:
        raise DovetailError(
            "there are no natural frequencies: with these parameters a stiffness or a mass is negative."
        ) from None
    modes: list[float] = []
    for value, shape in zip(mu[::-1], shapes.T[::-1], strict=True):
        if len(modes) == count or value <= mu[-1] * 1e-14:
            break
        strain = shape @ K @ shape
        if strain > _STRAIN_FLOOR * (abs(shape) @ abs(K) @ abs(shape)):
            modes.append(np.sqrt(strain / (shape @ M @ shape)) / (2.0 * np.pi))
    return np.array(modes)
