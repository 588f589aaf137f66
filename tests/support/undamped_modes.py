"""Natural frequencies of undamped matrices, by the modes from which the search for damped poles starts."""

from __future__ import annotations

from itertools import islice

import numpy as np
from numpy.typing import NDArray

from dovetail.errors import DovetailError
from dovetail.interfaces import SparseMatrices, StructuralMatrices
from dovetail.synthesis.natural_frequencies import dense_modes, lowest_modes
from dovetail.synthesis.pole_search import dofs_with_inertia

_RIGID_BODY_MODES = 6


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
        Hz, increasing; fewer if the model has fewer elastic modes.

    Raises
    ------
    DovetailError
        A stiffness or a mass is negative, or Lanczos does not converge.
    """
    if (matrices.M.diagonal() < 0).any():
        raise DovetailError("there are no natural frequencies: with these parameters a mass is negative.")
    if isinstance(matrices, SparseMatrices):
        return _sparse_frequencies(matrices, count)
    return np.array([frequency for frequency, _ in islice(dense_modes(matrices.K, matrices.M), count)])


def _sparse_frequencies(matrices: SparseMatrices, count: int) -> NDArray[np.float64]:
    active = dofs_with_inertia(abs(matrices.K) + abs(matrices.M), matrices.M.diagonal())
    K, M = matrices.K[active][:, active], matrices.M[active][:, active]
    most = int(np.count_nonzero(M.diagonal() > 0)) - 1
    wanted = min(count + _RIGID_BODY_MODES, most)
    while wanted > 0:
        frequencies, _, _ = lowest_modes(K, M, wanted)
        elastic = frequencies[frequencies > 0.0][:count]
        if len(elastic) == count or wanted == most:
            return elastic
        wanted = min(2 * wanted, most)
    return np.empty(0)
