"""Straight-line code, loops and batched LAPACK by the size of the coupled system, in one run.

    python tests/benchmarks/kernel_routes.py

Two kinds of systems: two beams that joints connect at many nodes (sparse: a chain), and two blocks in which everything
is connected with everything (dense). 4451 lines, one thread; times are the best of several rounds.
"""

from __future__ import annotations

import os

os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1", MKL_NUM_THREADS="1")

import sys
import time
from collections.abc import Callable, Iterable

import numpy as np

import dovetail
from dovetail import PartNode, StructuralMatrices, SubstructureModel
from dovetail.registry import Registry
from dovetail.synthesis import Attachment, Connection, Engine, Graph
from dovetail.synthesis import plan as plan_module

SAMPLES = 16


class Block(SubstructureModel):
    """Everything is connected with everything."""

    name, summary = "block", "Benchmark substructure"

    def __init__(self, nodes: int, seed: int) -> None:
        super().__init__()
        self.count, self.seed = nodes, seed

    @property
    def nodes(self) -> tuple[PartNode, ...]:
        """The nodes, a metre apart."""
        return tuple(PartNode(f"n{i}", float(i)) for i in range(self.count))

    def matrices(self) -> StructuralMatrices:
        """Return matrices with natural frequencies from 50 Hz to 12 kHz and a loss factor of 0.01."""
        rng, size = np.random.default_rng(self.seed), 2 * self.count
        modes, _ = np.linalg.qr(rng.standard_normal((size, size)))
        K = modes @ np.diag((2 * np.pi * np.linspace(50, 12000, size)) ** 2) @ modes.T
        K = (K + K.T) / 2
        return StructuralMatrices(np.diag(rng.uniform(0.8, 1.2, size)), K, None, 0.01 * K)


def find(kind: str, name: str) -> type:
    """Return a model that ships with Dovetail."""
    registry = Registry()
    registry.load_entry_points()
    return registry.find(kind, name).component


def blocks(nodes: int) -> Graph:
    """Two blocks and a contact layer at all nodes."""
    layer, at = find("joint", "spring_damper"), tuple(range(nodes))
    joint = Connection(layer(layer.Config(nodes=nodes)), (Attachment("a", at), Attachment("b", at)))
    return Graph({"a": Block(nodes, 1), "b": Block(nodes, 2)}, {"j": joint})


def beams(nodes: int) -> Graph:
    """Two beams and a spring-damper at each second node."""
    material = {"young": 210e9, "density": 7800, "poisson": 0.3, "loss_factor": 0.004}
    beam = {"model": "timoshenko_beam", "material": material}
    beam["sections"] = [{"length": 0.1 * nodes, "outer": 0.02, "elements": 2 * nodes}]
    ends = [{"a": {"to": "left", "at": 0.1 * i}, "b": {"to": "right", "at": 0.1 * i}} for i in range(nodes)]
    joints = {f"j{i}": {"model": "spring_damper", "connect": connect} for i, connect in enumerate(ends)}
    description = {"dovetail": 1, "name": "beams", "frequency": {"start": 100, "stop": 9000, "lines": 16}}
    parts = {"left": beam, "right": beam}
    response = {"at": "left", "position": 0, "quantity": "receptance"}
    return dovetail.load({**description, "substructures": parts, "joints": joints, "response": response}).graph


def parameters(graph: Graph) -> dict[str, np.ndarray]:
    """Draw parameter vectors from the middle of the ranges."""
    rng = np.random.default_rng(0)
    return {
        name: np.stack([p.from_unit(rng.uniform(0.3, 0.7, SAMPLES)) for p in connection.model.parameters], axis=-1)
        for name, connection in graph.connections.items()
    }


def timed(work: Callable[[], object], rounds: int = 1) -> float:
    """Return the shortest time in milliseconds."""
    times = []
    for _ in range(rounds):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return 1e3 * min(times)


def measure(graph: Graph, lines: int, limit: int) -> tuple[Engine, list[float]]:
    """Return the first FRF's time, and the times per FRF alone and with Jacobian, in milliseconds."""
    plan_module.SETTINGS = plan_module.Settings(straight_line=limit)
    theta = parameters(graph)
    name = next(iter(graph.substructures))
    engine = Engine(graph, np.linspace(100.0, 9000.0, lines), [(name, 0)], theta)
    engine.threads = 1
    single = {joint: values[:1] for joint, values in theta.items()}
    first = timed(lambda: engine.frfs(single)[:, 0])
    engine.frfs_jacobian(single)
    alone = timed(lambda: engine.frfs(theta)[:, 0], 3) / SAMPLES
    return engine, [first, alone, timed(lambda: engine.frfs_jacobian(theta), 3) / SAMPLES]


def main(sizes: Iterable[int] = (2, 3, 4, 6, 8, 10, 15), lines: int = 4451, longest: int = 4000) -> None:
    """Print a row for each system; straight-line code for eliminations up to `longest` multiplications."""
    chosen = plan_module.SETTINGS
    limit = chosen.straight_line
    print(f"times in ms, one thread, {lines} lines; the engine compiles up to {limit} multiplications without loops")
    print(f"{'':29}{'straight-line code':>30}{'loops':>30}{'LAPACK':>8}")
    titles = ["first", "FRF", "+Jacobian"]
    heads = "".join(f"{title:>10}" for title in titles * 2)
    print(f"{'':7}{'boundary':>9}{'mult.':>8}{'param.':>7}{heads}{'FRF':>8}")
    for kind, make in (("beams", beams), ("blocks", blocks)):
        for nodes in sizes:
            graph = make(nodes)
            engine, loops = measure(graph, lines, 0)
            straight = measure(graph, lines, 10**9)[1] if engine.program.multiplications <= longest else None
            single = {joint: values[:1] for joint, values in parameters(graph).items()}
            lapack = timed(lambda e=engine, t=single: e.receptance(t, e.system.points, e.system.points))
            count = sum(len(c.model.parameters) for c in graph.connections.values())
            numbers = f"{kind:8}{4 * nodes:8}{engine.program.multiplications:8}{count:7}"
            shown = "".join(f"{value:10.3f}" for value in straight) if straight else f"{'-':>10}" * 3
            print(numbers + shown + "".join(f"{value:10.3f}" for value in loops) + f"{lapack:8.0f}", flush=True)
    plan_module.SETTINGS = chosen


if __name__ == "__main__":
    if len(sys.argv) > 1:
        main([int(size) for size in sys.argv[2:]], int(sys.argv[1]))
    else:
        main()
