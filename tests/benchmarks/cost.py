"""How the cost of the engine grows: with lines, samples, the joint's own DOFs and the boundary DOFs, on one thread.

    python tests/benchmarks/cost.py [--points N] [--rounds N] [-o FOLDER]

Lines and samples are varied on the collet assembly. Joint DOFs are varied on a chain of masses and springs between two
lumped masses; boundary DOFs on two beams that a layer of springs and dampers connects at more and more nodes. What is
done once for an assembly (condensation, symbolic elimination, compilation) is timed separately. With -o the table and
the figure are written.
"""

from __future__ import annotations

import os

os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1", MKL_NUM_THREADS="1")

import argparse
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from processes import ASSEMBLY

import dovetail
from dovetail import JointModel, JointPort, Parameter
from dovetail.dataset import latin_hypercube
from dovetail.registry import Registry
from dovetail.synthesis import Attachment, Connection, Engine, Graph
from synthesis import printed

SAMPLES, LINES = 64, 1024
MATERIAL = {"young": 210e9, "density": 7800, "poisson": 0.3, "loss_factor": 0.004}


class Chain(JointModel):
    """Masses and damped springs in a row between two parts: any number of internal DOFs, each with two neighbours."""

    name, summary = "chain", "Benchmark"
    parameters = (Parameter("k", "N/m", 1e5, 1e7, "log"), Parameter("c", "N s/m", 1, 100), Parameter("m", "kg", 0.1, 1))
    ports = (JointPort("a", 1), JointPort("b", 1))
    internal_dofs = 1

    @classmethod
    def of(cls, masses: int) -> Chain:
        """Return a chain with so many masses."""
        return type("Chain", (cls,), {"internal_dofs": masses})(cls.Config())

    def matrices(self, theta: NDArray[np.float64]) -> dovetail.StructuralMatrices:
        """Return the matrices; the ports' rotations take no part."""
        joint = dovetail.StructuralMatrices.zeros(len(theta), self.size)
        along = np.array([0, *range(4, self.size), 2])
        first, second = along[:-1], along[1:]
        for matrix, values in ((joint.K, theta[:, :1]), (joint.C, theta[:, 1:2])):
            for ends in (first, second):
                np.add.at(matrix, (slice(None), ends, ends), values)
            matrix[:, first, second] -= values
            matrix[:, second, first] -= values
        joint.M[:, along[1:-1], along[1:-1]] = theta[:, 2:]
        return joint


@dataclass(frozen=True)
class Point:
    """One measured size.

    Parameters
    ----------
    size : int
        How many lines, samples or DOFs.
    running : float
        Seconds for all FRFs.
    once : float
        Seconds for what is done once for an assembly.
    """

    size: int
    running: float
    once: float


def timed(work: Callable[[], object]) -> float:
    """Return wall-clock seconds."""
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def measure(size: int, assembly: dovetail.Assembly, samples: int, rounds: int) -> Point:
    """Time the first FRF, which does everything that is done once, and then a batch."""
    theta = latin_hypercube(assembly, samples, seed=0)
    assembly.engine.threads = 1
    first = timed(lambda: assembly.frf(theta[0]))
    return Point(size, min(timed(lambda: assembly.frf(theta)) for _ in range(rounds)), first)


def with_lines(lines: int) -> dovetail.Assembly:
    """Return the collet assembly with another number of lines over the same frequencies."""
    frequency = {"start": 100, "stop": 9000, "step": 8900 / (lines - 1)}
    return dovetail.load({"extends": str(ASSEMBLY), "frequency": frequency})


def with_boundary(dofs: int) -> dovetail.Assembly:
    """Return two beams that are connected at `dofs` of their DOFs, half of them on either, and struck at an end."""
    nodes = dofs // 4
    section = {"length": 0.01 * (nodes + 4), "outer": 0.02, "elements": nodes + 4}
    beam = {"model": "timoshenko_beam", "material": MATERIAL, "sections": [section]}
    positions = {"a": [0.01 * (4 + node) for node in range(nodes)], "b": [0.01 * node for node in range(nodes)]}
    connect = {port: {"to": part, "at": positions[port]} for port, part in (("a", "left"), ("b", "right"))}
    return dovetail.load(
        {
            "dovetail": 1,
            "name": "two-beams",
            "frequency": {"start": 100, "stop": 9000, "step": 8900 / (LINES - 1)},
            "substructures": {"left": beam, "right": beam},
            "joints": {"layer": {"model": "spring_damper", "nodes": nodes, "connect": connect}},
            "response": {"at": "left", "position": 0},
        }
    )


def with_chain(masses: int, rounds: int) -> Point:
    """Time two lumped masses with a chain of `masses` between them."""
    registry = Registry()
    registry.load_entry_points()
    lumped = registry.find("substructure", "lumped").component
    masses_at = {name: lumped(lumped.Config(masses=[{"mass": 1.0}])) for name in ("left", "right")}
    joint = Connection(Chain.of(masses), (Attachment("left", (0,)), Attachment("right", (0,))))
    lower, upper = np.array([1e5, 1, 0.1]), np.array([1e7, 100, 1])
    theta = {"chain": lower + (upper - lower) * np.random.default_rng(0).random((SAMPLES, 3))}
    frequency = np.linspace(1, 500, LINES)

    def first() -> Engine:
        engine = Engine(Graph(masses_at, {"chain": joint}), frequency, [("left", 0)], theta)
        engine.threads = 1
        engine.frfs({"chain": theta["chain"][:1]})
        return engine

    once = timed(first)
    engine = first()
    return Point(masses, min(timed(lambda: engine.frfs(theta)[:, 0]) for _ in range(rounds)), once)


def series(points: int, rounds: int) -> dict[str, list[Point]]:
    """Return what was measured for each quantity."""
    return {
        "lines": [measure(n, with_lines(n), SAMPLES, rounds) for n in [556, 1112, 2225, 4451, 8901, 17801][:points]],
        "samples": [measure(n, dovetail.load(ASSEMBLY), n, rounds) for n in [4, 16, 64, 256, 1024, 4096][:points]],
        "joint DOFs": [with_chain(n, rounds) for n in [8, 16, 32, 64, 128, 256][:points]],
        "boundary DOFs": [measure(n, with_boundary(n), SAMPLES, rounds) for n in [8, 16, 32, 64, 96, 128][:points]],
    }


def slope(points: list[Point]) -> float:
    """Return the exponent of the time by size, of a straight line through the logarithms."""
    sizes, times = zip(*((np.log(point.size), np.log(point.running)) for point in points), strict=True)
    return float(np.polyfit(sizes, times, 1)[0])


def table(measured: dict[str, list[Point]]) -> str:
    """Return two Markdown tables: the exponents, and the times."""
    slopes = [["by", "from - to", "exponent", "exponent of the last step"]]
    times = [["by", "size", "all FRFs [ms]", "once [s]"]]
    for name, points in measured.items():
        span = f"{points[0].size} - {points[-1].size}"
        slopes.append([name, span, f"{slope(points):.2f}", f"{slope(points[-2:]):.2f}"])
        times += [[name, str(p.size), f"{1e3 * p.running:.2f}", f"{p.once:.2f}"] for p in points]
    return printed(slopes) + "\n\n" + printed(times)


def draw(measured: dict[str, list[Point]], file: Path) -> None:
    """Draw the times by size, with a line of exponent 1 from the first point."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10, 3), layout="constrained")
    for axes, (name, points) in zip(figure.subplots(1, len(measured)), measured.items(), strict=True):
        sizes, times = np.array([p.size for p in points]), 1e3 * np.array([p.running for p in points])
        axes.loglog(sizes, times, "o-", label="all FRFs")
        axes.loglog(sizes, 1e3 * np.array([p.once for p in points]), "s:", color="0.5", label="once")
        axes.loglog(sizes, times[0] * sizes / sizes[0], "--", color="0.7", label="linear")
        axes.set_title(f"exponent {slope(points):.2f}", fontsize=10)
        axes.set_xlabel(name)
        axes.grid(which="major", alpha=0.3)
        axes.tick_params(which="minor", labelleft=False, labelbottom=False)
    figure.axes[0].set_ylabel("ms")
    figure.axes[0].legend(fontsize=8)
    figure.savefig(file, dpi=110, metadata={"Software": None})


def main() -> None:
    """Print the tables, and draw them."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--points", type=int, default=6, help="sizes of each quantity, from the smallest")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("-o", "--output", type=Path, help="folder for cost.md and cost.png")
    arguments = parser.parse_args()
    measured = series(arguments.points, arguments.rounds)
    text = table(measured)
    print(text)
    if arguments.output:
        arguments.output.mkdir(parents=True, exist_ok=True)
        (arguments.output / "cost.md").write_text(text + "\n")
        draw(measured, arguments.output / "cost.png")


if __name__ == "__main__":
    main()
