"""The study of real structures, on files made here in the layout of the sources, whose data are not here."""

from __future__ import annotations

import io
import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import measured_data
import measured_structures
import numpy as np
import pytest
import scipy.io
from measured_data import STRUCTURES, altered, cases, convert, measured

import dovetail

FRAME = {
    "storey1.k": 3.5e5,
    "storey1.c": 35.0,
    "storey2.k": 1.05e6,
    "storey2.c": 49.0,
    "storey3.k": 1.04e6,
    "storey3.c": 4,
}


@pytest.fixture(scope="module")
def data(tmp_path_factory) -> Path:
    """A folder with the frame's FRFs, converted from a table as its analyser writes it."""
    clone = tmp_path_factory.mktemp("clone")
    assembly = fitted().assembly().on(np.arange(0.5, 400.5, 0.5))
    first = assembly.frf(assembly.vector(FRAME))
    columns = [part for scale in (1.0, 1.5, 2.0) for part in (scale * first.real, scale * first.imag)]
    rows = np.column_stack([assembly.frequency, *columns])
    lines = ["CSVFormatType;Spectrum2DComplex", "Signals;3", "0,0;1,0;0,0;1,0;0,0;1,0;0,0"]
    lines += [";".join(f"{cell:.12E}".replace(".", ",") for cell in row) for row in rows]
    (clone / "FRF.csv").write_text("\n".join(lines), encoding="latin-1")
    folder = tmp_path_factory.mktemp("data")
    assert len(convert(clone, folder)) == 3
    return folder


def fitted() -> measured_data.Structure:
    return next(one for one in STRUCTURES if one.name == "frame_fitted")


def test_every_description_has_a_node_where_it_is_measured():
    for structure in STRUCTURES:
        assembly = structure.assembly()
        assert assembly.name == structure.name
        assert structure.modes[0] > assembly.frequency[0]
        assert structure.modes[-1] < assembly.frequency[-1]


def test_the_frame_is_read_with_its_points(data):
    first, second = (dovetail.read_frf(data / f"frame_floor{floor}.npz") for floor in (1, 2))
    assert (first.quantity, first.response, first.force) == ("accelerance", "floor1:1+x", "floor1:1+x")
    assert (second.response, second.force) == ("floor2:1+x", "floor1:1+x")
    np.testing.assert_allclose(second.values, 1.5 * first.values, rtol=1e-9)
    assert first.frequency[0] == 0.5


def test_a_matlab_object_is_read_and_its_chain_taken_out(tmp_path):
    frequency = np.arange(0.0, 40.0, 0.25)
    true = np.arange(1, 16).reshape(5, 3, 1) / (1.0 + frequency)
    chain = measured_data.chain_phase(frequency, measured_data.BEAM_CHAIN)
    raw = true * chain * np.array(measured_data.BEAM_GAINS)[:, None]
    path = tmp_path / "beam.mat"
    path.write_bytes(opaque(2 * np.pi * frequency[:, None], raw))
    frfs = measured_data.read_beam(path)
    assert len(frfs) == 15
    np.testing.assert_allclose(frfs["beam_o3_i2"].values, true[2, 1, 1:], rtol=1e-9)
    assert (frfs["beam_o3_i2"].response, frfs["beam_o3_i2"].force) == ("beam:3+x", "beam:3+x")
    assert (frfs["beam_o5_i1"].response, frfs["beam_o5_i1"].force) == ("beam:5+x", "beam:1+x")


def opaque(angular: np.ndarray, values: np.ndarray) -> bytes:
    """Return a file as MATLAB writes one with objects: what they hold is in a file within the file."""
    cells = np.empty((2, 1), dtype=object)
    cells[0, 0], cells[1, 0] = angular, values
    inner = nameless({"MCOS": {"arr": cells}})
    return nameless(np.frombuffer(b"\x00\x01IM" + bytes(4) + inner[128:], dtype=np.uint8))


def nameless(variable: object) -> bytes:
    """Return a MATLAB file with a variable that has no name."""
    file = io.BytesIO()
    scipy.io.savemat(file, {"x": variable})
    named, empty = b"\x01\x00\x01\x00x\x00\x00\x00", b"\x01" + bytes(7)
    return file.getvalue().replace(named, empty, 1)


def test_the_alterations_are_what_they_say(data):
    (structure, frf), *_ = measured(data)
    changed = dict(altered(structure, frf, data))
    np.testing.assert_allclose(changed["sign"].values, -frf.values)
    np.testing.assert_allclose(changed["gain: 1.2"].values, 1.2 * frf.values)
    np.testing.assert_allclose(changed["unit: g"].values * 9.80665, frf.values)
    late = np.angle(changed["delay: 200 us"].values / frf.values)
    np.testing.assert_allclose(late, -2 * np.pi * frf.frequency * 200e-6, atol=1e-9)
    np.testing.assert_allclose(1 / changed["mass: 200 g"].values, 1 / frf.values + 0.2, rtol=1e-9)
    np.testing.assert_allclose(changed["point: floor2:1+x from floor1:1+x"].values, 1.5 * frf.values, rtol=1e-9)
    assert changed["point: floor2:1+x from floor1:1+x"].response == frf.response


def test_every_measurement_comes_unaltered_and_altered(data):
    names = [name for name, _, _ in cases(data)]
    assert [name for name in names if "unaltered" in name] == ["frame_fitted, unaltered"]
    assert len(names) == len({*names}) == 10


def test_a_beam_with_an_overhang_is_measured_at_its_coil_still():
    beam = next(one for one in STRUCTURES if one.name == "beam3")
    description = json.loads(measured_data.with_overhang(beam, 10.0).description.text)
    assert description["response"]["position"] == "460.0 mm"
    assert description["joints"]["coil3"]["connect"]["shaft"]["at"] == "460.0 mm"
    lengths = [float(section["length"].split()[0]) for section in description["substructures"]["beam"]["sections"]]
    assert lengths == [60, 400, 40]


def test_the_program_judges_the_measurements_in_a_folder(data):
    script = Path(__file__).with_name("measured_structures.py")
    command = [sys.executable, str(script), "--data", str(data), "--only", "frame_fitted"]
    printed = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    _, _, row = printed.splitlines()
    cells = [cell.strip() for cell in row.strip("|").split("|")]
    assert cells[0] == "frame_fitted"
    natural = fitted().assembly().natural_frequencies(fitted().assembly().vector(FRAME))
    np.testing.assert_allclose([float(cell) for cell in cells[4].split(",")], natural, rtol=1e-3)
    assert float(cells[5]) > 0.999


def test_the_causes_of_altered_measurements_are_counted(data, monkeypatch, capsys):
    def identify(assembly, frf, method, cause_seconds):
        flipped = frf.values[300].real < 0
        cause = SimpleNamespace(name="sign", words="the sign reversed")
        return SimpleNamespace(adequacy=SimpleNamespace(word="good", causes=(cause,) if flipped else ()))

    monkeypatch.setattr(measured_structures.dovetail, "identify", identify)
    monkeypatch.setattr(measured_structures, "cases", lambda data: some_cases())
    monkeypatch.setattr(measured_structures, "best_misfit", lambda _, frf: 2.0 - frf.values[0].real)
    measured_structures.table_of_alterations(data, "refined", "frame", 20.0)
    printed = capsys.readouterr().out
    assert "| frame, sign | good | +2.00 | the sign reversed | yes |" in printed
    assert "| frame, gain: 1.2 | good | +0.00 | - | no |" in printed
    assert "right cause is first in 1 of 2 altered" in printed
    assert "Of the 1 that make the best fit worse by 0.1 or more it is first in 1." in printed
    assert "None is named in 1 of 1 unaltered" in printed


def some_cases():
    """Three cases: unaltered, with the sign reversed, with a gain."""
    positive = dovetail.Frf(np.arange(1.0, 401.0), np.ones(400, dtype=complex), "accelerance")
    negative = dovetail.Frf(positive.frequency, -positive.values, "accelerance")
    return [("frame, unaltered", positive, None), ("frame, sign", negative, None), ("frame, gain: 1.2", positive, None)]


def test_the_best_misfit_of_a_measurement_is_that_of_noise_if_the_model_is_right():
    assembly = fitted().assembly()
    exact = assembly.frf(assembly.vector(FRAME))
    right = dovetail.noisy_frf(dovetail.Frf(assembly.frequency, exact, "accelerance"), 0.01, 1)
    assert measured_structures.best_misfit(assembly, right) < 0.8
    assert measured_structures.best_misfit(assembly, replace(right, values=-right.values)) > 2.0
