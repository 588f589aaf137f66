"""Natural frequencies, damping ratios and mode shapes with intervals."""

from __future__ import annotations

import json

import numpy as np
import pytest

import dovetail
from dovetail.identification.modal_estimates import _log_numbers
from support.small_joints import ASSEMBLIES

TRUTH = {"k": 2.5e6, "c": 40.0}
FREQUENCY, DAMPING = np.sqrt(2.5e6) / (2 * np.pi), 40.0 / (2 * np.sqrt(2.5e6))


@pytest.fixture(scope="module")
def sdof():
    return dovetail.load(ASSEMBLIES / "sdof.yaml")


@pytest.fixture(scope="module")
def collet():
    return dovetail.load(ASSEMBLIES / "bt40_er32.yaml")


def test_values_are_those_of_a_single_mass(sdof):
    np.testing.assert_allclose(dovetail.natural_frequencies(sdof, TRUTH), [FREQUENCY], rtol=1e-9)
    np.testing.assert_allclose(dovetail.damping_ratios(sdof, TRUTH), [DAMPING], rtol=1e-9)
    assert dovetail.mode_shapes(sdof, TRUTH)["mass"].shape == (1, 1, 2)
    modes = dovetail.modes(sdof, TRUTH)
    assert modes.natural_frequency_interval is None
    assert len(modes) == 1


@pytest.mark.parametrize("form", ["samples", "laplace"])
def test_intervals_follow_from_those_of_the_parameters(sdof, form):
    measured = dovetail.noisy_frf(sdof.simulate(TRUTH), 0.02, 1)
    result = dovetail.identify(sdof, measured, form=form, model_error=0.0)
    modes = dovetail.modes(sdof, result)
    low, high = np.sqrt(np.array(result.interval["k"])) / (2 * np.pi)
    np.testing.assert_allclose(modes.natural_frequency_interval[0], [low, high], rtol=1e-4)
    ends = np.array(result.interval["c"]) / (4 * np.pi * modes.natural_frequency[0])
    np.testing.assert_allclose(modes.damping_ratio_interval[0], ends, rtol=0.02)
    np.testing.assert_allclose(modes.natural_frequency, dovetail.natural_frequencies(sdof, result))
    frame = modes.to_dataframe()
    assert list(frame.index) == [1]
    assert frame["frequency_low_Hz"][1] < frame["natural_frequency_Hz"][1] < frame["frequency_high_Hz"][1]


def test_most_intervals_contain_the_truth_in_another_assembly_too(sdof):
    heavier = dovetail.load({
        "extends": str(ASSEMBLIES / "sdof.yaml"), "name": "heavier",
        "substructures": {"mass": {"masses": [{"mass": "2 kg"}]}},
    })  # fmt: skip
    truth = dovetail.modes(heavier, TRUTH)
    inside = np.zeros((12, 2), dtype=bool)
    for seed in range(12):
        result = dovetail.identify(sdof, dovetail.noisy_frf(sdof.simulate(TRUTH), 0.05, seed), samples=100)
        modes = dovetail.modes(heavier, result)
        low, high = modes.natural_frequency_interval[0]
        inside[seed, 0] = low <= truth.natural_frequency[0] <= high
        low, high = modes.damping_ratio_interval[0]
        inside[seed, 1] = low <= truth.damping_ratio[0] <= high
    assert (inside.sum(axis=0) >= 8).all()  # of 12, at 90 %; fewer has a probability of 0.4 %


def test_shapes_satisfy_the_residue_at_the_pole(collet):
    modes = collet.modes(count=3)
    found = dovetail.modes(collet, count=3)
    for number, mode in enumerate(modes):
        for name, shape in mode.shapes.items():
            np.testing.assert_array_equal(found.shapes[name][number], shape)


def test_modes_are_followed_where_two_of_them_cross():
    """Two equal masses on mounts of their own: which is the lower mode depends on the parameters."""
    mount = {"model": "spring_damper", "direction": "x"}
    parts = {name: {"model": "lumped", "masses": [{"mass": "1 kg"}]} for name in ("left", "right")}
    connected = {name: {"a": {"to": name, "at": "0 mm"}, "b": {"to": "base", "at": "0 mm"}} for name in parts}
    link = {"a": {"to": "left", "at": "0 mm"}, "b": {"to": "right", "at": "0 mm"}}
    assembly = dovetail.load(
        {
            "dovetail": 1,
            "name": "two masses",
            "frequency": {"start": "1 Hz", "stop": "600 Hz", "step": "1 Hz"},
            "substructures": {**parts, "base": {"model": "ground"}},
            "joints": {
                name: {**mount, "connect": ends, "parameters": {"c": f"{c} N s/m"}}
                for (name, ends), c in zip(connected.items(), (10, 30), strict=True)
            }
            | {"link": {**mount, "connect": link, "parameters": {"k": "1 N/m", "c": "0.001 N s/m"}}},
            "response": {"at": "left", "position": "0 mm", "direction": "x", "quantity": "accelerance"},
        }
    )
    numbers = _log_numbers(assembly, {"left.k": 1.0e6, "right.k": 1.1e6}, 2)
    frequency, damping = np.exp(numbers(np.array([[1.0e6, 1.1e6], [1.2e6, 1.1e6]]))).reshape(2, 2, 2).swapaxes(0, 1)
    np.testing.assert_allclose(frequency, np.sqrt([[1.0e6, 1.1e6], [1.2e6, 1.1e6]]) / (2 * np.pi), rtol=1e-4)
    np.testing.assert_allclose(damping, np.array([10.0, 30.0]) / (2 * 2 * np.pi * frequency), rtol=1e-3)


@pytest.mark.parametrize(
    ("options", "problem"), [({"count": 0}, "0 modes were asked for"), ({"level": 1.0}, "1 is not a probability")]
)
def test_senseless_options_are_refused(sdof, options, problem):
    with pytest.raises(dovetail.ParameterError, match=problem):
        dovetail.modes(sdof, **options)


def test_a_written_result_is_read(sdof, tmp_path):
    result = dovetail.identify(sdof, dovetail.noisy_frf(sdof.simulate(TRUTH), 0.01, 0))
    (tmp_path / "result.json").write_text(json.dumps(result.to_dict()))
    expected = dovetail.modes(sdof, result).damping_ratio_interval
    np.testing.assert_allclose(dovetail.modes(sdof, tmp_path).damping_ratio_interval, expected)
