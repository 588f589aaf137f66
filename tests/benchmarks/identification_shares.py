"""Where the processor time of an identification goes: kernel, matrices, linear algebra, reading, all other code.

``python tests/benchmarks/identification_shares.py [--repeat 3]`` prints a row for each of the shipped measurements: the
seconds on all cores, and shares on one core. A share is processor time of all threads over that of the whole process,
so that other processes do not change it.
"""

from __future__ import annotations

import argparse
import sys
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import wraps
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

import dovetail
from dovetail.parallel import use_cores
from dovetail.synthesis import engine
from dovetail.synthesis.codegen.compiler import MachineKernel

ASSEMBLIES = Path(__file__).resolve().parents[2] / "assemblies"
MEASURED = {
    "collet, 12 parameters": ("bt40_er32.yaml", "h0_j_t0_60Nm.uff"),
    "bolted lap, 4": ("bolted_lap_beam.yaml", "bolted_lap_beam.uff"),
    "shaft and hub": ("shaft_hub.yaml", "shaft_hub.uff"),
    "spindle and collet": ("spindle_bt40_er32.yaml", "spindle_bt40_er32.uff"),
}
PARTS = ("kernel", "matrices", "linear algebra", "reading")
LINEAR_ALGEBRA = ("eigh", "eigvalsh", "inv", "lstsq", "norm", "pinv", "qr", "slogdet", "solve", "svd")


@dataclass(frozen=True)
class Shares:
    """Seconds, processor seconds, and the share of each part in the latter."""

    seconds: float
    processor: float
    shares: dict[str, float]


class _Clock:
    """Adds up the processor time of each part, without what other parts take inside it."""

    def __init__(self) -> None:
        self.spent: Counter[str] = Counter()
        self._thread = threading.local()

    def timed(self, part: str, function: Callable[..., Any]) -> Callable[..., Any]:
        @wraps(function)
        def timed(*arguments: Any, **options: Any) -> Any:
            outer, self._thread.inside = getattr(self._thread, "inside", 0.0), 0.0
            began = time.thread_time()
            try:
                return function(*arguments, **options)
            finally:
                whole = time.thread_time() - began
                self.spent[part] += whole - self._thread.inside
                self._thread.inside = outer + whole

        return timed


@contextmanager
def clocked() -> Iterator[_Clock]:
    """Yield a clock of all parts."""
    clock = _Clock()
    targets = [(MachineKernel, "__call__", "kernel"), (dovetail, "read_frf", "reading")]
    targets += [(engine, name, "matrices") for name in ("_gather", "_gather_spectral")]
    targets += [(np.linalg, name, "linear algebra") for name in LINEAR_ALGEBRA]
    patches = [patch.object(owner, name, clock.timed(part, getattr(owner, name))) for owner, name, part in targets]
    for each in patches:
        each.start()
    try:
        yield clock
    finally:
        for each in patches:
            each.stop()


def shares_of(assembly: str, measured: str, **options: Any) -> Shares:
    """Return the shares of one identification by the default method, once everything is compiled."""
    loaded = dovetail.load(ASSEMBLIES / assembly)
    file = ASSEMBLIES / "measurements" / measured
    dovetail.identify(loaded, dovetail.read_frf(file), **options)
    began = time.perf_counter()
    dovetail.identify(loaded, dovetail.read_frf(file), **options)
    seconds = time.perf_counter() - began
    with one_core(), clocked() as clock:
        processor = time.process_time()
        dovetail.identify(loaded, dovetail.read_frf(file), **options)
        spent = time.process_time() - processor
    return Shares(seconds, spent, {part: clock.spent[part] / spent for part in PARTS})


@contextmanager
def one_core() -> Iterator[None]:
    """Let no other process do any of the work, whose clock could not be read."""
    use_cores(1)
    try:
        yield
    finally:
        use_cores(sys.maxsize)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeat", type=int, default=1, help="times each identification is done; the fastest counts")
    repeat = parser.parse_args().repeat
    print(f"{'measurement':24s}{'seconds':>9s}" + "".join(f"{part:>16s}" for part in (*PARTS, "other")))
    for name, files in MEASURED.items():
        best = min((shares_of(*files) for _ in range(repeat)), key=lambda shares: shares.seconds)
        row = [*best.shares.values(), 1.0 - sum(best.shares.values())]
        print(f"{name:24s}{best.seconds:9.2f}" + "".join(f"{share:16.0%}" for share in row))


if __name__ == "__main__":
    main()
