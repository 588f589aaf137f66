"""FRFs in MATLAB workspaces: version 5 (``save -v6``, ``save -v7``), and version 7.3, which is HDF5."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.errors import Fault, MeasurementError
from dovetail.measurement.formats.guarded_process import read_apart
from dovetail.measurement.formats.hdf5 import SIGNATURE
from dovetail.measurement.formats.matlab_elements import NOT_READ, Variable, variables_of
from dovetail.measurement.formats.named_arrays import Archive, Entry, recording_of
from dovetail.measurement.recording import Recording, Selection

__all__ = ["archive_of", "decode", "is_hdf5"]

_VERSION = slice(124, 128)
_VERSION_5 = (b"\x00\x01IM", b"\x01\x00MI")


def decode(path: Path, content: bytes, selection: Selection) -> Recording:
    """Return what a MATLAB workspace holds.

    Raises
    ------
    MeasurementError
        Neither version 5 nor 7.3, damaged, or its names do not say which FRF it holds.
    """
    if is_hdf5(content):
        return read_apart(path, selection, matlab=True)
    return recording_of(archive_of(path, content), selection)


def is_hdf5(content: bytes) -> bool:
    """Whether a workspace is of version 7.3."""
    return SIGNATURE in (content[:8], content[512:520])


def archive_of(path: Path, content: bytes) -> Archive:
    """Return the variables of a workspace of version 5.

    Raises
    ------
    MeasurementError
        Another version, or damaged.
    """
    if content[_VERSION] not in _VERSION_5:
        accepted = "version 5 (save -v6, save -v7) or 7.3 (save -v7.3)"
        raise MeasurementError(Fault(str(path), "this is no MATLAB workspace of a version that is read.", accepted))
    entries: dict[str, Entry] = {}
    for name, value in variables_of(path, content).items():
        entries |= dict(_flattened(path, name, value))
    return Archive(path, entries)


def _flattened(path: Path, name: str, value: Variable) -> Iterator[tuple[str, Entry]]:
    """Yield numbers and texts; fields of a struct by their path."""
    if isinstance(value, Mapping):
        for field, inner in value.items():
            yield from _flattened(path, f"{name}.{field}", inner)
    elif value is None:
        yield name, Entry(NOT_READ, partial(_refuse, path, name))
    else:
        what = "text" if value.dtype.kind == "U" else f"{value.shape} {value.dtype.name}"
        yield name, Entry(what, partial(np.asarray, value))


def _refuse(path: Path, name: str) -> NDArray[Any]:
    raise MeasurementError(Fault(str(path), f"'{name}' is {NOT_READ}.", "a full matrix of numbers"))
