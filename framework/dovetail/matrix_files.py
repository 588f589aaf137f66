"""Reading a file with which a finite element program exports a model: the choice of the reader, and halves mirrored."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from typing import cast

from dovetail.atomic_files import read_bounded
from dovetail.errors import DovetailError, Fault, PluginError
from dovetail.half_matrices import mirror_half
from dovetail.interfaces import MatrixReader, RecordedMatrix, RecordedModel, logged
from dovetail.registry import PluginPaths, components
from dovetail.registry.catalogue import find_reader, label_of, make_reader, refusals_reported

_LARGEST_FILE = 1_000_000_000
"""Bytes."""


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
