"""Amplitudes and phases that are hardly in the unit of their names, and numbers of averages that contradict."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

import dovetail

FREQUENCY = np.arange(100.0, 250.0)
OMEGA = 2.0 * np.pi * FREQUENCY
RECEPTANCE = 1.0 / (1e7 - 15.0 * OMEGA**2 + 60j * OMEGA)  # a resonance at 130 Hz
TURN = np.angle(RECEPTANCE)
DECIBELS = 20.0 * np.log10(np.abs(RECEPTANCE))


def read(folder: Path, kind: str, arrays: Mapping[str, np.ndarray]) -> dovetail.Frf:
    """Write arrays as a table or an archive of receptances, and read it."""
    path = folder / f"a.{kind}"
    if kind == "npz":
        np.savez(path, frequency_Hz=FREQUENCY, quantity="receptance", **arrays)
        return dovetail.read_frf(path)
    columns = np.column_stack([FREQUENCY, *arrays.values()])
    header = ",".join(["frequency_Hz", *arrays])
    np.savetxt(path, columns, delimiter=",", header=f"# quantity: receptance\n{header}", comments="")
    return dovetail.read_frf(path)


@pytest.mark.parametrize("kind", ["csv", "npz"])
@pytest.mark.parametrize("amplitude", ["amplitude", "db"])
def test_a_phase_that_does_not_turn_at_a_resonance_looks_like_radians(tmp_path, kind, amplitude):
    sizes = {"amplitude": np.abs(RECEPTANCE), "db": DECIBELS}[amplitude]
    message = r"a\.\w+: the phase in degrees never leaves .* does not turn where .* call it phase_rad"
    with pytest.warns(UserWarning, match=message):
        read(tmp_path, kind, {amplitude: sizes, "phase_deg": TURN})


@pytest.mark.parametrize("kind", ["csv", "npz"])
@pytest.mark.parametrize("sizes", [np.abs(RECEPTANCE), 500.0 * np.linspace(0.001, 1.0, len(FREQUENCY))])
def test_decibels_that_span_nothing_or_too_much_look_like_amplitudes(tmp_path, kind, sizes):
    with pytest.warns(UserWarning, match=r"a\.\w+: the decibels lie between .* call them amplitude"):
        read(tmp_path, kind, {"db": sizes})


@pytest.mark.parametrize(
    "arrays",
    [
        {"db": DECIBELS, "phase_deg": np.rad2deg(TURN)},
        {"db": DECIBELS + 200.0},  # over a small number
        {"db": 6.02 + 0.01 * np.sin(FREQUENCY)},  # a mass of 0.5 kg
        {"amplitude": np.abs(RECEPTANCE[:20].repeat(8)[:150]), "phase_deg": np.full(150, -1.0)},  # below a resonance
    ],
    ids=["usual", "positive", "mass", "below"],
)
@pytest.mark.parametrize("kind", ["csv", "npz"])
def test_decibels_and_phases_of_usual_measurements_are_not_remarked(tmp_path, kind, arrays):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        read(tmp_path, kind, arrays)


@pytest.mark.parametrize("line", ["Number of averages: 10", "# averages (linear): 10", "avg = 10", "Mittelungen; 10"])
def test_a_table_with_two_numbers_of_averages_is_refused(tmp_path, line):
    def table(averages: int) -> Path:
        rows = "".join(f"{f:g},{v.real:.9g},{v.imag:.9g}\n" for f, v in zip(FREQUENCY, RECEPTANCE, strict=True))
        head = f"{line}\n# quantity: receptance\n# averages: {averages}\n"
        (tmp_path / "a.csv").write_text(head + "frequency_Hz,real,imag\n" + rows)
        return tmp_path / "a.csv"

    assert dovetail.read_frf(table(10)).averages == 10
    with pytest.raises(dovetail.MeasurementError, match=r"a\.csv:1\n.*10 averages here, and 5 elsewhere"):
        dovetail.read_frf(table(5))


def test_an_archive_with_two_numbers_of_averages_is_refused(tmp_path):
    def archive(note: str) -> Path:
        np.savez(tmp_path / "a.npz", frequency=FREQUENCY, frf=RECEPTANCE, quantity="receptance", averages=5, info=note)
        return tmp_path / "a.npz"

    assert dovetail.read_frf(archive("averages: 5")).averages == 5
    with pytest.raises(dovetail.MeasurementError, match=r"10 averages here, and 5 elsewhere"):
        dovetail.read_frf(archive("averages: 10"))
