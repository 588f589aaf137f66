"""The variables of MATLAB workspaces of version 5 (``save -v6`` and ``-v7``); only imported by the guarded process."""

from __future__ import annotations

import io
import struct
import zlib
from collections.abc import Iterator, Sequence
from math import prod
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail import Fault, MeasurementError, damage_reported

_LARGEST_ARRAY = 40_000_000
"""Largest size of an unpacked array in bytes."""
_SMALL_ARRAY = 16_000
"""Largest size in bytes of an array that is loaded to see what it states."""
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


def workspace_contents(path: Path, content: bytes, names: Sequence[str] | None) -> dict[str, Any]:
    """Return the variables of a workspace, and why others are not returned.

    Parameters
    ----------
    path : Path
    content : bytes
    names : sequence of str or None
        Of the arrays; None for all.

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
            loaded = loadmat(io.BytesIO(content), variable_names=wanted)
            variables = {key: value for name in wanted for key, value in _entries(name, loaded[name])}
        except MemoryError:
            problem = "the workspace unpacks to far more than an FRF needs."
            raise MeasurementError(Fault(str(path), problem)) from None
    arrays = {name: value for name, value in variables.items() if isinstance(value, np.ndarray)}
    accepted = "a full matrix of numbers"
    return {
        "entries": {name: (_what(value), {}, _is_small(value)) for name, value in variables.items()},
        "closed": closed,
        "attributes": {},
        "groups": {},
        "faults": {
            name: (str(path), f"'{name}' is {_NOT_READ}.", accepted, "") for name in variables if name not in arrays
        },
    } | {f"array {name}": value for name, value in arrays.items() if names is None or name in names}


def _what(value: NDArray[Any] | None) -> str:
    if value is None:
        return _NOT_READ
    return "text" if value.dtype.kind == "U" else f"{value.shape} {value.dtype.name}"


def _is_small(value: NDArray[Any] | None) -> bool:
    return value is None or value.dtype.kind == "U" or value.nbytes <= _SMALL_ARRAY


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
        if not 0 <= size * _ITEM <= _LARGEST_ARRAY:  # scipy takes a negative length to be unknown
            problem = f"the workspace is damaged: '{name}' has {size:,} numbers, not as many as an FRF."
            raise MeasurementError(Fault(f"{path}: variable {number}", problem))
    if sum(sizes.values()) > _MOST_NUMBERS:
        raise MeasurementError(Fault(str(path), "the workspace unpacks to far more than an FRF needs."))


def _entries(name: str, value: Any, depth: int = 0) -> Iterator[tuple[str, NDArray[Any] | None]]:
    """Yield numbers and texts, with fields of a struct named by path and contents of a cell numbered from 1.

    What is neither is None.
    """
    from scipy.io.matlab import MatlabObject

    is_array = type(value) is np.ndarray  # function handles are subclasses
    if (is_array or isinstance(value, MatlabObject)) and value.dtype.names and value.size == 1:
        for field in value.dtype.names:
            yield from _entries(f"{name}.{field}", value[field].item(), depth)
    elif is_array and value.dtype.names and value.size <= _MOST_CELLS and depth < 3:
        for number, element in enumerate(value.ravel(order="F"), start=1):
            for field in value.dtype.names:
                yield from _entries(f"{name}({number}).{field}", element[field], depth + 1)
    elif is_array and value.dtype.kind == "O" and value.size <= _MOST_CELLS and depth < 3:
        for number, content in enumerate(value.ravel(order="F"), start=1):
            yield from _entries(f"{name}{{{number}}}", content, depth + 1)
    elif not is_array or value.dtype.kind not in "biufcU":
        yield name, None
    else:
        yield name, np.array("".join(value.ravel().tolist())) if value.dtype.kind == "U" else np.asarray(value)
