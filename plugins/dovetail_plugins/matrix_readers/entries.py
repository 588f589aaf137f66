"""Sparse matrices from entries between named DOFs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail import Direction

DIRECTIONS_1_TO_6: dict[Direction, str] = {"x": "1", "y": "2", "z": "3", "rx": "4", "ry": "5", "rz": "6"}
"""Words for the directions in NASTRAN and Abaqus."""


def matrix_of_entries(
    rows: NDArray[np.intp], columns: NDArray[np.intp], values: NDArray[np.float64], labels: Sequence[str]
) -> Any:
    """Return the sparse matrix of entries, none of which may be given twice.

    Parameters
    ----------
    rows, columns : (n,) arrays
        From 0.
    values : (n,) array
    labels : sequence of str
        Of the rows, for messages.

    Raises
    ------
    ValueError
        An entry is given twice.
    """
    from scipy.sparse import coo_array

    size = len(labels)
    keys = rows.astype(np.int64) * size + columns
    order = np.argsort(keys, kind="stable")
    repeated = np.flatnonzero(np.diff(keys[order]) == 0)
    if repeated.size:
        entry = int(order[repeated[0] + 1])
        between = f"between {labels[rows[entry]]} and {labels[columns[entry]]}"
        raise ValueError(f"the entry {between} is given twice: {_both(values, order, int(repeated[0]))}.")
    return coo_array((values, (rows, columns)), shape=(size, size))


def _both(values: NDArray[np.float64], order: NDArray[np.intp], place: int) -> str:
    return f"{values[order[place]]:g} and {values[order[place + 1]]:g}"


def whole_numbers(values: NDArray[np.float64], what: str) -> NDArray[np.int64]:
    """Return numbers of a text as integers.

    Raises
    ------
    ValueError
        One is not a whole number.
    """
    bad = np.flatnonzero(~(np.abs(values) < 2**53) | (values != np.round(values)))
    if bad.size:
        raise ValueError(f"{what} {values[bad[0]]:g} is not a whole number.")
    return np.asarray(values.astype(np.int64))


def sparse_parts(parts: Mapping[str, Any], name: str, size: int) -> Any:
    """Return a sparse matrix (size, size) from the arrays with which a guarded process returns it."""
    from scipy.sparse import coo_array

    data, row, column = (parts[f"{name} {part}"] for part in ("data", "row", "column"))
    return coo_array((data, (row, column)), shape=(size, size))
