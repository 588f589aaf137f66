"""Reading HDF5 files and MATLAB workspaces in a process of its own, with bounded memory and time.

A damaged file may state a length that the library reserves and fills: gigabytes for a file of twenty kilobytes. Other
damage makes the library end the process. Python cannot prevent that from within, so h5py and scipy read in a second
interpreter (`guarded_worker`), which may not have more memory than any FRF needs. It gets the bytes of the file and
sends arrays and JSON back; nothing is unpickled.
"""

from __future__ import annotations

import io
import json
import os
import subprocess
import sys
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, Literal

import numpy as np

from dovetail.errors import Fault, MeasurementError, require_package
from dovetail.measurement.formats.named_arrays import Archive, Entry
from dovetail.measurement.recording import ReadOptions, Recording

__all__ = ["ARRAYS", "WORDS", "Form", "read_arrays_guarded", "read_guarded"]

Form = Literal["HDF5", "MATLAB 7.3", "MATLAB 5"]
ARRAYS = ("frequency", "values", "coherence", "variance")
"""The arrays of a recording that come back."""
WORDS = (
    *("has_phase", "quantity", "is_stated", "how_to_state_quantity", "note"),
    *("factor", "unit", "averages", "rotation", "response", "force"),
)
"""What else of a recording comes back."""
_SECONDS = 30
_START = "import sys; sys.path += sys.argv[4:]; from dovetail.measurement.formats.guarded_worker import main; main()"
"""The packages of the installation come first; nothing of the current folder is ever imported."""


def read_guarded(path: Path, content: bytes, options: ReadOptions, form: Form) -> Recording:
    """Return the FRF that a file holds.

    Raises
    ------
    MeasurementError
        What is wrong with the file, or that reading it took more memory or time than any FRF.
    DovetailError
        h5py is not installed.
    """
    question = [options.index, options.response, options.force, dict(options.names)]
    words, held = _ask(path, content, form, {"options": question})
    arrays: dict[str, Any] = {name: held.get(name) for name in ARRAYS}
    return Recording(
        where=str(path),
        label=path.name,
        locate=lambda index: f"{path}  line {index + 1} of the arrays",
        **arrays,
        **words,
    )


def read_arrays_guarded(path: Path, content: bytes, names: Sequence[str], form: Form) -> Archive:
    """Return the arrays of a file; only those called by one of `names`, in full or by the last word, can be loaded.

    Raises
    ------
    MeasurementError, DovetailError
        As `read_guarded`.
    """
    words, held = _ask(path, content, form, {"arrays": list(names)})
    return Archive(path, {name: Entry("", partial(held.__getitem__, name)) for name in words["names"]})


def _ask(path: Path, content: bytes, form: Form, question: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Ask the second interpreter; return its words and its arrays."""
    kind = "workspace" if form == "MATLAB 5" else "HDF5 file"
    if kind == "HDF5 file":
        require_package("h5py", "hdf5", str(path))
    homes = str(Path(__file__).parents[3]), str(Path(np.__file__).parents[1])
    try:
        done = subprocess.run(
            [sys.executable, "-I", "-c", _START, str(path), form, json.dumps(question), *homes],
            input=content,
            capture_output=True,
            timeout=_SECONDS,
            env={**os.environ, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"},
            check=False,
        )
    except subprocess.TimeoutExpired:
        problem = f"the {kind} is damaged: reading it took more than {_SECONDS} seconds."
        raise MeasurementError(Fault(str(path), problem)) from None
    if done.returncode != 0:
        problem = f"the {kind} is damaged: the library that reads it gave up, or wanted more memory than any FRF."
        raise MeasurementError(Fault(str(path), problem))
    with np.load(io.BytesIO(done.stdout), allow_pickle=False) as archive:
        held = {name: archive[name] for name in archive.files}
    words: dict[str, Any] = json.loads(str(held.pop("words")))
    if "faults" in words:
        raise MeasurementError(*(Fault(*fault) for fault in words["faults"]))
    return words, held
