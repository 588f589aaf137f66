"""Make the synthetic measurement of the reference assembly at two points, both FRFs in one file.

    python assemblies/measurements/make_two_points.py

The joint and the mesh are those of make_synthetic.py. The noise is complex and of the same size in all lines of both
FRFs, one per cent of the standard deviation of the first. No laboratory was involved.
"""

from __future__ import annotations

import json
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from make_synthetic import HERE, NOISE, SEED, finer, parameters_at

import dovetail

TORQUE = 60.0
NAME = "h0_j_t0_60Nm_two_points.uff"


def main() -> None:
    """Write one UFF file with a set for each response."""
    described = dovetail.load(HERE.parent / "bt40_er32_two_points.yaml").description
    whole = finer(json.loads(described.text))
    whole["frequency"] = {"start": "100 Hz", "stop": "9000 Hz", "step": "2 Hz"}
    assembly = dovetail.load(whole)
    frfs = assembly.frfs(parameters_at(TORQUE))
    normal = np.random.default_rng(SEED).standard_normal((*frfs.shape, 2)) @ [1.0, 1.0j] / np.sqrt(2.0)
    sets = []
    with TemporaryDirectory() as folder:
        file = Path(folder) / "one.uff"
        for number, values in enumerate(frfs + NOISE * frfs[0].std() * normal, start=1):
            measured = dovetail.Frf(
                assembly.frequency,
                values,
                "accelerance",
                note=f"SYNTHETIC H0-J-T0 {TORQUE:g} N m, {described.response_labels[number - 1]}, 1 % noise",
                response=f"{number}+x",
                force=f"{number}+x",
            )
            dovetail.write_frf(measured, file, overwrite=True)
            sets.append(file.read_bytes())
    (HERE / NAME).write_bytes(b"".join(sets))


if __name__ == "__main__":
    main()
