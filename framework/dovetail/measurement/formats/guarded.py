"""HDF5 files and MATLAB workspaces, which C libraries read in a guarded process, never in this one."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import fields
from functools import partial
from pathlib import Path
from typing import Any, Literal

from numpy.typing import NDArray

from dovetail.errors import MeasurementError, require_package
from dovetail.guarded_process import call_guarded
from dovetail.measurement.formats import hdf5, matlab
from dovetail.measurement.formats.archives import Archive, Entry
from dovetail.measurement.formats.named_arrays import read_recording
from dovetail.measurement.quantity_words import words_of
from dovetail.measurement.recording import ReadOptions, Recording
from dovetail.measurement.statements import Statement

Form = Literal["HDF5", "MATLAB 7.3", "MATLAB 5"]
_HELD = tuple(field.name for field in fields(Recording) if field.name not in ("where", "label", "locate"))
"""Fields of a recording that the guarded process returns."""

_ARRAY = "array "
"""Before the names of arrays in an answer."""


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
    """Return the arrays of a file, of which only small ones and those of certain names can be loaded.

    Parameters
    ----------
    path : Path
    content : bytes
    names : sequence of str
        Names of arrays, or words in their names.

    Raises
    ------
    MeasurementError, DovetailError
        As in `decode`.
    """
    held = _ask(path, content, {"arrays": list(names)})
    entries = {
        name: Entry(what, partial(held.__getitem__, _ARRAY + name), attributes, _ARRAY + name in held)
        for name, (what, attributes) in held["entries"].items()
    }
    return Archive(path, entries, held["attributes"], held["groups"])


def _ask(path: Path, content: bytes, question: Mapping[str, Any]) -> dict[str, Any]:
    form: Form = "HDF5"
    if path.suffix.lower() == ".mat":
        form = "MATLAB 7.3" if matlab.check_version(path, content) else "MATLAB 5"
    else:
        hdf5.check_signature(path, content)
    if form != "MATLAB 5":
        require_package("h5py", "hdf5", str(path), load=False)
    return call_guarded(answer, path, content, form, dict(question), error=MeasurementError)


def answer(path: Path, content: bytes, form: Form, question: Mapping[str, Any]) -> dict[str, Any]:
    """Return the requested contents of a file; only for the guarded process."""
    with _opened(path, content, form) as archive:
        if "options" in question:
            index, response, force, named, columns, skip = question["options"]
            recording = read_recording(archive, ReadOptions(index, response, force, named, tuple(columns), tuple(skip)))
            return {name: getattr(recording, name) for name in _HELD}
        return {
            "entries": {name: (entry.what, dict(entry.attributes)) for name, entry in archive.entries.items()},
            "attributes": dict(archive.attributes),
            "groups": {name: dict(attributes) for name, attributes in archive.group_attributes.items()},
        } | {_ARRAY + name: array for name, array in _wanted_arrays(archive, question["arrays"])}


def _wanted_arrays(archive: Archive, names: Sequence[str]) -> Iterator[tuple[str, NDArray[Any]]]:
    for name, entry in archive.entries.items():
        is_named = name in names or not set(names).isdisjoint(words_of(name))
        if is_named or entry.is_small:
            try:
                yield name, entry.load()
            except MeasurementError:  # a value of another kind, such as a reference
                if is_named:
                    raise


def _opened(path: Path, content: bytes, form: Form) -> AbstractContextManager[Archive]:
    if form == "MATLAB 5":
        return nullcontext(matlab.workspace(path, content))
    return hdf5.open_hdf5(path, content, matlab=form == "MATLAB 7.3")
