"""What is identified from public measurements of real structures, and how well does it predict FRFs not fitted?

    python tests/benchmarks/gallery.py oscillator
    python tests/benchmarks/gallery.py hammer
    python tests/benchmarks/gallery.py frame --data FOLDER
    python tests/benchmarks/gallery.py beam --data FOLDER
    python tests/benchmarks/gallery.py collet --data FOLDER
    python tests/benchmarks/gallery.py brake_reuss --data FOLDER

prints the tables of a page of docs/gallery, and writes them to docs/gallery/tables (or the folder of `--to`). The
FRFs of oscillator and hammer are part of this repository; those of the others are not. Those of frame and beam are read
from the folder that measured_structures.py made with `--convert`, those of collet and Brake-Reuss beam from their
repositories' folders.

An FRF that is predicted is compared with the measured one by the FRAC, |<a, b>|^2 / (<a, a> <b, b>) over the band: 1 if
they differ by a factor only. It is blind to gains, and the highest peaks dominate it. The magnitude error next to it,
the median over the lines, weights all lines equally. Every choice is made by the FRFs that are fitted.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from gallery_brake_reuss import brake_reuss_page
from gallery_collet import collet
from gallery_tables import (
    interval_of_band,
    named,
    pairs,
    percent,
    predictions,
    rows,
    sentence,
    word,
)
from measured_data import DESCRIPTIONS, STRUCTURES
from numpy.typing import NDArray
from scipy.optimize import least_squares

import dovetail

ROOT = Path(__file__).parents[2]
HAMMER_WINDOW = 4.605
"""1/s that the exponential window adds to the decay of each mode, as the FRF's note says."""
BEAM_POSITIONS = (45, 50, 55)
"""mm from the beam's end to the first sensor: those that the sources try."""
BEAM_POSITION = 50
"""The one of them whose columns are fitted best."""


class Circle(NamedTuple):
    """A circle fitted to a resonance's mobility in the complex plane.

    Parameters
    ----------
    natural_frequency : float
        Hz.
    stiffness, damping : float
        Of a mass of 1 kg [N/m, N s/m].
    """

    natural_frequency: float
    stiffness: float
    damping: float


def circle_fit(frf: dovetail.Frf, band: tuple[float, float]) -> Circle:
    """Fit a circle to the lines of an accelerance within a band [Hz], and the angles on it.

    The mobility of an oscillator, 1 / (c + i (w m - k / w)), is a circle through 0, run through at the angle
    2 arctan((k - w^2 m) / (c w)). A gain, a constant phase and the residue of far modes only stretch, turn and move
    it. Centre and radius come from linear least squares (Kasa), k, c and the turn from least squares of the angles.
    """
    inside = (frf.frequency >= band[0]) & (frf.frequency <= band[1])
    omega = 2 * np.pi * frf.frequency[inside]
    mobility = frf.values[inside] / (1j * omega)
    mobility = mobility / np.abs(mobility).max()
    columns = np.column_stack([mobility.real, mobility.imag, np.ones(len(omega))])
    x, y, rest = np.linalg.lstsq(columns, np.abs(mobility) ** 2, rcond=None)[0]
    centre = complex(x, y) / 2
    radius = np.sqrt(abs(centre) ** 2 + rest)
    spokes = (mobility - centre) / radius
    highest = int(np.argmax(np.abs(mobility)))

    def residuals(unknown: NDArray[np.float64]) -> NDArray[np.float64]:
        turn, natural, width = unknown
        angles = turn + 2 * np.arctan((natural**2 - omega**2) / (width * omega))
        return np.asarray(np.angle(spokes * np.exp(-1j * angles)), dtype=np.float64)

    start = (float(np.angle(spokes[highest])), omega[highest], 2 * np.pi * float(np.diff(frf.frequency)[0]))
    fit = least_squares(residuals, start, x_scale=(0.1, 1.0, 0.5))
    _, natural, width = fit.x
    return Circle(natural / (2 * np.pi), natural**2, abs(width))


def with_band(assembly: dovetail.Assembly, start: float, stop: float) -> dovetail.Assembly:
    """Return the assembly with another band [Hz], in the same steps."""
    description = json.loads(assembly.description.text)
    description["frequency"] |= {"start": f"{start} Hz", "stop": f"{stop} Hz"}
    return dovetail.load(description)


def oscillator(_: Path) -> dict[str, str]:
    """Identify the oscillator from lines near its resonance, compare it with a circle fit, and predict other lines."""
    frf = dovetail.read_frf(ROOT / "assemblies/measurements/oscillator_case1.uff")
    assembly = dovetail.load(ROOT / "assemblies/oscillator.yaml")
    near = float(assembly.frequency[0]), float(assembly.frequency[-1])
    header = "lines|model error|k, circle [N/m]|k [N/m]|90 % interval|c, circle [N s/m]|c [N s/m]|90 % interval|verdict"
    lines: list[tuple[str, ...]] = []
    first = None
    for band in (near, (204.0625, 220.0), (195.0, 230.0)):
        circle = circle_fit(frf, band)
        for options in ({}, {"model_error": 0.0}):
            result = dovetail.identify(with_band(assembly, *band), frf, "posterior", **options)
            first = first or result
            k, c = (against(circle_value, result, name) for circle_value, name in zip(circle[1:], "kc", strict=True))
            given = "0" if options else "not given"
            lines.append((interval_of_band(band), given, *k, *c, word(result)))
    assert first is not None
    values = named(first, assembly)
    compared = []
    for band in (near, (150.0, 207.8125), (216.5625, 300.0), (300.0, 400.0)):
        ((likeness, error),) = predictions(with_band(assembly, *band), values, [frf])
        compared.append((interval_of_band(band), "fitted" if band == near else "", f"{likeness:.3f}", percent(error)))
    draw_oscillator(frf, assembly, values)
    return {
        "oscillator": rows(header, lines),
        "oscillator_predicted": rows("lines||FRAC|magnitude error", compared),
    }


def against(circle: float, result: dovetail.Identification, name: str) -> tuple[str, str, str]:
    """Return the cells of a value: that of the circle, the identified one with its difference, its interval."""
    value = float(result.theta[list(result.interval).index(name)])
    low, high = result.interval[name]
    inside = "" if low <= circle <= high else ", without the circle's"
    return f"{circle:.5g}", f"{value:.5g} ({100 * (value / circle - 1):+.2g} %)", f"{low:.5g} to {high:.5g}{inside}"


def draw_oscillator(frf: dovetail.Frf, assembly: dovetail.Assembly, values: Mapping[str, float]) -> None:
    """Draw the measured and the identified FRF, and their circles."""
    import matplotlib.pyplot as plt

    figure, (spectrum, plane) = plt.subplots(1, 2, figsize=(9, 4), layout="constrained", width_ratios=(2, 1))
    shown = (frf.frequency >= 150) & (frf.frequency <= 400)
    frequency = frf.frequency[shown]
    wide = assembly.on(frequency)
    model = wide.frf(wide.vector(values))
    sign = np.sign(np.vdot(model, frf.values[shown]).real)
    spectrum.semilogy(frequency, np.abs(frf.values[shown]), color="0.6", label="measured")
    spectrum.semilogy(frequency, np.abs(model), color="C0", lw=1, label="identified from the shaded lines")
    spectrum.axvspan(assembly.frequency[0], assembly.frequency[-1], color="C1", alpha=0.3, lw=0)
    spectrum.set(xlabel="Frequency [Hz]", ylabel="Accelerance, unit unknown")
    spectrum.legend()
    fine = assembly.on(np.linspace(assembly.frequency[0], assembly.frequency[-1], 2000))
    circle = sign * fine.frf(fine.vector(values)) / (2j * np.pi * fine.frequency)
    near = (frf.frequency >= assembly.frequency[0]) & (frf.frequency <= assembly.frequency[-1])
    mobility = frf.values[near] / (2j * np.pi * frf.frequency[near])
    plane.plot(circle.real, circle.imag, color="C0", lw=1)
    plane.plot(mobility.real, mobility.imag, "o", color="0.4", ms=4)
    plane.set(xlabel="Mobility, real", ylabel="imaginary", aspect="equal")
    figure.savefig(ROOT / "docs/gallery/oscillator.png", dpi=120, metadata={"Software": None})
    plt.close(figure)


def hammer(_: Path) -> dict[str, str]:
    """Identify one resonance of a hammer test behind an exponential window, and compare it with a circle fit."""
    frf = dovetail.read_frf(ROOT / "assemblies/measurements/hammer_test.uff")
    assembly = dovetail.load(ROOT / "assemblies/hammer_test.yaml")
    band = float(assembly.frequency[0]), float(assembly.frequency[-1])
    result = dovetail.identify(assembly, frf, "posterior")
    values = named(result, assembly)
    mass = values["mass.masses.0.mass"]
    circle = circle_fit(frf, band)
    damping = circle.damping - 2 * HAMMER_WINDOW
    natural = float(np.sqrt(values["k"] / mass) / (2 * np.pi))
    rate = values["c"] / mass
    pairs_of_values = ("natural frequency [Hz]", circle.natural_frequency, natural), ("c/m [1/s]", damping, rate)
    compared = [
        (name, f"{other:.2f}", f"{value:.2f}", f"{100 * (value / other - 1):+.2f} %")
        for name, other, value in pairs_of_values
    ]
    lines = [
        (name, f"{value:.4g}", "{:.4g} to {:.4g}".format(*result.interval[name])) for name, value in values.items()
    ]
    predicted = []
    for other in (band, (380.0, 437.0), (455.0, 500.0)):
        ((likeness, error),) = predictions(with_band(assembly, *other), values, [frf])
        predicted.append(
            (interval_of_band(other), "fitted" if other == band else "", f"{likeness:.3f}", percent(error))
        )
    return {
        "hammer": rows("|circle|identified|difference", compared),
        "hammer_parts": rows("parameter|value|90 % interval", lines),
        "hammer_predicted": rows("lines||FRAC|magnitude error", predicted),
        "hammer_adequacy": sentence(result),
    }


def frame(folder: Path) -> dict[str, str]:
    """Identify the frame from the FRF of one floor, and of all three, and predict those of the others."""
    measured = [dovetail.read_frf(folder / f"frame_floor{floor}.npz") for floor in (1, 2, 3)]
    assembly = dovetail.load(DESCRIPTIONS / "frame_free.yaml")
    results: dict[str, dovetail.Identification] = {}
    for floor in (1, 2, 3):
        results[f"floor {floor}"] = dovetail.identify(assembly.at(floor - 1), measured[floor - 1], "refined")
    results["all"] = dovetail.identify(assembly, measured, "refined")
    results["all, `multistart`"] = dovetail.identify(assembly, measured, "multistart", objective="frf", starts=8)
    modes = next(structure.modes for structure in STRUCTURES if structure.name == "frame")
    compared, parts = [], []
    for name, result in results.items():
        values = named(result, assembly)
        natural = assembly.natural_frequencies(assembly.vector(values))[: len(modes)]
        off = [f"{hertz:.2f} ({100 * (hertz / mode - 1):+.1f} %)" for hertz, mode in zip(natural, modes, strict=True)]
        compared.append((name, *off, *pairs(predictions(assembly, values, measured)), word(result)))
        masses = [f"{values[f'floor{floor}.masses.0.mass']:.2f}" for floor in (1, 2, 3)]
        stiffnesses = [f"{values[f'storey{storey}.k'] / 1e3:.0f}" for storey in (1, 2, 3)]
        parts.append((name, *masses, *stiffnesses))
    measured_modes = ("", *(f"{mode:g} measured" for mode in modes), "", "", "", "")
    return {
        "frame": rows("fitted|f1 [Hz]|f2 [Hz]|f3 [Hz]|floor 1|floor 2|floor 3|verdict", [measured_modes, *compared]),
        "frame_parts": rows("fitted|m1 [kg]|m2|m3|k1 [kN/m]|k2|k3", parts),
        "frame_adequacy": sentence(results["floor 1"]),
    }


def beam(folder: Path) -> dict[str, str]:
    """Identify the beam from the column of each actuator, and predict the other columns."""
    columns = {
        actuator: [dovetail.read_frf(folder / f"beam_o{sensor}_i{actuator}.npz") for sensor in range(1, 6)]
        for actuator in (1, 2, 3)
    }
    cases = [(1, position) for position in BEAM_POSITIONS] + [(2, BEAM_POSITION), (3, BEAM_POSITION)]
    tried, compared, accelerances, parts, modes, sentences = [], [], [], [], [], []
    for fitted, position in cases:
        assembly = beam_column(fitted, position)
        thinned = [replace(frf, frequency=frf.frequency[::4], values=frf.values[::4]) for frf in columns[fitted]]
        result = dovetail.identify(assembly, thinned, "multistart", objective="frf", starts=16)
        values = named(result, assembly)
        for actuator, measured in columns.items():
            frfs = predictions(beam_column(actuator, position), values, measured)
            cells = (str(fitted), str(actuator), *(f"{likeness:.3f}" for likeness, _ in frfs))
            if position == BEAM_POSITION:
                compared.append(cells)
                derived = predictions(beam_column(actuator, position), values, measured, derivatives=2)
                accelerances.append((*cells[:2], *(f"{likeness:.3f}" for likeness, _ in derived)))
            if actuator == fitted == 1:
                tried.append((f"{position} mm", *cells[2:], word(result)))
        if position == BEAM_POSITION:
            natural = assembly.natural_frequencies(assembly.vector(values), 9)
            modes.append((str(fitted), ", ".join(f"{hertz:.1f}" for hertz in natural)))
            parts.append((str(fitted), *(f"{values[f'coil{coil}.k']:.0f}" for coil in (1, 2, 3)),
                          *(f"{1e3 * values[f'coil{coil}.m']:.1f}" for coil in (1, 2, 3)),
                          f"{values['response_1.gain']:.2f}", f"{1e6 * values['response_1.delay']:.0f}"))  # fmt: skip
            sentences.append(f"- column {fitted}: {sentence(result)}")
    sensors = "sensor 1|sensor 2|sensor 3|sensor 4|sensor 5"
    return {
        "beam_positions": rows(f"first sensor at|{sensors}|verdict", tried),
        "beam": rows(f"fitted column|compared column|{sensors}", compared),
        "beam_accelerance": rows(f"fitted column|compared column|{sensors}", accelerances),
        "beam_parts": rows("fitted column|k1 [N/m]|k2|k3|m1 [g]|m2|m3|gain|delay [us]", parts),
        "beam_modes": rows("fitted column|natural frequencies [Hz]", modes),
        "beam_adequacy": "".join(sentences),
    }


def beam_column(actuator: int, position: float) -> dovetail.Assembly:
    """Return the beam with the FRFs of all sensors for the force of an actuator, the first sensor at `position` mm."""
    description = json.loads(dovetail.load(DESCRIPTIONS / "beam_column.yaml").description.text)
    sections = description["substructures"]["beam"]["sections"]
    sections[0]["length"], sections[2]["length"] = f"{position} mm", f"{100 - position} mm"
    at = [f"{position + 100 * sensor} mm" for sensor in range(5)]
    for coil in (1, 2, 3):
        description["joints"][f"coil{coil}"]["connect"]["shaft"]["at"] = at[2 * coil - 2]
    for sensor, response in enumerate(description["responses"]):
        response["position"] = at[sensor]
        response.pop("force", None)
        if sensor != 2 * actuator - 2:
            response["force"] = {"position": at[2 * actuator - 2], "direction": "x"}
    return dovetail.load(description)


PAGES: Mapping[str, Callable[[Path], dict[str, str]]] = {
    "oscillator": oscillator,
    "frame": frame,
    "beam": beam,
    "hammer": hammer,
    "collet": collet,
    "brake_reuss": brake_reuss_page,
}


def main() -> None:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("page", choices=list(PAGES))
    parser.add_argument("--data", type=Path, default=Path(), help="folder with the NPZ files")
    parser.add_argument("--to", type=Path, default=ROOT / "docs/gallery/tables")
    arguments = parser.parse_args()
    arguments.to.mkdir(parents=True, exist_ok=True)
    for name, table in PAGES[arguments.page](arguments.data).items():
        print(f"{name}\n\n{table}")
        (arguments.to / f"{name}.md").write_text(table, encoding="utf-8")


if __name__ == "__main__":
    main()
