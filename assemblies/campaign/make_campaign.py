"""Make the synthetic measurements of the campaign and the truth behind them. No laboratory was involved.

    python assemblies/campaign/make_campaign.py [--only NAME ...] [--to FOLDER] [--signals]

Every file is an impact test: ten impacts of a hammer, force and acceleration recorded at 25,600 Hz over 16,384 samples,
sensor noise on both, an accelerometer of 1.2 g on the structure; H1 and coherence from them. The structure has four
elements where the description that predicts it has one. Run again, it writes the same bytes.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from hammer_test import HammerTest
from models import ACCELEROMETER, FINER, HERE, described, finer, on_spindle, parameters_at, with_accelerometer

import dovetail

TOOL, HOLDER, SPINDLE = (80.0, 0.1e-3), (400.0, 0.1e-3), (420.0, 0.18e-3)
"""Mean peak [N] and duration [s] of the pulse on a tool, a holder, and a holder in the spindle, which a softer tip
strikes. The accelerometer stays within its 5000 m/s^2."""


@dataclass(frozen=True)
class Test:
    """One impact test.

    Parameters
    ----------
    name : str
        Of the file.
    structure : str
        The description that the structure refines.
    label : str
        What was tested, for the file's text.
    seed : int
    torque : float or None
        N m, of the collet's nut; None without a collet.
    mounted : bool
        On the spindle, else free-free.
    sensor, struck : float or None
        Position [m] on the measured part; None: the description's response point.
    pulse : (float, float)
        Mean peak [N] and duration [s].
    last : float
        Hz, last line that is kept.
    """

    name: str
    structure: str
    label: str
    seed: int
    torque: float | None = None
    mounted: bool = False
    sensor: float | None = None
    struck: float | None = None
    pulse: tuple[float, float] = TOOL
    last: float = 10200.0


def _tests() -> tuple[Test, ...]:
    parts = [
        *(Test(f"t{n}", f"t{n}", f"tool T{n}, free-free", 10 + n) for n in range(4)),
        Test("h0", "h0", "holder H0, free-free", 14, pulse=HOLDER),
    ]
    series = [
        Test(f"h0_j{torque}_t0", "h0_t0", f"H0-J{torque}-T0, free-free", 100 + torque, float(torque))
        for torque in (20, 40, 60, 80, 100)
    ]
    novel = [
        Test(f"h0_j{torque}_t{n}", f"h0_t{n}", f"H0-J{torque}-T{n}, free-free", 300 + torque, float(torque))
        for n, torque in ((1, 20), (2, 40), (3, 60))
    ]
    calibration = [
        Test(f"sf_h1_{name}", "h1", f"SF-H1, {name}", 500 + n, None, True, sensor, struck, pulse=SPINDLE, last=7100.0)
        for n, (name, sensor, struck) in enumerate((("aa", 0.0, 0.0), ("ab", 0.0, 0.02), ("bb", 0.02, 0.02)))
    ]
    mounted = [
        Test(f"sf_h2_j{torque}_t{n}", f"h2_t{n}", f"SF-H2-J{torque}-T{n}", 600 + n, float(torque), True, last=7100.0)
        for n, torque in ((1, 100), (2, 80), (3, 20))
    ]
    return (*parts, *series, *novel, *calibration, *mounted)


TESTS = _tests()


def structure_of(test: Test, *, accelerometer: bool) -> dovetail.Assembly:
    """Return the structure that is struck, on the lines of the simulation."""
    described_as = described(test.structure)
    sensor = described_as["response"]["position"] if test.sensor is None else test.sensor
    structure = finer(on_spindle(described_as) if test.mounted else described_as)
    if accelerometer:
        structure = with_accelerometer(structure, sensor)
    settings = HammerTest()
    structure["frequency"] = {"start": settings.step, "stop": settings.rate / 2, "step": settings.step}
    return dovetail.load(structure)


def theta_of(test: Test, assembly: dovetail.Assembly) -> dict[str, float]:
    """Return the true values of the joint's parameters by the assembly's names."""
    values = {} if test.torque is None else parameters_at(test.torque)
    return {p.name: values[p.name.rpartition(".")[2]] for p in assembly.parameters}


def measure(test: Test, signals: Path | None = None) -> dovetail.Frf:
    """Strike the structure and estimate its FRF; the time records go to `signals`, if that is a file."""
    assembly = structure_of(test, accelerometer=True)
    response = assembly.description.response
    nodes = assembly.description.substructures[response.substructure].nodes
    own = nodes[response.node].position
    sensor, struck = (own if given is None else given for given in (test.sensor, test.struck))
    part = response.substructure
    receptance = assembly.receptance(theta_of(test, assembly), [(part, sensor, "x")], [(part, struck, "x")])[:, 0, 0]
    accelerance = receptance * (2j * np.pi * assembly.frequency) ** 2
    settings = replace(HammerTest(), peak=test.pulse[0], duration=test.pulse[1])
    force, acceleration = settings.records(accelerance, test.seed)
    if signals is not None:
        np.savez(signals, force=force, response=acceleration, rate=settings.rate)
    return replace(_estimated(force, acceleration, settings, test), response=_dof(sensor), force=_dof(struck))


def _dof(position: float) -> str:
    """Name a point by its position: its number is that in millimetres, from 1."""
    return f"{1 + round(1e3 * position)}+x"


def _estimated(force: Any, acceleration: Any, settings: HammerTest, test: Test) -> dovetail.Frf:
    """H1 and coherence of the ten records, cut to the lines that are kept, in single precision."""
    estimated = dovetail.frf_from_signals(force, acceleration, settings.rate, force_window=0.02)
    if estimated.warnings:
        raise SystemExit(f"{test.name}: {' '.join(estimated.warnings)}")
    frf = estimated.frf
    kept = (frf.frequency >= 90.0) & (frf.frequency <= test.last)
    return replace(
        frf,
        frequency=frf.frequency[kept],
        values=frf.values[kept].astype(np.complex64),
        coherence=frf.coherence[kept].astype(np.float32),
        note=f"SYNTHETIC, no laboratory: {test.label}, H1 of {settings.impacts} impacts, 1.2 g on it",
    )


def truth_of(test: Test) -> dict[str, Any]:
    """Return what was put in, and the natural frequencies of the structure without and with the accelerometer."""
    bare, loaded = (structure_of(test, accelerometer=on) for on in (False, True))
    theta = theta_of(test, bare)
    return {
        "label": test.label,
        "structure": f"{test.structure}.yaml" + (" on spindle.yaml" if test.mounted else ""),
        "torque_Nm": test.torque,
        "parameters": {name.rpartition(".")[2]: float(f"{value:.8g}") for name, value in theta.items()},
        "natural_frequencies_Hz": _natural(bare, theta, test.last),
        "natural_frequencies_with_accelerometer_Hz": _natural(loaded, theta, test.last),
    }


def _natural(assembly: dovetail.Assembly, theta: dict[str, float], last: float) -> list[float]:
    found = assembly.natural_frequencies(theta, count=12)
    return [round(float(f), 3) for f in found[found <= last]]


def main() -> None:
    """Write the files that the command line asks for."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--only", nargs="+", metavar="NAME", choices=[test.name for test in TESTS])
    parser.add_argument("--to", type=Path, default=HERE / "measurements", metavar="FOLDER")
    parser.add_argument("--signals", action="store_true", help="write the time records too, as NAME.npz")
    chosen = parser.parse_args()
    chosen.to.mkdir(parents=True, exist_ok=True)
    for test in TESTS:
        if chosen.only is None or test.name in chosen.only:
            signals = chosen.to / f"{test.name}.npz" if chosen.signals else None
            dovetail.write_frf(measure(test, signals), chosen.to / f"{test.name}.uff", overwrite=True, binary=True)
    if chosen.only is None:
        truth = {
            "synthetic": True,
            "note": f"True values of the files in this folder: mesh {FINER} times finer, {ACCELEROMETER * 1e3:g} g on "
            "the structure, made by make_campaign.py. Natural frequencies are those of the damped structure.",
            "tests": {test.name: truth_of(test) for test in TESTS},
        }
        (chosen.to / "truth.json").write_text(json.dumps(truth, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
