"""Models compared with measurements: which peaks match, and where the joint comes from."""

from __future__ import annotations

import json

import numpy as np
import pytest

import dovetail
from dovetail.errors import MeasurementError, ParameterError
from dovetail.identification.reconstruction import reconstruct
from dovetail.measurement import add_accelerometer_mass
from dovetail.problem import Problem
from dovetail_bench import PeakRow, read_cases, validate
from dovetail_bench.pages.validation_figures import series_figure, validation_figure

TRUTH = {"k": 3e6, "c": 40.0}
SENSOR = 0.05

CASES = """\
dovetail_series: 1
accelerometer_mass: 0.05 kg
tests:
  heavier:
    assembly: heavier.yaml
    measured: heavier.uff
    joint: {assembly: sdof.yaml, measured: sdof.uff}
  again:
    assembly: heavier.yaml
    measured: heavier.uff
    joint: {assembly: sdof.yaml, measured: sdof.uff}
"""


@pytest.fixture
def bench(tmp_path, assemblies):
    (tmp_path / "sdof.yaml").write_text((assemblies / "sdof.yaml").read_text())
    heavier = "extends: sdof.yaml\nname: heavier\nsubstructures: {mass: {masses: [{mass: 2 kg}]}}\n"
    (tmp_path / "heavier.yaml").write_text(heavier)
    for name in ("sdof", "heavier"):
        assembly = dovetail.load(tmp_path / f"{name}.yaml")
        frf = dovetail.Frf(assembly.frequency, assembly.frf(TRUTH), "accelerance")
        dovetail.write_frf(add_accelerometer_mass(frf, SENSOR), tmp_path / f"{name}.uff")
    (tmp_path / "cases.yaml").write_text(CASES)
    return tmp_path


class Known:
    """Identifies what is known, and remembers what it was asked."""

    def __init__(self):
        self.asked = []

    def __call__(self, assembly, measured):
        self.asked.append((assembly.name, measured))
        theta = assembly.vector(TRUTH)
        return reconstruct(
            Problem.of(assembly, measured), theta, method="known", provenance={"assembly": assembly.name}
        )


def test_the_joint_of_one_measurement_predicts_another(bench):
    known = Known()
    done = validate(read_cases(bench / "cases.yaml"), known)
    (peak,) = done.cases[0].peaks
    natural = np.sqrt(TRUTH["k"] / 2.0) / (2 * np.pi)
    assert peak.predicted == pytest.approx(natural, rel=1e-4)
    assert peak.error == pytest.approx(0.0, abs=1e-3)
    assert peak.measured == pytest.approx(natural * np.sqrt(2.0 / (2.0 + SENSOR)), rel=1e-3)
    assert peak.shift == pytest.approx(100 * (np.sqrt((2.0 + SENSOR) / 2.0) - 1), rel=0.1)
    assert done.cases[0].mean_coherence == pytest.approx(1.0, abs=1e-9)
    assert done.cases[0].natural == pytest.approx([natural])


def test_a_joint_is_identified_once_and_without_the_accelerometer(bench):
    known = Known()
    validate(read_cases(bench / "cases.yaml"), known)
    ((name, measured),) = known.asked
    assembly = dovetail.load(bench / "sdof.yaml")
    assert name == "sdof"
    np.testing.assert_allclose(measured.values, assembly.frf(TRUTH), rtol=1e-9)


def test_a_wrong_joint_shows(bench):
    def wrong(assembly, measured):
        theta = assembly.vector(TRUTH | {"k": 3.3e6})
        return reconstruct(Problem.of(assembly, measured), theta, method="wrong", provenance={})

    (peak,) = validate(read_cases(bench / "cases.yaml"), wrong).cases[0].peaks
    assert peak.error == pytest.approx(100 * (np.sqrt(1.1) - 1), rel=0.01)


def test_a_peak_without_counterpart_stays_in_the_table(bench):
    def far(assembly, measured):
        theta = assembly.vector(TRUTH | {"k": 6e6})
        return reconstruct(Problem.of(assembly, measured), theta, method="far", provenance={})

    measured, predicted = validate(read_cases(bench / "cases.yaml"), far).cases[0].peaks
    assert (measured.predicted, measured.error) == (None, None)
    assert (predicted.measured, predicted.compensated) == (None, None)


def test_what_the_case_does_not_say_is_asked_for(bench):
    text = CASES.replace("    joint: {assembly: sdof.yaml, measured: sdof.uff}\n", "", 1)
    (bench / "cases.yaml").write_text(text)
    with pytest.raises(ParameterError, match=r"case heavier\n.*the test does not say from what"):
        validate(read_cases(bench / "cases.yaml"), Known())


def test_a_measurement_that_is_too_short_is_refused(bench):
    frf = dovetail.read_frf(bench / "heavier.uff")
    short = dovetail.Frf(frf.frequency[:300], frf.values[:300], "accelerance")
    dovetail.write_frf(short, bench / "heavier.uff", overwrite=True)
    with pytest.raises(MeasurementError, match=r"heavier.uff\n.*the measurement covers"):
        validate(read_cases(bench / "cases.yaml"), Known())


def test_a_measurement_is_compared_on_its_own_lines(bench):
    heavier = dovetail.load(bench / "heavier.yaml")
    lines = np.arange(0.7, 640.0, 0.6)
    frf = dovetail.Frf(lines, heavier.on(lines).frf(TRUTH), "accelerance")
    dovetail.write_frf(add_accelerometer_mass(frf, SENSOR), bench / "heavier.uff", overwrite=True)
    for result in validate(read_cases(bench / "cases.yaml"), Known()).cases:
        inside = lines[(lines >= 1.0) & (lines <= 600.0)]
        for shown in (result.measured, result.compensated, result.predicted):
            np.testing.assert_allclose(shown.frequency, inside, rtol=1e-6)
        np.testing.assert_allclose(result.predicted.values, heavier.on(result.measured.frequency).frf(TRUTH))
        assert result.mean_coherence > 0.999


def test_a_validation_has_plain_values_and_figures(bench):
    (bench / "cases.yaml").write_text(
        CASES.replace("tests:\n", "covariates: {torque: N m}\ntests:\n", 1).replace(
            "sdof.uff}\n", "sdof.uff}\n    at: {torque: 3 N m}\n"
        )
    )
    done = validate(read_cases(bench / "cases.yaml"), Known())
    plain = json.loads(json.dumps(done.to_dict(), allow_nan=False))
    assert [case["name"] for case in plain["cases"]] == ["heavier", "again"]
    assert plain["cases"][0]["joint"] == TRUTH
    frfs, series = validation_figure(done), series_figure(done)
    assert (len(frfs.axes), len(series.axes)) == (2, 1)
    assert {figure.get_suptitle() for figure in (frfs, series)} == {done.title}


def test_errors_are_relative_to_the_compensated_peak():
    row = PeakRow(measured=99.0, compensated=100.0, predicted=101.0)
    assert (row.error, row.shift) == (pytest.approx(1.0), pytest.approx(100 / 99 * 100 - 100))
    assert PeakRow(None, 1.0, None).error is None
