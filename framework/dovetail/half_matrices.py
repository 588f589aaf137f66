"""Symmetric matrices of which a file stores one half."""

from __future__ import annotations

from typing import Any

import numpy as np

from dovetail.errors import DovetailError, Fault

_ASYMMETRY = 1e-6
"""Largest difference of two mirrored entries, over the largest entry; printed matrices are rounded."""


def mirror_half(stored: Any, where: str) -> Any:
    """Return a symmetric matrix of which one half is stored, or both.

    Parameters
    ----------
    stored : (d, d) array or scipy.sparse array
    where : str
        The file, for messages.

    Returns
    -------
    scipy.sparse.csr_array

    Raises
    ------
    DovetailError
        The matrix is not square, or the two halves have different entries.
    """
    from scipy.sparse import coo_array, diags_array, tril, triu

    matrix = coo_array(stored).tocsr()  # entries that are stored twice are summed
    if matrix.shape[0] != matrix.shape[1]:
        raise DovetailError(Fault(where, f"the matrix has the shape {matrix.shape}.", "a square one"))
    lower, upper = tril(matrix, -1, format="csr"), triu(matrix, 1, format="csr").T.tocsr()
    common = (abs(lower) > 0).multiply(abs(upper) > 0)
    difference = abs(lower - upper).multiply(common).tocoo()
    largest = abs(matrix).max() if matrix.nnz else 0.0
    if difference.nnz and difference.max() > _ASYMMETRY * largest:
        entry = int(np.argmax(difference.data))
        row, column = int(difference.row[entry]), int(difference.col[entry])
        problem = (
            f"the file says that it is symmetric and stores both halves, which differ: the entry ({row + 1}, "
            f"{column + 1}) is {matrix[row, column]:g}, ({column + 1}, {row + 1}) is {matrix[column, row]:g}."
        )
        raise DovetailError(Fault(where, problem, "one half, or two that are equal"))
    half = lower + upper - upper.multiply(common)
    return half + half.T + diags_array(matrix.diagonal(), format="csr")
