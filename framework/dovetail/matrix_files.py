"""Reading a file with which a finite element program exports a model: the choice of the reader, and halves mirrored."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import numpy as np

from dovetail.atomic_files import read_bounded
from dovetail.errors import DovetailError, Fault, PluginError
from dovetail.interfaces import MatrixReader, RecordedMatrix, RecordedModel, logged
from dovetail.registry import PluginPaths, components
from dovetail.registry.catalogue import find_reader, label_of, make_reader, refusals_reported

_LARGEST_FILE = 1_000_000_000
"""Bytes."""
_ASYMMETRY = 1e-6
"""Largest difference of two mirrored entries, over the largest entry; printed matrices are rounded."""


def read_matrices(
    path: str | os.PathLike[str], *, reader: str | None = None, plugins: PluginPaths = ()
) -> RecordedModel:
    """Read a file with which a finite element program exports a model: matrices, DOFs, coordinates.

    Parameters
    ----------
    path : path
        ``dovetail plugins`` lists the readers, of the kind ``matrix_reader``.
    reader : str, optional
        Name of the reader. By default the one that recognises the format among those that have the suffix.
    plugins : path or iterable of paths
        Plugin files with further readers.

    Returns
    -------
    RecordedModel
        In the units of the file; matrices of which a half was stored are complete.

    Raises
    ------
    DovetailError
        The file is missing, larger than 1 GB, damaged or of no known format, or the two halves of a matrix differ.
    PluginError
        There is no such reader, or its code fails.
    """
    source, registry = Path(path), components(plugins)
    offers = registry.readers("matrix_reader")
    named = None if reader is None else make_reader(registry.find("matrix_reader", reader))
    if named is None and not source.is_dir() and source.suffix.lower() not in offers:
        problem = f"'{source.suffix}' is not the suffix of a file of matrices that is read."
        remedy = "A format of your own needs a plugin (see 'dovetail plugins')."
        raise DovetailError(Fault(str(source), problem, ", ".join(sorted(offers)), remedy))
    with logged(__name__, f"matrices {source} read"):
        content = read_bounded(source, _LARGEST_FILE)
        chosen = named or find_reader(source, content, offers, DovetailError)
        return decode_matrices(source, content, cast("MatrixReader", chosen))


def decode_matrices(path: Path, content: bytes, reader: MatrixReader) -> RecordedModel:
    """Return what a reader returns for a file, with halves mirrored.

    Raises
    ------
    DovetailError
        The reader refuses the file, or two halves of a matrix differ.
    PluginError
        Its code fails, or it returns something else.
    """
    with refusals_reported(path, reader, DovetailError):
        model = reader.read(path, content)
        if not isinstance(model, RecordedModel):
            raise PluginError(Fault(label_of(reader), f"read returned {model!r:.60}.", "a dovetail.RecordedModel"))
    whole = {name: _completed(name, matrix, path) for name, matrix in model.matrices.items()}
    return replace(model, matrices=whole)


def _completed(name: str, matrix: RecordedMatrix, path: Path) -> RecordedMatrix:
    """Return a matrix with both halves."""
    if not matrix.is_half:
        return matrix
    return replace(matrix, values=mirror_half(matrix.values, f"{path}  {name}"), is_half=False)


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
