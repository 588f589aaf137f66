"""Measurements on their own frequency lines: the model is computed there, and no measured value is interpolated."""

from __future__ import annotations

import json
import re
from dataclasses import replace

import numpy as np
import pytest

import dovetail
from dovetail.errors import MeasurementError
from dovetail.identification.result_file import load_result
from dovetail.identification.truth import TrueValues

NOISE = 0.02
FEW = {"multistart": {"starts": 8}, "posterior": {"samples": 100}}
"""Searches and samples where the answer has few unknowns."""


def genuine(assembly, axes, seed, label="measured"):
    """Return the true parameters of a random joint and its noisy FRF at each response, on axes of their own."""
    random = np.random.default_rng(seed)
    theta = assembly.from_unit(random.uniform(0.1, 0.9, len(assembly.parameters)))
    frfs = []
    for alone, response in zip(assembly.on(*axes).each_response, assembly.description.responses, strict=True):
        noise = random.standard_normal((2, len(alone.frequency)))
        values = alone.frf(theta) * (1.0 + NOISE * (noise[0] + 1j * noise[1]) / np.sqrt(2.0))
        frfs.append(dovetail.Frf(alone.frequency, values, response.quantity, label=label))
    return theta, frfs


def with_lines_deleted(frequency):
    return frequency[np.random.default_rng(8).random(len(frequency)) > 0.05]


def check(assembly, theta, result):
    """Make sure that a result is one of a genuine measurement."""
    assert result.is_trustworthy
    assert 0.9 < result.fit.chi_squared < 1.1
    deviation = np.sqrt(np.diag(np.linalg.inv(result.fit.information)))
    assert np.all(np.abs(assembly.to_unit(result.theta) - assembly.to_unit(theta)) < 4.5 * deviation)


@pytest.fixture(scope="module")
def collet(assemblies):
    return dovetail.load(assemblies / "bt40_er32.yaml")


@pytest.mark.sweep(keep=3)
@pytest.mark.parametrize(
    "frequency",
    [
        np.arange(95.0, 9001.0, 2.0),
        np.arange(100.0, 9000.1, 2.5),
        1.5625 * np.arange(1, 6400),
        np.arange(2.0, 10000.0, 4.0),
        with_lines_deleted(np.arange(100.0, 9000.1, 2.0)),
    ],
    ids=["from 95 Hz", "2.5 Hz", "1.5625 Hz", "4 Hz", "lines deleted"],
)
def test_a_genuine_measurement_fits_with_any_number_of_lines(collet, frequency, tmp_path):
    theta, (frf,) = genuine(collet, [frequency], len(frequency))
    dovetail.write_frf(frf, tmp_path / "measured.csv")
    measured = dovetail.read_frf(tmp_path / "measured.csv")
    result = dovetail.identify(collet, replace(measured, variance=(NOISE * np.abs(frf.values)) ** 2), "refined")
    check(collet, theta, result)
    inside = (measured.frequency >= 100.0) & (measured.frequency <= 9000.0)
    np.testing.assert_array_equal(result.measured.frequency, measured.frequency[inside])
    np.testing.assert_array_equal(result.measured.values, measured.values[inside])
    np.testing.assert_array_equal(result.frf.values, collet.on(frequency[inside]).frf(result.theta))
    assert all(100.0 <= mode.natural_frequency <= 9000.0 for mode in result.modes)
    assert result.band == (100.0, 9000.0)


def test_two_responses_have_lines_of_their_own(assemblies, tmp_path):
    assembly = dovetail.load(assemblies / "bt40_er32_two_points.yaml")
    axes = [np.arange(95.0, 9001.0, 2.5), with_lines_deleted(np.arange(130.0, 8990.0, 3.125))]
    theta, frfs = genuine(assembly, axes, 4)
    result = dovetail.identify(assembly, frfs, "refined")
    check(assembly, theta, result)
    fitted = assembly.on(*(at_point.frf.frequency for at_point in result.responses))
    for at_point, frf, alone in zip(result.responses, frfs, fitted.each_response, strict=True):
        inside = frf.frequency >= 100.0
        np.testing.assert_array_equal(at_point.measured.frequency, frf.frequency[inside])
        np.testing.assert_array_equal(at_point.measured.values, frf.values[inside])
        np.testing.assert_array_equal(at_point.frf.values, alone.frf(result.theta))
    assert sum(" has no lines from 100 to 130" in warning for warning in result.warnings) == 1
    (tmp_path / "result.json").write_text(json.dumps(result.to_dict()))
    read = load_result(tmp_path)
    assert read.band == result.band
    for stored, at_point in zip(read.responses, result.responses, strict=True):
        np.testing.assert_array_equal(stored.frf.frequency, at_point.frf.frequency)
        np.testing.assert_array_equal(stored.measured.values, at_point.measured.values)


@pytest.mark.usefixtures("few_mode_searches")
@pytest.mark.parametrize("form", [pytest.param("samples", marks=pytest.mark.slow), "laplace"])
def test_the_posterior_of_responses_with_lines_of_their_own(assemblies, form):
    """Nearly the intervals of the same measurement on common lines."""
    assembly = dovetail.load(assemblies / "bt40_er32_two_points.yaml")
    first = np.arange(100.0, 9001.0, 10.0)
    widths = []
    for second in (first, np.arange(105.0, 9001.0, 10.0)):
        theta, frfs = genuine(assembly, [first, second], 6)
        posterior = dovetail.identify(assembly, frfs, "posterior", form=form, samples=200).posterior
        low, high = np.transpose([*posterior.interval().values()])
        centre, wide = (low + high) / 2.0, 1.5 * (high - low)
        assert np.all(np.abs(theta - centre) < wide)
        widths.append(np.log(high / low))
    np.testing.assert_allclose(np.log(widths[1] / widths[0]), 0.0, atol=0.4)


@pytest.mark.usefixtures("few_mode_searches")
def test_part_of_the_band_is_compared_with_a_warning(sdof, model):
    """A network that cannot be given its whole band is no start, and the search does without."""
    theta, (whole,) = genuine(sdof, [np.arange(1.0, 601.0, 0.5)], 1)
    part = whole.frequency >= 40.0
    frf = dovetail.Frf(whole.frequency[part], whole.values[part], "accelerance", label="part.csv")
    expected = "The measurement has no lines from 1 to 40 Hz: it was compared from 40 to 600 Hz only."
    for method in ("refined", "multistart", "posterior"):
        result = dovetail.identify(sdof, frf, method, **FEW.get(method, {}))
        assert result.warnings.count(expected) == 1
        assert len(result.frf.frequency) == 1121
        np.testing.assert_allclose(result.theta, theta, rtol=0.02)
    np.testing.assert_array_equal(
        model.identify(frf, "refined").theta, dovetail.identify(model.assembly, frf, "refined").theta
    )
    with pytest.raises(MeasurementError, match=r"covers 40 to 600\.5 Hz, and 1 to 600 Hz are wanted"):
        model.identify(frf, "network")


def test_a_natural_frequency_outside_the_measured_lines_is_compared_with_the_truth(sdof, tmp_path):
    theta = np.array([4e6, 60.0])
    (natural,) = sdof.natural_frequencies(theta, 1)
    frequency = np.arange(1.0, 0.9 * natural, 0.25)
    result = dovetail.identify(sdof, dovetail.Frf(frequency, sdof.on(frequency).frf(theta), "accelerance"), "refined")
    (mode,) = result.modes
    assert mode.natural_frequency == pytest.approx(natural, rel=1e-3)
    assert mode.measured_peak is None
    assert f"it was compared from 1 to {frequency[-1]:.6g} Hz only" in " ".join(result.warnings)
    truth = TrueValues(dict(zip(result.parameters, theta, strict=True)), (float(natural),))
    page = dovetail.write_report(result, tmp_path / "report.html", truth=truth).read_text()
    assert f"{natural:.1f}" in page


def test_a_gap_in_the_band_is_reported_and_filled_for_the_network_only(sdof, model):
    lines = np.arange(1.0, 601.0)
    theta, (frf,) = genuine(sdof, [lines[(lines <= 200.0) | (lines >= 230.0)]], 3)
    result = dovetail.identify(sdof, frf, "refined")
    np.testing.assert_array_equal(result.measured.values, frf.values)
    np.testing.assert_allclose(result.theta, theta, rtol=0.02)
    assert "The measurement lacks lines between 200 and 230 Hz: nothing was compared there." in result.warnings
    by_network = model.identify(frf, "network")
    np.testing.assert_array_equal(by_network.measured.values, frf.values)
    assert any("200 and 230 Hz: the network was given values interpolated" in text for text in by_network.warnings)


def test_at_most_five_gaps_are_listed(sdof):
    lines = np.arange(1.0, 601.0)
    kept = np.min(np.abs(lines[:, np.newaxis] - np.arange(100.0, 500.0, 50.0)), axis=1) > 4.0
    _, (frf,) = genuine(sdof, [lines[kept]], 3)
    (warning,) = [text for text in dovetail.identify(sdof, frf, "refined").warnings if "lacks lines" in text]
    assert warning.count(" Hz") == 5
    assert warning.endswith("295 and 305 Hz, and in 3 further places: nothing was compared there.")


def test_all_measurements_without_lines_in_the_band_are_named(assemblies):
    assembly = dovetail.load(assemblies / "bt40_er32_two_points.yaml")
    _, frfs = genuine(assembly, [np.arange(10.0, 100.0), np.arange(9001.0, 9100.0)], 0)
    named = [dovetail.Frf(f.frequency, f.values, f.quantity, label=name) for f, name in zip(frfs, "ab", strict=True)]
    with pytest.raises(MeasurementError) as caught:
        dovetail.identify(assembly, named, "refined")
    first, second = caught.value.faults
    assert (first.where, second.where) == ("a", "b")
    assert "no line of the measurement is within 100 to 9000 Hz: the measurement covers 10 to 99 Hz" in first.problem
    assert "covers 9001 to 9099 Hz" in second.problem


@pytest.mark.parametrize("count", [1, 2, 3, 8])
def test_a_few_lines_suffice_for_an_answer(sdof, count):
    _, (frf,) = genuine(sdof, [np.linspace(90.0, 110.0, count)], 2)
    for method in ("refined", "multistart", "posterior"):
        assert np.isfinite(dovetail.identify(sdof, frf, method, **FEW.get(method, {})).theta).all()


def two_masses(**calibration):
    """Two masses on springs, with a transfer FRF each way."""
    masses = {name: {"model": "lumped", "masses": [{"mass": "1 kg"}]} for name in ("one", "two")}

    def spring(below, above, **parameters):
        ends = {"a": {"to": below, "at": 0}, "b": {"to": above, "at": 0}}
        return {"model": "spring_damper", "direction": "x", "connect": ends, "parameters": parameters}

    def response(at, force, **more):
        return {"at": at, "position": 0, "force": {"at": force, "position": 0}, **more}

    unknown = {"k": {"range": [1e5, 1e7], "scale": "log"}, "c": {"range": [1, 100], "scale": "log"}}
    return dovetail.load(
        {
            "dovetail": 1,
            "name": "two masses",
            "frequency": {"start": "20 Hz", "stop": "500 Hz", "lines": 300},
            "substructures": {**masses, "base": {"model": "ground"}},
            "joints": {
                "foot": spring("base", "one", k={"value": 1e6}, c={"value": 10}),
                "joint": spring("one", "two", **unknown),
            },
            "responses": [response("one", "two"), response("two", "one", **calibration)],
        }
    )


@pytest.mark.sweep(keep=2)
@pytest.mark.parametrize(
    ("gain", "calibration", "said"), [(1.0, {}, 0), (1.2, {}, 1), (1.2, {"gain": {"range": [0.5, 2]}}, 0)]
)
def test_frfs_with_force_and_response_exchanged_are_held_against_each_other(gain, calibration, said):
    assembly = two_masses(**({"calibration": calibration} if calibration else {}))
    axes = [assembly.frequency, np.concatenate([assembly.frequency[::2], [500.25]])]
    _, (first, second) = genuine(two_masses(), axes, 1)
    result = dovetail.identify(assembly, [first, replace(second, values=gain * second.values)], "refined")
    sentences = [warning for warning in result.warnings if "reciprocity" in warning]
    assert len(sentences) == said
    for sentence in sentences:
        assert "at one, 0 mm, force at two, 0 mm and at two, 0 mm, force at one, 0 mm should be equal" in sentence
        separate, explained = (float(number) for number in re.findall(r"(\S+) %", sentence))
        assert separate == pytest.approx(100 * 0.2 / 1.1, rel=0.1)  # next to the scatter
        assert explained == pytest.approx(100 * NOISE * np.sqrt(2), rel=0.2)
