"""FRFs per second of the engine and of the literal method, on the collet assembly, in one run.

    python tests/benchmarks/synthesis.py

The literal method (Eqs. 4-7, batched LAPACK) computes the substructures' receptances once, outside the timing, and runs
on one BLAS thread. Every route's best of several rounds counts.
"""

from __future__ import annotations

import os

os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1", MKL_NUM_THREADS="1")

import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

import dovetail
from dovetail.dataset import latin_hypercube
from dovetail.synthesis import LiteralSynthesis

ASSEMBLY = Path(__file__).resolve().parents[2] / "assemblies" / "bt40_er32.yaml"


def best_of(rounds: int, work: Callable[[], object]) -> float:
    """Return the shortest time in seconds."""
    times = []
    for _ in range(rounds):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return min(times)


def compare(samples: int, rounds: int, written: int) -> list[tuple[str, float]]:
    """Return each route's name and its time per FRF in seconds, the literal method first."""
    assembly = dovetail.load(ASSEMBLY)
    theta = latin_hypercube(assembly, samples, seed=0)
    one = {name: values[0] for name, values in assembly._by_joint(theta[:1]).items()}
    literal = LiteralSynthesis(assembly.graph, assembly.frequency, *assembly.drive_point)
    rows = [("literal, 1 thread", best_of(rounds, lambda: literal.receptance(one)))]
    engine, cores = assembly.engine, len(os.sched_getaffinity(0))
    for threads in sorted({1, cores}):
        engine.threads = threads
        named = f"{threads} thread{'s' if threads > 1 else ''}"
        for label, work, count in (
            ("engine, complex", lambda: assembly.frf(theta), samples),
            ("engine, amplitude", lambda: assembly.accelerance_amplitude(theta), samples),
            ("engine, with Jacobian", lambda: assembly.frf_jacobian(theta[: samples // 4]), samples // 4),
        ):
            work()
            rows.append((f"{label}, {named}", best_of(rounds, work) / count))
    with tempfile.TemporaryDirectory() as folder:
        start = time.perf_counter()
        dovetail.generate(assembly, Path(folder) / "data.zarr", samples=written)
        rows.append((f"{written} FRFs onto the disk, {cores} threads", (time.perf_counter() - start) / written))
    return rows


def main(samples: int = 1024, rounds: int = 5, written: int = 50_000) -> None:
    """Print the comparison."""
    rows = compare(samples, rounds, written)
    literal = rows[0][1]
    print(f"numpy {np.__version__}, {os.cpu_count()} cores; 4451 lines")
    print(f"{'':44}{'ms per FRF':>12}{'FRFs per s':>12}{'ratio':>8}")
    for name, seconds in rows:
        print(f"{name:44}{1e3 * seconds:12.3f}{1 / seconds:12.0f}{literal / seconds:8.0f}")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
