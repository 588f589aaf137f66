"""What stands before the numbers of a text table: comments, a header, perhaps a row of units."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from dovetail.errors import Fault, MeasurementError
from dovetail.measurement.parts import NUMBERS, chosen_names, plain_name
from dovetail.measurement.unit_labels import UnitMeaning, meaning_of_unit

__all__ = ["Header", "cells_of", "read_header"]

_COMMENT = re.compile(r"[#%]\s*(quantity|unit|averages|note|response|force)\s*[:=]\s*(.*?)\s*$", re.IGNORECASE)
_BRACKET = re.compile(r"([^\[(]*?)\s*[\[(](.*)[\])]")
_SEPARATORS = ("\t", ";", ",")
_ANGLES = {"deg": "phase_deg", "degree": "phase_deg", "degrees": "phase_deg", "°": "phase_deg", "rad": "phase_rad"}
_HERTZ = {"": 1.0, "hz": 1.0, "khz": 1e3, "rad/s": 1.0 / (2.0 * np.pi)}
_PURE = ("", "-", "1", "none")
_HEADERS = (
    "frequency_Hz,real,imag | frequency_Hz,amplitude,phase_deg | frequency_Hz,amplitude, "
    "each with or without a last column coherence"
)
_LONGEST = 1000


class Header(NamedTuple):
    """Where the numbers start and what they are.

    Parameters
    ----------
    first : int
        Index of the first line of numbers.
    separator : str
    width : int
        Columns of each line.
    columns : mapping of str to int
        From parts of the FRF to columns.
    names : tuple of str
        Of the columns.
    hertz : float
        Hz for each unit of the frequency.
    unit : str
        Of the values, empty where none is stated.
    comments : mapping of str to str
        What the comments say: quantity, averages, note, response, force.
    """

    first: int
    separator: str
    width: int
    columns: Mapping[str, int]
    names: tuple[str, ...]
    hertz: float
    unit: str
    comments: Mapping[str, str]


def read_header(path: str, lines: Sequence[str], given: Mapping[str, str]) -> Header:
    """Read comments, header and row of units.

    Parameters
    ----------
    path : str
    lines : sequence of str
    given : mapping of str to str
        Names of the columns, by the parts of the FRF.

    Raises
    ------
    MeasurementError
        No header, one that is not understood, units that are not or that differ.
    """
    number, comments = _preamble(path, lines)
    line = lines[number][:_LONGEST]
    separator = next((one for one in _SEPARATORS if one in line), ",")
    names, units = _names_and_units(cells_of(line, separator))
    below = cells_of(lines[number + 1][:_LONGEST], separator) if number + 1 < len(lines) else []
    has_units = len(below) == len(names) and not any(units) and not any(_is_number(cell) for cell in below)
    if has_units and any(below):
        units = [re.sub(r"^[\[(](.*)[\])]$", r"\1", cell) for cell in below]
    where = f"{path}:{number + 1}"
    columns = _columns(where, line, names, units, given)
    return Header(
        first=number + 1 + (has_units and any(below)),
        separator=separator,
        width=len(names),
        columns=columns,
        names=tuple(names),
        hertz=_hertz(where, units[columns["frequency"]]),
        unit=_unit(where, units, columns, comments.get("unit", "")),
        comments=comments,
    )


def cells_of(line: str, separator: str) -> list[str]:
    """Return the cells of a line without quotes and blanks around them."""
    return [cell.strip().strip('"').strip() for cell in line.split(separator)]


def _preamble(path: str, lines: Sequence[str]) -> tuple[int, dict[str, str]]:
    """Return the index of the header and what the comments before it say."""
    comments: dict[str, str] = {}
    for number, line in enumerate(lines):
        text = line.strip()
        if text and text[0] not in "#%":
            return number, comments
        if match := _COMMENT.match(text[:_LONGEST]):
            key = match[1].lower()
            comments[key] = match[2]
            comments[f"{key} stands in"] = f"{path}:{number + 1}"
    raise MeasurementError(Fault(path, "there is no header.", _HEADERS))


def _names_and_units(cells: Sequence[str]) -> tuple[list[str], list[str]]:
    split = [_BRACKET.fullmatch(cell) for cell in cells]
    names = [match[1] if match else cell for match, cell in zip(split, cells, strict=True)]
    return names, [match[2].strip() if match else "" for match in split]


def _columns(
    where: str, line: str, names: Sequence[str], units: Sequence[str], given: Mapping[str, str]
) -> dict[str, int]:
    """Return the column of each part of the FRF; a column that is none of them is refused unless names are given."""
    called = [
        _ANGLES[unit.lower()] if _is_angle(name) and unit.lower() in _ANGLES and name not in given.values() else name
        for name, unit in zip(names, units, strict=True)
    ]
    held = {name: unit for name, unit in zip(called, units, strict=True) if name}
    shown = line if len(line) <= 60 else f"{line[:60]}..."
    unclear = MeasurementError(Fault(where, f"the header {shown!r} is not understood.", _HEADERS))
    if len(held) < sum(1 for name in called if name):
        raise MeasurementError(Fault(where, f"the header {shown!r} has a name twice.", _HEADERS))
    try:
        chosen = chosen_names(where, held, given)
    except MeasurementError:
        if given:
            raise
        raise unclear from None
    parts = {part: name for part, name in chosen.items() if part in NUMBERS}
    if not given and set(held) != set(parts.values()):
        raise unclear
    return {part: called.index(name) for part, name in parts.items()}


def _is_angle(name: str) -> bool:
    return plain_name(name) in ("phase", "angle", "arg")


def _hertz(where: str, unit: str) -> float:
    if unit.lower() not in _HERTZ:
        raise MeasurementError(Fault(where, f"the frequency is in {unit[:40]!r}.", "Hz, kHz, rad/s"))
    return _HERTZ[unit.lower()]


def _unit(where: str, units: Sequence[str], columns: Mapping[str, int], stated: str) -> str:
    """Return the unit of the values that columns or comments state; they must not differ."""
    named = {units[columns[part]] for part in ("values", "real", "imag", "amplitude") if part in columns}
    labels = {label for label in (*named, stated) if label.lower() not in _PURE}
    meanings: dict[UnitMeaning, str] = {meaning_of_unit(label, where): label for label in sorted(labels)}
    if len(meanings) > 1:
        both = " and ".join(sorted(labels))
        raise MeasurementError(Fault(where, f"the values are in different units: {both}.", "one unit"))
    return next(iter(meanings.values()), "")


def _is_number(cell: str) -> bool:
    try:
        complex(cell.replace(",", ".").strip("()") or "0")
    except ValueError:
        return False
    return bool(cell)
