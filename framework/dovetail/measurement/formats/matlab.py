"""FRFs in MATLAB workspaces: version 5 (``save -v6``, ``save -v7``), and version 7.3, which is HDF5."""

from __future__ import annotations

import io
import struct
import zlib
from collections.abc import Iterator, Sequence
from functools import partial
from math import prod
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.errors import Fault, MeasurementError, damage_reported
from dovetail.measurement.formats.archives import LARGEST_ARRAY, SMALL_ARRAY, Archive, Entry
from dovetail.measurement.formats.frd import closed_entry, with_frd_units
from dovetail.measurement.formats.hdf5 import SIGNATURE

_VERSION = slice(124, 128)
_VERSION_5 = (b"\x00\x01IM", b"\x01\x00MI")
_CELL, _STRUCT, _OBJECT, _SPARSE, _FUNCTION, _OPAQUE = 1, 2, 3, 5, 16, 17
"""Numbers of classes in MATLAB's description of the format; those of numbers and texts are 4 and 6 to 15."""
_NO_NUMBERS = (_CELL, _STRUCT, _OBJECT, _SPARSE, _FUNCTION, _OPAQUE)
"""Classes whose shape does not determine the size of their contents."""
_HEADER = 1000
"""Number of bytes that contain the class, the shape and the name of a variable."""
_COMPRESSED = 10_000
"""Number of compressed bytes that unpack to at least a header, whatever their compression."""
_MOST_CELLS = 1000
_NOT_READ = "of a class that is not read (sparse, object, function handle)"
_ITEM = 16
"""Bytes of the largest type of number, complex in double precision."""
_MOST_NUMBERS = 12_500_000
"""Largest number of elements in all variables together."""


def check_version(path: Path, content: bytes) -> bool:
    """Return whether a workspace has version 7.3.

    Raises
    ------
    MeasurementError
        The version is neither 5 nor 7.3.
    """
    if SIGNATURE in (content[:8], content[512:520]):
        return True
    if content[_VERSION] in _VERSION_5:
        return False
    accepted = "version 5 (save -v6, save -v7) or 7.3 (save -v7.3)"
    raise MeasurementError(Fault(str(path), "this is no MATLAB workspace of a version that is read.", accepted))


def workspace(path: Path, content: bytes) -> Archive:
    """Return the variables of a workspace of version 5; only for the guarded process.

    Raises
    ------
    MeasurementError
        The file is damaged, truncated, or larger than any FRF.
    """
    from scipy.io import loadmat

    with damage_reported(str(path), "the workspace is damaged or truncated"):  # ValueError, zlib.error and others
        try:
            listed = list(_variables(content))
            _check_sizes(path, listed)
            closed = {name: label for name, _, kind, label in listed if kind in (_FUNCTION, _OPAQUE)}
            wanted = [name for name, _, _, _ in listed if name and name not in closed]
            variables = loadmat(io.BytesIO(content), variable_names=wanted)
            entries = {key: entry for name in wanted for key, entry in _entries(path, name, variables[name])}
            objects = {name: closed_entry(path, name, label, entries) for name, label in closed.items()}
            return Archive(path, with_frd_units(path, entries, ".") | objects)
        except MemoryError:
            problem = "the workspace unpacks to far more than an FRF needs."
            raise MeasurementError(Fault(str(path), problem)) from None


def _variables(content: bytes) -> Iterator[tuple[str, tuple[int, ...], int, str]]:
    """Yield name, shape and class number of each variable, and the class of an object that only MATLAB can open.

    scipy's `whosmat` fails if there is such an object.
    """
    order = "<" if content[126:128] == b"IM" else ">"
    position = 128
    while position + 8 <= len(content):
        kind, size = struct.unpack_from(f"{order}2I", content, position)
        start = content[position + 8 : position + 8 + min(size, _COMPRESSED)]
        if kind == 15:
            start = zlib.decompressobj().decompress(start, _HEADER)[8:]
        position += 8 + size
        fields = [data for _, data in zip(range(4), _elements(start[:_HEADER], order), strict=False)]
        number = struct.unpack_from(f"{order}I", fields[0])[0] & 0xFF
        if number == _OPAQUE:
            yield fields[1].decode("latin-1"), (), number, fields[3].decode("latin-1")
        else:
            shape = struct.unpack_from(f"{order}{len(fields[1]) // 4}i", fields[1])
            yield fields[2].decode("latin-1"), shape, number, "function handle"


def _elements(content: bytes, order: str) -> Iterator[bytes]:
    """Yield the data of the elements of a variable; up to four bytes are stored in the tag itself."""
    position = 0
    while position + 8 <= len(content):
        kind, size = struct.unpack_from(f"{order}2I", content, position)
        if kind >> 16:
            yield content[position + 4 : position + 4 + (kind >> 16)]
            position += 8
        else:
            yield content[position + 8 : position + 8 + size]
            position += 8 + size + -size % 8


def _check_sizes(path: Path, variables: Sequence[tuple[str, tuple[int, ...], int, str]]) -> None:
    """Refuse too many numbers before they are unpacked."""
    sizes = {name: 0 if kind in _NO_NUMBERS else prod(shape) for name, shape, kind, _ in variables}
    for number, (name, size) in enumerate(sizes.items(), start=1):
        if not 0 <= size * _ITEM <= LARGEST_ARRAY:  # scipy takes a negative length to be unknown
            problem = f"the workspace is damaged: '{name}' has {size:,} numbers, not as many as an FRF."
            raise MeasurementError(Fault(f"{path}: variable {number}", problem))
    if sum(sizes.values()) > _MOST_NUMBERS:
        raise MeasurementError(Fault(str(path), "the workspace unpacks to far more than an FRF needs."))


def _entries(path: Path, name: str, value: Any, depth: int = 0) -> Iterator[tuple[str, Entry]]:
    """Yield numbers and texts, with fields of a struct named by path and contents of a cell numbered from 1."""
    from scipy.io.matlab import MatlabObject

    is_array = type(value) is np.ndarray  # function handles are subclasses
    if (is_array or isinstance(value, MatlabObject)) and value.dtype.names and value.size == 1:
        for field in value.dtype.names:
            yield from _entries(path, f"{name}.{field}", value[field].item(), depth)
    elif is_array and value.dtype.names and value.size <= _MOST_CELLS and depth < 3:
        for number, element in enumerate(value.ravel(order="F"), start=1):
            for field in value.dtype.names:
                yield from _entries(path, f"{name}({number}).{field}", element[field], depth + 1)
    elif is_array and value.dtype.kind == "O" and value.size <= _MOST_CELLS and depth < 3:
        for number, content in enumerate(value.ravel(order="F"), start=1):
            yield from _entries(path, f"{name}{{{number}}}", content, depth + 1)
    elif not is_array or value.dtype.kind not in "biufcU":
        yield name, Entry(_NOT_READ, partial(_refuse, path, name))
    elif value.dtype.kind == "U":
        yield name, Entry("text", partial(np.array, "".join(value.ravel().tolist())))
    else:
        is_small = value.nbytes <= SMALL_ARRAY
        yield name, Entry(f"{value.shape} {value.dtype.name}", partial(np.asarray, value), is_small=is_small)


def _refuse(path: Path, name: str) -> NDArray[Any]:
    raise MeasurementError(Fault(str(path), f"'{name}' is {_NOT_READ}.", "a full matrix of numbers"))
