"""FRFs in tables of text, with comma, semicolon or tab between the columns.

A table has comments (``# quantity: mobility``), a header with the names of the columns, perhaps a row of units, and the
rows of numbers. `read_header` finds out which column holds which field of the FRF, `decode` reads the numbers, and
`encode` writes CSV.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dovetail.errors import Fault, MeasurementError
from dovetail.frf import Quantity
from dovetail.measurement.formats.column_names import (
    NUMERIC_FIELDS,
    assign_fields,
    combine_values,
    plain_name,
    quantity_of_name,
)
from dovetail.measurement.frf_units import UnitMeaning, meaning_of_unit
from dovetail.measurement.recording import MOST_LINES, FrfToWrite, ReadOptions, Recording, parse_quantity

__all__ = ["Header", "decode", "encode", "read_header", "split_cells", "split_lines"]

_MOST_COMMENTS = 1000
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


def decode(path: Path, content: bytes, options: ReadOptions) -> Recording:
    """Return what a table holds.

    Raises
    ------
    MeasurementError
        Not text, a header that is not understood, or a line that does not fit it.
    """
    if options.chooses:
        problem = f"{options.chooses} chooses one of several FRFs; a {path.suffix} file holds one FRF."
        raise MeasurementError(Fault(str(path), problem))
    lines = split_lines(path, content)
    header = read_header(str(path), lines, options.names)
    numbers, table = _table(path, lines, header)
    fields = {
        field: table[column] if field == "values" else table[column].real for field, column in header.columns.items()
    }
    fields["frequency"] = fields["frequency"] * header.hertz

    def locate(index: int) -> str:
        return f"{path}:{numbers[index]}"

    values, has_phase = combine_values(fields, locate)
    meaning = meaning_of_unit(header.unit, str(path)) if header.unit else None
    quantity = _quantity(path, header)
    return Recording(
        where=str(path),
        label=path.name,
        frequency=fields["frequency"],
        values=values,
        has_phase=has_phase,
        quantity=quantity,
        is_stated=quantity is not None,
        coherence=fields.get("coherence"),
        locate=locate,
        how_to_state_quantity="a line '# quantity: accelerance' before the header",
        note=header.comments.get("note", ""),
        factor=1.0 if meaning is None else meaning.factor,
        unit=header.unit,
        averages=_averages(header.comments),
        variance=fields.get("variance"),
        rotation=meaning is not None and meaning.rotation,
        response=header.comments.get("response", ""),
        force=header.comments.get("force", ""),
    )


def _quantity(path: Path, header: Header) -> Quantity | None:
    """Return what a comment, the unit or the name of the values says; all must agree."""
    word = header.comments.get("quantity", "")
    meaning = meaning_of_unit(header.unit, str(path)) if header.unit else None
    statements: tuple[Quantity | None, ...] = (
        parse_quantity(word.lower(), header.comments["quantity stands in"]) if word else None,
        None if meaning is None else meaning.quantity,
        quantity_of_name(header.names[header.columns["values"]]) if "values" in header.columns else None,
    )
    stated: list[Quantity] = [quantity for quantity in statements if quantity is not None]
    if len(set(stated)) > 1:
        problem = f"the file contradicts itself: {' and '.join(stated)}."
        raise MeasurementError(Fault(str(path), problem))
    return stated[0] if stated else None


def _averages(comments: Mapping[str, str]) -> int | None:
    if "averages" not in comments:
        return None
    text = comments["averages"]
    if not (text.isdecimal() and 1 <= int(text[:9]) <= MOST_LINES):
        where = comments["averages stands in"]
        raise MeasurementError(Fault(where, f"{text[:40]!r} is no number of averages.", "a whole number of 1 or more"))
    return int(text)


def _table(path: Path, lines: list[str], header: Header) -> tuple[list[int], NDArray[Any]]:
    """Return the line number of each row, from 1, and the (n_columns, n_freq) numbers."""
    numbers: list[int] = []
    rows: list[list[complex]] = []
    wanted = sorted(header.columns.values())
    is_complex = header.columns.get("values")
    for number, line in enumerate(lines[header.first :], start=header.first + 1):
        if not line.strip():
            continue
        cells = line.split(header.separator, header.width)
        if len(cells) != header.width:
            count = line.count(header.separator) + 1
            problem = f"the line has {count} column{'s' * (count != 1)}, the header {header.width}."
            raise MeasurementError(Fault(f"{path}:{number}", problem, ",".join(header.names)))
        numbers.append(number)
        rows.append(
            [_number(cells[column], header, column, f"{path}:{number}", column == is_complex) for column in wanted]
        )
    if not rows:
        raise MeasurementError(Fault(str(path), "there is no line after the header."))
    table = np.zeros((header.width, len(rows)), dtype=np.float64 if is_complex is None else np.complex128)
    table[wanted] = np.array(rows).T
    return numbers, table


def _number(cell: str, header: Header, column: int, where: str, is_complex: bool) -> complex:
    text = cell.strip().strip('"')
    if header.separator == ";" and "." not in text:
        text = text.replace(",", ".")
    try:
        return complex(text.strip("()").replace("i", "j")) if is_complex else float(text)
    except ValueError:
        name = header.names[column]
        raise MeasurementError(Fault(where, f"{text[:40]!r} in column {name} is not a number.")) from None


def split_lines(path: Path, content: bytes) -> list[str]:
    """Return the lines of a text file, whatever ends them.

    Raises
    ------
    MeasurementError
        Too many lines, or bytes that are not UTF-8.
    """
    if max(content.count(b"\n"), content.count(b"\r")) > MOST_LINES + _MOST_COMMENTS:
        raise MeasurementError(Fault(str(path), "the file has too many lines.", f"at most {MOST_LINES:,} lines"))
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise MeasurementError(
            Fault(str(path), f"the file is not text: byte {error.start + 1} is not UTF-8.", "comma-separated text")
        ) from None
    return text.replace("\r\n", "\n").replace("\r", "\n").split("\n")


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
        From the fields of the FRF to columns.
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


def read_header(path: str, lines: Sequence[str], chosen: Mapping[str, str]) -> Header:
    """Read comments, header and row of units.

    Parameters
    ----------
    path : str
    lines : sequence of str
    chosen : mapping of str to str
        From fields of the FRF to names of columns, as the caller says.

    Raises
    ------
    MeasurementError
        No header, one that is not understood, units that are not or that differ.
    """
    number, comments = _preamble(path, lines)
    line = lines[number][:_LONGEST]
    separator = next((candidate for candidate in _SEPARATORS if candidate in line), ",")
    names, units = _names_and_units(split_cells(line, separator))
    below = split_cells(lines[number + 1][:_LONGEST], separator) if number + 1 < len(lines) else []
    has_units = len(below) == len(names) and not any(units) and not any(_is_number(cell) for cell in below)
    if has_units and any(below):
        units = [re.sub(r"^[\[(](.*)[\])]$", r"\1", cell) for cell in below]
    where = f"{path}:{number + 1}"
    columns = _columns(where, line, names, units, chosen)
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


def split_cells(line: str, separator: str) -> list[str]:
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
    where: str, line: str, names: Sequence[str], units: Sequence[str], chosen: Mapping[str, str]
) -> dict[str, int]:
    """Return the column of each field of the FRF; any other column is refused unless the caller names the columns."""
    labels = [
        _ANGLES[unit.lower()] if _is_angle(name) and unit.lower() in _ANGLES and name not in chosen.values() else name
        for name, unit in zip(names, units, strict=True)
    ]
    contents = {name: unit for name, unit in zip(labels, units, strict=True) if name}
    shown = line if len(line) <= 60 else f"{line[:60]}..."
    unclear = MeasurementError(Fault(where, f"the header {shown!r} is not understood.", _HEADERS))
    if len(contents) < sum(1 for name in labels if name):
        raise MeasurementError(Fault(where, f"the header {shown!r} has a name twice.", _HEADERS))
    try:
        assigned = assign_fields(where, contents, chosen)
    except MeasurementError:
        if chosen:
            raise
        raise unclear from None
    fields = {field: name for field, name in assigned.items() if field in NUMERIC_FIELDS}
    if not chosen and set(contents) != set(fields.values()):
        raise unclear
    return {field: labels.index(name) for field, name in fields.items()}


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


def encode(content: FrfToWrite, path: Path, _binary: bool | None) -> bytes:
    """Return a CSV file with what is known of the FRF in comments and every digit of the numbers.

    Raises
    ------
    MeasurementError
        A number that is not finite.
    """
    frf = content.frf
    columns = {"frequency_Hz": frf.frequency}
    if frf.has_phase:
        columns |= {"real": content.values.real, "imag": content.values.imag}
    else:
        columns |= {"amplitude": np.abs(content.values)}
    for name, array in (("coherence", frf.coherence), ("variance", content.variance)):
        if array is not None:
            columns[name] = array
    table = np.column_stack(list(columns.values()))
    if not np.all(np.isfinite(table)):
        raise MeasurementError(Fault(str(path), f"{frf.label} holds numbers that are not finite: nothing is written."))
    rows = "\n".join(",".join(map(repr, row)) for row in table.tolist())
    return f"{_comments(content)}{','.join(columns)}\n{rows}\n".encode()


def _comments(content: FrfToWrite) -> str:
    frf = content.frf
    comments: dict[str, str] = {"quantity": frf.quantity}
    if frf.rotation or content.factor != 1.0:
        comments["unit"] = content.unit
    if frf.averages is not None:
        comments["averages"] = str(frf.averages)
    comments |= {name: " ".join(text.split()) for name in ("note", "response", "force") if (text := getattr(frf, name))}
    return "".join(f"# {name}: {text}\n" for name, text in comments.items())
