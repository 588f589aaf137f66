"""A mass on a mount that is measured every morning, for the tests of the watch."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

import dovetail

ASSEMBLY = Path(__file__).parents[2] / "assemblies" / "sdof.yaml"
NOISE = 0.01
OLD = 1.7e9
"""Time of change of the files [s], long ago."""


def write_morning(folder: Path, day: int, stiffness: float, *, seed: int = 0, mass_error: float = 0.003) -> Path:
    """Write the measurement of one morning, of a mass that is not quite the model's."""
    assembly = dovetail.load(ASSEMBLY)
    values = assembly.frf({"k": stiffness, "c": 20.0})
    values = values / (1.0 + mass_error * (assembly.frequency / assembly.frequency[-1]) ** 2)
    noisy = dovetail.noisy_frf(
        dovetail.Frf(assembly.frequency, values, "accelerance"), NOISE, np.random.default_rng([seed, day])
    )
    file = folder / f"{np.datetime64('2026-01-01') + day}.csv"
    dovetail.write_frf(noisy, file)
    os.utime(file, (OLD + day, OLD + day))
    return file


def write_mornings(folder: Path, count: int, *, loss_at: int | None = None, seed: int = 0) -> None:
    """Write mornings with a slow drift of the stiffness, and a sudden loss of 10 % if asked for."""
    folder.mkdir(exist_ok=True)
    for day in range(count):
        drift = 2e6 * (1.0 - 2e-5 * day)
        write_morning(folder, day, drift * (0.9 if loss_at is not None and day >= loss_at else 1.0), seed=seed)


def write_series(folder: Path, **more: object) -> Path:
    """Write the description of the watch next to the folder of its files."""
    file = folder / "watch.yaml"
    lines = [
        "dovetail_series: 1",
        "name: mass on a mount, every morning",
        f"assembly: {ASSEMBLY}",
        *(f"{key}: {value}" for key, value in more.items() if key != "parameters"),
        "tests: {first: {measured: files/2026-01-01.csv}}",
        f"parameters: {more.get('parameters', '{k: varying, c: varying}')}",
    ]
    file.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return file
