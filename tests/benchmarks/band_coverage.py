"""Do the bands of a predicted tool-tip FRF cover the measured one? For the campaign's three other tools.

    python tests/benchmarks/band_coverage.py

The joint is identified with tool T0 at the torque of the measurement, and the band of the other tool's FRF compared
with its measurement, without the accelerometer's mass.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

import dovetail

FOLDER = Path(__file__).resolve().parents[2] / "assemblies" / "campaign"
TESTS = {"t1": 20, "t2": 40, "t3": 60}
MASS = 1.2e-3
"""Of the accelerometer [kg]."""


def study() -> None:
    """Print for each tool and each form of the posterior the part of the lines that the band holds, and its width."""
    assembly = dovetail.load(FOLDER.parent / "bt40_er32.yaml")
    highest = assembly.frequency[-1]
    print("| tool | torque | form | lines within, where the joint was measured | all lines | median width |")
    print("|---|---|---|---|---|---|")
    for tool, torque in TESTS.items():
        joint = dovetail.read_frf(FOLDER / "measurements" / f"h0_j{torque}_t0.uff", accelerometer_mass=MASS)
        measured = dovetail.read_frf(FOLDER / "measurements" / f"h0_j{torque}_{tool}.uff", accelerometer_mass=MASS)
        other = dovetail.load(FOLDER / f"h0_{tool}.yaml")
        amplitude = np.interp(other.frequency, measured.frequency, measured.to("accelerance").amplitude)
        for form in ("samples", "laplace"):
            band = dovetail.predict_band(other, dovetail.identify(assembly, joint, "posterior", form=form))
            inside = (band.lower <= amplitude) & (amplitude <= band.upper)
            reported = other.frequency <= highest
            width = np.median(band.upper / band.lower - 1.0)
            print(f"| {tool.upper()} | {torque} N m | {form} | {inside[reported].mean():.0%} | {inside.mean():.0%} | "
                  f"{width:.1%} |")  # fmt: skip


if __name__ == "__main__":
    study()
