"""Named arrays of HDF5 files and MATLAB workspaces, which C libraries read in a guarded process, never in this one."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from dovetail import ArrayEntry, Fault, MeasurementError, RecordedArrays, call_guarded
from dovetail_plugins.readers.frd import closed_object, with_frd_units

_Contents = Callable[..., Mapping[str, Any]]
"""Function of a guarded process: path, content, further arguments, and the names of the arrays or None for all."""


def read_arrays(
    function: _Contents, path: Path, content: bytes, *arguments: Any, separator: str, is_matlab: bool = True
) -> RecordedArrays:
    """Return the arrays that a function returns from a guarded process.

    Parameters
    ----------
    function : callable
    path : Path
    content : bytes
    *arguments
        Of the function, between the content and the names.
    separator : str
        Between a struct and its fields.
    is_matlab : bool
        Whether structs of frequency response data are to be recognised.

    Raises
    ------
    MeasurementError
        The file is damaged, or needs more memory or time to read than any FRF.
    """
    held = call_guarded(function, path, content, *arguments, None, error=MeasurementError)

    def load(name: str) -> NDArray[Any]:
        answer = held
        if name not in held["faults"] and f"array {name}" not in held:
            answer = call_guarded(function, path, content, *arguments, [name], error=MeasurementError)
        if name in answer["faults"]:
            raise MeasurementError(Fault(*answer["faults"][name]))
        array: NDArray[Any] = answer[f"array {name}"]
        return array

    entries = {
        name: ArrayEntry(what, partial(load, name), attributes, is_small)
        for name, (what, attributes, is_small) in held["entries"].items()
    }
    if is_matlab:
        entries = with_frd_units(path, entries, separator)
    closed = [closed_object(path, name, label) for name, label in held["closed"].items()]
    entries |= {name: entry for name, (entry, _) in zip(held["closed"], closed, strict=True)}
    faults = [fault for _, fault in closed if fault is not None]
    return RecordedArrays(path, entries, held["attributes"], held["groups"], faults)
