"""The zero-thickness contact layer: springs and dampers between pairs of nodes that face each other."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from dovetail import StructuralMatrices

__all__ = ["add_contact_layer"]


def add_contact_layer(
    matrices: StructuralMatrices,
    pairs: Sequence[tuple[int, int]],
    stiffness: NDArray[np.float64],
    damping: NDArray[np.float64],
) -> None:
    """Add a spring and a damper between each pair of DOFs, in place.

    Parameters
    ----------
    matrices : StructuralMatrices
        Of (n, d, d) arrays, changed in place.
    pairs : sequence of (int, int)
        Local DOFs that face each other.
    stiffness, damping : (n,) arrays
        Of each single spring and damper [N/m and N s/m, or N m/rad and N m s/rad].
    """
    for matrix, value in ((matrices.K, stiffness), (matrices.C, damping)):
        for first, second in pairs:
            matrix[:, first, first] += value
            matrix[:, second, second] += value
            matrix[:, first, second] -= value
            matrix[:, second, first] -= value
