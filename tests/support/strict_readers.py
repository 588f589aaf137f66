"""Strict readers of each format, straight from its definition; they share no code with ours.

Each takes the bytes of a file like that of the corpus, with its names and units, and returns frequencies [Hz] and
accelerance [m/s^2/N]. A file that is spelled in another way than the definition has it raises `LibertyError`, with the
name of the liberty that our reader takes. HDF5 alone is opened by the same library as in ours.
"""

from __future__ import annotations

import ast
import csv
import io
import re
import struct
import zipfile
import zlib
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]
Read = tuple[Array, Array]

LIBERTIES = {
    "blanks": "blanks and tabs around cells, empty lines and blanks behind a row are left out",
    "code": "bytes that are no UTF-8 are Latin-1, in names and notes; UTF-16 is recognised by its mark",
    "line ends": "a carriage return alone ends a line, and so do mixed ends",
    "quotes": "a quote within a cell is left out",
    "names": "names of columns and arrays have many spellings, and a name may begin with that of a signal",
    "unit": "units are read by pint, in many spellings; a column without one has that of the others",
    "above": "any lines may stand above a table, and a header above may be a comment",
    "separator": "the separator follows from the lines themselves",
    "number": "a complex number in i or j, 'infinity' and the like, as Python writes them",
    "type": "arrays of other numbers than doubles, and other orders of bytes and axes",
    "several": "other arrays, sets and segments next to those of the FRF are left alone",
    "header": "keys of a LabVIEW header, and the order of their lines, do not matter; other keys are left alone",
    "fields": "fields of a universal file may stand next to their columns; those that say nothing are ignored",
    "archive": "an archive and an array may have trailing bytes, and unused fields of their headers are not looked at",
}
"""What our readers read and the strict ones do not, by name."""


class LibertyError(Exception):
    """A file that only our reader reads, by one of its liberties."""

    def __init__(self, liberty: str) -> None:
        assert liberty in LIBERTIES
        super().__init__(liberty)


def need(condition: object, liberty: str) -> None:
    if not condition:
        raise LibertyError(liberty)


# Tables of text

_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)
_FIELDS = {
    "frequency_Hz": "frequency",
    "Freq": "frequency",
    "f": "frequency",
    "real": "real",
    "Real": "real",
    "imag": "imag",
    "Imag": "imag",
    "coherence": "coherence",
}
_UNITS = {"": 1.0, "m/(N s^2)": 1.0, "m/s^2/N": 1.0, "g/N": 9.80665}


def lines_of(content: bytes, code: str = "utf-8") -> list[str]:
    need(b"\r" not in content and b"\x00" not in content and content[:2] not in (b"\xff\xfe", b"\xfe\xff"), "line ends")
    try:
        text = content.decode(code)
    except UnicodeDecodeError:
        raise LibertyError("code") from None
    need(not text.startswith("\ufeff"), "code")
    return text.removesuffix("\n").split("\n")


def number(cell: str, mark: str = ".") -> float:
    need(mark == "." or "." not in cell, "separator")
    text = cell.replace(mark, ".")
    need(cell == cell.strip(), "blanks")
    need(_NUMBER.fullmatch(text), "number")
    return float(text)


def is_number(cell: str, mark: str) -> bool:
    return bool(_NUMBER.fullmatch(cell.replace(mark, ".")))


def rows_of(lines: Sequence[str], separator: str) -> list[list[str]]:
    need(all(line.strip() for line in lines), "blanks")
    need(not any('"' in line for line in lines), "quotes")
    return list(csv.reader(lines, delimiter=separator, quoting=csv.QUOTE_NONE))


def table(separator: str, mark: str = ".", code: str = "utf-8") -> Callable[[bytes], Read]:
    """Return the reader of a table with this separator and decimal mark."""

    def read(content: bytes) -> Read:
        lines = lines_of(content, code)
        rows = rows_of(lines, separator)
        first = next((i for i, row in enumerate(rows) if len(row) > 2 and all(is_number(c, mark) for c in row)), None)
        need(first is not None, "separator")
        assert first is not None
        has_units = first > 1 and rows[first - 1][0] in ("Hz", "")
        need(first > has_units, "above")
        names = rows[first - 1 - has_units]
        units = rows[first - 1] if has_units else [""] * len(names)
        need(all(name in _FIELDS for name in names), "names")
        fields = [_FIELDS[name] for name in names]
        need({"frequency", "real", "imag"} <= set(fields) and len(set(fields)) == len(fields), "names")
        need(not any("frequency" in line or "Freq" in line for line in lines[: first - 1 - has_units]), "above")
        table = [[number(cell, mark) for cell in row] for row in rows[first:]]
        assert {len(row) for row in table} == {len(names)}, "rows of different lengths"
        columns = dict(zip(fields, np.array(table).T, strict=True))
        of_column = dict(zip(fields, units, strict=True))
        need(of_column["frequency"] in ("", "Hz") and of_column["real"] == of_column["imag"], "unit")
        unit = of_column["real"] or next((w for line in lines[:first] for w in re.findall(r"^# unit: (.*)", line)), "")
        need(unit in _UNITS, "unit")
        need(not any("unit" in line and not line.startswith("# unit: ") for line in lines[:first]), "unit")
        return columns["frequency"], _UNITS[unit] * (columns["real"] + 1j * columns["imag"])

    return read


def cutpro(content: bytes) -> Read:
    """Three columns with tabs between them, behind those of the first row its labels."""
    rows = rows_of(lines_of(content), "\t")
    table = [[number(cell, ",") for cell in row[:3]] for row in rows]
    assert {len(row) for row in rows[1:]} <= {3}, "rows of different lengths"
    assert len(rows[0]) >= 3
    need(rows[0][3:] in (["Freq", "Hz", "Real", "m/s^2/N"], []), "unit")
    frequency, real, imag = np.array(table).T
    return frequency, real + 1j * imag


def labview(content: bytes) -> Read:
    """A header of the file, one of the segment, names, and rows; the last column may hold comments."""
    lines = [line.rstrip("\t") for line in lines_of(content)]
    ends = [i for i, line in enumerate(lines) if line == "***End_of_Header***"]
    need(len(ends) == 2, "several")
    first, second = (
        {k: v for k, *v in (line.split("\t") for line in part)}
        for part in (
            lines[: ends[0]],
            lines[ends[0] + 1 : ends[1]],
        )
    )
    need(lines[0] == "LabVIEW Measurement" and first.get("Separator") == ["Tab"], "header")
    need(first.get("Decimal_Separator") == ["."] and first.get("X_Columns") == ["One"], "header")
    need(second.get("X_Dimension") == ["Frequency"] * 2 and second.get("X_Unit_Label") == ["Hz"] * 2, "header")
    need(second.get("Channels") == ["2"], "header")
    need(lines[ends[1] + 1].split("\t") == ["X_Value", "FRF (Real)", "FRF (Imag)", "Comment"], "names")
    need(second.get("Y_Unit_Label") == ["m/s^2/N"] * 2, "unit")
    rows = [line.split("\t") for line in lines[ends[1] + 2 :]]
    need(all(len(row) in (3, 4) for row in rows), "blanks")
    frequency, real, imag = np.array([[number(cell) for cell in row[:3]] for row in rows]).T
    return frequency, real + 1j * imag


# Arrays of numpy


def npy(content: bytes) -> Array:
    """One array, in format 1.0, as numpy's page on the format describes it."""
    need(content[:8] == b"\x93NUMPY\x01\x00", "archive")
    (length,) = struct.unpack_from("<H", content, 8)
    try:
        header = ast.literal_eval(content[10 : 10 + length].decode("latin-1"))
    except (SyntaxError, ValueError):
        raise LibertyError("archive") from None
    need(isinstance(header, dict) and header.keys() == {"descr", "fortran_order", "shape"}, "archive")
    need(re.fullmatch(r"<(f8|c16|U\d+)", str(header["descr"])) and header["fortran_order"] is False, "type")
    dtype, shape = np.dtype(header["descr"]), header["shape"]
    size = int(np.prod(shape)) * dtype.itemsize
    need(len(content) == 10 + length + size, "archive")
    array: Array = np.frombuffer(content, dtype, offset=10 + length).reshape(shape)
    return array


def npy_columns(content: bytes) -> Read:
    array = npy(content)
    need(array.dtype == np.complex128 and array.ndim == 2 and array.shape[1] == 2, "type")
    assert not array[:, 0].imag.any()
    return array[:, 0].real, array[:, 1]


def npz(content: bytes) -> Read:
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        need(len(set(archive.namelist())) == len(archive.namelist()), "several")
        arrays = {
            name: npy(archive.read(name)) for name in ("frequency.npy", "values.npy") if name in archive.namelist()
        }
        need(len(arrays) == 2, "names")
        unit = "m/s^2/N"
        if "unit.npy" in archive.namelist():
            unit = str(npy(archive.read("unit.npy")).reshape(-1)[0])
    need(unit in _UNITS, "unit")
    frequency, values = arrays["frequency.npy"], arrays["values.npy"]
    need(frequency.dtype == np.float64 and values.dtype == np.complex128, "type")
    return frequency.ravel(), _UNITS[unit] * values.ravel()


# Universal files: the records of data set 58 as SDRC's description of the format has them


class Record7(NamedTuple):
    form: int
    count: int
    is_even: bool
    first: float
    step: float


def integer(text: str) -> int:
    need(re.fullmatch(r" *[+-]?\d+", text, re.ASCII), "fields")
    return int(text)


def real(text: str) -> float:
    need(re.fullmatch(r" *[+-]?\d*\.\d*([eEdD][+-]?\d+)?", text, re.ASCII) and re.search(r"\d", text), "fields")
    return float(text.replace("D", "E").replace("d", "e"))


def universal(content: bytes) -> Read:
    """The only FRF of a file."""
    found = [uff_set for uff_set in sets_58(content) if integer(uff_set[0][6][0:5]) == 4]
    need(len(found) == 1, "several")
    header, order, data = found[0]
    directions = integer(header[6][51:55]), integer(header[6][76:80])
    fields = header[7].ljust(80)
    seven = Record7(
        integer(fields[0:10]),
        integer(fields[10:20]),
        fields[20:30].strip() == "1",
        real(fields[30:43]),
        real(fields[43:56]),
    )
    need(fields[20:30].strip() in ("0", "1"), "fields")
    kinds = [integer(header[n][0:10]) for n in (8, 9, 10)]
    need(kinds == [18, 12, 13] and header[8][47:67].strip() in ("Hz", "NONE", ""), "fields")
    need(header[9][47:67].strip() in ("m/s^2", "NONE") and header[10][47:67].strip() in ("N", "NONE"), "unit")
    need(max(map(abs, directions)) <= 3, "fields")
    sign = -1.0 if directions[0] * directions[1] < 0 else 1.0
    frequency, values = data_58(data, seven, order)
    return frequency, sign * values


def sets_58(content: bytes) -> Iterator[tuple[list[str], str, bytes]]:
    """Yield header lines (from 1), the order of bytes or nothing for text, and the data of each set 58."""
    place = 0
    while content[place:].strip():
        start, place = line_at(content, place)
        need(start.rstrip() == b"    -1", "fields")
        kind, after = line_at(content, place)
        header = [""]
        for _ in range(11):
            line, after = line_at(content, after)
            header.append(line.decode("latin-1"))
        need(kind[:6] == b"    58", "several")
        if kind[6:7] == b"b":
            fields = kind.decode("latin-1").ljust(80)
            order, size = integer(fields[7:13]), integer(fields[31:43])
            need(order in (1, 2) and integer(fields[13:19]) == 2 and integer(fields[19:31]) == 11, "fields")
            data, after = content[after : after + size], after + size
            end, place = line_at(content, after)
            end, place = (end, place) if end.strip() else line_at(content, place)
            need(end.rstrip() == b"    -1", "fields")
            yield header, "<" if order == 1 else ">", data
        else:
            lines = []
            line, after = line_at(content, after)
            while line.rstrip() != b"    -1":
                need(after < len(content), "fields")
                lines.append(line)
                line, after = line_at(content, after)
            place = after
            yield header, "", b"\n".join(lines)


def line_at(content: bytes, place: int) -> tuple[bytes, int]:
    need(place < len(content), "fields")
    end = content.find(b"\n", place)
    end = len(content) if end < 0 else end
    line = content[place:end].removesuffix(b"\r")
    need(b"\r" not in line, "line ends")
    return line, end + 1


def data_58(data: bytes, seven: Record7, order: str) -> Read:
    parts = 2 if seven.form in (5, 6) else 1
    need(seven.form in (2, 4, 5, 6), "fields")
    item = ("E13.5", "f4") if seven.form in (2, 5) else ("E20.12", "f8")
    if order:
        kinds = ([] if seven.is_even else [("x", f"{order}{item[1]}")]) + [
            (f"v{i}", f"{order}{item[1]}") for i in range(parts)
        ]
        table = np.frombuffer(data, np.dtype(kinds))
        columns = [table[name].astype(np.float64) for name, _ in kinds]
    else:
        widths = ([] if seven.is_even else [13]) + [13 if item[0] == "E13.5" else 20] * parts
        columns = list(np.array(list(numbers_58(data, widths, seven))).reshape(-1, len(widths)).T)
    assert all(len(column) == seven.count for column in columns), "not as many lines as the header announces"
    frequency = seven.first + seven.step * np.arange(seven.count) if seven.is_even else columns.pop(0)
    return frequency, columns[0] + 1j * columns[1] if parts == 2 else columns[0].astype(complex)


def numbers_58(data: bytes, widths: Sequence[int], seven: Record7) -> Iterator[float]:
    """Yield the numbers of rows of up to 80 columns, each in its own columns."""
    whole = 80 // sum(widths) if sum(widths) != 26 else 3
    for line in data.decode("latin-1").split("\n"):
        place = 0
        text = line.rstrip()
        for width in list(widths) * whole:
            if place < len(text):
                yield real(text[place : place + width])
            place += width
        need(len(text) <= place, "fields")


# HDF5, and MATLAB's two formats


def hdf5(content: bytes, *, matlab: bool = False) -> Read:
    import h5py

    with h5py.File(io.BytesIO(content), "r") as file:
        need({"frequency", "values"} <= set(file), "names")
        unit = file["values"].attrs.get("unit", file.attrs.get("unit", ""))
        need(isinstance(unit, str) and unit in _UNITS, "unit")
        need(not set(file["frequency"].attrs) & {"unit", "units"}, "unit")
        frequency, values = file["frequency"][()], file["values"][()]
    if matlab:
        need(values.dtype.names == ("real", "imag"), "type")
        values = values["real"] + 1j * values["imag"]
    need(frequency.dtype == np.float64 and values.dtype == np.complex128, "type")
    return frequency.ravel(), _UNITS[unit] * values.ravel()


_MATLAB_TYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}


def matlab_5(content: bytes) -> Read:
    """Variables `frequency` and `values` of full doubles, as MathWorks describes the format."""
    need(content[124:128] == b"\x00\x01IM", "type")
    variables: dict[str, Array] = {}
    for kind, data in elements(content[128:]):
        if kind == 15:
            (kind, data), *_ = elements(zlib.decompress(data))
        need(kind == 14, "several")
        flags, shape, name, *numbers = elements(data)
        (number_of_class,) = struct.unpack_from("<I", flags[1])
        label = name[1].decode("latin-1")
        need(label not in variables, "several")
        if label not in ("frequency", "values"):
            continue
        need(number_of_class & 0xFF == 6, "type")
        need(len(numbers) == 1 + bool(number_of_class & 0x800), "type")
        parts = [np.frombuffer(part, "<" + _MATLAB_TYPES[code]).astype(float) for code, part in numbers]
        assert all(part.size == np.prod(np.frombuffer(shape[1], "<i4")) for part in parts)
        variables[label] = parts[0] if len(parts) == 1 else parts[0] + 1j * parts[1]
    need(len(variables) == 2, "names")
    need(np.iscomplexobj(variables["values"]), "type")
    return variables["frequency"], variables["values"]


def elements(data: bytes) -> Iterator[tuple[int, bytes]]:
    place = 0
    while place < len(data):
        need(place + 8 <= len(data), "archive")
        kind, size = struct.unpack_from("<II", data, place)
        if kind >> 16:
            yield kind & 0xFFFF, data[place + 4 : place + 4 + (kind >> 16)]
            place += 8
        else:
            need(place + 8 + size <= len(data), "archive")
            yield kind, data[place + 8 : place + 8 + size]
            place += 8 + size + (-size % 8 if kind != 15 else 0)


READERS: dict[str, Callable[[bytes], Read]] = {
    "a.csv": table(","),
    "a.tsv": table("\t"),
    "a.txt": table(";", ",", "latin-1"),
    "a.frf": cutpro,
    "a.lvm": labview,
    "a.npy": npy_columns,
    "a.npz": npz,
    "a.uff": universal,
    "b.uff": universal,
    "a.h5": hdf5,
    "a.mat": matlab_5,
    "b.mat": lambda content: hdf5(content, matlab=True),
}
