"""HDF5 files and MATLAB workspaces, which C libraries read in a guarded process, never in this one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import fields
from functools import partial
from pathlib import Path
from typing import Any, Literal

from dovetail.errors import MeasurementError, require_package
from dovetail.guarded_process import call_guarded
from dovetail.measurement.formats import hdf5, matlab
from dovetail.measurement.formats.archives import Archive, Entry
from dovetail.measurement.formats.column_names import plain_name
from dovetail.measurement.formats.named_arrays import read_recording
from dovetail.measurement.recording import ReadOptions, Recording
from dovetail.measurement.statements import Statement

__all__ = ["answer", "decode", "read_arrays"]

Form = Literal["HDF5", "MATLAB 7.3", "MATLAB 5"]
_HELD = tuple(field.name for field in fields(Recording) if field.name not in ("where", "label", "locate"))
"""Fields of a recording that the guarded process returns."""


def decode(path: Path, content: bytes, options: ReadOptions) -> Recording:
    """Return the FRF in a file.

    Raises
    ------
    MeasurementError
        The file is invalid, or needs more memory or time to read than any FRF.
    DovetailError
        h5py is not installed.
    """
    question = [options.index, options.response, options.force, dict(options.names), options.columns, options.skip]
    held = _ask(path, content, {"options": question})
    held["mentions"] = [Statement(*mention) for mention in held.get("mentions", ())]
    return Recording(
        where=str(path),
        label=path.name,
        locate=lambda index: f"{path}  line {index + 1} of the arrays",
        **{"coherence": None, "variance": None} | held,
    )


def read_arrays(path: Path, content: bytes, names: Sequence[str]) -> Archive:
    """Return the arrays of a file; only those whose full name or last word is among `names` can be loaded.

    Raises
    ------
    MeasurementError, DovetailError
        As in `decode`.
    """
    held = _ask(path, content, {"arrays": list(names)})
    return Archive(path, {name: Entry("", partial(held.__getitem__, name)) for name in held["names"]})


def _ask(path: Path, content: bytes, question: Mapping[str, Any]) -> dict[str, Any]:
    form: Form = "HDF5"
    if path.suffix.lower() == ".mat":
        form = "MATLAB 7.3" if matlab.check_version(path, content) else "MATLAB 5"
    else:
        hdf5.check_signature(path, content)
    if form != "MATLAB 5":
        require_package("h5py", "hdf5", str(path))
    return call_guarded(answer, path, content, form, dict(question), error=MeasurementError)


def answer(path: Path, content: bytes, form: Form, question: Mapping[str, Any]) -> dict[str, Any]:
    """Return the requested contents of a file; only for the guarded process."""
    with _opened(path, content, form) as archive:
        if "options" in question:
            index, response, force, named, columns, skip = question["options"]
            recording = read_recording(archive, ReadOptions(index, response, force, named, tuple(columns), tuple(skip)))
            return {name: getattr(recording, name) for name in _HELD}
        names = question["arrays"]
        wanted = [name for name in archive.entries if name in names or plain_name(name) in names]
        return {"names": list(archive.entries)} | {name: archive.entries[name].load() for name in wanted}


def _opened(path: Path, content: bytes, form: Form) -> AbstractContextManager[Archive]:
    if form == "MATLAB 5":
        return nullcontext(matlab.workspace(path, content))
    return hdf5.open_hdf5(path, content, matlab=form == "MATLAB 7.3")
