"""Makes the synthetic measurements of this folder: one rod, clamped at five torques.

Run it from anywhere: ``python assemblies/series/make_series.py``.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

import dovetail

HERE = Path(__file__).resolve().parent
TORQUES = (20, 40, 60, 80, 100)
"""N m."""
NOISE = 0.01
"""Of the standard deviation of each FRF."""
SHARED = {"c": 60.0, "cr": 0.6}
"""SI; the same at every torque."""
SCATTER = 0.05
"""Standard deviation of the logarithm of `kr`, from one clamping to the next."""


def parameters_at(torque: float, random: np.random.Generator) -> dict[str, float]:
    """Return the true parameters at a torque [N m], SI."""
    share = (1.0 - np.exp(-(torque - 20.0) / 30.0)) / (1.0 - np.exp(-80.0 / 30.0))
    k = 2e7 * (5e7 / 2e7) ** share
    kr = 3e4 * np.exp(SCATTER * random.standard_normal())
    return {"k": float(k), "kr": float(kr), **SHARED}


def main() -> None:
    """Write a file for each torque, and the truth."""
    assembly, random = dovetail.load(HERE / "clamped_rod.yaml"), np.random.default_rng(4)
    truth = {}
    for number, torque in enumerate(TORQUES):
        theta = parameters_at(torque, random)
        frf = dovetail.Frf(assembly.frequency, assembly.frf(theta), "accelerance")
        noisy = dovetail.noisy_frf(frf, NOISE, number)
        dovetail.write_frf(noisy, HERE / f"torque_{torque}.csv", overwrite=True)
        truth[f"T{torque}"] = theta
    (HERE / "truth.json").write_text(json.dumps(truth, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
