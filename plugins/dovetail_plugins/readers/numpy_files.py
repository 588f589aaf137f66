"""NumPy archives (.npz) and single NumPy arrays (.npy), read without pickle."""

from __future__ import annotations

import io
import math
import zipfile
from collections.abc import Sequence
from contextlib import AbstractContextManager
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail import (
    ArrayEntry,
    Fault,
    Frf,
    FrfReader,
    FrfToWrite,
    MeasurementError,
    RecordedArrays,
    damage_reported,
)
from dovetail_plugins.arrays import holds_impossible_characters

_LARGEST_ARRAY = 40_000_000
"""Largest size of an unpacked array in bytes."""
_SMALL_ARRAY = 16_000
"""Largest size in bytes of an array that is loaded to see what it states."""
_MOST_ARRAYS = 1000
_ENTRY = b"PK\x01\x02"
"""First bytes of each entry in the directory; counted, since the number at the end of the archive may be wrong."""
_WIDEST_ITEM = 4000
"""Largest size of an array item in bytes: a text of 1000 characters."""
_MOST_AXES = 3
_MOST_LINES = 1_000_000
"""Largest number of lines of an FRF."""


class NpzReader(FrfReader):
    """Named arrays as `numpy.savez` writes them."""

    name = "npz"
    summary = "Archives of NumPy arrays: .npz"
    suffixes = (".npz",)
    default_for = suffixes
    written = suffixes

    def sniff(self, content: bytes) -> bool:
        """Look for the signature of a zip archive."""
        return content.startswith(b"PK\x03\x04")

    def read(self, path: Path, content: bytes) -> RecordedArrays:
        """Return the arrays, without loading them.

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
            return RecordedArrays(path, {name: _entry(path, archive, name) for name in names})

    def write(self, content: FrfToWrite, path: Path) -> bytes:  # noqa: ARG002
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

    def samples(self, folder: Path) -> Sequence[Path]:
        """Write an FRF as `write` does."""
        file = folder / "sample.npz"
        frf = Frf(np.array([10.0, 20.0, 30.0]), np.array([1.0, 2.0j, 3.0]), "accelerance", averages=4, note="bench")
        file.write_bytes(self.write(FrfToWrite(frf, frf.unit, 1.0), file))
        return [file]


class NpyReader(FrfReader):
    """One array: structured, or columns that a user names."""

    name = "npy"
    summary = "A single NumPy array: .npy"
    suffixes = (".npy",)
    default_for = suffixes

    def sniff(self, content: bytes) -> bool:
        """Look for the signature."""
        return content.startswith(b"\x93NUMPY")

    def read(self, path: Path, content: bytes) -> NDArray[Any]:
        """Return the array.

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
            if len(content) > _LARGEST_ARRAY:
                problem = f"the array has {len(content) / 1e6:.0f} MB."
                raise MeasurementError(Fault(str(path), problem, f"at most {_LARGEST_ARRAY // 1_000_000} MB"))
            array = np.asarray(np.lib.format.read_array(io.BytesIO(content), allow_pickle=False))
        for field in array.dtype.names or ():
            _check_texts(path, field, array[field])
        return _check_texts(path, path.name, array)

    def samples(self, folder: Path) -> Sequence[Path]:
        """Write two complex columns, and a structured array."""
        lines, values = np.array([10.0, 20.0, 30.0]), np.array([1.0, 2.0j, 3.0])
        fields = np.zeros(3, dtype=[("frequency", "f8"), ("values", "c16")])
        fields["frequency"], fields["values"] = lines, values
        files = folder / "columns.npy", folder / "structured.npy"
        np.save(files[0], np.column_stack([lines, values]))
        np.save(files[1], fields)
        return files


def _report_damage(path: Path) -> AbstractContextManager[None]:
    """Convert the errors that zipfile, decompressors and NumPy raise for a damaged archive to one fault."""
    return damage_reported(str(path), "the archive is damaged", "a file of np.savez")


def _entry(path: Path, archive: zipfile.ZipFile, name: str) -> ArrayEntry:
    is_small = archive.getinfo(f"{name}.npy").file_size <= _SMALL_ARRAY
    return ArrayEntry("", partial(_load_array, path, archive, name), is_small=is_small)


def _load_array(path: Path, archive: zipfile.ZipFile, name: str) -> NDArray[Any]:
    """Return one array, if its header shows that it is small and holds plain values."""
    with _report_damage(path):
        size = archive.getinfo(f"{name}.npy").file_size
        if size > _LARGEST_ARRAY:
            accepted = f"at most {_LARGEST_ARRAY // 1_000_000} MB"
            raise MeasurementError(Fault(str(path), f"'{name}' unpacks to {size / 1e6:.0f} MB.", accepted))
        with archive.open(f"{name}.npy") as stream:
            _check_plain(path, name, *_read_header(path, stream, name))
        with archive.open(f"{name}.npy") as stream:
            array = np.asarray(np.lib.format.read_array(stream, allow_pickle=False))
        return _check_texts(path, name, array)


def _check_plain(path: Path, name: str, shape: tuple[int, ...], dtype: np.dtype[Any]) -> None:
    """Refuse Python objects, and arrays that are too large for an FRF."""
    if dtype.hasobject:
        problem = f"'{name}' holds Python objects (pickle), which are never loaded."
        raise MeasurementError(Fault(str(path), problem, "an array of numbers"))
    if any(length > _MOST_LINES for length in shape) or len(shape) > _MOST_AXES or dtype.itemsize > _WIDEST_ITEM:
        problem = f"'{name}' has the shape {shape} of {dtype.itemsize} bytes each."
        accepted = f"the shape (n_freq,) or with axes of DOFs, at most {_MOST_LINES:,} lines"
        raise MeasurementError(Fault(str(path), problem, accepted))


def _check_texts(path: Path, name: str, array: NDArray[Any]) -> NDArray[Any]:
    """Return an array after the check that its texts hold characters."""
    if holds_impossible_characters(array):
        problem = "the text holds a number that is not the code of any character: the file is damaged."
        raise MeasurementError(Fault(f"{path}  {name}", problem, "a text"))
    return array


def _read_header(path: Path, stream: Any, name: str) -> tuple[tuple[int, ...], np.dtype[Any]]:
    version = np.lib.format.read_magic(stream)
    if version == (1, 0):
        shape, _, dtype = np.lib.format.read_array_header_1_0(stream)
    elif version == (2, 0):
        shape, _, dtype = np.lib.format.read_array_header_2_0(stream)
    else:
        raise MeasurementError(Fault(str(path), f"'{name}' has the array format {version}.", "format 1.0 or 2.0"))
    return shape, dtype
