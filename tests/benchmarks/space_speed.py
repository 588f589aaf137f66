"""FRFs per second of two beams in space that a bushing connects, next to those of the planar collet.

    python tests/benchmarks/space_speed.py [--samples N] [--rounds N]

One drive-point FRF of 4451 lines for each parameter vector, on one thread. Times are processor times, so that other
work on the machine counts little; the best of each assembly's rounds counts.
"""

from __future__ import annotations

import argparse

from several_frfs import ASSEMBLY, best_times, engine_for

import dovetail

STEEL = {"young": "210 GPa", "density": "7850 kg/m^3", "loss_factor": 0.003}
RANGES = {
    **{f"k_{each}": {"range": [1e6, 1e9]} for each in "xyz"},
    **{f"k_r{each}": {"range": [1e3, 1e6]} for each in "xyz"},
}


def bushing() -> dovetail.Assembly:
    """Return two beams of ten elements, at right angles, the first one welded to the ground; twelve unknowns."""
    bar = {"length": "200 mm", "width": "20 mm", "height": "30 mm", "elements": 10}
    beam = {"model": "spatial_beam", "material": STEEL, "sections": [bar]}
    ends = {"a": {"to": "post", "at": "200 mm"}, "b": {"to": "arm", "at": "0 mm"}}
    foot = {"a": {"to": "post", "at": "0 mm"}, "b": {"to": "floor", "at": "0 mm"}}
    described = {
        "dovetail": 1,
        "name": "two beams",
        "frequency": {"start": 100.0, "stop": 9000.0, "step": 2.0},
        "substructures": {
            "post": {**beam, "place": {"along": "z"}},
            "arm": {**beam, "place": {"origin": ["0 mm", "0 mm", "200 mm"], "along": "x", "across": "z"}},
            "floor": {"model": "ground"},
        },
        "joints": {
            "bolts": {"model": "bushing", "connect": ends, "parameters": RANGES},
            "foot": {"model": "rigid", "direction": "all", "connect": foot},
        },
        "response": {"at": "arm", "position": "200 mm", "direction": "z"},
    }
    return dovetail.load(described)


def main() -> None:
    """Print a row for each assembly."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--samples", type=int, default=64)
    parser.add_argument("--rounds", type=int, default=5)
    given = parser.parse_args()
    print("| assembly | unknowns | ms per FRF | FRFs per second | with all derivatives, ms |\n|---|---|---|---|---|")
    assemblies = {
        "two beams and a bushing, in space": (bushing(), ("arm", 0.2, "z")),
        "the collet, in a plane": (dovetail.load(ASSEMBLY), ("tool", 0.01, "x")),
    }
    for name, (assembly, place) in assemblies.items():
        routes = {"one": [engine_for(assembly, [place], [place])]}
        best = best_times(routes, assembly, given.samples, given.rounds)
        values, jacobian = (1e3 * best["one", what] for what in ("frfs", "frfs_jacobian"))
        count = len(assembly.parameters)
        print(f"| {name} | {count} | {values:.3f} | {1e3 / values:.0f} | {jacobian:.2f} |")


if __name__ == "__main__":
    main()
