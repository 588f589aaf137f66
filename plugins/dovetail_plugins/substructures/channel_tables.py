"""Tables of channels and impacts, as pyFBS has them: name, quantity, group, position and direction of each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from dovetail import DovetailError, Fault, MeasuredDofs
from dovetail_plugins.substructures.spreadsheets import plain_number, read_rows

_POSITION = tuple(f"position_{number}" for number in (1, 2, 3))
_DIRECTION = tuple(f"direction_{number}" for number in (1, 2, 3))
_REQUIRED = ("name", "quantity", *_POSITION, *_DIRECTION)
_OPTIONAL = ("grouping", "weight", "description")
_EXAMPLE = "a first line 'Name,Quantity,Grouping,Position_1,Position_2,Position_3,Direction_1,Direction_2,Direction_3'"
_HARMLESS = ("", "index", "no", "nr", "number", "id", "serial", "serial_number", "comment", "note", "remark", "color")
"""Names of columns that do not change what the numbers mean; pandas writes its index as `Unnamed: 0`."""
MOTIONS = {"displacement": 0, "velocity": 1, "acceleration": 2}
"""Quantities of channels, and how often they differentiate a displacement by time."""
_LOADS = {"force": 0, "moment": 0}
_ROTATIONAL = {**{f"angular {word}": word for word in MOTIONS}, "moment": "moment"}


@dataclass(frozen=True, eq=False)
class ChannelTable:
    """Channels, or impacts.

    Parameters
    ----------
    dofs : MeasuredDofs
    derivatives : (n,) int array
        How often each differentiates a displacement by time; 0 for impacts.
    groups : tuple of str
        Of each; empty if the table has none.
    file : str
        For messages.
    """

    dofs: MeasuredDofs
    derivatives: NDArray[np.intp]
    groups: tuple[str, ...]
    file: str

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the channels or impacts."""
        return self.dofs.names

    def rows_in_group(self, group: str) -> tuple[int, ...]:
        """Return the numbers of those in a group."""
        return tuple(number for number, each in enumerate(self.groups) if each == group)


def read_channels(file: str, sheet: str, unit_of_length: float) -> ChannelTable:
    """Return the table of channels in a CSV or XLSX file.

    Raises
    ------
    DovetailError
        The file cannot be read, or a row is not a channel.
    """
    return _read(file, sheet, "Channels", MOTIONS, unit_of_length)


def read_impacts(file: str, sheet: str, unit_of_length: float) -> ChannelTable:
    """Return the table of impacts in a CSV or XLSX file; as `read_channels`."""
    return _read(file, sheet, "Impacts", _LOADS, unit_of_length)


def _read(file: str, sheet: str, beginning: str, known: Mapping[str, int], unit_of_length: float) -> ChannelTable:
    rows = read_rows(Path(file), sheet, beginning)
    header = [" ".join(cell.lower().split()).replace(" ", "_") for cell in rows[0]] if rows else []
    missing = [name for name in _REQUIRED if name not in header]
    if missing or len(rows) < 2:
        problem = f"the table has no column '{missing[0]}'." if missing else "the table has no rows."
        raise DovetailError(Fault(file, problem, _EXAMPLE))
    for name in header:
        if header.count(name) > 1 and name:
            raise DovetailError(Fault(file, f"the column '{name}' is there twice."))
    cells = {name: [row[at] if at < len(row) else "" for row in rows[1:]] for at, name in enumerate(header)}
    for name, column in cells.items():
        known_name = name in (*_REQUIRED, *_OPTIONAL, *_HARMLESS) or name.startswith("unnamed")
        if not known_name and any(cell.strip() for cell in column):
            remedy = "Write positions in m (or give 'unit_of_length') and FRFs in SI, and remove the column."
            raise DovetailError(
                Fault(file, f"the column '{name[:40]}' may change what the numbers mean.", remedy=remedy)
            )
    names = cells["name"]
    for number, name in enumerate(names):
        if not name or name in names[:number]:
            problem = f"the name '{name[:40]}' is there twice." if name else "there is no name."
            raise DovetailError(Fault(f"{file}  row {number + 2}", problem, "a name of its own for each"))
    quantities, rotational = _quantities(cells["quantity"], known, file)
    positions, directions = (_numbers(cells, columns, file) for columns in (_POSITION, _DIRECTION))
    weights = _numbers(cells, ("weight",), file)[:, 0] if "weight" in cells else None
    try:
        dofs = MeasuredDofs(tuple(names), unit_of_length * positions, directions, rotational, weights)
    except DovetailError as error:
        fault = error.faults[0]
        raise DovetailError(Fault(f"{file}  {fault.where}", fault.problem, fault.accepted)) from None
    return ChannelTable(dofs, quantities, tuple(map(_group, cells.get("grouping", ()))), file)


def _quantities(
    words: Sequence[str], known: Mapping[str, int], file: str
) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
    """Return the numbers of derivatives, and which are rotations or moments."""
    plain = [" ".join(word.lower().split()) for word in words]
    rotational = [word in _ROTATIONAL for word in plain]
    kinds = [_ROTATIONAL.get(word, word) for word in plain]
    for number, (kind, word) in enumerate(zip(kinds, words, strict=True)):
        if kind not in known:
            accepted = [word.capitalize() for word in known]
            accepted += [word.capitalize() for word, plain in _ROTATIONAL.items() if plain in known and word != plain]
            problem = f"the quantity is '{word[:40]}'." if word else "there is no quantity."
            raise DovetailError(Fault(f"{file}  row {number + 2}", problem, ", ".join(accepted)))
    return np.array([known[kind] for kind in kinds], dtype=np.intp), np.array(rotational)


def _numbers(cells: Mapping[str, Sequence[str]], columns: Sequence[str], file: str) -> NDArray[np.float64]:
    """Return the numbers (n, n_columns) in some columns."""
    numbers = []
    for name in columns:
        column = []
        for number, cell in enumerate(cells[name]):
            try:
                value = plain_number(cell)
            except ValueError:
                value = np.nan
            if not np.isfinite(value):
                problem = f"{name} is '{cell[:40]}', which is not a number."
                raise DovetailError(Fault(f"{file}  row {number + 2}", problem, "a number"))
            column.append(value)
        numbers.append(column)
    return np.array(numbers, dtype=np.float64).T


def _group(cell: str) -> str:
    """Return the name of a group; a spreadsheet may write the number 1 as 1.0."""
    return cell.removesuffix(".0")
