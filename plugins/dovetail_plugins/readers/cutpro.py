"""FRFs in the text files (.frf) that CutPro exports and reads.

Each row has frequency, real and imaginary part. The numbers of the first row are followed by the labels of the columns,
such as ``Freq Hz Real m/N Imag m/N``; exponents may have three digits.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from dovetail import (
    Fault,
    FrfReader,
    MeasurementError,
    RecordedFrf,
    Statement,
    check_not_truncated,
    decode_text,
    read_unit,
)

_COLUMNS = 3
_GAP = re.compile(r"[\s,;]+")
_DECIMAL_COMMA = re.compile(r"[+-]?\d*,\d+(?:[eE][+-]?\d+)?")
_NUMBERS = re.compile(rb"\s*(?:[-+]?[\d.]+(?:[,.]\d+)?(?:[eE][-+]?\d+)?[\s,;]+){3}")
_LONGEST = 500
"""Largest number of characters in a line, including labels."""
_ACCEPTED = "frequency in Hz, real part, imaginary part"
_PARTS = {
    **dict.fromkeys(("real", "re", "real_part"), "real"),
    **dict.fromkeys(("imag", "im", "imaginary", "imag_part", "imaginary_part"), "imag"),
}
_HARMLESS = (
    *("", "part", "frf", "h", "h1", "h2", "hv", "function", "of", "the"),
    *("frequency", "frequency_hz", "frequencies", "freq", "freq_hz", "f", "f_hz"),
)
_NOT_READ = re.compile(r"\b(magnitude|mag|phase|amplitude|db|khz|rpm)\b", re.IGNORECASE)


class CutProReader(FrfReader):
    """Three columns, with labels behind the numbers of the first row."""

    name = "cutpro"
    summary = "FRFs of CutPro: .frf"
    suffixes = (".frf",)
    default_for = suffixes

    def sniff(self, content: bytes) -> bool:
        """Look for three numbers at the beginning, perhaps followed by words."""
        return _NUMBERS.match(content + b"\n") is not None

    def read(self, path: Path, content: bytes) -> Sequence[RecordedFrf]:
        """Return the one FRF.

        Raises
        ------
        MeasurementError
            Not text, a row without three numbers, labels of anything other than real and imaginary part.
        """
        lines = decode_text(path, content).split("\n")
        numbers, rows, labels = _rows(path, lines)
        check_not_truncated(str(path), lines)
        table = np.array(rows)
        first, statements = _read_labels(f"{path}:{numbers[0]}", labels)
        order = "real and imaginary part" if first == "real" else "imaginary and real part"
        units = [one.text for one in statements if one.about == "unit"][:1]
        return [
            RecordedFrf(
                table[:, 0],
                table[:, 1] + 1j * table[:, 2] if first == "real" else table[:, 2] + 1j * table[:, 1],
                statements=statements,
                where=str(path),
                locate=lambda index: f"{path}:{numbers[index]}",
                how_to_state_quantity="the unit in the first row, such as m/N",
                meanings=[" in ".join([f"column 1 is the frequency in Hz, 2 and 3 are {order}", *units])],
            )
        ]

    def samples(self, folder: Path) -> Sequence[Path]:
        """Write a file with labels."""
        file = folder / "sample.frf"
        rows = "10 1e-6 0 Freq Hz Real m/N Imag m/N\n20 2e-6 -1e-006\n30 1e-6 -3e-006\n"
        file.write_text(rows, encoding="ascii")
        return [file]


def _rows(path: Path, lines: Sequence[str]) -> tuple[list[int], list[list[float]], str]:
    """Return the numbers of the lines with rows, the rows, and the labels behind the first one."""
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
        if len(words) != _COLUMNS and (len(rows) > 1 or _is_number(words[_COLUMNS])):
            raise MeasurementError(Fault(f"{path}:{number}", f"the row has {len(words)} columns.", "three numbers"))
    if not rows:
        raise MeasurementError(Fault(str(path), "there is no row of numbers."))
    return numbers, rows, labels


def _split(line: str) -> list[str]:
    """Return the words of a row; a comma within numbers that are separated by blanks is a decimal comma."""
    words = re.split(r"[\s;]+", line)
    commas = [word for word in words[:_COLUMNS] if "," in word]
    if len(words) > 1 and commas and all(map(_DECIMAL_COMMA.fullmatch, commas)):
        return [*(word.replace(",", ".") for word in words[:_COLUMNS]), *words[_COLUMNS:]]
    return _GAP.split(line)


def _number(word: str) -> float:
    if "_" in word or not word.isascii():
        raise ValueError(word)  # `float` takes 1_0 and the digits of other scripts
    return float(word)


def _is_number(word: str) -> bool:
    try:
        _number(word.replace(",", "."))
    except ValueError:
        return False
    return True


def _parse_row(words: list[str], where: str) -> list[float]:
    try:
        row = [_number(word) for word in words[:_COLUMNS]]
    except ValueError:
        shown = " ".join(words)[:60]
        raise MeasurementError(Fault(where, f"the row '{shown}' does not start with three numbers.")) from None
    if len(row) < _COLUMNS:
        raise MeasurementError(Fault(where, f"the row has {len(row)} columns.", "three numbers"))
    return row


def _read_labels(where: str, labels: str) -> tuple[str, list[Statement]]:
    """Return which part is in the second column, and what the labels of the first row state.

    Raises
    ------
    MeasurementError
        The labels name other columns.
    """
    if match := _NOT_READ.search(labels):
        raise MeasurementError(Fault(where, f"the labels '{labels[:60]}' contain '{match[0]}'.", _ACCEPTED))
    estimators = {word.lower() for word in re.findall(r"\bH[12v]\b", labels, re.IGNORECASE)}
    if len(estimators) > 1:
        problem = f"the labels '{labels[:60]}' name {' and '.join(sorted(estimators))}, which are not one FRF."
        raise MeasurementError(Fault(where, problem, _ACCEPTED))
    part_order: list[str] = []
    statements: list[Statement] = []
    for word in labels.split():
        plain = word.strip("[](),;:.").lower()
        text = word.strip("[]()") if word.count("/") == 1 else word
        unit = read_unit(plain)
        if plain in _PARTS:
            part_order.append(_PARTS[plain])
            statements.append(Statement("label", word, where))
        elif plain in ("rad/s", "rad/sec") or (unit is not None and unit.kind == "frequency"):
            statements.append(Statement("axis unit", plain, where))
        elif plain not in _HARMLESS:
            reading = read_unit(text)
            is_unit = "/" in text or (reading is not None and reading.kind != "none")
            statements.append(Statement("unit", text, where) if is_unit else Statement("word", plain, where))
    if part_order not in ([], ["real"], ["real", "imag"], ["imag", "real"]):
        raise MeasurementError(Fault(where, f"the labels '{labels[:60]}' do not name each part once.", _ACCEPTED))
    return (part_order or ["real"])[0], statements
