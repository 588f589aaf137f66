"""Square matrices from NPZ, MAT and Matrix Market files, whose contents are not trusted."""

from __future__ import annotations

import io
import math
import re
import zipfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from dovetail import DovetailError, Fault, call_guarded, mirror_half, read_bounded

_LARGEST_FILE = 1_000_000_000
"""Largest size in bytes of a file, and of the unpacked contents of an archive."""
_ALWAYS_UNPACKED, _MOST_TIMES = 100_000_000, 20
"""Unpacked bytes that are always accepted, and largest ratio to the archive's size; sparse matrices need 3 to 8."""
_MOST_ARRAYS = 1000
"""Entries of an archive; a part has some twenty."""
_ENTRY = b"PK\x01\x02"
"""First bytes of each entry in the directory; counted, since the number at the end of the archive may be wrong."""
_LARGEST_DENSE = 3_000
"""Largest number of DOFs of a full matrix: 72 MB."""
_LARGEST_ENTRY = 1e100
"""In SI; sums and products of entries up to it are finite."""
_MOST_DOFS = 2_000_000
"""Of a sparse matrix, which bounds the memory."""
_ASYMMETRY = 1e-6
"""Largest difference of two mirrored entries, over the largest entry; printed matrices are rounded."""
_FORMATS = "NPZ (.npz), MATLAB to version 7 (.mat) or, one for each matrix, Matrix Market (.mtx)"


def read_archive(path: Path) -> dict[str, Any]:
    """Return the contents of an NPZ or MAT file by name; Python objects are never loaded.

    Raises
    ------
    DovetailError
        The file is missing, too large, of another kind or damaged.
    """
    content = read_bounded(path, _LARGEST_FILE)
    if path.suffix.lower() not in (".npz", ".mat"):
        raise DovetailError(Fault(str(path), f"'{path.suffix}' is not the ending of an archive of matrices.", _FORMATS))
    return archive_arrays(path, content)


def archive_arrays(path: Path, content: bytes) -> dict[str, Any]:
    """Return the contents of an NPZ or MAT file by name, from its bytes.

    Raises
    ------
    DovetailError
        It is damaged.
    """
    if path.suffix.lower() == ".mat":
        return call_guarded(matlab_arrays, path, content, memory=_memory(content))
    with _report_damage(path):
        return _read_npz(path, content)


def matrix_market(path: Path, content: bytes) -> Any:
    """Return the matrix in a Matrix Market file, from its bytes.

    Raises
    ------
    DovetailError
        It is not of real numbers, or damaged.
    """
    parts = call_guarded(matrix_market_parts, path, content, memory=_memory(content))
    return matrix_in(parts, "matrix", str(path))


def matlab_arrays(path: Path, content: bytes) -> dict[str, Any]:
    """Return the variables of a workspace that are numbers or texts; only for the guarded process."""
    from scipy.io import loadmat
    from scipy.sparse import issparse

    with _report_damage(path):
        try:
            variables = loadmat(io.BytesIO(content))
        except NotImplementedError:
            problem = "the file has MATLAB's format 7.3, which is not read."
            raise DovetailError(Fault(str(path), problem, _FORMATS, "Save it with the option '-v7'.")) from None
    arrays: dict[str, Any] = {}
    for name, value in variables.items():
        if issparse(value):
            arrays |= _parts(name, value, str(path))
        elif isinstance(value, np.ndarray) and value.dtype.kind in "biufcU":
            arrays[name] = value
        elif isinstance(value, np.ndarray) and value.dtype.kind == "O":
            arrays[name] = np.array([_text(cell) for cell in value.ravel()])
    return arrays


def matrix_market_parts(path: Path, content: bytes) -> dict[str, Any]:
    """Return the matrix in a Matrix Market file, full or as sparse arrays; only for the guarded process."""
    from scipy.io import mminfo, mmread

    with _report_damage(path):
        rows, columns, entries, layout, field, symmetry = mminfo(io.BytesIO(content))
        if field not in ("real", "double", "integer", "unsigned-integer"):
            raise DovetailError(Fault(str(path), f"the file has {field} entries.", "real numbers"))
        most = _LARGEST_DENSE if layout == "array" else _MOST_DOFS
        if 2 * entries > len(content) or max(rows, columns) > most:
            problem = f"the file announces {entries} entries of a {rows} x {columns} matrix, which is too many."
            raise DovetailError(Fault(str(path), problem))
        if layout == "coordinate" and symmetry == "symmetric":
            return _parts("matrix", mirror_half(mmread(io.BytesIO(_as_general(content))), str(path)), str(path))
        matrix = mmread(io.BytesIO(content))
        return {"matrix": matrix} if layout == "array" else _parts("matrix", matrix, str(path))


def _as_general(content: bytes) -> bytes:
    """Return a symmetric Matrix Market file as a general one, so that its entries are read as they are stored."""
    header, rest = content.split(b"\n", 1)
    return re.sub(rb"symmetric", b"general", header, flags=re.IGNORECASE) + b"\n" + rest


def _parts(name: str, matrix: Any, where: str) -> dict[str, Any]:
    if matrix.shape[0] != matrix.shape[1]:
        raise DovetailError(Fault(where, f"the matrix {name} has the shape {matrix.shape}.", "a square one"))
    columns = matrix.tocsc()
    return {f"{name}_{part}": getattr(columns, part) for part in ("data", "indices", "indptr")}


def _text(cell: Any) -> str:
    """Return the text or the number in a MATLAB cell as a text, empty if it contains anything else."""
    value = np.asarray(cell).ravel()
    if value.size != 1 or value.dtype.kind not in "biufU":
        return ""
    return str(int(value[0])) if value.dtype.kind == "f" and float(value[0]).is_integer() else str(value[0])


@contextmanager
def _report_damage(path: Path) -> Iterator[None]:
    try:
        yield
    except DovetailError:
        raise
    except Exception as error:  # zipfile, zlib and scipy each raise their own on a damaged file
        reason = str(error)[:120] or type(error).__name__
        raise DovetailError(Fault(str(path), f"the file cannot be read: {reason.rstrip('.')}.", _FORMATS)) from None


def matrix_in(archive: Mapping[str, Any], name: str, where: str) -> Any:
    """Return the matrix of this name, full or from the arrays of compressed rows or columns; None if it is missing.

    Raises
    ------
    DovetailError
        These arrays are inconsistent.
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
        problem = f"the parts of the sparse matrix {name} are inconsistent: {str(error)[:120].rstrip('.')}."
        raise DovetailError(
            Fault(where, problem, "data, indices and indptr of scipy's csr_array or csc_array")
        ) from None
    return matrix


def sound_matrix(name: str, values: Any, where: str) -> Any:
    """Return a matrix as compressed columns of finite real numbers, square and exactly symmetric.

    Raises
    ------
    DovetailError
        It is not square, not symmetric, too large for a full matrix, or its entries are not finite real numbers.
    """
    from scipy.sparse import csc_array, issparse

    matrix = values if issparse(values) else np.asarray(values)
    if matrix.ndim != 2 or matrix.shape[0] != matrix.shape[1] or not matrix.shape[0]:
        raise DovetailError(Fault(where, f"the matrix {name} has the shape {matrix.shape}.", "a square one"))
    if not issparse(matrix) and matrix.shape[0] > _LARGEST_DENSE:
        raise DovetailError(Fault(where, f"the matrix {name} has {matrix.shape[0]} DOFs in full.", "a sparse one"))
    if matrix.dtype.kind not in "fiu":
        raise DovetailError(Fault(where, f"the matrix {name} has {matrix.dtype} entries.", "real numbers"))
    columns = csc_array(matrix, dtype=np.float64)
    columns.sum_duplicates()
    bad = np.flatnonzero(~(np.abs(columns.data) <= _LARGEST_ENTRY))
    if len(bad):
        row, column = _place(columns, int(bad[0]))
        accepted = f"finite numbers up to {_LARGEST_ENTRY:g}"
        raise DovetailError(Fault(where, f"the entry ({row}, {column}) of {name} is {columns.data[bad[0]]}.", accepted))
    difference = abs(columns - columns.T).tocsc()
    if difference.nnz and difference.max() > _ASYMMETRY * abs(columns).max():
        row, column = _place(difference, int(np.argmax(difference.data)))
        problem = (
            f"the matrix {name} is not symmetric: its entry ({row}, {column}) is {columns[row - 1, column - 1]:g}, "
        )
        problem += f"({column}, {row}) is {columns[column - 1, row - 1]:g}."
        raise DovetailError(Fault(where, problem, remedy="Mirror a triangular matrix before you write it."))
    return csc_array(0.5 * (columns + columns.T))


def _place(matrix: Any, index: int) -> tuple[int, int]:
    """Return row and column, from 1, of a stored entry in compressed columns."""
    return int(matrix.indices[index]) + 1, int(np.searchsorted(matrix.indptr, index, side="right"))


def _memory(content: bytes) -> int:
    """Return the memory that a reader may use: that of the libraries, and a multiple of the size of the file."""
    return (3 << 29) + 16 * len(content)


def _read_npz(path: Path, content: bytes) -> dict[str, Any]:
    """Return the arrays of an archive; their sizes are checked before anything is unpacked."""
    from dovetail_plugins.arrays import holds_impossible_characters  # not where the guarded process imports this module

    if content.count(_ENTRY) > _MOST_ARRAYS:
        raise DovetailError(Fault(str(path), f"the archive has more than {_MOST_ARRAYS} entries."))
    arrays = {}
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        unpacked = sum(member.file_size for member in archive.infolist())
        if unpacked > min(_LARGEST_FILE, max(_ALWAYS_UNPACKED, _MOST_TIMES * len(content))):
            problem = f"the archive of {len(content) / 1e6:.1f} MB unpacks to {unpacked / 1e6:.0f} MB."
            accepted = (
                f"{_ALWAYS_UNPACKED / 1e6:.0f} MB, or {_MOST_TIMES} times its own size to {_LARGEST_FILE / 1e9:.0f} GB"
            )
            raise DovetailError(Fault(str(path), problem, accepted, "Write large matrices as sparse ones."))
        for member in archive.infolist():
            with archive.open(member) as stream:
                readers = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}
                shape, _, dtype = readers[np.lib.format.read_magic(stream)](stream)
            if math.prod(shape) * dtype.itemsize > member.file_size or dtype.hasobject:
                raise ValueError(
                    f"'{member.filename}' contains Python objects, or less data than its shape {shape} says"
                )
            with archive.open(member) as stream:
                array = np.lib.format.read_array(stream, allow_pickle=False)
            if holds_impossible_characters(array):
                raise ValueError(f"a text of '{member.filename}' has a value that is not the code of a character")
            arrays[member.filename.removesuffix(".npy")] = array
    return arrays
