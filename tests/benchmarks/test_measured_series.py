"""The parts of the studies of measured series, without their data."""

import brake_reuss
import dropbear
import numpy as np
import pytest
import scipy.io
import yaml

import dovetail
from dovetail.series import read_series


def test_poles_are_those_of_a_sum_of_decaying_oscillations():
    time = np.arange(100) / 250.0
    signal = sum(
        a * np.exp(-2.0 * np.pi * f * z * time) * np.cos(2.0 * np.pi * f * time)
        for a, f, z in ((1.0, 26.3, 0.01), (0.3, 41.0, 0.02))
    )
    frequency, amplitude = dropbear.poles(signal, 4, 1.0 / 250.0)
    expected = [26.3 * np.hypot(1.0, 0.01), 41.0 * np.hypot(1.0, 0.02)]
    np.testing.assert_allclose(np.sort(frequency), expected, rtol=1e-6)
    assert amplitude[np.argmin(frequency)] == pytest.approx(0.5, rel=1e-3)


def test_a_roller_at_a_node_is_a_spring_there():
    description = yaml.safe_load((dropbear.HERE / "roller_beam.yaml").read_text())
    connect = {"a": {"to": "beam", "at": "100 mm"}, "b": {"to": "block", "at": "0 mm"}}
    fixed = {"k": {"value": 1e7}, "c": {"value": 1.0}, "kr": {"value": 1e-6}, "cr": {"value": 1e-6}}
    description["joints"]["roller"] = {"model": "spring_damper", "connect": connect, "parameters": fixed}
    known = {"clamp.kr": 1e3, "beam.material.young": 2e11, "accelerometer.masses.0.mass": 0.05}
    known["accelerometer.masses.0.inertia"] = 1e-5
    spring = dovetail.load(description)
    expected = dovetail.natural_frequencies(spring, {one.name: known.get(one.name, 1e3) for one in spring.parameters})
    at_node = {**known, "roller.position": 0.1, "roller.k": 1e7}
    np.testing.assert_allclose(dovetail.natural_frequencies(dropbear.assembly(), at_node), expected, rtol=1e-6)


def test_the_tracker_finds_the_position_whose_natural_frequencies_were_measured():
    position = np.linspace(0.05, 0.2, 1501)
    frequency = np.stack([20.0 + 100.0 * position, 100.0 + 600.0 * position], axis=1)
    tracker = dropbear.Tracker(position, frequency, np.array([0.004, 0.02]))
    mean, low, high = tracker.locate(dovetail.ModalParameters(np.array([30.0, 160.0])))
    assert mean == pytest.approx(0.1, abs=1e-4)
    assert low < 0.1 < high
    assert high - low == pytest.approx(2 * 1.645 * 0.004 * 30.0 / 100.0, rel=0.1)


def test_each_level_of_the_beam_is_a_test_of_a_series(tmp_path):
    frequency, levels = np.arange(79.0, 81.0, 0.05), []
    for level, damping in ((5.0, 3.0), (80.0, 13.0)):
        s = 2j * np.pi * frequency
        accelerance = s**2 / (1.9 * s**2 + damping * s + 1.9 * (2.0 * np.pi * 80.0) ** 2)
        phase = np.angle(-accelerance)  # the accelerometer faces the force
        force = level / np.abs(accelerance)
        levels.append(
            {"frequency": frequency, "force": force, "amplitude": np.full(len(frequency), level), "phase": phase}
        )
    table = np.array([tuple(one.values()) for one in levels], dtype=[(name, object) for name in levels[0]])
    scipy.io.savemat(tmp_path / "ForcedFrequencyResponses.mat", {"FRdata": {"ResponseControl": table}})
    series = read_series(brake_reuss.write_series(tmp_path, tmp_path, {"law": "linear", "over": "level"}))
    assert [test.covariates["level"] for test in series.tests] == pytest.approx([5.0, 80.0])
    (_, frf), _ = brake_reuss.levels(tmp_path)
    assert abs(frf.values[20]) == pytest.approx(2.0 * np.pi * 80.0 / 3.0, rel=0.01)
    assert yaml.safe_load((tmp_path / "series.yaml").read_text())["parameters"]["c"] == {
        "law": "linear",
        "over": "level",
    }
