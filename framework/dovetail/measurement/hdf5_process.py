"""Reading HDF5 in a process of its own, with bounded memory and time.

In a damaged file a length may stand that the library reserves and fills: gigabytes for a file of twenty kilobytes.
Python cannot bound that from within, so the file is read by a second interpreter that may not have more. The answer
comes back as arrays and JSON; nothing is unpickled.
"""

from __future__ import annotations

import io
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from dovetail.errors import Fault, MeasurementError
from dovetail.measurement.recording import Recording
from dovetail.measurement.selection import Selection

__all__ = ["read_apart"]

_MEMORY = 2 << 30
"""Bytes of address space, most of it for the libraries themselves."""
_SECONDS = 30
_ARRAYS = ("frequency", "values", "coherence", "variance")
_WORDS = (
    *("has_phase", "quantity", "is_stated", "how_to_state_quantity", "note"),
    *("factor", "unit", "averages", "rotation", "response", "force"),
)


def read_apart(path: Path, selection: Selection, *, matlab: bool) -> Recording:
    """Return what an HDF5 file holds.

    Raises
    ------
    MeasurementError
        What the reader finds, or that it needed more memory or time than any FRF.
    """
    chosen = [selection.index, selection.response, selection.force, dict(selection.names)]
    with tempfile.TemporaryDirectory() as folder:
        answer = Path(folder, "answer.npz")
        command = [
            sys.executable,
            "-m",
            __name__,
            str(path.resolve()),
            json.dumps(chosen),
            str(int(matlab)),
            str(answer),
        ]
        environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
        try:
            done = subprocess.run(command, capture_output=True, timeout=_SECONDS, env=environment, check=False)
        except subprocess.TimeoutExpired:
            found = f"the HDF5 file is damaged: reading it took more than {_SECONDS} seconds."
            raise MeasurementError(Fault(str(path), found)) from None
        if done.returncode != 0 or not answer.exists():
            found = "the HDF5 file is damaged: the library that reads it gave up, or wanted more memory than any FRF."
            raise MeasurementError(Fault(str(path), found))
        with np.load(answer, allow_pickle=False) as archive:
            held = {name: archive[name] for name in archive.files}
    words = json.loads(str(held.pop("words")))
    if "faults" in words:
        faults = [[part.replace(words["path"], str(path)) for part in fault] for fault in words["faults"]]
        raise MeasurementError(*(Fault(*fault) for fault in faults))
    arrays: dict[str, Any] = {name: held.get(name) for name in _ARRAYS}
    return Recording(
        where=str(path),
        label=path.name,
        place=lambda index: f"{path}  line {index + 1} of the arrays",
        **arrays,
        **words,
    )


def _answer(path: Path, selection: Selection, *, matlab: bool) -> dict[str, Any]:
    from dovetail.measurement.disk import read_bounded
    from dovetail.measurement.hdf5 import recording_in

    try:
        recording = recording_in(path, read_bounded(path), selection, matlab=matlab)
    except MeasurementError as error:
        faults = [(fault.where, fault.found, fault.accepted, fault.remedy) for fault in error.faults]
        return {"words": np.array(json.dumps({"faults": faults, "path": str(path)}))}
    words = {name: getattr(recording, name) for name in _WORDS}
    arrays = {name: array for name in _ARRAYS if (array := getattr(recording, name)) is not None}
    return {"words": np.array(json.dumps(words)), **arrays}


def _main(path: str, chosen: str, matlab: str, answer: str) -> None:
    try:
        import resource
    except ImportError:  # no such limits on this system; the time is bounded still
        pass
    else:
        allowed = resource.getrlimit(resource.RLIMIT_AS)[1]
        most = _MEMORY if allowed == resource.RLIM_INFINITY else min(allowed, _MEMORY)
        resource.setrlimit(resource.RLIMIT_AS, (most, most))
    stream = io.BytesIO()
    np.savez(stream, allow_pickle=False, **_answer(Path(path), Selection(*json.loads(chosen)), matlab=matlab == "1"))
    Path(answer).write_bytes(stream.getvalue())


if __name__ == "__main__":
    _main(*sys.argv[1:])
