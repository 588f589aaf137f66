"""FRFs in the columns of one matrix, alone in a file or as an entry of an archive."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.errors import Fault, MeasurementError, listing
from dovetail.interfaces import RecordedArrays
from dovetail.measurement.content.tables import SAY_COLUMNS, check_columns, read_header, recording_of
from dovetail.measurement.free_text import FreeText
from dovetail.measurement.recording import ReadOptions, Recording


def find_matrix(archive: RecordedArrays, options: ReadOptions) -> str | None:
    """Return the name of the matrix whose columns are the FRF, or None if the FRF is in several arrays.

    It is the only array of the file, or that with as many columns as the caller names; ``values`` in the caller's names
    chooses between several.

    Raises
    ------
    MeasurementError
        No such matrix, or several.
    """
    entries = archive.entries
    if not options.columns:
        arrays = [name for name in entries if entries[name].what != "text"]
        if len(arrays) != 1 or (array := entries[arrays[0]].load()).ndim != 2 or min(array.shape) < 2:
            return None
        return arrays[0]
    if set(options.names) - {"values"}:
        raise MeasurementError(Fault("the argument names", "the argument columns names the columns already."))
    wanted = options.names.get("values")
    if wanted is not None and wanted in entries:
        return wanted
    count = len(options.columns)
    shapes = {name: entries[name].load().shape for name in entries if entries[name].what != "text"}
    fitting = [name for name, shape in shapes.items() if len(shape) == 2 and count in shape and min(shape) > 1]
    if len(fitting) != 1:
        held = listing(f"{name} {shape}" for name, shape in shapes.items())
        problem = f"{len(fitting)} arrays have {count} columns; the file holds {held}."
        remedy = "Name each column of it; `names={'values': 'NAME'}` chooses one of several arrays."
        raise MeasurementError(Fault(str(archive.path), problem, ",".join(options.columns), remedy))
    return fitting[0]


def columns_of_array(
    path: Path, array: NDArray[Any], options: ReadOptions, shown: str, free_text: FreeText | None = None
) -> Recording:
    """Return the FRF of an array of (n_freq, n_columns) numbers, or of its transpose.

    Parameters
    ----------
    path : Path
    array : array
    options : ReadOptions
    shown : str
        What the array is called in messages.
    free_text : FreeText, optional
        What the file states besides.

    Raises
    ------
    MeasurementError
        Columns that are not named, or that do not fit the names.
    """
    has_two = array.ndim == 2 and 2 in array.shape and array.dtype.kind == "c"
    columns = options.columns or (("frequency", "values") if has_two else ())
    if array.ndim != 2 or array.dtype.kind not in "fiuc":
        problem = f"{shown} has the shape {array.shape} and the type {array.dtype}, and no frequencies."
        remedy = "Save them too: np.savez('frf.npz', frequency=frequency, values=values)."
        raise MeasurementError(Fault(str(path), problem, "columns of numbers, or a structured array", remedy))
    if not columns:
        problem = f"{shown} has the shape {array.shape}, and its columns have no names."
        raise MeasurementError(Fault(str(path), problem, remedy=SAY_COLUMNS))
    if len(columns) not in array.shape:
        problem = f"{shown} has the shape {array.shape}, and {len(columns)} columns are named."
        raise MeasurementError(Fault(str(path), problem, ",".join(columns)))
    table = array if array.shape[1] == len(columns) else array.T
    wanted = check_columns(ReadOptions(columns=tuple(columns)))
    header = read_header("the argument columns", columns, (), {}, {})
    for column in wanted:
        if column != header.columns.get("values") and np.any(np.imag(table[:, column])):
            raise MeasurementError(Fault(str(path), f"the column {columns[column]} is complex.", "real numbers"))
    if not len(table):
        raise MeasurementError(Fault(str(path), f"{shown} is empty."))
    arrays = {name: table[:, column].astype(np.complex128) for name, column in header.columns.items()}
    return recording_of(path, header, arrays, lambda index: f"{path}  line {index + 1} of the array", free_text)
