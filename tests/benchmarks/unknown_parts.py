"""Time an FRF of an assembly with an unknown part of ten elements, over that with all parts known.

python tests/benchmarks/unknown_parts.py
"""

from __future__ import annotations

import copy
import time
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

import dovetail

ARM: dict[str, Any] = {
    "dovetail": 1,
    "name": "arm",
    "frequency": {"start": "1 Hz", "stop": "4451 Hz", "step": "1 Hz"},
    "substructures": {
        "arm": {
            "model": "timoshenko_beam",
            "material": {"young": "206 GPa", "density": "7850 kg/m^3", "loss_factor": 0.004},
            "sections": [{"length": "320 mm", "outer": "22 mm", "elements": 10}],
        },
        "wall": {"model": "ground"},
    },
    "joints": {
        "foot": {"model": "spring_damper", "connect": {"a": {"to": "arm", "at": 0}, "b": {"to": "wall", "at": 0}}}
    },
    "response": {"at": "arm", "position": "node n8"},
}
COLLET = "assemblies/bt40_er32.yaml"


def seconds_of_one(assemblies: Sequence[dovetail.Assembly], count: int) -> NDArray[np.float64]:
    """Return the least time of an FRF in a batch, and of one with its Jacobian, (n_assemblies, 2); all in turn."""
    random, tries = np.random.default_rng(0), []
    for _ in range(3000 // (count + 50)):
        times = []
        for assembly in assemblies:
            for compute in (assembly.frf, assembly.frf_jacobian):
                theta = assembly.from_unit(random.random((count, len(assembly.parameters))))
                start = time.perf_counter()
                compute(theta)
                times.append((time.perf_counter() - start) / count)
        tries.append(times)
    return np.min(tries, axis=0).reshape(-1, 2)


def main() -> None:
    part = copy.deepcopy(ARM)
    part["substructures"]["arm"]["material"]["young"] = {"range": ["190 GPa", "220 GPa"]}
    bent = copy.deepcopy(ARM)
    bent["substructures"]["arm"]["sections"][0]["length"] = {"range": ["300 mm", "340 mm"]}
    collet = {"extends": COLLET}
    stretched = {**collet, "substructures": {"tool": {"material": {"young": {"range": ["550 GPa", "620 GPa"]}}}}}
    cases = {
        "arm on a spring": (ARM, {"Young's modulus": part, "length": bent}),
        "collet": (collet, {"Young's modulus of the tool": stretched}),
    }
    for name, (plain, unknown) in cases.items():
        assemblies = [dovetail.load(description) for description in (plain, *unknown.values())]
        for count in (1, 200):
            known, *with_unknown = seconds_of_one(assemblies, count)
            shown = ", ".join(f"{1e3 * value:.3f} ms" for value in known)
            print(f"{name}, {count} at once: FRF and FRF with Jacobian in {shown}")
            for option, times in zip(unknown, with_unknown, strict=True):
                print(
                    f"    {option} unknown too: {' and '.join(f'{ratio:.2f}' for ratio in times / known)} times as long"
                )


if __name__ == "__main__":
    main()
