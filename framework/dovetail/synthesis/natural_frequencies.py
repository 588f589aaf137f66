"""Natural frequencies of the undamped assembly, from dense or from sparse matrices."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh
from scipy.sparse.csgraph import connected_components

from dovetail.errors import DovetailError
from dovetail.interfaces import SparseMatrices, StructuralMatrices

__all__ = ["elastic_frequencies"]

_RIGID_BODY_MODES = 6
_STRAIN_FLOOR = 1e-13
"""A mode whose strain energy is below this part of the largest its amplitudes allow is a rigid-body mode. Rounding
leaves a hundredth of it; a beam of 2500 elements in its first bending mode has twice as much."""
_SHIFT_FLOOR = 1e-14
"""A square of a frequency [1/s^2] below this part of the shift is rounding. The motion of a mass that nothing holds has
no strain but the rounding of its shape, which is in that of its amplitudes as any elastic mode's is."""


def elastic_frequencies(matrices: StructuralMatrices | SparseMatrices, count: int) -> NDArray[np.float64]:
    """Return the lowest natural frequencies of the modes that deform the structure.

    Parameters
    ----------
    matrices : StructuralMatrices or SparseMatrices
        (d, d); damping is ignored.
    count : int

    Returns
    -------
    (<= count,) array
        Hz, increasing. Fewer where the model has fewer elastic modes.

    Raises
    ------
    DovetailError
        The structure is not stable: a stiffness or a mass is negative. Or Lanczos does not converge.

    Notes
    -----
    Neither massless DOFs nor rigid-body modes are a special case. Dense matrices: M phi = mu (K + s M) phi. Sparse
    ones: shift-invert Lanczos with a shift below zero.
    """
    if (matrices.M.diagonal() < 0).any():
        raise DovetailError("there are no natural frequencies: with these parameters a mass is negative.")
    if isinstance(matrices, SparseMatrices):
        return _sparse_elastic_frequencies(matrices, count)
    active = _dofs_with_inertia((matrices.K != 0) | (matrices.M != 0), np.diag(matrices.M))
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
    finite = mu > mu[-1] * 1e-14
    shapes = shapes[:, finite][:, ::-1]
    return np.array(list(islice(_elastic_modes(K, M, shapes, _SHIFT_FLOOR * shift), count)))


def _sparse_elastic_frequencies(matrices: SparseMatrices, count: int) -> NDArray[np.float64]:
    from scipy.sparse.linalg import ArpackError, eigsh

    active = _dofs_with_inertia(abs(matrices.K) + abs(matrices.M), matrices.M.diagonal())
    K, M = matrices.K[active][:, active], matrices.M[active][:, active]
    inertia = M.diagonal() > 0
    most = int(inertia.sum()) - 1
    wanted = min(count + _RIGID_BODY_MODES, most)
    start = np.random.default_rng(0).standard_normal(len(active))
    while wanted > 0:
        stiffest = float(np.median(K.diagonal()[inertia] / M.diagonal()[inertia])) or 1.0
        try:
            basis = min(max(2 * wanted + 1, 20), most + 1)  # massless DOFs add no direction
            values, shapes = eigsh(K, wanted, M, sigma=-1e-6 * stiffest, which="LM", v0=start, ncv=basis)
        except (ArpackError, RuntimeError) as error:
            raise DovetailError(f"the natural frequencies of this large model are not found: {error}") from None
        if values.min() < -1e-6 * stiffest:
            raise DovetailError("there are no natural frequencies: with these parameters a stiffness is negative.")
        least = _SHIFT_FLOOR * 1e-6 * stiffest
        modes = list(islice(_elastic_modes(K, M, shapes[:, np.argsort(values)], least), count))
        if len(modes) == count or wanted == most:
            return np.array(modes)
        wanted = min(2 * wanted, most)
    return np.empty(0)


def _dofs_with_inertia(pattern: Any, inertia: NDArray[np.float64]) -> NDArray[np.intp]:
    """Return the DOFs that are connected with a mass; the others have no motion."""
    _, group = connected_components(pattern, directed=False)
    return np.flatnonzero(np.isin(group, group[inertia > 0]))


def _elastic_modes(K: Any, M: Any, shapes: NDArray[np.float64], least: float) -> Iterator[float]:
    """Yield the frequencies [Hz] of those shapes that deform the structure, with squares [1/s^2] above the least."""
    stiffness = abs(K)
    for shape in shapes.T:
        strain, mass = shape @ K @ shape, shape @ M @ shape
        if strain > least * mass and strain > _STRAIN_FLOOR * (abs(shape) @ stiffness @ abs(shape)):
            yield np.sqrt(strain / mass) / (2.0 * np.pi)
