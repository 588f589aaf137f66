"""The variables of a MATLAB 5 workspace.

scipy's reader is not used: a damaged file can end the process, a compressed element may unpack to a thousand times its
size, and a matrix may declare dimensions that its data do not fill.
Source of the layout: MAT-File Format, The MathWorks.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator, Mapping
from math import prod
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.errors import Fault, MeasurementError
from dovetail.measurement.formats.named_arrays import LARGEST_ARRAY

__all__ = ["NOT_READ", "Variable", "variables_of"]

Variable = NDArray[Any] | Mapping[str, Any] | None
"""Numbers in MATLAB's shape, a text as an array of one string, a struct by its fields, or None (`NOT_READ`)."""
NOT_READ = "of a class that is not read (cell, sparse, object, function handle, array of structs)"
_HEADER = 128
_COMPRESSED, _MATRIX = 15, 14
_STRUCT, _CHAR = 2, 4
_NUMBERS = range(6, 16)
_COMPLEX, _LOGICAL = 0x0800, 0x0200
_TYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
_TEXTS = {16: "utf-8", 17: "utf-16", 18: "utf-32"}
_LARGEST = 100_000_000
"""Bytes of all elements together."""
_MOST_MATRICES = 10_000
_DEEPEST = 8


class _DamagedError(Exception):
    """The elements do not fit each other."""


def variables_of(path: Path, content: bytes) -> dict[str, Variable]:
    """Return the variables of a workspace by name.

    Raises
    ------
    MeasurementError
        Damaged, truncated, or more than an FRF needs.
    """
    order = "<" if content[126:128] == b"IM" else ">"
    reader = _Reader(order)
    variables: dict[str, Variable] = {}
    total = 0
    for number, (kind, data) in enumerate(_top_elements(path, content, order), start=1):
        total += len(data)
        if total > _LARGEST:
            raise MeasurementError(Fault(str(path), "the workspace unpacks to far more than an FRF needs."))
        if kind != _MATRIX:
            continue
        try:
            name, value = reader.matrix(data, 0)
        except (_DamagedError, struct.error, ValueError) as error:
            reason = f": {error}" if isinstance(error, _DamagedError) else ""
            raise MeasurementError(Fault(f"{path}: variable {number}", f"the workspace is damaged{reason}.")) from None
        if name:
            variables[name] = value
    return variables


def _top_elements(path: Path, content: bytes, order: str) -> Iterator[tuple[int, bytes]]:
    """Yield type and data of each variable, unpacked."""
    position = _HEADER
    truncated = MeasurementError(Fault(str(path), "the workspace ends within a variable: it is truncated."))
    while position < len(content):
        if position + 8 > len(content):
            raise truncated
        kind, size = struct.unpack_from(f"{order}2I", content, position)
        data = content[position + 8 : position + 8 + size]
        if len(data) < size:
            raise truncated
        position += 8 + size
        yield _unpacked(path, data, order) if kind == _COMPRESSED else (kind, data)


def _unpacked(path: Path, data: bytes, order: str) -> tuple[int, bytes]:
    packed = zlib.decompressobj()
    try:
        plain = packed.decompress(data, _LARGEST)
    except zlib.error:
        raise MeasurementError(Fault(str(path), "a compressed variable is damaged.")) from None
    if packed.unconsumed_tail:
        raise MeasurementError(Fault(str(path), "the workspace unpacks to far more than an FRF needs."))
    kind, size = struct.unpack_from(f"{order}2I", plain) if len(plain) >= 8 else (0, 0)
    if not packed.eof or len(plain) < 8 + size:
        raise MeasurementError(Fault(str(path), "a compressed variable is truncated."))
    return kind, plain[8 : 8 + size]


class _Reader:
    """Reads matrices, and counts them."""

    def __init__(self, order: str) -> None:
        self._order = order
        self._matrices = 0

    def matrix(self, data: bytes, depth: int) -> tuple[str, Variable]:
        """Return name and value of a matrix."""
        self._matrices += 1
        if self._matrices > _MOST_MATRICES or depth > _DEEPEST:
            raise _DamagedError("it has more parts, or deeper ones, than any FRF")
        parts = self._elements(data)
        flags = struct.unpack_from(f"{self._order}I", next(parts, (0, b""))[1])[0]
        shape_data = next(parts, (0, b""))[1]
        name = next(parts, (0, b""))[1].decode("ascii", errors="replace")[:80]
        kind = flags & 0xFF
        if kind not in (_STRUCT, _CHAR, *_NUMBERS):
            return name, None
        shape = struct.unpack(f"{self._order}{len(shape_data) // 4}i", shape_data[: len(shape_data) // 4 * 4])
        if not 2 <= len(shape) <= 32 or min(shape) < 0:
            raise _DamagedError(f"'{name}' has the dimensions {shape}")
        if kind == _STRUCT:
            return name, self._struct(name, parts, prod(shape), depth)
        if kind == _CHAR:
            return name, np.array(self._text(next(parts, (0, b""))))
        return name, self._numbers(name, parts, shape, bool(flags & _COMPLEX))

    def _numbers(
        self, name: str, parts: Iterator[tuple[int, bytes]], shape: tuple[int, ...], is_complex: bool
    ) -> NDArray[Any]:
        if prod(shape) * 16 > LARGEST_ARRAY:
            raise _DamagedError(f"'{name}' has {prod(shape):,} numbers, far more than an FRF needs")
        real = self._vector(name, parts, prod(shape))
        if is_complex:
            real = real + 1j * self._vector(name, parts, prod(shape))
        return real.reshape(shape, order="F")

    def _vector(self, name: str, parts: Iterator[tuple[int, bytes]], items: int) -> NDArray[Any]:
        kind, data = next(parts, (0, b""))
        if kind not in _TYPES:
            raise _DamagedError(f"'{name}' has data of the type {kind}")
        dtype = np.dtype(self._order + _TYPES[kind])
        if len(data) != items * dtype.itemsize:
            raise _DamagedError(f"'{name}' has {len(data)} bytes of data for {items:,} numbers")
        return np.frombuffer(data, dtype)

    def _text(self, part: tuple[int, bytes]) -> str:
        kind, data = part
        if kind in _TEXTS:
            encoding = _TEXTS[kind] if kind == 16 else f"{_TEXTS[kind]}-{'le' if self._order == '<' else 'be'}"
            return data.decode(encoding, errors="replace")
        return data.decode("latin-1") if kind in (1, 2) else "".join(map(chr, self._codes(data)))

    def _codes(self, data: bytes) -> list[int]:
        codes: list[int] = np.frombuffer(data[: len(data) // 2 * 2], self._order + "u2").tolist()
        return codes

    def _struct(self, name: str, parts: Iterator[tuple[int, bytes]], items: int, depth: int) -> Variable:
        """Return the fields of one struct by name; an array of structs is not read."""
        length = struct.unpack_from(f"{self._order}i", next(parts, (0, b""))[1])[0]
        names = next(parts, (0, b""))[1]
        if not 1 <= length <= 1000:
            raise _DamagedError(f"'{name}' has field names of {length} letters")
        if items != 1:
            return None
        fields = [names[at : at + length].split(b"\0")[0] for at in range(0, len(names), length)]
        values = [data for _, data in parts]
        if len(values) != len(fields):
            raise _DamagedError(f"'{name}' has {len(fields)} fields and {len(values)} values")
        return {
            field.decode("ascii", errors="replace"): self.matrix(data, depth + 1)[1] if data else None
            for field, data in zip(fields, values, strict=True)
        }

    def _elements(self, data: bytes) -> Iterator[tuple[int, bytes]]:
        """Yield type and data of the elements that stand one behind the other, padded to eight bytes."""
        position = 0
        while position + 8 <= len(data):
            kind, size = struct.unpack_from(f"{self._order}2I", data, position)
            if kind >> 16:
                yield kind & 0xFFFF, data[position + 4 : position + 4 + min(kind >> 16, 4)]
                position += 8
                continue
            if position + 8 + size > len(data):
                raise _DamagedError("a part is longer than what holds it")
            yield kind, data[position + 8 : position + 8 + size]
            position += 8 + size + -size % 8
