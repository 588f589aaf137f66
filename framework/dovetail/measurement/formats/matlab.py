"""FRFs in MATLAB workspaces: version 5 (``save -v6``, ``save -v7``), and version 7.3, which is HDF5."""

from __future__ import annotations

import io
from collections.abc import Iterator, Sequence
from functools import partial
from math import prod
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.errors import Fault, MeasurementError
from dovetail.measurement.formats.guarded_process import Form, read_guarded
from dovetail.measurement.formats.hdf5 import SIGNATURE
from dovetail.measurement.formats.named_arrays import LARGEST_ARRAY, Archive, Entry
from dovetail.measurement.recording import ReadOptions, Recording

__all__ = ["decode", "form_of", "workspace"]

_VERSION = slice(124, 128)
_VERSION_5 = (b"\x00\x01IM", b"\x01\x00MI")
_NO_NUMBERS = ("cell", "struct", "object", "sparse", "function", "opaque")
"""Classes, as scipy calls them, whose shape does not say how much they hold."""
_NOT_READ = "of a class that is not read (cell, sparse, object, function handle, array of structs)"
_ITEM = 16
"""Bytes of the largest number, a complex one in double precision."""
_MOST_NUMBERS = 12_500_000
"""In all variables together."""


def decode(path: Path, content: bytes, options: ReadOptions) -> Recording:
    """Return what a MATLAB workspace holds.

    Raises
    ------
    MeasurementError
        Neither version 5 nor 7.3, damaged, or its names do not say which FRF it holds.
    """
    return read_guarded(path, content, options, form_of(path, content))


def form_of(path: Path, content: bytes) -> Form:
    """Return the version of a workspace.

    Raises
    ------
    MeasurementError
        Neither version 5 nor 7.3.
    """
    if SIGNATURE in (content[:8], content[512:520]):
        return "MATLAB 7.3"
    if content[_VERSION] in _VERSION_5:
        return "MATLAB 5"
    accepted = "version 5 (save -v6, save -v7) or 7.3 (save -v7.3)"
    raise MeasurementError(Fault(str(path), "this is no MATLAB workspace of a version that is read.", accepted))


def workspace(path: Path, content: bytes) -> Archive:
    """Return the variables of a workspace of version 5; to be called in the guarded process only.

    Raises
    ------
    MeasurementError
        Damaged, truncated, or more than an FRF needs.
    """
    from scipy.io import loadmat, whosmat

    try:
        _check_sizes(path, whosmat(io.BytesIO(content)))
        variables = {name: value for name, value in loadmat(io.BytesIO(content)).items() if not name.startswith("__")}
        return Archive(path, {key: entry for name in variables for key, entry in _entries(path, name, variables[name])})
    except MeasurementError:
        raise
    except MemoryError:
        raise MeasurementError(Fault(str(path), "the workspace unpacks to far more than an FRF needs.")) from None
    except Exception as error:  # scipy raises ValueError, TypeError, zlib.error and others for damaged files
        reason = " ".join(str(error).split())[:100] or type(error).__name__
        raise MeasurementError(Fault(str(path), f"the workspace is damaged or truncated: {reason}.")) from None


def _check_sizes(path: Path, variables: Sequence[tuple[str, tuple[int, ...], str]]) -> None:
    """Refuse numbers that are too many before they are unpacked."""
    sizes = {name: 0 if kind in _NO_NUMBERS else prod(shape) for name, shape, kind in variables}
    for number, (name, size) in enumerate(sizes.items(), start=1):
        if size * _ITEM > LARGEST_ARRAY:
            problem = f"the workspace is damaged: '{name}' has {size:,} numbers, far more than an FRF needs."
            raise MeasurementError(Fault(f"{path}: variable {number}", problem))
    if sum(sizes.values()) > _MOST_NUMBERS:
        raise MeasurementError(Fault(str(path), "the workspace unpacks to far more than an FRF needs."))


def _entries(path: Path, name: str, value: Any) -> Iterator[tuple[str, Entry]]:
    """Yield numbers and texts; fields of a struct by their path."""
    is_array = type(value) is np.ndarray  # objects and function handles are subclasses
    if is_array and value.dtype.names and value.size == 1:
        for field in value.dtype.names:
            yield from _entries(path, f"{name}.{field}", value[field].item())
    elif not is_array or value.dtype.kind not in "biufcU":
        yield name, Entry(_NOT_READ, partial(_refuse, path, name))
    elif value.dtype.kind == "U":
        yield name, Entry("text", partial(np.array, "".join(value.ravel().tolist())))
    else:
        yield name, Entry(f"{value.shape} {value.dtype.name}", partial(np.asarray, value))


def _refuse(path: Path, name: str) -> NDArray[Any]:
    raise MeasurementError(Fault(str(path), f"'{name}' is {_NOT_READ}.", "a full matrix of numbers"))
