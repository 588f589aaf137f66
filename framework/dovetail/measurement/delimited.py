"""FRFs in tables of text: comma, semicolon or tab between the columns."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.errors import Fault, MeasurementError
from dovetail.frf import Quantity
from dovetail.measurement.parts import combined, quantity_of_name
from dovetail.measurement.recording import MOST_LINES, Recording, known_quantity
from dovetail.measurement.selection import Selection
from dovetail.measurement.table_header import Header, read_header
from dovetail.measurement.unit_labels import meaning_of_unit
from dovetail.measurement.written import Written

__all__ = ["decode", "encode", "text_lines"]

_MOST_COMMENTS = 1000


def decode(path: Path, content: bytes, selection: Selection) -> Recording:
    """Return what a table holds.

    Raises
    ------
    MeasurementError
        Not text, a header that is not understood, or a line that does not fit it.
    """
    if selection.chooses:
        found = f"{selection.chooses} chooses one of several FRFs; a {path.suffix} file holds one FRF."
        raise MeasurementError(Fault(str(path), found))
    lines = text_lines(path, content)
    header = read_header(str(path), lines, selection.names)
    numbers, table = _table(path, lines, header)
    parts = {part: table[column] if part == "values" else table[column].real for part, column in header.columns.items()}
    parts["frequency"] = parts["frequency"] * header.hertz

    def place(index: int) -> str:
        return f"{path}:{numbers[index]}"

    values, has_phase = combined(parts, place)
    meaning = meaning_of_unit(header.unit, str(path)) if header.unit else None
    quantity = _quantity(path, header)
    return Recording(
        where=str(path),
        label=path.name,
        frequency=parts["frequency"],
        values=values,
        has_phase=has_phase,
        quantity=quantity,
        is_stated=quantity is not None,
        coherence=parts.get("coherence"),
        place=place,
        how_to_state_quantity="a line '# quantity: accelerance' before the header",
        note=header.comments.get("note", ""),
        factor=1.0 if meaning is None else meaning.factor,
        unit=header.unit,
        averages=_averages(header.comments),
        variance=parts.get("variance"),
        rotation=meaning is not None and meaning.rotation,
        response=header.comments.get("response", ""),
        force=header.comments.get("force", ""),
    )


def encode(written: Written, path: Path, _binary: bool | None) -> bytes:
    """Return a CSV file with what is known of the FRF in comments and every digit of the numbers.

    Raises
    ------
    MeasurementError
        A number that is not finite.
    """
    frf = written.frf
    columns = {"frequency_Hz": frf.frequency}
    if frf.has_phase:
        columns |= {"real": written.values.real, "imag": written.values.imag}
    else:
        columns |= {"amplitude": np.abs(written.values)}
    for name, array in (("coherence", frf.coherence), ("variance", written.variance)):
        if array is not None:
            columns[name] = array
    table = np.column_stack(list(columns.values()))
    if not np.all(np.isfinite(table)):
        raise MeasurementError(Fault(str(path), f"{frf.label} holds numbers that are not finite: nothing is written."))
    rows = "\n".join(",".join(map(repr, row)) for row in table.tolist())
    return f"{_comments(written)}{','.join(columns)}\n{rows}\n".encode()


def _comments(written: Written) -> str:
    frf = written.frf
    said: dict[str, str] = {"quantity": frf.quantity}
    if frf.rotation or written.factor != 1.0:
        said["unit"] = written.unit
    if frf.averages is not None:
        said["averages"] = str(frf.averages)
    said |= {name: " ".join(text.split()) for name in ("note", "response", "force") if (text := getattr(frf, name))}
    return "".join(f"# {name}: {text}\n" for name, text in said.items())


def text_lines(path: Path, content: bytes) -> list[str]:
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


def _quantity(path: Path, header: Header) -> Quantity | None:
    """Return what a comment, the unit or the name of the values says; all must agree."""
    word = header.comments.get("quantity", "")
    meaning = meaning_of_unit(header.unit, str(path)) if header.unit else None
    stated: tuple[Quantity | None, ...] = (
        known_quantity(word.lower(), header.comments["quantity stands in"]) if word else None,
        None if meaning is None else meaning.quantity,
        quantity_of_name(header.names[header.columns["values"]]) if "values" in header.columns else None,
    )
    said: list[Quantity] = [one for one in stated if one is not None]
    if len(set(said)) > 1:
        found = f"the file contradicts itself: {' and '.join(said)}."
        raise MeasurementError(Fault(str(path), found))
    return said[0] if said else None


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
            found = f"the line has {count} column{'s' * (count != 1)}, the header {header.width}."
            raise MeasurementError(Fault(f"{path}:{number}", found, ",".join(header.names)))
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
