"""The speed of the synthesis on the collet assembly at 4451 lines, all in one run, next to its targets.

    python tests/benchmarks/synthesis.py [--samples N] [--rounds N] [--written N] [--no-first] [-o FOLDER]

The literal method (Eqs. 4-7 of Processes 14 (2026) 1875, doi:10.3390/pr14121875, in batched LAPACK) computes the
substructures' receptances once, outside the timing, and runs on one BLAS thread. The routes take turns and the best of
each route's rounds counts, so that other work on the machine slows all of them equally. With -o the tables are
written as Markdown too.
"""

from __future__ import annotations

import os

os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1", MKL_NUM_THREADS="1")

import argparse
import platform
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from processes import ASSEMBLY, first_frf, written_dataset

import dovetail
from dovetail.dataset import latin_hypercube
from dovetail.synthesis import LiteralSynthesis

Routes = dict[str, tuple[int, Callable[[], object]]]


def routes(assembly: dovetail.Assembly, samples: int) -> Routes:
    """Return what is compared: how many FRFs each computes at once, and how; the literal method first."""
    theta = latin_hypercube(assembly, samples, seed=0)
    few = theta[: max(1, samples // 4)]
    single = assembly.by_joint(theta[0])
    literal = LiteralSynthesis(assembly.graph, assembly.frequency, *assembly.description.response.point)

    def on(threads: int, work: Callable[[], object]) -> Callable[[], object]:
        def timed() -> object:
            assembly.engine.threads = interpolated.engine.threads = threads
            return work()

        return timed

    interpolated = assembly.interpolated(1e-9)
    compared: Routes = {"literal, batched NumPy, 1 thread": (1, lambda: literal.receptance(single))}
    for threads in sorted({1, len(os.sched_getaffinity(0))}):
        named = f"{threads} thread{'s' if threads > 1 else ''}"
        compared[f"engine, complex, {named}"] = samples, on(threads, lambda: assembly.frf(theta))
        compared[f"engine, amplitude, {named}"] = samples, on(threads, lambda: assembly.accelerance_amplitude(theta))
        compared[f"engine, amplitude, interpolated, {named}"] = (
            samples,
            on(threads, lambda: interpolated.accelerance_amplitude(theta)),
        )
        compared[f"engine, complex with Jacobian, {named}"] = len(few), on(threads, lambda: assembly.frf_jacobian(few))
    return compared


@dataclass(frozen=True)
class Cost:
    """Best wall-clock time of a route and the least processor time of all threads, in seconds per FRF."""

    wall: float = np.inf
    cores: float = np.inf


def cost_per_frf(compared: Routes, rounds: int) -> dict[str, Cost]:
    """Return the best of each route, after one round that is not counted."""
    best = dict.fromkeys(compared, Cost())
    for counted in [False, *[True] * rounds]:
        for name, (count, work) in compared.items():
            wall, cores = time.perf_counter(), time.process_time()
            work()
            wall, cores = (time.perf_counter() - wall) / count, (time.process_time() - cores) / count
            if counted:
                best[name] = Cost(min(best[name].wall, wall), min(best[name].cores, cores))
    return best


def speed_table(best: dict[str, Cost]) -> list[list[str]]:
    """Return rows of route, time, rate, ratio to the literal method, and processor time."""
    literal = next(iter(best.values())).wall
    rows = [["route", "ms per FRF", "FRFs per s", "ratio", "core ms per FRF"]]
    for name, cost in best.items():
        numbers = (
            f"{1e3 * cost.wall:.3f}",
            f"{1 / cost.wall:.0f}",
            f"{literal / cost.wall:.0f}",
            f"{1e3 * cost.cores:.3f}",
        )
        rows.append([name, *numbers])
    return rows


def aims_table(best: dict[str, Cost], written: int, *, first: bool = True) -> list[list[str]]:
    """Return rows of what is measured, its value, and what is aimed at; on wish without the first FRF of a process."""
    cores = len(os.sched_getaffinity(0))
    single = best["engine, complex, 1 thread"].wall
    many = best[f"engine, complex, {cores} thread{'s' if cores > 1 else ''}"].wall
    jacobian = best["engine, complex with Jacobian, 1 thread"].wall
    literal = next(iter(best.values())).wall
    seconds, size, memory = written_dataset(written)
    phased, phased_size, phased_memory = written_dataset(written, storage="complex")
    fewer, _, fewer_memory = written_dataset(written, interpolation=1e-9)
    rows = [
        ["what", "measured", "aim"],
        ["engine over literal, thread for thread", f"{literal / single:.0f} times", "300 times"],
        [f"{cores} threads over one", f"{single / many:.2f} times", "3 times from 4 cores"],
        ["FRF with Jacobian of 12 parameters over FRF", f"{jacobian / single:.2f} times", "at most 2.5 times"],
        [f"{written} amplitudes computed and written", f"{seconds:.1f} s", "12 s on 4 cores, then 5 s"],
        ["their size on disk, and peak memory", f"{size / 1e6:.0f} MB, {memory / 1e9:.2f} GB", "memory below 1.5 GB"],
        [f"{written} complex FRFs computed and written", f"{phased:.1f} s", ""],
        ["their size on disk, and peak memory", f"{phased_size / 1e6:.0f} MB, {phased_memory / 1e9:.2f} GB", ""],
        [f"{written} interpolated amplitudes computed and written", f"{fewer:.1f} s", ""],
        ["peak memory", f"{fewer_memory / 1e9:.2f} GB", ""],
    ]
    if first:
        ever, later = first_frf()
        rows.append(["first FRF ever: no caches, no bytecode", f"{ever:.2f} s", "6 s"])
        rows.append(["first FRF of a later process", f"{later:.2f} s", "1.5 s"])
    return rows


def printed(rows: list[list[str]]) -> str:
    """Align rows as a Markdown table."""
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    lines = [
        "| " + " | ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)) + " |" for row in rows
    ]
    return "\n".join([lines[0], "|" + "|".join("-" * (width + 2) for width in widths) + "|", *lines[1:]])


def main() -> None:
    """Print both tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--samples", type=int, default=512, help="FRFs in one call of the engine")
    parser.add_argument("--rounds", type=int, default=8)
    parser.add_argument("--written", type=int, default=50_000, help="FRFs in the dataset")
    parser.add_argument("--no-first", action="store_true", help="do not time the first FRF of a process")
    parser.add_argument("-o", "--output", type=Path, help="folder for comparison.md")
    arguments = parser.parse_args()
    assembly = dovetail.load(ASSEMBLY)
    cores, lines = len(os.sched_getaffinity(0)), len(assembly.frequency)
    busy = f"{os.getloadavg()[0]:.1f} of them busy with other work"
    print(f"NumPy {np.__version__}, Python {platform.python_version()}, {cores} cores, {busy}; {lines} lines\n")
    best = cost_per_frf(routes(assembly, arguments.samples), arguments.rounds)
    text = printed(speed_table(best))
    print(text, end="\n\n", flush=True)
    text += "\n\n" + printed(aims_table(best, arguments.written, first=not arguments.no_first))
    print(text.split("\n\n")[1])
    if arguments.output:
        arguments.output.mkdir(parents=True, exist_ok=True)
        (arguments.output / "comparison.md").write_text(text + "\n")


if __name__ == "__main__":
    main()
