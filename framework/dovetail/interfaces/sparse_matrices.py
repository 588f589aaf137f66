"""Structural matrices of a large substructure, sparse."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy  # loads a part of it when that is first used

from dovetail.interfaces.matrices import refuse_complex

__all__ = ["SparseMatrices"]


@dataclass(frozen=True, eq=False, init=False)
class SparseMatrices:
    """Sparse matrices of the dynamic stiffness Z = K + iD + i omega C - omega^2 M of one substructure.

    Parameters
    ----------
    M, K, C, D : (d, d) scipy sparse arrays or matrices, or arrays
        As in `StructuralMatrices`; stored as csc_array of float64. `C` and `D` are zero by default.

    Raises
    ------
    ValueError
        The matrices are complex or not square, or their shapes differ.
    """

    M: scipy.sparse.csc_array
    K: scipy.sparse.csc_array
    C: scipy.sparse.csc_array
    D: scipy.sparse.csc_array

    def __init__(self, M: Any, K: Any, C: Any = None, D: Any = None) -> None:
        for name, values in (("M", M), ("K", K), ("C", C), ("D", D)):
            refuse_complex(name, values)
        stiffness = scipy.sparse.csc_array(K, dtype=np.float64)
        if stiffness.shape[0] != stiffness.shape[1]:
            raise ValueError(f"K has the shape {stiffness.shape}; a square matrix (d, d) is expected.")
        for name, values in (("M", M), ("K", stiffness), ("C", C), ("D", D)):
            matrix = scipy.sparse.csc_array(stiffness.shape if values is None else values, dtype=np.float64)
            if matrix.shape != stiffness.shape:
                raise ValueError(f"{name} has the shape {matrix.shape}, but K has {stiffness.shape}.")
            object.__setattr__(self, name, matrix)

    @property
    def size(self) -> int:
        """Number of DOFs."""
        return int(self.K.shape[0])

    def dynamic_stiffness(self, frequency: float) -> scipy.sparse.csc_array:
        """Return the (d, d) complex sparse array Z at one frequency [Hz]."""
        omega = 2.0 * np.pi * frequency
        return (self.K - omega**2 * self.M) + 1j * (self.D + omega * self.C)
