"""How long does the engine take when a joint fills entries that its elimination was not planned for?

    python tests/benchmarks/replanning.py [--rounds 5]

The collet of the reference assembly gets a stop: a rotational stiffness between its ends that bears above 97 % of
the range of its first parameter. Each round makes a new engine, computes an FRF and a Jacobian below the stop,
and then above it.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import numpy as np

import dovetail
from dovetail.synthesis import Engine, direct_receptance
from dovetail.synthesis.codegen.compiler import compiled

ASSEMBLY = Path(__file__).resolve().parents[2] / "assemblies" / "bt40_er32.yaml"
BEARS = 0.97


def assembly_with_stop():
    """Return the reference assembly, whose collet has a stop, and its parameters below and above it."""
    assembly = dovetail.load(ASSEMBLY)
    connection = assembly.graph.connections["collet"]
    model, parameter = connection.model, connection.model.parameters[0]
    limit = float(parameter.from_unit(np.array(BEARS)))
    last = model.size - 1

    class WithStop(type(model)):
        def matrices(self, theta):
            result = super().matrices(theta)
            result.add_contact_layer([(1, last)], 1e4 * np.maximum(theta[:, 0] / limit - 1.0, 0.0))
            return result

    model.__class__ = WithStop
    below, above = np.full((2, 1, len(assembly.parameters)), 0.5)
    above[:, 0] = 0.99
    return assembly, assembly.by_joint(assembly.from_unit(below)), assembly.by_joint(assembly.from_unit(above))


def study(rounds: int) -> None:
    """Print the times of one FRF and Jacobian, and the error of the one above the stop."""
    assembly, below, above = assembly_with_stop()
    calls = {"first": below, "next": below, "with a wider plan": above, "next, with a wider plan": above}
    times: dict[str, list[float]] = {label: [] for label in calls}
    for _ in range(rounds):
        compiled.cache_clear()
        engine = Engine(assembly.graph, assembly.frequency, [assembly.description.response.point], below)
        for label, theta in calls.items():
            start = time.perf_counter()
            frf = engine.frfs_jacobian(theta)[0][:, 0]
            times[label].append(time.perf_counter() - start)
    point = [int(assembly.graph.substructure_dofs(name)[dof]) for name, dof in (assembly.description.response.point,)]
    lines = slice(None, None, 50)
    single = {name: values[0] for name, values in above.items()}
    direct = direct_receptance(assembly.graph, assembly.frequency[lines], single, point, point)[:, 0, 0]
    print("| FRF and Jacobian | ms (median) |\n|---|---|")
    for label, seconds in times.items():
        print(f"| {label} | {1e3 * np.median(seconds):.1f} |")
    print(f"| error above the stop, against the direct solve | {np.abs(frf[0, lines] / direct - 1.0).max():.1e} |")


if __name__ == "__main__":
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--rounds", type=int, default=5)
    study(**vars(arguments.parse_args()))
