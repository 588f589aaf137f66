"""Natural frequencies of the undamped assembly."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh
from scipy.sparse.csgraph import connected_components

from dovetail.errors import DovetailError
from dovetail.interfaces import SparseMatrices, StructuralMatrices

__all__ = ["elastic_frequencies", "sparse_elastic_frequencies"]

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


_RIGID_BODY_MODES = 6
_STRAIN_FLOOR = 1e-13
"""A mode whose strain energy is below this part of the largest its amplitudes allow is a rigid-body mode. Rounding
leaves a hundredth of it; a beam of 2500 elements in its first bending mode has twice as much."""
_START = 0


def sparse_elastic_frequencies(matrices: SparseMatrices, count: int) -> NDArray[np.float64]:
    """Return the lowest natural frequencies of the modes that deform the structure.

    Parameters
    ----------
    matrices : SparseMatrices
        Damping is left out.
    count : int

    Returns
    -------
    (<= count,) array
        Hz, increasing.

    Raises
    ------
    DovetailError
        The structure is not stable, or the eigenvalues are not found.

    Notes
    -----
    Shift-invert Lanczos below zero, which takes massless DOFs and rigid-body modes without special cases.
    """
    from scipy.sparse.linalg import ArpackError, eigsh

    _, group = connected_components(abs(matrices.K) + abs(matrices.M), directed=False)
    massive = matrices.M.diagonal() > 0
    active = np.flatnonzero(np.isin(group, group[massive]))  # what has no inertia has no motion
    K, M = matrices.K[active][:, active], matrices.M[active][:, active]
    if (matrices.M.diagonal() < 0).any():
        raise DovetailError("there are no natural frequencies: with these parameters a mass is negative.")
    inertia = massive[active]
    most = int(inertia.sum()) - 1
    wanted = min(count + _RIGID_BODY_MODES, most)
    start = np.random.default_rng(_START).standard_normal(len(active))
    while wanted > 0:
        stiffest = float(np.median(K.diagonal()[inertia] / M.diagonal()[inertia])) or 1.0
        try:
            values, shapes = eigsh(K, wanted, M, sigma=-1e-6 * stiffest, which="LM", v0=start)
        except (ArpackError, RuntimeError) as error:
            raise DovetailError(f"the natural frequencies of this large model are not found: {error}") from None
        if values.min() < -1e-6 * stiffest:
            raise DovetailError("there are no natural frequencies: with these parameters a stiffness is negative.")
        found = _elastic(K, M, shapes[:, np.argsort(values)])
        if len(found) >= count or wanted == most:
            return found[:count]
        wanted = min(2 * wanted, most)
    return np.empty(0)


def _elastic(K: Any, M: Any, shapes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the frequencies of those shapes that deform the structure [Hz]."""
    modes = []
    for shape in shapes.T:
        strain = shape @ (K @ shape)
        if strain > _STRAIN_FLOOR * (abs(shape) @ (abs(K) @ abs(shape))):
            modes.append(np.sqrt(strain / (shape @ (M @ shape))) / (2.0 * np.pi))
    return np.array(modes)
