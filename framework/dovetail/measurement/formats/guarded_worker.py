"""The second interpreter: it reads one file with bounded memory and leaves its answer as arrays and JSON."""

from __future__ import annotations

import io
import json
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from dovetail.atomic_files import read_bounded
from dovetail.errors import MeasurementError
from dovetail.measurement.formats.column_names import plain_name
from dovetail.measurement.formats.guarded_process import ARRAYS, WORDS
from dovetail.measurement.formats.hdf5 import opened
from dovetail.measurement.formats.named_arrays import Archive, recording_of
from dovetail.measurement.recording import Selection

_MEMORY = 2 << 30
"""Bytes of address space, most of it for the libraries themselves."""


def _answer(path: Path, question: Mapping[str, Any], *, matlab: bool) -> dict[str, Any]:
    try:
        with opened(path, read_bounded(path), matlab=matlab) as archive:
            if "arrays" in question:
                words, arrays = _named(archive, question["arrays"])
            else:
                recording = recording_of(archive, Selection(*question["selection"]))
                words = {name: getattr(recording, name) for name in WORDS}
                arrays = {name: array for name in ARRAYS if (array := getattr(recording, name)) is not None}
    except MeasurementError as error:
        faults = [(fault.where, fault.problem, fault.accepted, fault.remedy) for fault in error.faults]
        words, arrays = {"faults": faults, "path": str(path)}, {}
    return {"words": np.array(json.dumps(words)), **arrays}


def _named(archive: Archive, names: Sequence[str]) -> tuple[dict[str, Any], dict[str, Any]]:
    chosen = [name for name in archive.entries if name in names or plain_name(name) in names]
    return {"names": chosen}, {str(number): archive.entries[name].load() for number, name in enumerate(chosen)}


def _main(path: str, question: str, matlab: str, answer: str) -> None:
    try:
        import resource
    except ImportError:  # no such limits on this system; the time is bounded still
        pass
    else:
        allowed = resource.getrlimit(resource.RLIMIT_AS)[1]
        most = _MEMORY if allowed == resource.RLIM_INFINITY else min(allowed, _MEMORY)
        resource.setrlimit(resource.RLIMIT_AS, (most, most))
    stream = io.BytesIO()
    np.savez(stream, allow_pickle=False, **_answer(Path(path), json.loads(question), matlab=matlab == "1"))
    Path(answer).write_bytes(stream.getvalue())


if __name__ == "__main__":
    _main(*sys.argv[1:])
