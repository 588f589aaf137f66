"""The second interpreter: it reads one file with bounded memory and answers with arrays and JSON."""

from __future__ import annotations

import io
import json
import sys
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import astuple
from pathlib import Path
from typing import Any

import numpy as np

from dovetail.errors import MeasurementError
from dovetail.measurement.formats import hdf5, matlab
from dovetail.measurement.formats.column_names import plain_name
from dovetail.measurement.formats.guarded_process import ARRAYS, WORDS
from dovetail.measurement.formats.named_arrays import Archive, read_recording
from dovetail.measurement.recording import ReadOptions

_MEMORY = 2 << 30
"""Bytes of address space, most of it for the libraries themselves."""


def main() -> None:
    """Answer the question in the arguments about the file on the standard input."""
    path, form, question = sys.argv[1:4]
    _bound_memory()
    stream = io.BytesIO()
    answer = _answer(Path(path), sys.stdin.buffer.read(), form, json.loads(question))
    np.savez(stream, allow_pickle=False, **answer)
    sys.stdout.buffer.write(stream.getvalue())


def _bound_memory() -> None:
    try:
        import resource
    except ImportError:  # no such limits on this system; the time is bounded still
        return
    allowed = resource.getrlimit(resource.RLIMIT_AS)[1]
    most = _MEMORY if allowed == resource.RLIM_INFINITY else min(allowed, _MEMORY)
    resource.setrlimit(resource.RLIMIT_AS, (most, most))


def _answer(path: Path, content: bytes, form: str, question: Mapping[str, Any]) -> dict[str, Any]:
    try:
        with _opened(path, content, form) as archive:
            if "arrays" in question:
                words, arrays = _named(archive, question["arrays"])
            else:
                recording = read_recording(archive, ReadOptions(*question["options"]))
                words = {name: getattr(recording, name) for name in WORDS}
                arrays = {name: array for name in ARRAYS if (array := getattr(recording, name)) is not None}
    except MeasurementError as error:
        words, arrays = {"faults": [astuple(fault) for fault in error.faults]}, {}
    return {"words": np.array(json.dumps(words)), **arrays}


def _opened(path: Path, content: bytes, form: str) -> AbstractContextManager[Archive]:
    if form == "MATLAB 5":
        return nullcontext(matlab.workspace(path, content))
    return hdf5.open_hdf5(path, content, matlab=form == "MATLAB 7.3")


def _named(archive: Archive, names: Sequence[str]) -> tuple[dict[str, Any], dict[str, Any]]:
    wanted = [name for name in archive.entries if name in names or plain_name(name) in names]
    return {"names": list(archive.entries)}, {name: archive.entries[name].load() for name in wanted}
