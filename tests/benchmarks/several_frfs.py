"""The time of fifteen FRFs of one structure: together in one elimination, one at a time, and of one alone.

    python tests/benchmarks/several_frfs.py [--samples N] [--rounds N]

Three forces and five responses on the collet assembly at 4451 lines, one thread. One alone is the FRF at the described
drive point. Times are processor times, so that other work on the machine counts little. The routes take turns, and the
best of each route's rounds counts.
"""

from __future__ import annotations

import os

os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1", MKL_NUM_THREADS="1")

import argparse
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

import dovetail
from dovetail.dataset import latin_hypercube
from dovetail.synthesis import Engine

ASSEMBLY = Path(__file__).resolve().parents[2] / "assemblies" / "bt40_er32.yaml"
FORCES = [("tool", 0.01, "x"), ("tool", 0.05, "x"), ("holder", 0.1454, "x")]
RESPONSES = [*FORCES, ("tool", 0.0, "x"), ("tool", 0.0, "rz")]


def engine_for(assembly: dovetail.Assembly, outputs: Sequence[tuple], inputs: Sequence[tuple]) -> Engine:
    """Return an engine of one thread for the FRFs between all of some points."""
    points = list(dict.fromkeys(assembly.point(*place) for place in (*outputs, *inputs)))
    pairs = [
        (points.index(assembly.point(*output)), points.index(assembly.point(*force)))
        for output in outputs
        for force in inputs
    ]
    probes = assembly.by_joint(latin_hypercube(assembly, 8, seed=1))
    engine = Engine(assembly.graph, assembly.frequency, points, probes, pairs=pairs)
    engine.threads = 1
    return engine


def best_times(routes: dict[str, list[Engine]], assembly: dovetail.Assembly, samples: int, rounds: int) -> dict:
    """Return the seconds per parameter vector of each route, for values and for values with Jacobian, all kept."""
    theta = assembly.by_joint(latin_hypercube(assembly, samples, seed=0))
    best = {(name, what): np.inf for name in routes for what in ("frfs", "frfs_jacobian")}
    for counted in [False, *[True] * rounds]:
        for name, what in best:
            start = time.process_time()
            kept = [getattr(engine, what)(theta) for engine in routes[name]]
            seconds = (time.process_time() - start) / samples
            if counted:
                best[name, what] = min(best[name, what], seconds)
            del kept
    return best


def main() -> None:
    """Print a row for each route."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--samples", type=int, default=4, help="parameter vectors in one call of an engine")
    parser.add_argument("--rounds", type=int, default=8)
    arguments = parser.parse_args()
    assembly = dovetail.load(ASSEMBLY)
    together = engine_for(assembly, RESPONSES, FORCES)
    routes = {
        "one": [engine_for(assembly, FORCES[:1], FORCES[:1])],
        "fifteen, one at a time": [engine_for(assembly, [o], [i]) for o in RESPONSES for i in FORCES],
        "fifteen together": [together],
    }
    print(f"{len(assembly.frequency)} lines, {arguments.samples} parameter vectors at once, one thread; ", end="")
    print(f"{routes['one'][0].program.multiplications} multiplications a line for one FRF, ", end="")
    print(f"{together.program.multiplications} before the receptances of fifteen\n")
    best = best_times(routes, assembly, arguments.samples, arguments.rounds)
    print("| FRFs | ms | over one | ms with Jacobian | over one |")
    print("|---|---|---|---|---|")
    for name in routes:
        values, jacobian = best[name, "frfs"], best[name, "frfs_jacobian"]
        ratios = values / best["one", "frfs"], jacobian / best["one", "frfs_jacobian"]
        print(f"| {name} | {1e3 * values:.3f} | {ratios[0]:.2f} | {1e3 * jacobian:.3f} | {ratios[1]:.2f} |")


if __name__ == "__main__":
    main()
