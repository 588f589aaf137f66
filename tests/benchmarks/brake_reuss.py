"""The damping of a bolted joint over its level of vibration as a law: the Brake-Reuss beam, eight levels.

    python tests/benchmarks/brake_reuss.py CLONE [--samples 400] [--compare]

CLONE is a clone of mattiacenedese/BRBtesting, whose data are not copied here. Its file ForcedFrequencyResponses.mat has
forces and accelerations under sines near the first bending mode, whose amplitude was held at eight levels (response
control): eight FRFs of a structure that is linear at each. They are a series over the level; stiffness and damping of
the mode are free or follow a law, its mass is shared.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import scipy.io
import yaml
from processors import processor_time

import dovetail
from dovetail.registry import installed_components
from dovetail.series import SeriesDescription, read_series
from dovetail.series.description import Role
from dovetail.series.fitted_tests import fit_tests
from dovetail.series.fitting import fit_series
from dovetail.series.result import SeriesIdentification
from dovetail.series.unknowns import SeriesUnknowns

ASSEMBLY = Path(__file__).with_name("measured_series") / "brake_reuss.yaml"
LAWS = ("free", "shared", "linear", "power", "exponential_approach", "monotone_spline")


def sweeps(clone: Path, held: str) -> Sequence[Any]:
    """Return the sweeps in which "ResponseControl" or "ForceControl" held the amplitude or the force."""
    file = clone / "ForcedFrequencyResponses.mat"
    data = scipy.io.loadmat(file, struct_as_record=False, squeeze_me=True)["FRdata"]
    return np.atleast_1d(getattr(data, held))


def levels(clone: Path) -> list[tuple[float, dovetail.Frf]]:
    """Return the median amplitude [m/s^2] and the FRF of each level."""
    found = []
    for test in sweeps(clone, "ResponseControl"):
        # 0 below the resonance, -pi above: the accelerometer faces the force
        accelerance = -test.amplitude / test.force * np.exp(1j * test.phase)
        found.append((float(np.median(test.amplitude)), dovetail.Frf(test.frequency, accelerance, "accelerance")))
    return found


def write_series(clone: Path, folder: Path, damping: object = "free", stiffness: object = "free") -> Path:
    """Write the FRFs and the description of the series, and return its path."""
    tests = {}
    for number, (level, frf) in enumerate(levels(clone), 1):
        dovetail.write_frf(frf, folder / f"level_{number}.csv", overwrite=True)
        tests[f"L{number}"] = {"measured": f"level_{number}.csv", "at": {"level": level}}
    described = {
        "dovetail_series": 1,
        "name": "Brake-Reuss beam",
        "assembly": str(ASSEMBLY),
        "covariates": {"level": "m/s^2"},
        "tests": tests,
        "parameters": {"k": stiffness, "c": damping, "mode.masses.0.mass": "shared"},
    }
    file = folder / "series.yaml"
    file.write_text(yaml.safe_dump(described, sort_keys=False), encoding="utf-8")
    return file


def laws(series: SeriesDescription) -> None:
    """Print how well each law of the damping explains all levels."""
    tests = fit_tests(series)
    print("| damping | unknowns | sum of squares | by chance | N s/m at the first and the last level |")
    print("|---|---|---|---|---|")
    for name in LAWS:
        law = None if name in ("free", "shared") else installed_components().create("law", name)
        role = Role(name) if law is None else Role("law", law, "level")  # type: ignore[arg-type]
        unknowns = SeriesUnknowns(series.with_roles({"c": role}))
        fit = fit_series(unknowns, tests)
        found = SeriesIdentification(unknowns.series, tests, unknowns, fit)
        column = [parameter.name for parameter in tests[0].problem.parameters].index("c")
        ends = " and ".join(f"{found.theta(test)[column]:.1f}" for test in (0, len(tests) - 1))
        print(f"| {name} | {unknowns.count} | {fit.squares.sum():.1f} | {fit.contradiction:.1g} | {ends} |", flush=True)


def main() -> None:
    """Print the laws, the damping at each level, and which law the measurements prefer."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("clone", type=Path)
    parser.add_argument("--samples", type=int, default=400)
    parser.add_argument("--compare", action="store_true", help="compare the laws by their marginal likelihoods too")
    options = parser.parse_args()
    began = processor_time()
    with tempfile.TemporaryDirectory() as place:
        file = write_series(options.clone, Path(place))
        laws(read_series(file))
        found = dovetail.identify_series(file, samples=options.samples)
        print("| level m/s² | natural frequency Hz | damping N s/m | 90 % interval |\n|---|---|---|---|")
        for number, fitted in enumerate(found.tests):
            rows = {row.name: row for row in found.rows_of(number)}
            natural = np.sqrt(rows["k"].estimate / rows["mode.masses.0.mass"].estimate) / (2.0 * np.pi)
            level, c = fitted.test.covariates["level"], rows["c"]
            print(f"| {level:.1f} | {natural:.2f} | {c.estimate:.1f} | {c.low:.1f} to {c.high:.1f} |")
        if options.compare:
            print(dovetail.compare_models(file, roles={"c": LAWS}, samples=options.samples).sentence)
    print(f"{processor_time() - began:.0f} s of processor time")


if __name__ == "__main__":
    main()
