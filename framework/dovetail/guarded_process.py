"""Calling a reader in a process of its own, isolated, with bounded memory and time.

A damaged file may state a length that a library in C reserves and fills: gigabytes for a file of twenty kilobytes.
Other damage ends the process. Python cannot prevent that from within, so such libraries read in a second interpreter.
It imports nothing from the current folder, knows few variables of the environment, and sends arrays and JSON back:
nothing is unpickled.
"""

from __future__ import annotations

import importlib.util
import io
import json
import math
import os
import signal
import subprocess
import sys
import warnings
from collections.abc import Callable, Mapping
from dataclasses import astuple
from pathlib import Path
from typing import Any

import numpy as np

from dovetail.errors import DovetailError, Fault
from dovetail.worker_processes import end_with_parent

_START = "import sys; sys.path[:0] = sys.argv[5:]; from dovetail.guarded_process import main; main()"
"""The packages are those of this process; nothing of the current folder is ever imported."""
_ENVIRONMENT = ("HOME", "LANG", "LC_ALL", "LC_CTYPE", "LD_LIBRARY_PATH", "PATH", "SYSTEMROOT", "TEMP", "TMPDIR")
_SET = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "HDF5_PLUGIN_PRELOAD": "::"}
"""No threads, whose stacks take memory; no filters of HDF5 that would be loaded from folders."""
_WAIT = 10.0
"""Most seconds for each second of processor time that is allowed."""
_WORDS = "words of the answer"


def call_guarded(
    function: Callable[..., Mapping[str, Any]],
    path: Path,
    content: bytes,
    *arguments: Any,
    error: type[DovetailError] = DovetailError,
    memory: int = 2 << 30,
    seconds: float = 30.0,
) -> dict[str, Any]:
    """Call ``function(path, content, *arguments)`` in a second interpreter and return its answer.

    Parameters
    ----------
    function : callable
        At the top of a module that imports of its own package nothing relative; it returns arrays, and values that
        JSON holds, by their names.
    path : Path
        Names the file in messages.
    content : bytes
        What is in the file.
    *arguments
        Values that JSON holds.
    error : type
        Of what is raised.
    memory : int
        Bytes of address space, half a gigabyte or more of it for the libraries themselves; not bounded on Windows.
    seconds : float
        Processor time after which the file is given up; a machine that is busy with other work may take ten times as
        long.

    Returns
    -------
    dict
        Arrays and plain values.

    Raises
    ------
    DovetailError
        Of the class `error`: what the function raised, or that it took more memory or time or ended the process.
    """
    module = sys.modules[function.__module__].__file__ or ""
    question = json.dumps([str(path), memory, seconds, os.getpid(), arguments])
    homes = str(Path(__file__).parents[1]), str(Path(np.__file__).parents[1])
    command = [sys.executable, "-I", "-c", _START, module, function.__module__, function.__name__, question, *homes]
    environment = {name: os.environ[name] for name in _ENVIRONMENT if name in os.environ}
    too_long = f"the file is damaged: reading it took more than {seconds:g} seconds."
    try:
        done = subprocess.run(
            command, input=content, capture_output=True, timeout=_WAIT * seconds, env=environment | _SET, check=False
        )
    except subprocess.TimeoutExpired:
        raise error(Fault(str(path), too_long)) from None
    if done.returncode == -getattr(signal, "SIGXCPU", 0) != 0:
        raise error(Fault(str(path), too_long))
    if done.returncode != 0:
        problem = "the file is damaged: the library that reads it gave up, or wanted more memory than is allowed."
        raise error(Fault(str(path), problem))
    with np.load(io.BytesIO(done.stdout), allow_pickle=False) as archive:
        answer: dict[str, Any] = {name: archive[name] for name in archive.files}
    words = json.loads(str(answer.pop(_WORDS)))
    for message in words.get("warnings", ()):
        warnings.warn(message, stacklevel=2)
    if "faults" in words:
        raise error(*(Fault(*fault) for fault in words["faults"]))
    answer |= words["values"]
    return answer


def main() -> None:
    """Answer the call in the arguments, about the file on the standard input."""
    file, name, function, question = sys.argv[1:5]
    path, memory, seconds, parent, arguments = json.loads(question)
    end_with_parent(parent)
    content = sys.stdin.buffer.read()
    _bound(memory, seconds)
    try:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always", UserWarning)
            answer = getattr(_module(name, file), function)(Path(path), content, *arguments)
        words: dict[str, Any] = {"values": {key: value for key, value in answer.items() if not _is_array(value)}}
        words["warnings"] = [str(each.message) for each in caught if issubclass(each.category, UserWarning)]
        arrays: dict[str, Any] = {key: value for key, value in answer.items() if _is_array(value)}
    except DovetailError as error:
        words, arrays = {"faults": [astuple(fault) for fault in error.faults]}, {}
    stream = io.BytesIO()
    arrays[_WORDS] = np.array(json.dumps(words))
    np.savez(stream, **arrays)
    sys.stdout.buffer.write(stream.getbuffer())


def _is_array(value: Any) -> bool:
    return isinstance(value, np.ndarray)


def _module(name: str, file: str) -> Any:
    """Import a module by its file, without the rest of its package where that is not Dovetail's own."""
    if name.startswith("dovetail."):
        return importlib.import_module(name)
    spec = importlib.util.spec_from_file_location(name.replace(".", "_"), file)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def _bound(memory: int, seconds: float) -> None:
    """Bound the memory and the processor time of this process."""
    try:
        import resource
    except ImportError:  # no such limits on this system; the time is bounded still
        return
    for kind, wanted in ((resource.RLIMIT_AS, memory), (resource.RLIMIT_CPU, math.ceil(seconds))):
        allowed = resource.getrlimit(kind)[1]
        most = wanted if allowed == resource.RLIM_INFINITY else min(allowed, wanted)
        # A process that passes the soft limit of the time ends by SIGXCPU, which says why.
        resource.setrlimit(kind, (most, most if kind == resource.RLIMIT_AS else allowed))
