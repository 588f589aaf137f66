"""Square matrices from NPZ, MAT and Matrix Market files, read without trust in what they hold."""

from __future__ import annotations

import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from dovetail import DovetailError, Fault

__all__ = ["matrix_in", "read_archive", "read_matrix_market", "sound_matrix"]

_LARGEST_FILE = 2_000_000_000
"""Bytes of a file, and of what an archive unpacks to."""
_LARGEST_DENSE = 10_000
"""DOFs from which a full matrix is refused: 0.8 GB."""
_ASYMMETRY = 1e-6
"""Difference of an entry from its mirror image, over the largest entry, that a printed matrix may have."""
_FORMATS = "NPZ (.npz), MATLAB to version 7 (.mat) or, one for each matrix, Matrix Market (.mtx)"


def read_archive(path: Path) -> dict[str, Any]:
    """Return everything in an NPZ or MAT file by its name; Python objects are never loaded.

    Raises
    ------
    DovetailError
        The file is missing, too large, of another kind or damaged.
    """
    _check_file(path)
    readers = {".npz": _read_npz, ".mat": _read_mat}
    if path.suffix.lower() not in readers:
        raise DovetailError(Fault(str(path), f"'{path.suffix}' is not the ending of an archive of matrices.", _FORMATS))
    try:
        return readers[path.suffix.lower()](path)
    except DovetailError:
        raise
    except Exception as error:  # zipfile, zlib and scipy each raise their own on a damaged file
        reason = str(error)[:120] or type(error).__name__
        raise DovetailError(Fault(str(path), f"the file cannot be read: {reason.rstrip('.')}.", _FORMATS)) from None


def read_matrix_market(path: Path) -> Any:
    """Return the matrix in a Matrix Market file.

    Raises
    ------
    DovetailError
        The file is missing, too large, not of real numbers, or damaged.
    """
    from scipy.io import mminfo, mmread

    _check_file(path)
    if path.suffix.lower() != ".mtx":
        raise DovetailError(Fault(str(path), "this is not a Matrix Market file.", "a name that ends in .mtx"))
    try:
        rows, columns, entries, layout, field, _ = mminfo(path)
        if field not in ("real", "double", "integer", "unsigned-integer"):
            raise DovetailError(Fault(str(path), f"the file holds {field} entries.", "real numbers"))
        if 2 * entries > path.stat().st_size or (layout == "array" and max(rows, columns) > _LARGEST_DENSE):
            problem = (
                f"the file announces {entries} entries of a {rows} x {columns} matrix, more than it holds or may hold."
            )
            raise DovetailError(Fault(str(path), problem))
        return mmread(path)
    except DovetailError:
        raise
    except Exception as error:  # the parser raises ValueError, OverflowError and others
        reason = (str(error) or type(error).__name__)[:120].rstrip(".")
        raise DovetailError(Fault(str(path), f"the file cannot be read: {reason}.", "Matrix Market")) from None


def matrix_in(archive: Mapping[str, Any], name: str, where: str) -> Any:
    """Return the matrix of this name, full or in the parts of compressed rows or columns; None where it is missing.

    Raises
    ------
    DovetailError
        Its parts do not fit together.
    """
    from scipy.sparse import csc_array

    if name in archive:
        return archive[name]
    keys = [f"{name}_{array}" for array in ("data", "indices", "indptr")]
    if not any(key in archive for key in keys):
        return None
    missing = [key for key in keys if key not in archive]
    if missing:
        raise DovetailError(Fault(where, f"the sparse matrix {name} lacks '{missing[0]}'.", ", ".join(keys)))
    data, indices, indptr = (np.asarray(archive[key]) for key in keys)
    try:
        size = len(indptr) - 1
        matrix = csc_array((data, indices, indptr), shape=(size, size))
        matrix.check_format(full_check=True)
    except Exception as error:
        problem = f"the parts of the sparse matrix {name} do not fit together: {str(error)[:120].rstrip('.')}."
        raise DovetailError(
            Fault(where, problem, "data, indices and indptr of scipy's csr_array or csc_array")
        ) from None
    return matrix


def sound_matrix(name: str, values: Any, where: str) -> Any:
    """Return a matrix as compressed columns of finite real numbers, square and exactly symmetric.

    Raises
    ------
    DovetailError
        It is not square, not symmetric, too large to be full, or its entries are not finite real numbers.
    """
    from scipy.sparse import csc_array, issparse

    matrix = values if issparse(values) else np.asarray(values)
    if matrix.ndim != 2 or matrix.shape[0] != matrix.shape[1] or not matrix.shape[0]:
        raise DovetailError(Fault(where, f"the matrix {name} has the shape {matrix.shape}.", "a square one"))
    if not issparse(matrix) and matrix.shape[0] > _LARGEST_DENSE:
        raise DovetailError(Fault(where, f"the matrix {name} has {matrix.shape[0]} DOFs in full.", "a sparse one"))
    if matrix.dtype.kind not in "fiu":
        raise DovetailError(Fault(where, f"the matrix {name} holds {matrix.dtype} entries.", "real numbers"))
    columns = csc_array(matrix, dtype=np.float64)
    columns.sum_duplicates()
    bad = np.flatnonzero(~np.isfinite(columns.data))
    if len(bad):
        row, column = _place(columns, int(bad[0]))
        raise DovetailError(Fault(where, f"the entry ({row}, {column}) of {name} is {columns.data[bad[0]]}."))
    difference = abs(columns - columns.T).tocsc()
    if difference.nnz and difference.max() > _ASYMMETRY * abs(columns).max():
        row, column = _place(difference, int(np.argmax(difference.data)))
        problem = (
            f"the matrix {name} is not symmetric: its entry ({row}, {column}) is {columns[row - 1, column - 1]:g}, "
        )
        problem += f"({column}, {row}) is {columns[column - 1, row - 1]:g}."
        raise DovetailError(Fault(where, problem, remedy="A triangle alone must be mirrored before it is written."))
    return csc_array(0.5 * (columns + columns.T))


def _place(matrix: Any, index: int) -> tuple[int, int]:
    """Return row and column, from 1, of a stored entry of compressed columns."""
    return int(matrix.indices[index]) + 1, int(np.searchsorted(matrix.indptr, index, side="right"))


def _check_file(path: Path) -> None:
    try:
        size = path.stat().st_size
    except OSError:
        raise DovetailError(Fault(str(path), "there is no such file.")) from None
    if not path.is_file():
        raise DovetailError(Fault(str(path), "this is not a file."))
    if size > _LARGEST_FILE:
        raise DovetailError(Fault(str(path), f"the file has {size / 1e9:.1f} GB.", f"{_LARGEST_FILE / 1e9:.0f} GB"))


def _read_npz(path: Path) -> dict[str, Any]:
    with zipfile.ZipFile(path) as members:
        unpacked = sum(member.file_size for member in members.infolist())
    if unpacked > _LARGEST_FILE:
        problem = f"the archive unpacks to {unpacked / 1e9:.1f} GB."
        raise DovetailError(Fault(str(path), problem, f"{_LARGEST_FILE / 1e9:.0f} GB"))
    with np.load(path, allow_pickle=False) as archive:
        return {name: archive[name] for name in archive.files}


def _read_mat(path: Path) -> dict[str, Any]:
    from scipy.io import loadmat

    try:
        return {name: value for name, value in loadmat(path).items() if not name.startswith("__")}
    except NotImplementedError:
        problem = "the file has MATLAB's format 7.3, which is not read."
        raise DovetailError(Fault(str(path), problem, _FORMATS, "Save it with the option '-v7'.")) from None
