"""Checks of the input arrays of reducers and regressors, of the arrays in their states, and of those in files."""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dovetail import ComponentState, DovetailError, Fault


def checked_rows(values: ArrayLike, owner: str, *, width: int | None = None) -> NDArray[Any]:
    """Return `values` as a finite two-dimensional array in C order.

    Parameters
    ----------
    values : (n_samples, n_columns) array_like
    owner : str
        Name of the component, for messages.
    width : int, optional
        Required number of columns.

    Raises
    ------
    DovetailError
        It is not a table of numbers, has no rows, another width, or a value that is not finite.
    """
    rows = np.asarray(values, order="C")  # the order of a sum, and with it the last bits, depends on the layout
    wanted = f"(n_samples, {'n_columns' if width is None else width})"
    if rows.ndim != 2 or rows.dtype.kind not in "fiu" or 0 in rows.shape:
        raise DovetailError(Fault(owner, f"it was given an array of {rows.dtype} with shape {rows.shape}.", wanted))
    if width is not None and rows.shape[1] != width:
        raise DovetailError(Fault(owner, f"it was given {rows.shape[1]} columns, but was fitted to {width}.", wanted))
    finite = np.isfinite(rows.sum(axis=1, dtype=np.float64))
    if not finite.all():
        row = int(np.argmin(finite))
        column = int(np.argmin(np.isfinite(rows[row])))
        problem = f"row {row}, column {column} is {rows[row, column]}, which is not finite."
        raise DovetailError(Fault(owner, problem, "finite numbers only"))
    return rows


def state_array(state: ComponentState, key: str, owner: str, shape: tuple[int | None, ...]) -> NDArray[Any]:
    """Return the finite array `key` of a state.

    Parameters
    ----------
    state : mapping
    key : str
    owner : str
        Name of the component, for messages.
    shape : tuple of int or None
        Required shape; None allows any length.

    Raises
    ------
    DovetailError
        It is missing, has another shape, or a value that is not finite.
    """
    value = np.asarray(state.get(key))
    fits = value.ndim == len(shape) and all(want in (None, got) for want, got in zip(shape, value.shape, strict=True))
    if value.dtype.kind not in "fiu" or not fits:
        problem = f"its state has '{key}' as {value.dtype} with shape {value.shape}." if key in state else ""
        wanted = ", ".join("any" if length is None else str(length) for length in shape)
        raise DovetailError(Fault(owner, problem or f"its state lacks '{key}'.", f"an array of shape ({wanted})"))
    if not np.isfinite(value).all():
        raise DovetailError(Fault(owner, f"its state has values in '{key}' that are not finite."))
    return value


def state_number(state: ComponentState, key: str, owner: str) -> float:
    """Return the finite number `key` of a state.

    Raises
    ------
    DovetailError
        It is missing or not a finite number.
    """
    return float(state_array(state, key, owner, ()))


def holds_impossible_characters(array: NDArray[Any]) -> bool:
    """Return whether a text in an array holds numbers that are not characters: NumPy takes them from a file as is."""
    if array.dtype.kind != "U" or not array.itemsize:
        return False
    native = np.ascontiguousarray(array.astype(array.dtype.newbyteorder("=")))
    return bool(np.any(native.reshape(-1).view(np.uint32) > sys.maxunicode))
