"""Reading HDF5 in a process of its own, with bounded memory and time.

In a damaged file a length may stand that the library reserves and fills: gigabytes for a file of twenty kilobytes.
Python cannot bound that from within, so the file is read by a second interpreter that may not have more. The answer
comes back as arrays and JSON; nothing is unpickled.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from dovetail.errors import Fault, MeasurementError
from dovetail.measurement.formats.named_arrays import Archive, Entry
from dovetail.measurement.recording import Recording, Selection

__all__ = ["ARRAYS", "WORDS", "arrays_apart", "read_apart"]

_WORKER = "dovetail.measurement.formats.guarded_worker"
_SECONDS = 30
ARRAYS = ("frequency", "values", "coherence", "variance")
"""The arrays of a recording, and beside them its words, that come back."""
WORDS = (
    *("has_phase", "quantity", "is_stated", "how_to_state_quantity", "note"),
    *("factor", "unit", "averages", "rotation", "response", "force"),
)


def read_apart(path: Path, selection: Selection, *, matlab: bool) -> Recording:
    """Return the FRF that an HDF5 file holds.

    Raises
    ------
    MeasurementError
        What the reader finds, or that it needed more memory or time than any FRF.
    """
    chosen = [selection.index, selection.response, selection.force, dict(selection.names)]
    words, held = _answer_of(path, {"selection": chosen}, matlab)
    arrays: dict[str, Any] = {name: held.get(name) for name in ARRAYS}
    return Recording(
        where=str(path),
        label=path.name,
        place=lambda index: f"{path}  line {index + 1} of the arrays",
        **arrays,
        **words,
    )


def arrays_apart(path: Path, names: Sequence[str], *, matlab: bool) -> Archive:
    """Return the arrays of an HDF5 file that are called by one of `names`, in full or by the last part of their path.

    Raises
    ------
    MeasurementError
        As `read_apart`.
    """
    words, held = _answer_of(path, {"arrays": list(names)}, matlab)
    entries = {name: Entry("", partial(held.__getitem__, str(number))) for number, name in enumerate(words["names"])}
    return Archive(path, entries)


def _answer_of(path: Path, question: Mapping[str, Any], matlab: bool) -> tuple[dict[str, Any], dict[str, Any]]:
    """Ask the other process; return its words and its arrays."""
    with tempfile.TemporaryDirectory() as folder:
        answer = Path(folder, "answer.npz")
        arguments = [str(path.resolve()), json.dumps(question), str(int(matlab)), str(answer)]
        environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
        try:
            done = subprocess.run(
                [sys.executable, "-m", _WORKER, *arguments],
                capture_output=True,
                timeout=_SECONDS,
                env=environment,
                check=False,
            )
        except subprocess.TimeoutExpired:
            problem = f"the HDF5 file is damaged: reading it took more than {_SECONDS} seconds."
            raise MeasurementError(Fault(str(path), problem)) from None
        if done.returncode != 0 or not answer.exists():
            problem = "the HDF5 file is damaged: the library that reads it gave up, or wanted more memory than any FRF."
            raise MeasurementError(Fault(str(path), problem))
        with np.load(answer, allow_pickle=False) as archive:
            held = {name: archive[name] for name in archive.files}
    words: dict[str, Any] = json.loads(str(held.pop("words")))
    if "faults" in words:
        faults = [[part.replace(words["path"], str(path)) for part in fault] for fault in words["faults"]]
        raise MeasurementError(*(Fault(*fault) for fault in faults))
    return words, held
