"""The time of fifteen FRFs of one structure: together in one elimination, one at a time, and of one alone.

    python tests/benchmarks/several_frfs.py [--samples N] [--rounds N]
    python tests/benchmarks/several_frfs.py --fit

Three forces and five responses on the collet assembly at 4451 lines, one thread. One alone is the FRF at the described
drive point. Times are processor times, so that other work on the machine counts little. The routes take turns, and the
best of each route's rounds counts. With --fit: the refined fit of a joint to one of fifteen noisy FRFs of a beam, and
to all together.
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


def fit_times() -> None:
    """Print the time of a fit to one FRF and to fifteen, and how far the worst parameter is off."""
    places = [{"at": "beam", "position": f"node n{number}"} for number in (3, 5, 7, 9, 11)]
    responses = [{**response, "force": force} for response in places for force in places[::2]]
    parameters = {"k": (1e6, 1e8), "c": (10, 1000), "kr": (1e3, 1e5), "cr": (0.1, 10)}
    described = {
        "dovetail": 1,
        "name": "beam",
        "frequency": {"start": "20 Hz", "stop": "4000 Hz", "step": "2 Hz"},
        "substructures": {
            "beam": {
                "model": "timoshenko_beam",
                "material": {"young": "206 GPa", "density": "7850 kg/m^3", "loss_factor": 0.004},
                "sections": [{"length": "320 mm", "outer": "22 mm", "elements": 10}],
            },
            "wall": {"model": "ground"},
        },
        "joints": {
            "foot": {
                "model": "spring_damper",
                "connect": {"a": {"to": "beam", "at": 0}, "b": {"to": "wall", "at": 0}},
                "parameters": {name: {"range": list(ends), "scale": "log"} for name, ends in parameters.items()},
            }
        },
    }
    theta = {name: (low * high) ** 0.5 * 1.3 for name, (low, high) in parameters.items()}
    for count in (1, 15):
        assembly = dovetail.load({**described, "responses": responses[:count]})
        frfs = [
            dovetail.noisy_frf(alone.simulate(theta), 0.01, seed=n) for n, alone in enumerate(assembly.each_response)
        ]
        start = time.process_time()
        result = dovetail.identify(assembly, frfs, "refined")
        seconds = time.process_time() - start
        off = max(abs(result.parameters[name].value / value - 1.0) for name, value in theta.items())
        print(f"{count} FRFs of {len(assembly.frequency)} lines: {seconds:.1f} s, worst parameter off by {off:.2%}")


def main() -> None:
    """Print a row for each route."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--samples", type=int, default=4, help="parameter vectors in one call of an engine")
    parser.add_argument("--rounds", type=int, default=8)
    parser.add_argument("--fit", action="store_true", help="time the fit to one and to fifteen FRFs instead")
    arguments = parser.parse_args()
    if arguments.fit:
        fit_times()
        return
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
