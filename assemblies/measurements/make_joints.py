"""Make the synthetic measurements of the bolted lap, the shaft in its hub and the spindle, and the truth behind them.

    python assemblies/measurements/make_joints.py [--to FOLDER] [--layer TIMES]

Each structure has four elements where the description that identifies it has one. Complex Gaussian noise of 1 % of
each line's own magnitude. No laboratory was involved. With ``--layer 4`` the interference fits have four times as many
springs, too: what a joint model that is coarser than the truth does to its parameters.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np
from make_synthetic import parameters_at

import dovetail
from dovetail.measurement import complex_noise
from dovetail.units import to_si

HERE = Path(__file__).resolve().parent
FINER, NOISE = 4, 0.01

LAP = {"kt": (1.2e8, "N/m"), "kr": (3.5e3, "N m/rad"), "ct": (40.0, "N s/m"), "cr": (0.05, "N m s/rad")}
FIT = {"k": (5e10, "N/m^2"), "kr": (4e6, "N"), "c": (2e4, "N s/m^2"), "cr": (20.0, "N s")}
TAPER = {"k": (3e10, "N/m^2"), "kr": (8e6, "N"), "c": (4e4, "N s/m^2"), "cr": (40.0, "N s")}
TORQUE = 60.0
"""Of the collet's nut [N m]."""


def collet() -> dict[str, tuple[float, str]]:
    """Return the truth of the collet, as in the reference assembly."""
    units = {p.name: p.unit for p in dovetail.load(HERE.parent / "bt40_er32.yaml").parameters}
    return {f"collet.{name}": (value, units[name]) for name, value in parameters_at(TORQUE).items()}


def finer(description: dict[str, Any], times: int, layer: int = 1) -> dict[str, Any]:
    """Divide every element in `times`, and the intervals between the springs of an interference fit in `layer`."""
    for part in description["substructures"].values():
        for section in part.get("sections", ()):
            section["elements"] = times * section.get("elements", 1)
    for joint in description["joints"].values():
        if joint["model"] == "collet":
            joint["elements_per_segment"] = times
        if joint["model"] == "interference_fit" and layer > 1:
            joint["nodes"] = layer * (joint["nodes"] - 1) + 1
            for port in joint["connect"].values():
                first, last = (to_si(port["at"][end], "m") for end in (0, -1))
                port["at"] = np.linspace(first, last, joint["nodes"]).tolist()
    return description


def make(name: str, truth: dict[str, tuple[float, str]], seed: int, folder: Path, layer: int) -> None:
    """Write one measurement and the truth behind it."""
    plain = json.loads(dovetail.load(HERE.parent / f"{name}.yaml").description.text)
    structure = dovetail.load(finer(plain, FINER, layer))
    theta = {key: value for key, (value, _) in truth.items()}
    values = complex_noise(structure.frf(theta), NOISE, seed)
    note = f"SYNTHETIC {name}, {NOISE:.0%} noise"
    dovetail.write_frf(
        dovetail.Frf(structure.frequency, values, "accelerance", note=note), folder / f"{name}.uff", overwrite=True
    )
    natural = [float(f) for f in structure.natural_frequencies(theta, 12) if f <= structure.frequency[-1]]
    known = {
        "synthetic": True,
        "note": f"Truth behind {name}.uff: mesh {FINER} times finer, {NOISE:.0%} noise, made by make_joints.py.",
        "parameters": {key: f"{value:.8g} {unit}" for key, (value, unit) in truth.items()},
        "natural_frequencies_Hz": [round(f, 4) for f in natural],
    }
    (folder / f"{name}.truth.json").write_text(json.dumps(known, indent=2) + "\n", encoding="utf-8")


def main() -> None:
    """Write all three measurements."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--to", type=Path, default=HERE, help="folder of the files")
    parser.add_argument("--layer", type=int, default=1, help="springs of an interference fit, times")
    given = parser.parse_args()
    truths = {
        "bolted_lap_beam": LAP,
        "shaft_hub": FIT,
        "spindle_bt40_er32": collet() | {f"taper.{name}": value for name, value in TAPER.items()},
    }
    for seed, (name, truth) in enumerate(truths.items(), start=71):
        make(name, truth, seed, given.to, given.layer)


if __name__ == "__main__":
    main()
