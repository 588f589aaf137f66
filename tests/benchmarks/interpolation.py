"""How many exact lines an FRF of the collet assembly needs, and what interpolating the others costs, on one thread.

    python tests/benchmarks/interpolation.py [--samples N] [-o FOLDER]

Three ways to choose the exact lines: those that AAA picks when it knows all 4451 (nobody can, but it shows what is
to gain); adaptively, each next line where the last two functions differ most; and Chebyshev's points, the same for all.
Errors are relative to the FRF computed at every line, the greatest over all lines. With -o the table and the figure are
written.
"""

from __future__ import annotations

import os

os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1", MKL_NUM_THREADS="1")

import argparse
import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from processes import ASSEMBLY
from scipy.interpolate import AAA

import dovetail
from dovetail.dataset import latin_hypercube
from dovetail.synthesis.interpolation import RationalInterpolant, chebyshev_lines
from synthesis import printed

COUNTS = (13, 17, 21, 25, 29, 33, 41, 49)
TOLERANCE = 1e-9
AIM = 1e-8
FEW = 20
"""FRFs for AAA, which takes 0.1 s for each."""


def greatest(approximation: NDArray[np.complex128], exact: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Return the greatest relative error over the lines."""
    error: NDArray[np.float64] = np.max(np.abs(approximation - exact) / np.abs(exact), axis=-1)
    return error


def rational(frequency: NDArray[np.float64], known: NDArray[np.intp], exact: NDArray[np.complex128]) -> NDArray:
    """Return the FRF that AAA makes of some of its lines."""
    terms = (len(known) + 1) // 2
    return AAA(frequency[known], exact[known], max_terms=terms, rtol=0, clean_up=False)(frequency)


def knowing_all(frequency: NDArray[np.float64], exact: NDArray[np.complex128], count: int) -> NDArray:
    """Return the FRF that AAA makes of all lines with as many support lines as `count` exact lines determine."""
    return AAA(frequency, exact, max_terms=(count + 1) // 2, rtol=0, clean_up=False)(frequency)


def adaptive(frequency: NDArray[np.float64], exact: NDArray[np.complex128]) -> tuple[int, float]:
    """Add lines where the last two functions differ most, until they hardly differ; return the number and the error."""
    known = chebyshev_lines(9, len(frequency))
    before, now = np.zeros_like(exact), rational(frequency, known, exact)
    while greatest(before, now) > TOLERANCE and len(known) < 99:
        difference = np.abs(now - before) / np.abs(now)
        difference[known] = 0.0
        known = np.sort(np.append(known, np.argmax(difference)))
        before, now = now, rational(frequency, known, exact)
    return len(known), float(greatest(now, exact))


@dataclass(frozen=True)
class Fixed:
    """FRFs from the same exact lines: their errors, how many the estimate refuses, and the seconds for each."""

    errors: NDArray[np.float64]
    refused: float
    seconds: float
    worst_accepted: float


def best_of(work: Callable[[], object], rounds: int = 5) -> float:
    """Return the shortest time in seconds."""
    times = []
    for _ in range(rounds):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return min(times)


def fixed(assembly: dovetail.Assembly, theta: NDArray[np.float64], exact: NDArray[np.complex128], count: int) -> Fixed:
    """Interpolate between `count` of Chebyshev's points; the time is that of amplitudes, with the exact lines."""
    interpolant = RationalInterpolant(assembly.frequency, chebyshev_lines(count, len(assembly.frequency)))
    interpolated = np.empty_like(exact)
    estimated = interpolant.fill(exact[:, interpolant.lines], interpolated)
    errors, accepted = greatest(interpolated, exact), estimated <= TOLERANCE
    block = theta[:64]
    amplitude = np.empty((len(block), len(assembly.frequency)), dtype=np.float32)
    sparse = dovetail.Assembly(assembly.description)
    nodes = type(sparse.engine)(
        sparse.graph,
        sparse.frequency[interpolant.lines],
        [sparse.description.response.point],
        sparse.by_joint(theta[:5]),
    )
    nodes.threads = 1

    def work() -> None:
        interpolant.fill(nodes.frfs(sparse.by_joint(block))[:, 0], amplitude)

    work()
    worst = float(errors[accepted].max()) if accepted.any() else np.nan
    return Fixed(errors, float(np.mean(~accepted)), best_of(work) / len(block), worst)


def table(by_count: dict[int, Fixed], known: dict[int, NDArray[np.float64]], engine: float) -> str:
    """Return the Markdown table of errors and times by number of exact lines."""
    rows = [["exact lines", "AAA, worst of 20", "median", "99 %", "worst", "refused", "worst accepted", "µs", "speed"]]
    for count, result in by_count.items():
        per_frf = result.seconds + result.refused * engine
        rows.append(
            [
                str(count),
                f"{known[count].max():.0e}",
                *(f"{np.quantile(result.errors, q):.0e}" for q in (0.5, 0.99, 1.0)),
                f"{100 * result.refused:.1f} %",
                f"{result.worst_accepted:.0e}",
                f"{1e6 * per_frf:.0f}",
                f"{engine / per_frf:.1f} times",
            ]
        )
    return printed(rows)


def draw(by_count: dict[int, Fixed], known: dict, adaptive_lines: list, engine: float, file: Path) -> None:
    """Draw errors and times by number of exact lines."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10, 3.6), layout="constrained")
    errors, times = figure.subplots(1, 2)
    counts = list(by_count)
    worst, median = ([np.quantile(by_count[n].errors, q) for n in counts] for q in (1.0, 0.5))
    errors.semilogy(counts, worst, "o-", label="Chebyshev's lines, worst FRF")
    errors.semilogy(counts, median, "o--", color="C0", alpha=0.5, label="Chebyshev's lines, median FRF")
    errors.semilogy(
        counts, [known[n].max() for n in counts], "s-", color="C1", label="AAA that knows all lines, worst of 20"
    )
    errors.semilogy(*zip(*adaptive_lines, strict=True), "x", color="C2", label="adaptive lines, 20 FRFs")
    errors.axhline(AIM, color="0.5", ls=":")
    errors.set(xlabel="exact lines of 4451", ylabel="greatest relative error")
    errors.legend(fontsize=8)
    times.plot(counts, [1e6 * by_count[n].seconds for n in counts], "o-", label="interpolated")
    accepted = [1e6 * (by_count[n].seconds + by_count[n].refused * engine) for n in counts]
    times.plot(counts, accepted, "o--", label="with those refused computed exactly")
    times.axhline(1e6 * engine, color="0.5", label="every line exact")
    times.set(xlabel="exact lines of 4451", ylabel="µs per FRF", ylim=(0, None))
    times.legend(fontsize=8)
    figure.savefig(file, dpi=110, metadata={"Software": None})


def main() -> None:
    """Print the table, and draw it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--samples", type=int, default=2000)
    parser.add_argument("-o", "--output", type=Path, help="folder for interpolation.md and interpolation.png")
    arguments = parser.parse_args()
    warnings.simplefilter("ignore", RuntimeWarning)  # AAA says whenever it is stopped at the wanted number of terms
    assembly = dovetail.load(ASSEMBLY)
    assembly.engine.threads = 1
    theta = latin_hypercube(assembly, arguments.samples, seed=0)
    exact = assembly.frf(theta)
    few = exact[:FEW]
    engine = best_of(lambda: assembly.accelerance_amplitude(theta[:64])) / 64
    by_count = {count: fixed(assembly, theta, exact, count) for count in COUNTS}
    known = {n: np.array([greatest(knowing_all(assembly.frequency, h, n), h) for h in few]) for n in COUNTS}
    adaptive_lines = [adaptive(assembly.frequency, h) for h in few]
    lines, errors = zip(*adaptive_lines, strict=True)
    text = table(by_count, known, engine)
    text += (
        f"\n\nEvery line exact: {1e6 * engine:.0f} µs per FRF, {1e9 * engine / exact.shape[1]:.0f} ns per line. "
        f"Lines chosen adaptively for each FRF: {min(lines)} to {max(lines)}, with errors up\nto {max(errors):.0e}."
    )
    print(text)
    if arguments.output:
        arguments.output.mkdir(parents=True, exist_ok=True)
        (arguments.output / "interpolation.md").write_text(text + "\n", encoding="utf-8")
        draw(by_count, known, adaptive_lines, engine, arguments.output / "interpolation.png")


if __name__ == "__main__":
    main()
