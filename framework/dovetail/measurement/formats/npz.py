"""FRFs in NumPy archives and in single NumPy arrays, read without pickle."""

from __future__ import annotations

import io
import math
import sys
import zipfile
from contextlib import AbstractContextManager
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.errors import Fault, MeasurementError, damage_reported
from dovetail.measurement.formats.archives import LARGEST_ARRAY, SMALL_ARRAY, Archive, Entry
from dovetail.measurement.formats.column_arrays import columns_of_array
from dovetail.measurement.formats.named_arrays import read_recording
from dovetail.measurement.recording import MOST_LINES, ReadOptions, Recording
from dovetail.measurement.writing import FrfToWrite

_MOST_ARRAYS = 1000
_ENTRY = b"PK\x01\x02"
"""First bytes of each entry in the directory; counted, since the number at the end of the archive may be wrong."""
_WIDEST_ITEM = 4000
"""Largest size of an array item in bytes: a text of 1000 characters."""
_MOST_AXES = 3


def decode(path: Path, content: bytes, options: ReadOptions) -> Recording:
    """Return the FRF in an NPZ file.

    Raises
    ------
    MeasurementError
        Not an archive, missing or misshapen arrays, Python objects.
    """
    with _report_damage(path):
        return read_recording(open_archive(path, content), options)


def open_archive(path: Path, content: bytes) -> Archive:
    """Return the arrays of an NPZ file without loading them.

    Raises
    ------
    MeasurementError
        Not an archive.
    """
    if content.count(_ENTRY) > _MOST_ARRAYS:
        raise MeasurementError(Fault(str(path), f"the archive has more than {_MOST_ARRAYS} entries."))
    with _report_damage(path):
        archive = zipfile.ZipFile(io.BytesIO(content))
        names = [name.removesuffix(".npy") for name in archive.namelist() if name.endswith(".npy")]
        return Archive(path, {name: _entry(path, archive, name) for name in names})


def _entry(path: Path, archive: zipfile.ZipFile, name: str) -> Entry:
    is_small = archive.getinfo(f"{name}.npy").file_size <= SMALL_ARRAY
    return Entry("", partial(_load_array, path, archive, name), is_small=is_small)


def _report_damage(path: Path) -> AbstractContextManager[None]:
    """Convert the errors that zipfile, decompressors and NumPy raise for a damaged archive to one fault."""
    return damage_reported(str(path), "the archive is damaged", "a file of np.savez")


def encode(content: FrfToWrite, _path: Path, _binary: bool | None) -> bytes:
    """Return an NPZ file."""
    frf = content.frf
    arrays: dict[str, Any] = {"frequency": frf.frequency, "quantity": np.array(frf.quantity)}
    arrays |= {"values": content.values} if frf.has_phase else {"amplitude": np.abs(content.values)}
    arrays["unit"] = np.array(content.unit)
    for name, array in (("coherence", frf.coherence), ("variance", content.variance)):
        if array is not None:
            arrays[name] = array
    if frf.averages is not None:
        arrays["averages"] = np.array(frf.averages)
    for name in ("note", "response", "force"):
        if text := getattr(frf, name):
            arrays[name] = np.array(text)
    stream = io.BytesIO()
    np.savez(stream, **arrays)
    return stream.getvalue()


def _load_array(path: Path, archive: zipfile.ZipFile, name: str) -> NDArray[Any]:
    """Return one array, if its header shows that it is small and holds plain values."""
    with _report_damage(path):
        return _load_plain_array(path, archive, name)


def _load_plain_array(path: Path, archive: zipfile.ZipFile, name: str) -> NDArray[Any]:
    size = archive.getinfo(f"{name}.npy").file_size
    if size > LARGEST_ARRAY:
        raise MeasurementError(
            Fault(str(path), f"'{name}' unpacks to {size / 1e6:.0f} MB.", f"at most {LARGEST_ARRAY // 1_000_000} MB")
        )
    with archive.open(f"{name}.npy") as stream:
        _check_plain(path, name, *_read_header(path, stream, name))
    with archive.open(f"{name}.npy") as stream:
        array = np.asarray(np.lib.format.read_array(stream, allow_pickle=False))
    return _check_texts(path, name, array)


def _check_plain(path: Path, name: str, shape: tuple[int, ...], dtype: np.dtype[Any]) -> None:
    """Refuse Python objects, and arrays that are too large for an FRF."""
    if dtype.hasobject:
        raise MeasurementError(
            Fault(str(path), f"'{name}' holds Python objects (pickle), which are never loaded.", "an array of numbers")
        )
    if any(length > MOST_LINES for length in shape) or len(shape) > _MOST_AXES or dtype.itemsize > _WIDEST_ITEM:
        raise MeasurementError(
            Fault(
                str(path),
                f"'{name}' has the shape {shape} of {dtype.itemsize} bytes each.",
                f"the shape (n_freq,) or with axes of DOFs, at most {MOST_LINES:,} lines",
            )
        )


def decode_array(path: Path, content: bytes, options: ReadOptions) -> Recording:
    """Return the FRF in an NPY file: a structured array, two complex columns, or columns that the caller names.

    Raises
    ------
    MeasurementError
        Not an array, Python objects, an array without frequencies or with columns that are not named.
    """
    array = read_array(path, content)
    if array.dtype.names:
        return read_recording(archive_of_fields(path, array), options)
    if options.chooses or options.names:
        option = options.chooses or f"names={dict(options.names)}"
        raise MeasurementError(Fault(str(path), f"{option} is not for an array without names, which holds one FRF."))
    return columns_of_array(path, array, options, "the array")


def read_array(path: Path, content: bytes) -> NDArray[Any]:
    """Return the array in an NPY file.

    Raises
    ------
    MeasurementError
        Not an array, Python objects, a truncated or a large array.
    """
    stream = io.BytesIO(content)
    with _report_damage(path):
        shape, dtype = _read_header(path, stream, path.name)
        _check_plain(path, path.name, shape, dtype)
        if math.prod(shape) * dtype.itemsize > len(content):
            raise MeasurementError(Fault(str(path), f"the array is truncated: its shape is {shape}."))
        if len(content) > LARGEST_ARRAY:
            problem = f"the array has {len(content) / 1e6:.0f} MB."
            raise MeasurementError(Fault(str(path), problem, f"at most {LARGEST_ARRAY // 1_000_000} MB"))
        array = np.asarray(np.lib.format.read_array(io.BytesIO(content), allow_pickle=False))
    for field in array.dtype.names or ():
        _check_texts(path, field, array[field])
    return _check_texts(path, path.name, array)


def _check_texts(path: Path, name: str, array: NDArray[Any]) -> NDArray[Any]:
    """Return an array after the check that its texts hold characters: NumPy takes their codes from the file as is."""
    if array.dtype.kind == "U" and array.itemsize:
        native = np.ascontiguousarray(array.astype(array.dtype.newbyteorder("=")))
        if np.any(native.reshape(-1).view(np.uint32) > sys.maxunicode):
            problem = "the text holds a number that is not the code of any character: the file is damaged."
            raise MeasurementError(Fault(f"{path}  {name}", problem, "a text"))
    return array


def archive_of_fields(path: Path, array: NDArray[Any]) -> Archive:
    """Return the fields of a structured array as named arrays."""
    return Archive(path, {name: Entry("", partial(np.asarray, array[name])) for name in array.dtype.names or ()})


def _read_header(path: Path, stream: Any, name: str) -> tuple[tuple[int, ...], np.dtype[Any]]:
    version = np.lib.format.read_magic(stream)
    if version == (1, 0):
        shape, _, dtype = np.lib.format.read_array_header_1_0(stream)
    elif version == (2, 0):
        shape, _, dtype = np.lib.format.read_array_header_2_0(stream)
    else:
        raise MeasurementError(Fault(str(path), f"'{name}' has the array format {version}.", "format 1.0 or 2.0"))
    return shape, dtype
