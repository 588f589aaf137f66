"""Makes a folder of measurements to watch: the clamped rod of this folder on 90 mornings.

The torque of 60 N m is lost slowly, half a newton metre by the last morning. On the 61st morning the stiffness `k`
falls by 10 %.

Run it from anywhere: ``python assemblies/series/make_mornings.py FOLDER``.
"""

from __future__ import annotations

import sys
from datetime import date, timedelta
from pathlib import Path

import numpy as np
from make_series import HERE, NOISE, SHARED, parameters_at

import dovetail

MORNINGS, LOSS_AT = 90, 60


def main(folder: Path) -> None:
    """Write a file for each morning."""
    folder.mkdir(parents=True, exist_ok=True)
    assembly, random = dovetail.load(HERE / "clamped_rod.yaml"), np.random.default_rng(7)
    for number in range(MORNINGS):
        theta = {**parameters_at(60.0 - 0.5 * number / MORNINGS, random), "kr": 3e4, **SHARED}
        theta["k"] *= 0.9 if number >= LOSS_AT else 1.0
        frf = dovetail.Frf(assembly.frequency, assembly.frf(theta), "accelerance")
        day = date(2026, 1, 1) + timedelta(days=number)
        dovetail.write_frf(dovetail.noisy_frf(frf, NOISE, random), folder / f"{day}.csv", overwrite=True)


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "mornings"))
