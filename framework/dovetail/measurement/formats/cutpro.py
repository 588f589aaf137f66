"""FRFs in the text files (.frf) that CutPro exports and reads.

Each row has frequency, real and imaginary part. The numbers of the first row are followed by the labels of the columns,
such as ``Freq Hz Real m/N Imag m/N``; exponents may have three digits.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from dovetail.errors import Fault, MeasurementError
from dovetail.measurement.formats.text_tables import check_end, is_number, split_lines
from dovetail.measurement.frf_units import UnitMeaning, meaning_of_unit
from dovetail.measurement.recording import ReadOptions, Recording
from dovetail.units import plain_float

__all__ = ["decode"]

_COLUMNS = 3
_GAP = re.compile(r"[\s,;]+")
_DECIMAL_COMMA = re.compile(r"[+-]?\d*,\d+(?:[eE][+-]?\d+)?")
_LONGEST = 500
"""Largest number of characters in a line, including labels."""
_NOT_READ = re.compile(r"\b(magnitude|mag|phase|amplitude|db|khz|rpm)\b", re.IGNORECASE)


def decode(path: Path, content: bytes, options: ReadOptions) -> Recording:
    """Return the FRF in a CutPro file.

    Raises
    ------
    MeasurementError
        Not text, a row without three numbers, labels of anything other than real and imaginary part, different units.
    """
    if options.chooses or options.names:
        option = options.chooses or f"names={dict(options.names)}"
        raise MeasurementError(Fault(str(path), f"{option} is not for {path.suffix} files, which hold one FRF."))
    lines = split_lines(path, content)
    numbers, rows, labels = [], [], ""
    for number, line in enumerate(lines, start=1):
        if not line.strip():
            continue
        if len(line) > _LONGEST:
            raise MeasurementError(Fault(f"{path}:{number}", f"the line has {len(line):,} characters."))
        words = _split(line.strip())
        rows.append(_parse_row(words, f"{path}:{number}"))
        numbers.append(number)
        if len(rows) == 1:
            labels = " ".join(word.strip('"') for word in words[_COLUMNS:])
        if len(words) != _COLUMNS and (len(rows) > 1 or is_number(words[_COLUMNS])):
            raise MeasurementError(Fault(f"{path}:{number}", f"the row has {len(words)} columns.", "three numbers"))
    if not rows:
        raise MeasurementError(Fault(str(path), "there is no row of numbers."))
    check_end(str(path), lines)
    table = np.array(rows)
    meaning, unit = _unit(f"{path}:{numbers[0]}", labels)
    return Recording(
        where=str(path),
        label=path.name,
        frequency=table[:, 0],
        values=table[:, 1] + 1j * table[:, 2],
        has_phase=True,
        quantity=None if meaning is None else meaning.quantity,
        is_stated=meaning is not None,
        coherence=None,
        locate=lambda index: f"{path}:{numbers[index]}",
        how_to_state_quantity="the unit in the first row, such as m/N",
        factor=1.0 if meaning is None else meaning.factor,
        unit=unit,
        taken=[f"column 1 is the frequency in Hz, 2 and 3 are real and imaginary part{unit and f' in {unit}'}"],
    )


def _split(line: str) -> list[str]:
    """Return the words of a row; a comma within numbers that are separated by blanks is a decimal comma."""
    words = re.split(r"[\s;]+", line)
    commas = [word for word in words[:_COLUMNS] if "," in word]
    if len(words) > 1 and commas and all(map(_DECIMAL_COMMA.fullmatch, commas)):
        return [*(word.replace(",", ".") for word in words[:_COLUMNS]), *words[_COLUMNS:]]
    return _GAP.split(line)


def _parse_row(words: list[str], where: str) -> list[float]:
    try:
        row = [plain_float(word) for word in words[:_COLUMNS]]
    except ValueError:
        shown = " ".join(words)[:60]
        raise MeasurementError(Fault(where, f"the row '{shown}' does not start with three numbers.")) from None
    if len(row) < _COLUMNS:
        raise MeasurementError(Fault(where, f"the row has {len(row)} columns.", "three numbers"))
    return row


def _unit(where: str, labels: str) -> tuple[UnitMeaning | None, str]:
    """Return the unit of the values according to the labels of the first row, and its meaning."""
    if match := _NOT_READ.search(labels):
        problem = f"the labels '{labels[:60]}' speak of {match[0]}."
        raise MeasurementError(Fault(where, problem, "frequency in Hz, real part, imaginary part"))
    words = [word.strip("[]()") if word.count("/") == 1 else word for word in labels.split()]
    units = sorted({word for word in words if "/" in word})
    meanings = {meaning_of_unit(word, where) for word in units}
    if len(meanings) > 1:
        raise MeasurementError(Fault(where, f"the values are in different units: {' and '.join(units)}.", "one unit"))
    return (meanings.pop(), units[0]) if meanings else (None, "")
