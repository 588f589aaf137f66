"""Coupling and decoupling of beams, compared with the beam in one piece; the spindle's flange from three tests."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

import dovetail
import dovetail_machining
from dovetail.coupling import couple, decouple
from dovetail.errors import DescriptionError, FileError, MeasurementError, ParameterError
from dovetail.measurement import add_accelerometer_mass
from dovetail_machining.spindle import difference_receptance, error_gain

STEEL = {"young": 2.05e11, "density": 7850.0, "poisson": 0.3, "loss_factor": 0.01}
LINES = {"start": 50.0, "stop": 5000.0, "step": 10.0}


def beam(length: float, elements: int, outer: float = 0.03, at: float = 0.0) -> dovetail.Assembly:
    section = {"length": length, "outer": outer, "elements": elements}
    return dovetail.load(
        {
            "dovetail": 1,
            "name": "beam",
            "frequency": LINES,
            "substructures": {"holder": {"model": "timoshenko_beam", "material": STEEL, "sections": [section]}},
            "response": {"at": "holder", "position": at},
        }
    )


def receptance(assembly, *positions):
    points = [("holder", position, direction) for position, direction in positions]
    return assembly.receptance(None, points, points)


@pytest.fixture(scope="module")
def parts():
    """A stub of 72 mm, the rest of 240 mm, and both in one piece of 312 mm with the same elements."""
    return beam(0.072, 9), beam(0.24, 30), beam(0.312, 39)


TIP, END = ((0.0, "x"), (0.0, "rz")), ((0.072, "x"), (0.072, "rz"))


def blocks(matrix):
    return matrix[:, :2, :2], matrix[:, :2, 2:], matrix[:, 2:, :2], matrix[:, 2:, 2:]


def worst(found, exact):
    return np.abs(found - exact).max() / np.abs(exact).max()


def test_two_beams_are_the_long_one(parts):
    stub, rest, whole = parts
    known = blocks(receptance(stub, *TIP, *END))
    found = couple(*known, receptance(rest, *TIP))
    assert worst(found, receptance(whole, *TIP)) < 1e-8


def test_decoupling_undoes_coupling(parts):
    stub, rest, whole = parts
    known = blocks(receptance(stub, *TIP, *END))
    assert worst(decouple(receptance(whole, *TIP), *known), receptance(rest, *TIP)) < 1e-6
    assert worst(decouple(couple(*known, receptance(rest, *TIP)), *known), receptance(rest, *TIP)) < 1e-8


def struck(whole, mass=0.0, a=0.0, b=0.024):
    """Return h_aa, h_ab and h_bb with the accelerometer's mass on each."""
    matrix = receptance(whole, (a, "x"), (b, "x"))
    omega = 2 * np.pi * whole.frequency
    aa, ab, bb = matrix[:, 0, 0], matrix[:, 0, 1], matrix[:, 1, 1]
    loaded = (aa / (1 - mass * omega**2 * aa), ab / (1 - mass * omega**2 * aa), bb / (1 - mass * omega**2 * bb))
    return tuple(dovetail.Frf(whole.frequency, values, "receptance").to("accelerance") for values in loaded)


def test_three_translations_give_the_flange(parts):
    stub, rest, whole = parts
    found = dovetail_machining.spindle_flange(stub, struck(whole), (0.0, 0.024), 0.072)
    assert worst(found.values, receptance(rest, *TIP)) < 1e-6


def test_the_accelerometer_is_taken_off_drive_and_transfer_tests(parts):
    stub, rest, whole = parts
    mass = 1.2e-3
    tests = struck(whole, mass)
    bare = dovetail.Frf(whole.frequency, receptance(whole, (0.0, "x"))[:, 0, 0], "receptance")
    np.testing.assert_allclose(tests[0].values, add_accelerometer_mass(bare, mass).to("accelerance").values, rtol=1e-9)
    found = dovetail_machining.spindle_flange(stub, tests, (0.0, 0.024), 0.072, accelerometer_mass=mass)
    assert worst(found.values, receptance(rest, *TIP)) < 1e-6


def test_finite_differences_err_in_the_first_order():
    """On a slender beam: a pair of opposite forces also shears what is between them, which grows as they approach."""
    slender = beam(0.6, 300, outer=0.002)
    exact = receptance(slender, *TIP)[:, 1, 1]
    errors = []
    for distance in (0.032, 0.016, 0.008):
        matrix = receptance(slender, (0.0, "x"), (distance, "x"))
        found = difference_receptance(matrix[:, 0, 0], matrix[:, 0, 1], matrix[:, 1, 1], distance)[:, 1, 1]
        errors.append(abs(found[0] - exact[0]) / abs(exact[0]))
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    np.testing.assert_allclose(orders, 1.0, atol=0.15)


def test_a_test_on_other_lines_or_without_phase_is_refused(parts):
    stub, _, whole = parts
    aa, ab, bb = struck(whole)
    short = dovetail.Frf(aa.frequency[:-1], aa.values[:-1], "accelerance")
    with pytest.raises(MeasurementError, match="not on the lines"):
        dovetail_machining.spindle_flange(stub, (short, ab, bb), (0.0, 0.024), 0.072)
    amplitude = dovetail.Frf(aa.frequency, aa.amplitude, "accelerance", has_phase=False)
    with pytest.raises(MeasurementError, match="needs phases"):
        dovetail_machining.spindle_flange(stub, (amplitude, ab, bb), (0.0, 0.024), 0.072)


def test_a_holder_that_is_not_known_and_a_single_point_are_refused(parts):
    stub, _, whole = parts
    described = json.loads(stub.description.text)
    described["substructures"]["holder"]["material"]["young"] = {"range": ["190 GPa", "220 GPa"]}
    unknown = dovetail.load(described)
    with pytest.raises(ParameterError, match="the holder has unknown parameters"):
        dovetail_machining.spindle_flange(unknown, struck(whole), (0.0, 0.024), 0.072)
    with pytest.raises(ParameterError, match="the points a and b are the same"):
        dovetail_machining.spindle_flange(stub, struck(whole), (0.024, 0.024), 0.072)


def test_errors_of_the_tests_are_amplified_by_the_reported_gain(parts):
    """Against the scatter of flanges from tests with noise; points further apart make it smaller."""
    stub, _, whole = parts
    level, random = 1e-5, np.random.default_rng(0)
    medians = []
    for distance in (0.024, 0.048):
        tests = struck(whole, b=distance)
        exact = dovetail_machining.spindle_flange(stub, tests, (0.0, distance), 0.072)
        squares = []
        for _ in range(100):
            noise = random.standard_normal((2, 3, len(whole.frequency))) / np.sqrt(2.0)
            noisy = tuple(
                replace(frf, values=frf.values * (1.0 + level * (real + 1j * imaginary)))
                for frf, real, imaginary in zip(tests, *noise, strict=True)
            )
            flange = dovetail_machining.spindle_flange(stub, noisy, (0.0, distance), 0.072).values
            squares.append(np.abs(np.diagonal(flange / exact.values - 1.0, axis1=1, axis2=2) / level) ** 2)
        gain = error_gain(exact, stub, tests, (0.0, distance), 0.072)
        np.testing.assert_allclose(np.sqrt(np.mean(squares, axis=0)), gain, rtol=0.5)
        np.testing.assert_allclose(np.median(np.sqrt(np.mean(squares, axis=0)) / gain, axis=0), 1.0, rtol=0.05)
        medians.append(np.median(gain, axis=0))
    assert np.all(medians[1] < 0.5 * medians[0])


@pytest.fixture
def flange_file(parts, tmp_path):
    stub, _, whole = parts
    flange = dovetail_machining.spindle_flange(stub, struck(whole), (0.0, 0.024), 0.072)
    dovetail.write_receptance(flange, tmp_path / "flange.npz")
    return tmp_path / "flange.npz"


def test_the_file_gives_back_every_digit(flange_file, parts):
    stub, _, whole = parts
    made = dovetail_machining.spindle_flange(stub, struck(whole), (0.0, 0.024), 0.072)
    read = dovetail.read_receptance(flange_file)
    assert np.array_equal(read.values, made.values)
    assert np.array_equal(read.frequency, made.frequency)
    between = made.frequency[:-1] + 5.0
    assert worst(read.at(between)[:3], made.values[:3]) < 0.5
    with pytest.raises(MeasurementError, match=r"covers 50 to 5000 Hz, and 50 to 6000 Hz are wanted"):
        read.at(np.array([50.0, 6000.0]))


@pytest.mark.parametrize("content", [b"not an archive", b"PK\x05\x06" + bytes(18)])
def test_other_archives_are_refused_as_receptance_matrices(content, tmp_path):
    file = tmp_path / "x.npz"
    file.write_bytes(content)
    with pytest.raises(MeasurementError, match="this is not a receptance matrix"):
        dovetail.read_receptance(file)
    file.write_bytes(b"")
    with pytest.raises(FileError, match="the file is empty"):
        dovetail.read_receptance(file)
    with pytest.raises(FileError, match="there is no such file"):
        dovetail.read_receptance(tmp_path / "none.npz")


def on_flange(parts, file):
    stub, _, _ = parts
    described = json.loads(stub.description.text)
    described["substructures"]["spindle"] = {"model": "measured", "file": str(file)}
    described["joints"] = {
        "flange": {"model": "rigid", "connect": {"a": {"to": "holder", "at": 0.072}, "b": {"to": "spindle", "at": 0.0}}}
    }
    return described


def test_a_measured_part_in_a_description_is_the_part_itself(parts, flange_file):
    assembly = dovetail.load(on_flange(parts, flange_file))
    whole = parts[2]
    assert worst(assembly.frf(), whole.frf()) < 1e-6


def test_its_file_is_relative_to_the_description_that_names_it(parts, flange_file, tmp_path, monkeypatch):
    described = on_flange(parts, flange_file.name)
    (tmp_path / "base.yaml").write_text(json.dumps(described))
    below = tmp_path / "below"
    below.mkdir()
    (below / "longer.yaml").write_text("extends: ../base.yaml\nname: longer\n")
    monkeypatch.chdir(tmp_path.parent)
    assembly = dovetail.load(below / "longer.yaml")
    again = dovetail.load(json.loads(assembly.description.text))
    assert np.array_equal(again.frf(), assembly.frf())


def test_a_missing_file_is_a_fault_of_the_description(parts, tmp_path):
    with pytest.raises(DescriptionError, match=r"substructures.spindle\n.*there is no such file"):
        dovetail.load(on_flange(parts, tmp_path / "none.npz"))


@pytest.mark.parametrize(
    ("kind", "options", "where"),
    [
        ({"rotation": True}, {}, "displacement per force"),
        ({}, {"accelerometer_mass": -1e-3}, "accelerometer_mass"),
        ({}, {"rotations": "modell"}, "rotations"),
    ],
)
def test_impossible_inputs_of_a_flange_are_refused(kind, options, where):
    steel = {"young": 206e9, "density": 7850.0, "poisson": 0.3}
    sections = [{"length": 0.1, "outer": 0.03, "elements": 10}]
    holder = dovetail.load(
        {
            "dovetail": 1,
            "name": "holder",
            "frequency": {"start": 50.0, "stop": 500.0, "step": 5.0},
            "substructures": {"holder": {"model": "timoshenko_beam", "material": steel, "sections": sections}},
            "response": {"at": "holder", "position": 0.0},
        }
    )
    values = np.full(len(holder.frequency), 1e-7 + 0j)
    plain = dovetail.Frf(holder.frequency, values, "receptance")
    tests = plain, dovetail.Frf(holder.frequency, values, "receptance", **kind), plain
    with pytest.raises(dovetail.DovetailError, match=where):
        dovetail_machining.spindle_flange(holder, tests, (0.0, 0.04), 0.1, **options)
