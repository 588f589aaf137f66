"""Tables of numbers in text files: their start, the separator of their columns, and their header.

A table may follow any lines of text. `find_table` finds its header by the names in it; `find_rows` finds the first row
of a table whose columns the caller names; `read_rows` reads the numbers, with decimal points or decimal commas.
"""

from __future__ import annotations

import contextlib
import csv
import re
from array import array
from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dovetail.errors import Fault, MeasurementError, counted
from dovetail.measurement.recording import MOST_LINES

_MOST_ABOVE = 10_000
"""Largest number of lines above a table; the longest headers of analysers have some hundred."""
_LONGEST_LINE = 100_000
"""Characters of the longest line: a row or a header of a thousand impacts."""
_THOUSANDS = re.compile(r"[+-]?[1-9]\d{0,2}(?:,\d{3})+")
"""A number whose commas may mark thousands."""
_CONTROL = re.compile(rb"[\x00-\x08\x0e-\x1f]")
"""Bytes that do not occur in text of a single-byte encoding; form feeds and tabs do."""
_BLANKS = ""
"""The separator of columns that are separated by one or more blanks."""
_DECIMAL_COMMA = re.compile(r"[+-]?\d*,\d+(?:[eE][+-]?\d+)?")
_LAST_NUMBER = re.compile(r"[^\s,;]+(?=\s*$)")
_LAST_ROWS, _FEWEST_ROWS, _MANY_DIGITS = 60, 3, 8
"""Rows at the end that are compared, fewest of them, and characters of a number that is not short by chance."""
_WORD = re.compile(r"[^\W\d_]{2}|[#%*()/=:]")
_WORDS = re.compile(r"\S+(?:\s*[\[(][^\])]*[\])])?")
"""A word with the brackets behind it, as in ``Real [um/N]``."""


class TextTable(NamedTuple):
    """A table in a text file.

    Parameters
    ----------
    where : str
        The file.
    lines : sequence of str
        All of its lines.
    header : tuple of str
        Cells of the header; without one, the names that the caller gives.
    line : int
        Index of the header; without one, of the first row.
    first : int
        Index of the first row of numbers.
    separator : str
        Separator of the columns; empty for blanks.
    """

    where: str
    lines: Sequence[str]
    header: tuple[str, ...]
    line: int
    first: int
    separator: str

    @property
    def end(self) -> int:
        """Index after the last row; below it are only empty lines and lines of words."""
        last = len(self.lines)
        while last > self.first and _is_below(self.lines[last - 1][:_LONGEST_LINE], self.separator, len(self.header)):
            last -= 1
        return last

    @property
    def around(self) -> list[tuple[int, str]]:
        """The lines above the header and below the last row that are not empty, with their numbers from 1."""
        numbered = [(number, self.lines[number - 1]) for number in range(1, self.line + 1)]
        numbered += [(number, self.lines[number - 1]) for number in range(self.end + 1, len(self.lines) + 1)]
        return [(number, line[:_LONGEST_LINE]) for number, line in numbered if line.strip()]

    @property
    def between(self) -> list[tuple[int, str]]:
        """The lines between the header, with its row of units, and the first row, with their numbers from 1."""
        numbers = range(self.line + 2 + bool(self.units), self.first + 1)
        return [(number, line) for number in numbers if (line := self.lines[number - 1][:_LONGEST_LINE]).strip()]

    @property
    def units(self) -> tuple[str, ...]:
        """Cells of a row of units right below the header; empty if there is none."""
        if self.line == self.first:  # without a header, the line below is a row of numbers
            return ()
        below = self.lines[self.line + 1][:_LONGEST_LINE] if self.line + 1 < len(self.lines) else ""
        cells = _split_names(below, self.separator, len(self.header))
        if len(cells) != len(self.header) or not any(cells) or any(map(is_number, cells)):
            return ()
        return tuple(cells)


def _is_below(line: str, separator: str, width: int) -> bool:
    """Return whether a line has words, and not a number for some column of a whole row."""
    cells = [cell for cell in _split(line, separator) if cell]
    if len(cells) == width and any(map(is_number, cells)):
        return False
    return not cells or any(_WORD.search(cell) and not is_number(cell) for cell in cells)


def decode_text(path: Path, content: bytes) -> str:
    """Return a text file with line feeds as line ends, from UTF-8, UTF-16 with a byte order mark, or else Latin-1.

    Raises
    ------
    MeasurementError
        Too many lines, or bytes that are not text.
    """
    if max(content.count(b"\n"), content.count(b"\r")) > MOST_LINES + _MOST_ABOVE:
        raise MeasurementError(Fault(str(path), "the file has too many lines.", f"at most {MOST_LINES:,} lines"))
    encoding = "utf-16" if content[:2] in (b"\xff\xfe", b"\xfe\xff") else "utf-8-sig"
    try:
        text = content.decode(encoding)
    except UnicodeDecodeError as error:
        if encoding == "utf-16" or _CONTROL.search(content):
            problem = f"the file is not text: byte {error.start + 1} is not {encoding.upper()[:6].rstrip('-')}."
            raise MeasurementError(Fault(str(path), problem, "comma-separated text")) from None
        text = content.decode("latin-1")
    return text.replace("\r\n", "\n").replace("\r", "\n")


def find_table(
    where: str, lines: Sequence[str], is_header: Callable[[Sequence[str]], bool], accepted: str, remedy: str = ""
) -> TextTable:
    """Return the table below the last header before the rows of numbers.

    Parameters
    ----------
    where : str
        The file.
    lines : sequence of str
    is_header : callable
        Returns whether cells are those of a header.
    accepted : str
        Accepted headers, for the message.
    remedy : str
        What to do if there is none.

    Returns
    -------
    TextTable
        If no line is a header, the header is a line just above the numbers that has as many cells.

    Raises
    ------
    MeasurementError
        No header.
    """
    start = _start_of_numbers(lines)
    guess = _BLANKS if start == len(lines) else _separator(lines[start])
    width = len(_split(lines[start][:_LONGEST_LINE], guess)) if start < len(lines) else 0
    last = None
    for number in range(min(start, _MOST_ABOVE) - 1, -1, -1):
        line = lines[number][:_LONGEST_LINE].strip(" ").lstrip("#%! ")
        for separator in dict.fromkeys((guess, _separator(line)) if width else (_separator(line),)):
            cells = _split_names(line, separator, width)
            fits = len(cells) == width > 1 or (not width and len(cells) > 1)
            table = TextTable(where, lines, tuple(cells), number, number + 1, separator)
            if is_header(cells) and (fits or (separator != _BLANKS and len(cells) > 1)):
                return _below(table, start)
            if last is None and fits and width and number >= start - 2 and lines[number][:9].lstrip()[:1] not in "#%":
                last = table
    if last is not None:
        return last
    if start < len(lines):
        raise MeasurementError(Fault(f"{where}:{start + 1}", "the table has no header.", accepted, remedy))
    raise MeasurementError(Fault(where, "there is no header.", accepted))


def single_column(where: str, lines: Sequence[str], is_header: Callable[[Sequence[str]], bool]) -> TextTable | None:
    """Return a table of one column, a header and below it one number in each line; None if others follow."""
    filled = [number for number, line in enumerate(lines[:_MOST_ABOVE]) if line.strip()]
    if not filled or _start_of_numbers(lines) < filled[-1]:
        return None
    for header, first in pairwise(filled):
        text = lines[first].strip()
        if "," not in text and is_number(text):
            name = lines[header].strip().lstrip("#%! ")
            below = (lines[later] for later in filled if later > first)
            is_last = not any(is_header(_split(line, _separator(line))) for line in below)
            return TextTable(where, lines, (name,), header, first, _BLANKS) if is_last and is_header([name]) else None
    return None


def _below(table: TextTable, start: int) -> TextTable:
    """Return a table that starts below a row of units, or below the lines that SignalCalc writes under a header."""
    between = [line[:_LONGEST_LINE].strip() for line in table.lines[table.first : start]]
    if "Units:" in between and not any(is_number(cell) for line in between for cell in line.split()):
        return table._replace(first=start)
    return table._replace(first=table.line + 2) if table.units else table


def find_rows(where: str, lines: Sequence[str], columns: Sequence[str], wanted: Sequence[int]) -> TextTable:
    """Return the table that starts at the first line with as many cells as names and a number in each wanted column.

    Raises
    ------
    MeasurementError
        No such line.
    """
    for number, line in enumerate(lines[:_MOST_ABOVE]):
        separator = _separator(line)
        cells = _split(line[:_LONGEST_LINE], separator)
        if len(cells) == len(columns) and all(is_number(cells[column]) for column in wanted):
            return TextTable(where, lines, tuple(columns), number, number, separator)
    start = _start_of_numbers(lines)
    accepted = ",".join(columns)
    if start == len(lines):
        raise MeasurementError(Fault(where, f"there is no row of {len(columns)} numbers.", accepted))
    count = len(_split(lines[start][:_LONGEST_LINE], _separator(lines[start])))
    problem = f"the line has {counted(count, 'column')}, and {len(columns)} are named."
    raise MeasurementError(Fault(f"{where}:{start + 1}", problem, accepted, "Name each column; 'skip' leaves one out."))


def _start_of_numbers(lines: Sequence[str]) -> int:
    """Return the index of the first of two successive rows of numbers of equal length, or of a single row at the end.

    Without any it is the number of lines.
    """
    before, width = None, 0
    for number, line in enumerate(lines[: _MOST_ABOVE + 2]):
        if not line or line.isspace():
            continue
        cells = _split(line[:_LONGEST_LINE], _separator(line))
        if len(cells) < 2 or not any(cells) or not all(map(is_number, filter(None, cells))):
            before = None
        elif before is not None and len(cells) == width:
            return before
        else:
            before, width = number, len(cells)
    return len(lines) if before is None else before


def _separator(line: str) -> str:
    """Return what separates the cells of a line: a tab, a semicolon, a comma, or blanks.

    A comma within numbers that are separated by blanks is a decimal comma.
    """
    text = line[:_LONGEST_LINE].strip(" ")
    for separator in "\t;":
        if separator in text:
            return separator
    words = text.split()
    commas = [word for word in words if "," in word]
    return "," if commas and (len(words) == 1 or not all(map(_DECIMAL_COMMA.fullmatch, commas))) else _BLANKS


def _split(line: str, separator: str) -> list[str]:
    """Split a line into cells, without quotes and blanks around them."""
    if separator == _BLANKS:
        return line.split()
    cells = line.split(separator)
    if '"' in line:
        with contextlib.suppress(csv.Error, StopIteration):
            cells = next(csv.reader([line], delimiter=separator, skipinitialspace=True))
    return [cell.strip().strip('"').strip() for cell in cells]


def _split_names(line: str, separator: str, width: int) -> list[str]:
    """Split a header or a row of units, whose cells may contain blanks, into `width` cells (0 if unknown)."""
    if separator != _BLANKS:
        return _split(line, separator)
    ways = re.split(r"\s{2,}", line.strip()), _WORDS.findall(line), line.split()
    return next((cells for cells in ways if len(cells) == width), ways[1])


def is_number(cell: str) -> bool:
    """Return whether a cell is a number, real or complex, with a decimal point or a decimal comma."""
    if "_" in cell or not cell.isascii():
        return False
    try:
        complex(cell.replace(",", ".").strip("()").replace("i", "j") or "x")
    except ValueError:
        return cell.strip("+-").lower() in ("inf", "infinity")
    return True


def read_rows(
    table: TextTable, names: Sequence[str], wanted: Sequence[int], complex_column: int | None = None
) -> tuple[list[int], NDArray[Any]]:
    """Read the rows of numbers.

    Parameters
    ----------
    table : TextTable
    names : sequence of str
        Of the columns, for messages.
    wanted : sequence of int
        The columns that are read.
    complex_column : int, optional
        The column that holds complex numbers.

    Returns
    -------
    numbers : list of int
        The line of each row, from 1.
    columns : (n_wanted, n_rows) array
        Complex where there is a complex column.

    Raises
    ------
    MeasurementError
        No row, a row of another length, what is not a number, decimal points and decimal commas in one table.
    """
    numbers: list[int] = []
    values = array("d")
    marks: dict[str, int] = {}
    width, separator, end = len(table.header), table.separator, table.end
    for number, line in enumerate(table.lines[table.first : end], start=table.first + 1):
        if not line or line.isspace():
            continue
        if len(line) > _LONGEST_LINE:
            raise MeasurementError(Fault(f"{table.where}:{number}", f"the line has {len(line):,} characters."))
        is_plain = line.isascii() and "_" not in line
        quoted = '"' in line or separator == _BLANKS
        cells = _split(line, separator) if quoted else line.split(separator, width)
        if len(cells) != width:
            count = len(cells) if quoted else line.count(separator) + 1
            raise _another_width(f"{table.where}:{number}", count, width, names)
        numbers.append(number)
        for column in wanted:
            text = cells[column].strip()
            if separator != "," or quoted:
                text = _decimal_point(text, marks, f"{table.where}:{number}", number)
            try:
                if not is_plain and ("_" in text or not text.isascii()):
                    raise ValueError  # of numbers that `float` takes and no analyser writes
                value = complex(text.strip("()").replace("i", "j")) if column == complex_column else float(text)
            except ValueError:
                problem = f"{cells[column].strip()[:40]!r} in column {names[column]} is not a number."
                raise MeasurementError(Fault(f"{table.where}:{number}", problem)) from None
            values.append(value.real)
            if complex_column is not None:
                values.append(value.imag)
    if not numbers:
        raise MeasurementError(Fault(table.where, "there is no line after the header."))
    _check_thousands(table.where, marks)
    if end == len(table.lines):
        check_not_truncated(table.where, table.lines)
    kind = np.float64 if complex_column is None else np.complex128
    return numbers, np.frombuffer(values, dtype=kind).reshape(len(numbers), len(wanted)).T


def _another_width(where: str, count: int, width: int, names: Sequence[str]) -> MeasurementError:
    problem = f"the line has {counted(count, 'column')}, the header {width}."
    return MeasurementError(Fault(where, problem, ",".join(names)))


def check_not_truncated(where: str, lines: Sequence[str]) -> None:
    """Refuse a truncated file, whose last line has no end and whose last number is shorter than all others.

    It is refused only if all numbers have many digits, since short numbers may be shorter by chance.

    Raises
    ------
    MeasurementError
    """
    if not lines[-1].strip():
        return
    matches = (_LAST_NUMBER.search(line) for line in lines[-_LAST_ROWS:])
    numbers = [match[0].lstrip("+-") for match in matches if match]
    others, last = numbers[:-1], "".join(numbers[-1:])
    shortest = min(map(len, others[1:]), default=0)
    if len(others) > _FEWEST_ROWS and shortest >= _MANY_DIGITS and len(last) < shortest:
        problem = f"the file ends within the row, or its last number, '{last}', is shorter than those above."
        remedy = "Export it again, or end the last line if it is whole."
        raise MeasurementError(Fault(f"{where}:{len(lines)}", problem, remedy=remedy))


def _decimal_point(text: str, marks: dict[str, int], where: str, number: int) -> str:
    """Return a number with a decimal point; `marks` records the line in which comma and point first occurred."""
    for mark in ",.":
        if mark in text:
            marks.setdefault(mark, number)
    if {",", "."} <= marks.keys():
        problem = (
            f"numbers have a comma (line {marks[',']}) and a point (line {marks['.']}): which is decimal is unknown."
        )
        raise MeasurementError(Fault(where, problem, "one decimal mark, and no marks of thousands"))
    if "," in text:
        marks.setdefault("thousands" if _THOUSANDS.fullmatch(text) else "decimals", number)
    return text.replace(",", ".")


def _check_thousands(where: str, marks: Mapping[str, int]) -> None:
    """Refuse commas that may all mark thousands, as in ``1,000``: no number shows that they are decimal."""
    if "thousands" in marks and "decimals" not in marks:
        problem = "the comma in a number may be decimal or mark thousands."
        raise MeasurementError(Fault(f"{where}:{marks['thousands']}", problem, "numbers without marks of thousands"))
