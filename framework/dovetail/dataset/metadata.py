"""The metadata of a dataset's arrays, checked before any of them is opened.

Zarr calls any codec that the metadata name, and allocates any length that they give. A codec may unpickle. So only the
metadata that `generate` writes are accepted: format 3, plain chunks with or without a checksum, of limited size.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from dovetail.atomic_files import read_bounded
from dovetail.errors import DatasetError, Fault, FileError

_LARGEST_CHUNK = 200_000_000
"""Bytes."""
LARGEST_ARRAY = 500_000_000
"""Bytes of an array that is read whole: parameters, frequencies, flags."""
_LARGEST_METADATA = 16_000_000
"""Bytes; the attributes of the group contain the description."""
_CODECS = ([["bytes"], ["bytes", "crc32c"]], "bytes, crc32c")
_REMEDY = "Generate the dataset again, or restore a copy."
_ATTRIBUTES: dict[str, type] = {"name": str, "description": str, "fingerprint": str, "seed": int}
"""Required attributes of the group."""


def check_attributes(folder: Path, attributes: Mapping[str, Any]) -> None:
    """Check that a dataset describes its origin.

    Raises
    ------
    DatasetError
    """
    for name, kind in _ATTRIBUTES.items():
        if type(attributes.get(name)) is not kind:
            fault = f"its '{name}' is {attributes.get(name)!r:.40}" if name in attributes else f"it has no '{name}'"
            accepted = "a whole number" if kind is int else "a text"
            raise DatasetError(Fault(str(folder / "zarr.json"), f"{fault}.", f"'{name}' as {accepted}", _REMEDY))


def check_metadata(folder: Path, array: str, dtype: str) -> None:
    """Check that a dataset has the arrays of `generate`, with consistent shapes and permitted codecs.

    Parameters
    ----------
    folder : Path
    array, dtype : str
        Name and type of the array of the FRFs.

    Raises
    ------
    DatasetError
    """
    wanted = {"parameters": ("float64", 2), "frequency": ("float64", 1), array: (dtype, 2), "written": ("uint8", 1)}
    arrays = {name: _checked(folder / name, *kind, whole=name != array) for name, kind in wanted.items()}
    (samples, _), (lines,), (rows, width), (flags,) = (tuple(metadata["shape"]) for metadata in arrays.values())
    chunk = arrays[array]["chunk_grid"]["configuration"]["chunk_shape"]
    if rows != samples or not lines or width % lines or chunk[1] != width or flags != -(-rows // chunk[0]):
        problem = f"its arrays are inconsistent: {samples} parameter vectors, {rows} FRFs of {width} values, "
        raise DatasetError(Fault(str(folder), f"{problem}{lines} frequencies, {flags} flags.", remedy=_REMEDY))


def read_metadata(folder: Path, kind: str) -> dict[str, Any]:
    """Return the metadata of a group or an array.

    Raises
    ------
    DatasetError
        It is missing, damaged, of another kind or not of Zarr's format 3.
    """
    try:
        metadata = json.loads(read_bounded(folder / "zarr.json", _LARGEST_METADATA))
    except (FileError, ValueError, RecursionError) as error:
        reason = error.faults[0].problem.rstrip(".") if isinstance(error, FileError) else str(error)
        raise DatasetError(
            Fault(str(folder), f"this is not a readable dovetail dataset (zarr.json: {reason}).")
        ) from None
    if not isinstance(metadata, dict) or metadata.get("zarr_format") != 3 or metadata.get("node_type") != kind:
        raise DatasetError(Fault(str(folder), f"this is not a dovetail dataset: no Zarr {kind} of format 3."))
    return metadata


def _checked(folder: Path, dtype: str, axes: int, *, whole: bool) -> dict[str, Any]:
    """Return the checked metadata of an array; `whole` if it will be read at once."""
    metadata = read_metadata(folder, "array")
    try:
        shape, grid = metadata["shape"], metadata["chunk_grid"]
        chunk = grid["configuration"]["chunk_shape"]
        codecs = [codec["name"] for codec in metadata["codecs"]]
        endian = metadata["codecs"][0].get("configuration", {}).get("endian", "little")
        plain: tuple[Any, ...] = (
            *(grid["name"] == "regular", metadata["data_type"] == dtype, endian == "little"),
            *(not metadata.get("storage_transformers"), len(shape) == len(chunk) == axes),
            all(type(length) is int and length > 0 for length in (*shape, *chunk)),
            metadata.get("chunk_key_encoding", {}) == {"name": "default", "configuration": {"separator": "/"}},
        )
    except (KeyError, TypeError, AttributeError, IndexError):
        codecs, plain = [], (False,)
    if codecs not in _CODECS[0]:
        names = ", ".join(str(name)[:40] for name in codecs[:5]) or "none"
        raise DatasetError(Fault(str(folder), f"its codecs are {names}.", _CODECS[1], _REMEDY))
    if not all(plain):
        raise DatasetError(
            Fault(str(folder), f"this is not an array of {dtype} as 'dovetail generate' writes it.", "", _REMEDY)
        )
    size = np.dtype(dtype).itemsize
    if size * math.prod(chunk) > _LARGEST_CHUNK or (whole and size * math.prod(shape) > LARGEST_ARRAY):
        problem = f"its shape {tuple(shape)} in chunks of {tuple(chunk)} is far more than a dataset needs."
        accepted = f"{LARGEST_ARRAY / 1e6:.0f} MB, in chunks of {_LARGEST_CHUNK / 1e6:.0f} MB"
        raise DatasetError(Fault(str(folder), problem, accepted, _REMEDY))
    return metadata


def chunk_bytes(metadata: Mapping[str, Any]) -> int:
    """Return the length of the file of a chunk."""
    chunk: list[int] = metadata["chunk_grid"]["configuration"]["chunk_shape"]
    has_checksum = any(codec["name"] == "crc32c" for codec in metadata["codecs"])
    return int(math.prod(chunk) * np.dtype(metadata["data_type"]).itemsize + 4 * has_checksum)
