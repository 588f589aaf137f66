"""The arrays of a dataset on disk. A missing or damaged chunk is an error, never a block of fill values."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from dovetail.dataset.metadata import chunk_bytes
from dovetail.errors import DatasetError, Fault

Storage = Literal["amplitude", "complex"]
"""Stored form of each accelerance: amplitude (float32), or amplitude and phase (complex64)."""

ARRAYS: dict[Storage, tuple[str, str]] = {
    "amplitude": ("amplitude", "float32"),
    "complex": ("accelerance", "complex64"),
}
"""Name and type of the array of FRFs."""

READING_ERRORS = (OSError, ValueError, RuntimeError, TypeError, ArithmeticError, LookupError, AttributeError)
"""What Zarr raises for damaged files, and for metadata that contradict each other."""


class StoredFrfs:
    """The FRFs of a dataset, read when they are indexed by a row or a slice of rows.

    Parameters
    ----------
    folder : path
        The dataset's.
    array : zarr.Array
        (n_samples, n_responses n_freq), one chunk a block of samples.
    written : (n_chunks,) bool array
        Which chunks the generation has finished.
    magnitude : bool
        Return magnitudes where complex values are stored.

    Attributes
    ----------
    shape : tuple of int
    chunks : tuple of int
    dtype : numpy.dtype
    """

    def __init__(self, folder: Path, array: Any, written: NDArray[np.bool_], *, magnitude: bool = False) -> None:
        self._folder = folder
        self._array = array
        self._written = written
        self._magnitude = magnitude and array.dtype.kind == "c"
        self.shape: tuple[int, int] = array.shape
        self.chunks: tuple[int, int] = array.chunks
        self.dtype: np.dtype[Any] = np.dtype(np.float32) if self._magnitude else array.dtype

    def __len__(self) -> int:
        return self.shape[0]

    def __getitem__(self, rows: int | slice) -> NDArray[Any]:
        """Return the FRF of a row (n_freq,), or those of a slice (n, n_freq).

        Raises
        ------
        DatasetError
            They are not generated yet, or a chunk that holds them is missing or damaged.
        """
        if not isinstance(rows, slice):
            row = range(len(self))[rows]
            single: NDArray[Any] = self[row : row + 1][0]
            return single
        numbers = range(len(self))[rows]
        chunks = range(min(numbers) // self.chunks[0], max(numbers) // self.chunks[0] + 1) if numbers else range(0)
        self._check(chunks)
        try:
            values = np.asarray(self._array[rows])
        except READING_ERRORS:
            self._raise_damage(chunks)
            raise
        return np.abs(values) if self._magnitude else values

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        return np.asarray(self[:], dtype=dtype)

    def complete_chunks(self) -> NDArray[np.bool_]:
        """Return which chunks are complete: marked as written, and present in full length, (n_chunks,)."""
        expected = self._chunk_bytes()
        files = [self._file(chunk) for chunk in range(len(self._written))]
        present = [file.is_file() and file.stat().st_size == expected for file in files]
        return self._written & np.array(present, dtype=np.bool_)

    def _chunk_bytes(self) -> int:
        return chunk_bytes(self._array.metadata.to_dict())

    def _file(self, chunk: int) -> Path:
        return self._folder / str(self._array.basename) / "c" / str(chunk) / "0"

    def check_chunks(self, among: NDArray[np.intp] | None = None) -> None:
        """Raise DatasetError unless each chunk (or some) that is marked as written is present in full length."""
        chunks = np.flatnonzero(self._written)
        self._check((chunks if among is None else np.intersect1d(chunks, among)).tolist())

    def _check(self, chunks: Iterable[int]) -> None:
        expected = self._chunk_bytes()
        for chunk in chunks:
            file = self._file(chunk)
            if not self._written[chunk]:
                problem = "its generation was interrupted before these samples."
                raise DatasetError(Fault(str(self._folder), problem, remedy="Finish it with `resume=True`."))
            if not file.is_file():
                raise self._fault(chunk, "it is missing", "Continue with `resume=True` to compute it again.")
            size = file.stat().st_size
            if size != expected:
                damage = f"it has {size} bytes instead of {expected}"
                raise self._fault(chunk, damage, "Continue with `resume=True` to compute it again.")

    def _raise_damage(self, chunks: range) -> None:
        """Raise an error that names the chunk which cannot be read."""
        for chunk in chunks:
            try:
                self._array[chunk * self.chunks[0]]
            except READING_ERRORS as error:
                remedy = "Delete this file and continue with `resume=True` to compute it again."
                raise self._fault(chunk, f"its content is damaged ({error})", remedy) from error

    def _fault(self, chunk: int, damage: str, remedy: str) -> DatasetError:
        last = min((chunk + 1) * self.chunks[0], len(self)) - 1
        samples = f"samples {chunk * self.chunks[0]} to {last}"
        return DatasetError(Fault(str(self._file(chunk)), f"this chunk holds {samples}, and {damage}.", remedy=remedy))


def read_array(folder: Path, group: Any, name: str) -> NDArray[Any]:
    """Read a small array of a dataset.

    Raises
    ------
    DatasetError
        A chunk of it is missing or damaged.
    """
    array = group[name]
    where = str(folder / name)
    remedy = "Generate the dataset again, or restore a copy."
    if array.nchunks_initialized != array.nchunks:
        missing = array.nchunks - array.nchunks_initialized
        raise DatasetError(Fault(where, f"{missing} of its {array.nchunks} chunks are missing.", remedy=remedy))
    try:
        _check_lengths(folder / name, array)
        return np.asarray(array[:])
    except READING_ERRORS as error:
        raise DatasetError(Fault(where, f"it is damaged ({error}).", remedy=remedy)) from error


def read_flags(folder: Path, group: Any, name: str) -> NDArray[np.bool_]:
    """Read which chunks are written; a chunk without a flag is not.

    Raises
    ------
    DatasetError
        They cannot be read.
    """
    try:
        _check_lengths(folder / name, group[name])
        return np.asarray(group[name][:], dtype=np.bool_)
    except READING_ERRORS as error:
        remedy = f"Delete {folder / name / 'c'} and continue with `resume=True`."
        raise DatasetError(Fault(str(folder / name), f"it is damaged ({error}).", remedy=remedy)) from error


def _check_lengths(folder: Path, array: Any) -> None:
    """Raise a ValueError if a chunk is a device, or its length contradicts the metadata, before it is read."""
    expected = chunk_bytes(array.metadata.to_dict())
    for file in (folder / "c").rglob("*"):
        if not file.is_dir() and not (file.is_file() and file.stat().st_size == expected):
            raise ValueError(f"the chunk {file.relative_to(folder)} is not a file of {expected} bytes")
