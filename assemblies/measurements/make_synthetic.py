"""Make the synthetic measurement of the reference assembly at 60 N m, and the truth behind it.

    python assemblies/measurements/make_synthetic.py

A mesh four times finer than the one that identifies, lines 1.5625 Hz apart as from 16,384 samples at 25,600 Hz, and
complex Gaussian noise of 1 % of each line's own magnitude. No laboratory was involved.
"""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import dovetail
from dovetail.measurement import complex_noise

HERE = Path(__file__).resolve().parent
FINER, NOISE, SEED = 4, 0.01, 60

# Ground truth of the synthetic campaign: value at 20 N m, value at 100 N m, unit.
TRUTH = {
    "Dc": (33.306e-3, 36.119e-3, "m"),
    "dc": (13.181e-3, 12.839e-3, "m"),
    "mn1": (0.083245, 0.048748, "kg"),
    "mn2": (0.073369, 0.088281, "kg"),
    "kt_tc": (5.9704e8, 8.1204e8, "N/m"),
    "kr_tc": (1.7616e4, 1.9413e4, "N m/rad"),
    "ct_tc": (400, 240, "N s/m"),
    "cr_tc": (1.2, 0.6, "N m s/rad"),
    "kt_hc": (1.3022e9, 2.1673e9, "N/m"),
    "kr_hc": (3.5244e5, 7.3429e5, "N m/rad"),
    "ct_hc": (500, 300, "N s/m"),
    "cr_hc": (2.2, 1.21, "N m s/rad"),
}


def parameters_at(torque: float) -> dict[str, float]:
    """Return the true parameters at a tightening torque between 20 and 100 N m."""
    share = (1 - math.exp(-(torque - 20) / 30)) / (1 - math.exp(-80 / 30))
    return {name: low * (high / low) ** share for name, (low, high, _) in TRUTH.items()}


def finer(description: dict[str, Any]) -> dict[str, Any]:
    """Divide every element in four and read the FRF as the analyser does."""
    for part in description["substructures"].values():
        for section in part["sections"]:
            section["elements"] = FINER * section.get("elements", 1)
    description["joints"]["collet"]["elements_per_segment"] = FINER
    description["frequency"] = {"start": "93.75 Hz", "stop": "9006.25 Hz", "step": "1.5625 Hz"}
    return description


def main(torque: float = 60.0) -> None:
    """Write the UFF file and the true values."""
    text = dovetail.load(HERE.parent / "bt40_er32.yaml").description.text
    assembly = dovetail.load(finer(json.loads(text)))
    theta = parameters_at(torque)
    measured = dovetail.Frf(
        assembly.frequency,
        complex_noise(assembly.frf(theta), NOISE, SEED),
        "accelerance",
        note=f"SYNTHETIC H0-J-T0 {torque:g} N m, 1 % noise",
    )
    name = f"h0_j_t0_{torque:g}Nm"
    dovetail.write_frf(measured, HERE / f"{name}.uff", overwrite=True)
    truth = {
        "synthetic": True,
        "note": f"Truth behind {name}.uff: mesh {FINER} times finer, {NOISE:.0%} noise, made by make_synthetic.py.",
        "parameters": {key: f"{value:.8g} {TRUTH[key][2]}" for key, value in theta.items()},
        "natural_frequencies_Hz": [round(float(f), 4) for f in assembly.natural_frequencies(theta)],
    }
    (HERE / f"{name}.truth.json").write_text(json.dumps(truth, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
