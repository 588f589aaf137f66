"""Tables that assign the rows of a matrix to nodes and directions."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail import DofTable, DovetailError, Fault, read_bounded
from dovetail_plugins.substructures.spreadsheets import csv_rows, plain_number

TABLE_ARRAYS = {"nodes": "node", "directions": "direction", "positions": "position", "rows": "row"}
"""Arrays of a table in an archive, and the corresponding columns of a CSV file."""
_COORDINATES = ("point_x", "point_y", "point_z")
"""Columns, and arrays, of the coordinates of a node in space."""
_COLUMNS = (*TABLE_ARRAYS.values(), *_COORDINATES)
_EXAMPLE = "a first line 'node,direction' (and 'position', 'row'), then a line for each DOF"
_LARGEST_FILE = 100_000_000
"""Bytes."""


def read_dof_table(path: Path, size: int) -> DofTable:
    """Read a table from a CSV file with the columns node, direction and, optionally, position and row (from 1).

    A table of nodes in space has the columns point_x, point_y and point_z.

    Parameters
    ----------
    path : Path
    size : int
        Rows of the matrices.

    Raises
    ------
    DovetailError
        The file cannot be read, or the table does not fit the matrices.
    """
    content = read_bounded(path, _LARGEST_FILE)
    try:
        lines = csv_rows(content)
    except (UnicodeDecodeError, csv.Error) as error:
        raise DovetailError(Fault(str(path), f"this is not a table of DOFs: {error}.", _EXAMPLE)) from None
    header = [cell.lower() for cell in lines[0]] if lines else []
    if not {"node", "direction"} <= set(header) or not set(header) <= set(_COLUMNS) or len(lines) < 2:
        problem = f"the first line is '{','.join(lines[0])[:80]}'." if len(lines) > 1 else "the table has no DOFs."
        raise DovetailError(Fault(str(path), problem, _EXAMPLE))
    if twice := sorted({name for name in header if header.count(name) > 1}):
        raise DovetailError(Fault(str(path), f"the first line has '{twice[0]}' twice.", _EXAMPLE))
    for number, line in enumerate(lines):
        if len(line) != len(header):
            raise DovetailError(Fault(f"{path}:{number + 1}", f"the line has {len(line)} cells, not {len(header)}."))
    columns = {name: [line[index] for line in lines[1:]] for index, name in enumerate(header)}
    return _table(columns, str(path), size)


def table_in(archive: Mapping[str, Any], where: str, size: int) -> DofTable | None:
    """Return the table in an archive: arrays 'nodes', 'directions' and, optionally, 'positions' and 'rows' (from 1).

    Nodes in space have the arrays point_x, point_y and point_z.

    Raises
    ------
    DovetailError
        The table does not fit the matrices.
    """
    known = {**TABLE_ARRAYS, **{name: name for name in _COORDINATES}}
    columns = {column: _cells(archive[name]) for name, column in known.items() if name in archive}
    if not {"node", "direction"} & set(columns):
        return None
    for name, column in list(TABLE_ARRAYS.items())[:2]:
        if column not in columns:
            raise DovetailError(Fault(where, f"there is no '{name}', which the table of DOFs needs."))
    lengths = {name: len(columns[column]) for name, column in known.items() if column in columns}
    if len(set(lengths.values())) > 1:
        listed = ", ".join(f"{name} {length}" for name, length in lengths.items())
        raise DovetailError(Fault(where, f"the columns of the table of DOFs differ in length: {listed}."))
    return _table(columns, where, size)


def _table(columns: Mapping[str, Sequence[str]], where: str, size: int) -> DofTable:
    count = len(columns["node"])
    if "row" in columns:
        numbers = _numbers(columns["row"], "row", where)
        if np.any(numbers != np.round(numbers)) or np.any(np.abs(numbers) > 2**53):  # beyond, integers are not exact
            raise DovetailError(
                Fault(where, "a row number in the table of DOFs is not a whole number.", "1, 2, 3, ...")
            )
        rows = numbers.astype(np.intp) - 1
    elif count == size:
        rows = np.arange(size)
    else:
        problem = f"the table has {count} DOFs, the matrices have {size} rows."
        raise DovetailError(Fault(where, problem, "all DOFs in the order of the rows, or some with a column 'row'"))
    positions = _numbers(columns["position"], "position", where) if "position" in columns else None
    points = None
    if given := [name for name in _COORDINATES if name in columns]:
        if len(given) < len(_COORDINATES):
            problem = f"the table has {', '.join(given)} alone."
            raise DovetailError(Fault(where, problem, ", ".join(_COORDINATES)))
        if positions is not None:
            problem = "the table has positions along a line, and points in space."
            accepted = f"either the positions or {', '.join(_COORDINATES)}"
            raise DovetailError(Fault(where, problem, accepted, "Remove those that do not belong to the part."))
        points = np.stack([_numbers(columns[name], name, where) for name in _COORDINATES], axis=1)
    nodes, directions = tuple(columns["node"]), tuple(columns["direction"])
    return DofTable(nodes, directions, rows, positions, where, points).checked(size)


def _numbers(cells: Sequence[str], name: str, where: str) -> NDArray[np.float64]:
    numbers = []
    for index, cell in enumerate(cells):
        try:
            numbers.append(plain_number(cell))
        except ValueError:
            raise DovetailError(
                Fault(f"{where}  DOF {index + 1}", f"the {name} '{cell[:40]}' is not a number.")
            ) from None
    return np.array(numbers)


def _cells(array: Any) -> list[str]:
    """Return the entries of an array of texts or numbers, or of a MATLAB cell array, as texts."""
    cells = []
    for entry in np.asarray(array).ravel():
        while isinstance(entry, np.ndarray):
            entry = entry.ravel()[0] if entry.size else ""
        number = isinstance(entry, (float, np.floating)) and float(entry).is_integer()
        cells.append(str(int(entry)) if number else str(entry).strip())
    return cells
