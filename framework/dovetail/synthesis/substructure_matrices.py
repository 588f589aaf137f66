"""The matrices that a substructure gives, checked."""

from __future__ import annotations

from typing import Any

import numpy as np

from dovetail.errors import Fault, PluginError
from dovetail.interfaces import DIRECTIONS, SparseMatrices, StructuralMatrices, SubstructureModel

__all__ = ["substructure_matrices"]

_ASYMMETRY = 1e-8
"""Difference of an entry from its mirror image, over the matrix's largest entry, that rounding may leave."""


def substructure_matrices(substructure: SubstructureModel) -> StructuralMatrices | SparseMatrices | None:
    """Return the matrices of a substructure, or None for one that is known by its FRFs only.

    Raises
    ------
    PluginError
        They are too small for the substructure's nodes, not finite or not symmetric, or no matrices at all.
    """
    matrices = substructure.matrices()
    if matrices is None:
        return None
    where = f"substructure model '{substructure.name}'"
    if not isinstance(matrices, (StructuralMatrices, SparseMatrices)):
        raise PluginError(Fault(where, f"it returns {type(matrices).__name__}.", "StructuralMatrices, SparseMatrices"))
    least = len(DIRECTIONS) * len(substructure.nodes)
    if matrices.K.ndim != 2 or matrices.size < least:
        found = f"its matrices have the shape {matrices.K.shape}, but its {len(substructure.nodes)} nodes need {least}"
        raise PluginError(Fault(where, f"{found} DOFs."))
    for name in ("M", "K", "C", "D"):
        if fault := _fault(name, getattr(matrices, name)):
            raise PluginError(Fault(where, fault))
    return matrices


def _fault(name: str, matrix: Any) -> str:
    values = matrix if isinstance(matrix, np.ndarray) else matrix.data
    if not np.isfinite(values).all():
        return f"its matrix {name} holds values that are not finite."
    if values.size and abs(matrix - matrix.T).max() > _ASYMMETRY * abs(values).max():
        return f"its matrix {name} is not symmetric."
    return ""
