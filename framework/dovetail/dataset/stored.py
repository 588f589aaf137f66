"""FRFs on disk, read in a way that a damaged or missing chunk is told and never filled in."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.errors import DatasetError, Fault

__all__ = ["StoredFrfs", "flags", "whole_array"]

_CHECKSUM_BYTES = 4
_READING_ERRORS = (OSError, ValueError, RuntimeError, TypeError)


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
        Give the magnitude of what is stored.

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
        """Return one FRF (n_freq,), or those of a slice (n, n_freq).

        Raises
        ------
        DatasetError
            They are not generated yet, or a chunk that holds them is missing or damaged.
        """
        if not isinstance(rows, slice):
            row = range(len(self))[rows]
            single: NDArray[Any] = self[row : row + 1][0]
            return single
        chosen = range(len(self))[rows]
        if chosen:
            chunks = range(min(chosen) // self.chunks[0], max(chosen) // self.chunks[0] + 1)
            self._require(chunks)
        try:
            values = np.asarray(self._array[rows])
        except _READING_ERRORS:
            self._blame(chunks)
            raise
        return np.abs(values) if self._magnitude else values

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        return np.asarray(self[:], dtype=dtype)

    def sound(self) -> NDArray[np.bool_]:
        """Return which chunks are written and there in full length, (n_chunks,)."""
        expected = self._chunk_bytes()
        files = [self._file(chunk) for chunk in range(len(self._written))]
        there = [file.is_file() and file.stat().st_size == expected for file in files]
        return self._written & np.array(there, dtype=np.bool_)

    def _chunk_bytes(self) -> int:
        codecs: list[str] = [codec["name"] for codec in self._array.metadata.to_dict()["codecs"]]
        plain = self.chunks[0] * self.chunks[1] * int(self._array.dtype.itemsize)
        return plain + _CHECKSUM_BYTES * codecs.count("crc32c")

    def _file(self, chunk: int) -> Path:
        return self._folder / str(self._array.basename) / "c" / str(chunk) / "0"

    def require_sound(self) -> None:
        """Raise DatasetError unless each chunk that was written is there in full length."""
        self._require(np.flatnonzero(self._written).tolist())

    def _require(self, chunks: Iterable[int]) -> None:
        expected = self._chunk_bytes()
        for chunk in chunks:
            file = self._file(chunk)
            if not self._written[chunk]:
                problem = "its generation was interrupted before these samples."
                raise DatasetError(Fault(str(self._folder), problem, remedy="Finish it with --resume."))
            if not file.is_file():
                raise self._fault(chunk, "it is missing", "Go on with --resume: it is computed anew.")
            size = file.stat().st_size
            if size != expected:
                damage = f"it has {size} bytes instead of {expected}"
                raise self._fault(chunk, damage, "Go on with --resume: it is computed anew.")

    def _blame(self, chunks: range) -> None:
        """Find the chunk that cannot be read and raise what is wrong with it."""
        for chunk in chunks:
            try:
                self._array[chunk * self.chunks[0]]
            except _READING_ERRORS as error:
                remedy = "Delete this file and go on with --resume: it is computed anew."
                raise self._fault(chunk, f"its content is damaged ({error})", remedy) from error

    def _fault(self, chunk: int, damage: str, remedy: str) -> DatasetError:
        last = min((chunk + 1) * self.chunks[0], len(self)) - 1
        held = f"samples {chunk * self.chunks[0]} to {last}"
        return DatasetError(Fault(str(self._file(chunk)), f"this chunk holds {held}, and {damage}.", remedy=remedy))


def whole_array(folder: Path, group: Any, name: str) -> NDArray[Any]:
    """Read a small array of a dataset at once.

    Raises
    ------
    DatasetError
        A chunk of it is missing or damaged.
    """
    array = group[name]
    place = str(folder / name)
    remedy = "Generate the dataset anew, or take it from a copy."
    if array.nchunks_initialized != array.nchunks:
        missing = array.nchunks - array.nchunks_initialized
        raise DatasetError(Fault(place, f"{missing} of its {array.nchunks} chunks are missing.", remedy=remedy))
    try:
        return np.asarray(array[:])
    except _READING_ERRORS as error:
        raise DatasetError(Fault(place, f"it is damaged ({error}).", remedy=remedy)) from error


def flags(folder: Path, group: Any, name: str) -> NDArray[np.bool_]:
    """Read which chunks are written; one without a flag is not.

    Raises
    ------
    DatasetError
        They cannot be read.
    """
    try:
        written: NDArray[np.bool_] = np.asarray(group[name][:]) != 0
    except _READING_ERRORS as error:
        remedy = f"Delete {folder / name / 'c'} and go on with --resume."
        raise DatasetError(Fault(str(folder / name), f"it is damaged ({error}).", remedy=remedy)) from error
    return written
