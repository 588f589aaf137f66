"""Which files of framework and plugins a job enters, traced while it runs: an identification and a synthesis.

    python tests/architecture/trips.py

A file is entered when a function that it defines is called, in any thread; the report's templates count too. What an
import runs does not count: neither the statements of a module nor the functions that these call. Both jobs use the
smallest assembly, one mass on a spring and a damper.
"""

from __future__ import annotations

import gc
import inspect
import sys
import tempfile
import threading
from collections.abc import Callable
from functools import cache
from pathlib import Path
from types import FrameType

import numpy as np

import dovetail

ASSEMBLY = Path(__file__).parents[2] / "assemblies" / "sdof.yaml"
PACKAGES = ("dovetail", "dovetail_bench", "dovetail_machining", "dovetail_plugins")
IMPORTING = "<frozen importlib."
TRUTH = [2e6, 30.0]


def files_entered(job: Callable[[], object]) -> list[str]:
    """Run a job and return the files of ours that it enters, in the order in which it does."""
    entered: dict[str, None] = {}

    def note(frame: FrameType, event: str, _argument: object) -> None:  # called for every call, not for each line
        file = frame.f_code.co_filename
        is_function = frame.f_code.co_flags & inspect.CO_OPTIMIZED
        if event == "call" and is_function and file not in entered and ours(file) and not is_import(frame):
            entered[file] = None

    gc.collect()  # ends generators that an earlier job left unfinished: their files are not entered by this one
    threading.settrace(note)
    sys.settrace(note)
    try:
        job()
    finally:
        sys.settrace(None)
        threading.settrace(None)  # type: ignore[arg-type]
    return [ours(file) for file in entered]


@cache
def ours(file: str) -> str:
    """Return a file's path from its package on, or nothing for one of another package."""
    path = Path(file)
    package = next((folder for folder in path.parents if folder.name in PACKAGES), None)
    return str(path.relative_to(package.parent)) if package else ""


def is_import(frame: FrameType | None) -> bool:
    """Return whether an import waits for this frame."""
    while frame is not None:
        if frame.f_code.co_filename.startswith(IMPORTING):
            return True
        frame = frame.f_back
    return False


def measured_file(folder: Path) -> Path:
    """Write a measured FRF of the assembly, with 1 % of random error."""
    assembly = dovetail.load(ASSEMBLY)
    real, imaginary = np.random.default_rng(0).standard_normal((2, len(assembly.frequency)))
    frf = assembly.frf(TRUTH) * (1 + 0.01 * (real + 1j * imaginary) / np.sqrt(2))
    file = folder / "measured.csv"
    columns = np.column_stack([assembly.frequency, frf.real, frf.imag])
    np.savetxt(file, columns, delimiter=",", header="frequency_Hz,real,imag", comments="")
    return file


def identification() -> list[str]:
    """Trace a measured file from its reader through `dovetail.identify` to the written report."""
    with tempfile.TemporaryDirectory() as folder:
        file, assembly = measured_file(Path(folder)), dovetail.load(ASSEMBLY)

        def identify() -> None:
            measured = dovetail.read_frf(file, quantity="accelerance")
            dovetail.write_report(dovetail.identify(assembly, measured, "refined"), Path(folder) / "report.html")

        return files_entered(identify)


def synthesis() -> list[str]:
    """Trace theta from `Assembly.frf` to the kernel, which the first call has compiled."""
    assembly = dovetail.load(ASSEMBLY)
    assembly.frf(TRUTH)
    return files_entered(lambda: assembly.frf(TRUTH))


TRIPS = {"identification": identification, "synthesis": synthesis}


if __name__ == "__main__":
    for name, trip in TRIPS.items():
        files = trip()
        print(f"{name}: {len(files)} files", *files, sep="\n  ")
