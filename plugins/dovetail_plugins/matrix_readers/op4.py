"""NASTRAN's OUTPUT4 files: in text or binary, in full or sparse, of 32 or 64 bits and either order of bytes.

Own code, since the libraries that read them bring much more with them than this format needs.
"""

from __future__ import annotations

import re
import struct
from abc import ABC, abstractmethod
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dovetail import MatrixReader, RecordedMatrix, RecordedModel
from dovetail_plugins.matrix_readers.entries import DIRECTIONS_1_TO_6
from dovetail_plugins.matrix_readers.nastran import matrix_meaning

_TEXT = re.compile(rb"\A(?:[ \t]*-?\d+){3}[ \t]*[1-4][A-Za-z ]")
_RECORDS = tuple(struct.pack(f"{order}i", length) for order in "<>" for length in (24, 48))
_FORMAT = re.compile(r"(?:1P,)?(\d+)[EDF](\d+)", re.IGNORECASE)
_SYMMETRIC = 6
"""Form of a matrix of which half is stored."""
_MOST_DOFS = 2_000_000
_BIG = 65536
"""Rows from which the strings of a sparse column have two integers in front, as in a matrix with negative rows."""


class Op4Reader(MatrixReader):
    """Matrices of OUTPUT4; the DOFs of their rows are in the bulk data. Matrices that are not square are left out."""

    name = "op4"
    summary = "Matrices of NASTRAN (OUTPUT4, .op4)"
    suffixes = (".op4",)
    default_for = (".op4",)

    def sniff(self, content: bytes) -> bool:
        """Look for the integers in front of the first matrix."""
        return content[:4] in _RECORDS or _TEXT.match(content) is not None

    def read(self, path: Path, content: bytes) -> RecordedModel:  # noqa: ARG002
        """Return the square matrices."""
        source: _Source
        if content[:4] in _RECORDS:
            source = _Binary(content)
        elif _TEXT.match(content):
            source = _Text(content.decode("ascii", "replace"))
        else:
            raise ValueError("the file does not begin with the size of a matrix, as OUTPUT4 writes it.")
        matrices = dict[str, RecordedMatrix]()
        while (header := source.header()) is not None:
            values = _entries(source, header)
            if header.is_square:
                if header.is_complex:
                    raise ValueError(f"the matrix {header.name} is complex.")
                if header.name in matrices:
                    raise ValueError(f"there are two matrices {header.name}.")
                is_half = header.form == _SYMMETRIC
                matrices[header.name] = RecordedMatrix(values, matrix_meaning(header.name), is_half)
        if not matrices:
            raise ValueError("there is no square matrix.")
        return RecordedModel(matrices, axes=DIRECTIONS_1_TO_6, has_units=False)

    def samples(self, folder: Path) -> Sequence[Path]:
        """Write a spring between two nodes, in text and in binary."""
        text, binary = folder / "text.op4", folder / "binary.op4"
        column = "{:8d}{:8d}{:8d}\n{}\n"
        rows = [column.format(1, 1, 2, " 1.0000E+06-1.0000E+06"), column.format(2, 1, 2, "-1.0000E+06 1.0000E+06")]
        end = column.format(3, 1, 1, " 1.0000E+00")
        text.write_text(f"{2:8d}{2:8d}{6:8d}{2:8d}KAA     1P,5E11.4\n{''.join(rows)}{end}")
        records = [struct.pack("<4i8s", 2, 2, 6, 2, b"KAA     ")]
        records += [struct.pack("<3i2d", 1, 1, 4, 1e6, -1e6), struct.pack("<3i2d", 2, 1, 4, -1e6, 1e6)]
        records += [struct.pack("<3id", 3, 1, 2, 1.0)]
        binary.write_bytes(b"".join(struct.pack("<i", len(r)) + r + struct.pack("<i", len(r)) for r in records))
        return [text, binary]


class _Header(NamedTuple):
    columns: int
    rows: int
    form: int
    is_double: bool
    is_complex: bool
    name: str
    is_big: bool

    @property
    def is_square(self) -> bool:
        return self.rows == self.columns


class _Source(ABC):
    """The integers and reals of a file, in their order."""

    @abstractmethod
    def header(self) -> _Header | None:
        """Return the next header; None at the end of the file."""

    @abstractmethod
    def column(self) -> tuple[int, int, int]:
        """Return the number of a column, of its first row or zero if it is sparse, and of its words."""

    @abstractmethod
    def string(self, header: _Header) -> tuple[int, int]:
        """Return the number of words of the next string of a sparse column, and its first row."""

    @abstractmethod
    def reals(self, words: int, header: _Header, *, is_sparse: bool) -> NDArray[np.float64]:
        """Return the next reals, of so many words."""

    @abstractmethod
    def end_column(self) -> None:
        """Go to the next column."""

    @abstractmethod
    def end_matrix(self) -> None:
        """Go past what is behind the last column."""


def _entries(source: _Source, header: _Header) -> object:
    """Return the sparse matrix after a header.

    Raises
    ------
    ValueError
        A column is damaged.
    """
    from scipy.sparse import coo_array

    rows, columns, values = [np.zeros(0, np.intp)], [np.zeros(0, np.intp)], [np.zeros(0)]

    def add(first: int, entries: NDArray[np.float64]) -> None:
        if header.is_complex or not header.is_square:
            return
        if not 1 <= first <= header.rows - len(entries) + 1:
            raise ValueError(f"column {column} of {header.name} has rows outside of the matrix.")
        rows.append(np.arange(first - 1, first - 1 + len(entries)))
        columns.append(np.full(len(entries), column - 1))
        values.append(entries)

    while True:
        column, row, words = source.column()
        if column > header.columns or column < 1:
            source.end_matrix()
            break
        if row > 0:
            add(row, source.reals(words, header, is_sparse=False))
        while row <= 0 < words:
            length, first = source.string(header)
            words -= length + (2 if header.is_big else 1)
            add(first, source.reals(length, header, is_sparse=True))
        source.end_column()
    entries = np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))
    return coo_array(entries, shape=(header.rows, header.columns))


def _checked(columns: int, rows: int, form: int, kind: int, name: str) -> _Header:
    """Return a header.

    Raises
    ------
    ValueError
        The type is not one of NASTRAN's, or a square matrix is too large.
    """
    clean = re.sub(r"\W", "", name).upper()
    if kind not in (1, 2, 3, 4):
        raise ValueError(f"the matrix '{clean}' has the type {kind}, not one of 1 to 4.")
    if columns < 1 or rows == 0 or columns == abs(rows) > _MOST_DOFS:
        raise ValueError(f"the file announces a {abs(rows)} x {columns} matrix.")
    is_big = rows < 0 or rows >= _BIG
    return _Header(columns, abs(rows), abs(form), kind in (2, 4), kind > 2, clean, is_big)


class _Text(_Source):
    def __init__(self, text: str) -> None:
        self._lines = text.splitlines()
        self._at = 0
        self._per_line, self._width = 5, 16

    def _line(self) -> str:
        if self._at >= len(self._lines):
            raise ValueError("the file ends within a matrix.")
        self._at += 1
        return self._lines[self._at - 1]

    def header(self) -> _Header | None:
        while self._at < len(self._lines) and not self._lines[self._at].strip():
            self._at += 1
        if self._at == len(self._lines):
            return None
        line = self._line()
        wide = 16 if line.rstrip().endswith("|I16") else 8
        places = (0, wide, 2 * wide, 2 * wide + 8, 2 * wide + 16, 2 * wide + 24)
        numbers = [_integer(line[start:stop]) for start, stop in pairwise(places[:5])]
        if form := _FORMAT.search(line[places[5] :]):
            self._per_line, self._width = int(form.group(1)), int(form.group(2))
        columns, rows, shape, kind = numbers
        return _checked(columns, rows, shape, kind, line[places[4] : places[5]])

    def column(self) -> tuple[int, int, int]:
        line = self._line()
        return _integer(line[:8]), _integer(line[8:16]), _integer(line[16:24])

    def string(self, header: _Header) -> tuple[int, int]:
        line = self._line()
        if header.is_big:
            return _integer(line[:8]) - 1, _integer(line[8:16])
        return _packed(_integer(line))

    def reals(self, words: int, header: _Header, *, is_sparse: bool) -> NDArray[np.float64]:
        count = words // 2 if is_sparse and header.is_double else words
        cells = list[str]()
        while len(cells) < count:
            line = self._line()
            take = min(self._per_line, count - len(cells))
            cells += [line[at * self._width : (at + 1) * self._width] for at in range(take)]
        try:
            return np.array([float(cell.upper().replace("D", "E")) for cell in cells])
        except ValueError as error:
            raise ValueError(f"line {self._at}: {str(error)[:60]}.") from None

    def end_column(self) -> None:
        pass

    def end_matrix(self) -> None:
        self._line()


class _Binary(_Source):
    """Records of Fortran, each with its length in front and behind."""

    def __init__(self, content: bytes) -> None:
        self._content = content
        self._at = self._end = 0
        self._order = "<" if struct.unpack("<i", content[:4])[0] in (24, 48) else ">"
        self._is_wide = struct.unpack(f"{self._order}i", content[:4])[0] == 48
        self._integer = "q" if self._is_wide else "i"

    def _take(self, form: str) -> tuple[int, ...]:
        size = struct.calcsize(self._order + form)
        if self._at + size > len(self._content):
            raise ValueError("the file ends within a matrix.")
        self._at += size
        return struct.unpack_from(self._order + form, self._content, self._at - size)

    def header(self) -> _Header | None:
        if self._at >= len(self._content):
            return None
        self._take("i")
        columns, rows, form, kind = self._take(f"4{self._integer}")
        size = 16 if self._is_wide else 8
        name = self._content[self._at : self._at + size].decode("ascii", "replace")
        self._at += size
        self._take("i")
        return _checked(columns, rows, form, kind, name)

    def column(self) -> tuple[int, int, int]:
        (length,) = self._take("i")
        self._end = self._at + length
        column, row, words = self._take(f"3{self._integer}")
        return column, row, words

    def string(self, header: _Header) -> tuple[int, int]:
        if header.is_big:
            length, row = self._take(f"2{self._integer}")
            return length - 1, row
        return _packed(self._take(self._integer)[0])

    def reals(self, words: int, header: _Header, *, is_sparse: bool) -> NDArray[np.float64]:  # noqa: ARG002
        per_real = 2 if header.is_double and not self._is_wide else 1
        kind = "f8" if header.is_double or self._is_wide else "f4"
        count, size = words // per_real, int(kind[1])
        if count < 0 or self._at + count * size > len(self._content):
            raise ValueError("the file ends within a matrix.")
        self._at += count * size
        start = self._at - count * size
        found = np.frombuffer(self._content, dtype=np.dtype(f"{self._order}{kind}"), count=count, offset=start)
        return found.astype(np.float64)

    def end_column(self) -> None:
        if self._end < self._at:
            raise ValueError("a column is longer than its record.")
        self._at = self._end
        self._take("i")

    def end_matrix(self) -> None:
        self.end_column()


def _packed(number: int) -> tuple[int, int]:
    """Return the words and the first row of a string, which are packed in one integer."""
    length = (number >> 16) - 1
    return length, number - ((length + 1) << 16)


def _integer(text: str) -> int:
    try:
        return int(text)
    except ValueError:
        raise ValueError(f"'{text.strip()[:20]}' is not a whole number where the size of a part is expected.") from None
