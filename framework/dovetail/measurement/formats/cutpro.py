"""FRFs in the text files (.frf) that CutPro exports and reads.

Each row has frequency, real and imaginary part. The numbers of the first row are followed by the labels of the columns,
such as ``Freq Hz Real m/N Imag m/N``; exponents may have three digits.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Literal

import numpy as np

from dovetail.errors import Fault, MeasurementError
from dovetail.measurement.formats.column_names import FIELD_NAMES
from dovetail.measurement.formats.text_tables import check_end, is_number, split_lines
from dovetail.measurement.frf_units import frequency_factor, meaning_of_unit, read_unit
from dovetail.measurement.quantity_words import read_label
from dovetail.measurement.recording import ReadOptions, Recording
from dovetail.measurement.statements import Meaning, Statement, check_axis, fields_of, interpret
from dovetail.units import plain_float

_COLUMNS = 3
_GAP = re.compile(r"[\s,;]+")
_DECIMAL_COMMA = re.compile(r"[+-]?\d*,\d+(?:[eE][+-]?\d+)?")
_LONGEST = 500
"""Largest number of characters in a line, including labels."""
_ACCEPTED = "frequency in Hz, real part, imaginary part"
_HARMLESS = ("", "part", "frf", "h", "h1", "h2", "hv", "function", "-", "/", "of", "the", "frequency_hz", "freq_hz")
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
    where = f"{path}:{numbers[0]}"
    first, meaning = _labels(where, labels)
    values = table[:, 1] + 1j * table[:, 2] if first == "real" else table[:, 2] + 1j * table[:, 1]
    order = "real and imaginary part" if first == "real" else "imaginary and real part"
    fields = fields_of(meaning)
    unit = fields["unit"]
    return Recording(
        where=str(path),
        label=path.name,
        frequency=table[:, 0] * check_axis(meaning, (), ""),
        values=values,
        has_phase=True,
        coherence=None,
        locate=lambda index: f"{path}:{numbers[index]}",
        how_to_state_quantity="the unit in the first row, such as m/N",
        taken=[f"column 1 is the frequency in Hz, 2 and 3 are {order}{unit and f' in {unit}'}"],
        **fields,
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


def _labels(where: str, labels: str) -> tuple[Literal["real", "imag"], Meaning]:
    """Return which part is in the second column, and what the labels of the first row state.

    Raises
    ------
    MeasurementError
        A word that is not understood, so that the columns may hold something else.
    """
    if match := _NOT_READ.search(labels):
        problem = f"the labels '{labels[:60]}' speak of {match[0]}."
        raise MeasurementError(Fault(where, problem, _ACCEPTED))
    part_order: list[Literal["real", "imag"]] = []
    statements: list[Statement] = []
    for word in labels.split():
        plain = word.strip("[](),;:.").lower()
        text = word.strip("[]()") if word.count("/") == 1 else word
        if plain in FIELD_NAMES["real"] or plain in FIELD_NAMES["imag"]:
            part_order.append("real" if plain in FIELD_NAMES["real"] else "imag")
            statements.append(Statement("label", word, where))
        elif frequency_factor(plain) is not None:
            statements.append(Statement("axis unit", plain, where))
        elif "/" in text or read_unit(text) is not None:
            statements.append(Statement("unit", text, where))
        elif plain not in _HARMLESS and plain not in FIELD_NAMES["frequency"]:
            label = read_label(plain)
            if not (label.quantities or label.motions or label.unclear):
                problem = f"the word '{word[:40]}' in the labels '{labels[:60]}' is not understood."
                raise MeasurementError(Fault(where, problem, _ACCEPTED))
            statements.append(Statement("label", plain, where))
    if part_order not in ([], ["real"], ["real", "imag"], ["imag", "real"]):
        raise MeasurementError(Fault(where, f"the labels '{labels[:60]}' do not name each part once.", _ACCEPTED))
    units = sorted({text for about, text, _ in statements if about == "unit"})
    if len({meaning_of_unit(unit, where) for unit in units}) > 1:
        raise MeasurementError(Fault(where, f"the values are in different units: {' and '.join(units)}.", "one unit"))
    return (part_order or ["real"])[0], interpret(statements)
