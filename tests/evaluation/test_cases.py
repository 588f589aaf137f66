"""The tests of a series as cases, sound and broken."""

from __future__ import annotations

import pytest

from dovetail.errors import DescriptionError, MeasurementError
from dovetail_bench import read_cases

SOUND = """\
dovetail_series: 1
name: Two
covariates: {torque: N m}
accelerometer_mass: 1.2 g
tests:
  first:
    assembly: a.yaml
    measured: m/first.uff
    joint: {assembly: b.yaml, measured: {file: joint.uff, accelerometer_mass: 2 g, index: 3}}
    at: {torque: 20 N m}
  second:
    assembly: a.yaml
    measured: {file: second.csv, quantity: mobility}
    joint: {result: results}
    at: {torque: 40 N m}
"""


def written(tmp_path, text):
    file = tmp_path / "cases.yaml"
    file.write_text(text)
    return file


def test_names_are_taken_from_the_files_folder(tmp_path):
    cases = read_cases(written(tmp_path, SOUND))
    first, second = cases.cases
    assert (cases.title, cases.series) == ("Two", "torque [N m]")
    assert (first.name, first.value, first.assembly) == ("first", 20.0, tmp_path / "a.yaml")
    assert (first.measured.file, first.measured.accelerometer_mass) == (tmp_path / "m/first.uff", 1.2e-3)
    assert (first.joint.assembly, first.joint.result) == (tmp_path / "b.yaml", None)
    assert (first.joint.measured.accelerometer_mass, first.joint.measured.options) == (2e-3, {"index": 3})
    assert (second.measured.options["quantity"], second.joint.result) == ("mobility", tmp_path / "results")


def test_a_table_without_a_header_is_read_by_what_the_case_or_the_caller_states(tmp_path):
    (tmp_path / "second.csv").write_text("10,1,2\n20,3,4\n")
    given = SOUND.replace("quantity: mobility}", "quantity: mobility, columns: [frequency, imag, real]}")
    for text, reading in ((given, {"columns": ("frequency", "real", "imag")}),
                          (SOUND, {"columns": ("frequency", "imag", "real"), "quantity": "accelerance"})):  # fmt: skip
        _, second = read_cases(written(tmp_path, text), **reading).cases
        frf = second.measured.read(compensated=False)
        assert (frf.quantity, frf.values.tolist()) == ("mobility", [2 + 1j, 4 + 3j])


def test_another_covariate_in_the_measured_file_is_refused(tmp_path):
    rows = "# quantity: mobility\nfrequency_Hz,real,imag\n10,1,2\n20,3,4\n"
    for torque, fits in (("40 N m", True), ("0.04 kN m", True), ("60 N m", False)):
        (tmp_path / "second.csv").write_text(f"# torque: {torque}\n{rows}")
        _, second = read_cases(written(tmp_path, SOUND)).cases
        if fits:
            second.measured.read(compensated=True)
        else:
            with pytest.raises(MeasurementError, match="torque is '60 N m' here, and 40 N m in the test 'second'"):
                second.measured.read(compensated=True)


BROKEN = {
    "no format": ("dovetail_series: 1\n", "", ["the file does not say that it describes a series of tests."]),
    "newer format": ("dovetail_series: 1", "dovetail_series: 2", [":1:18  dovetail_series", "2 is not a format"]),
    "a typing error": ("    assembly: a.yaml\n    measured: m", "    asembly: a.yaml\n    measured: m",
                       [":7:5  tests.first.asembly", "Did you mean 'assembly'?"]),
    "two sources": ("{result: results}", "{result: results, assembly: b.yaml}",
                    [":14:5  tests.second.joint", "a joint comes from 'assembly' and 'measured', or from 'result'"]),
    "no value": ("    at: {torque: 40 N m}\n", "", [":11:3  tests.second", "the test does not give 'torque'"]),
    "a value in another unit": ("40 N m", "40 N", ["tests.second.at.torque", "N m"]),
    "several files": ("{file: second.csv, quantity: mobility}", "[second.csv, third.csv]",
                      ["tests.second.measured", "2 measured files"]),
    "a mass in seconds": ("1.2 g", "1.2 s", [":4:21  accelerometer_mass", "kg"]),
    "a negative mass": ("1.2 g", "-1.2 g", [":4:21  accelerometer_mass", "at least 0"]),
    "no tests": (SOUND[SOUND.index("tests:\n  first") :], "tests: {}\n", ["tests", "1 or more"]),
}  # fmt: skip


@pytest.mark.parametrize("case", BROKEN)
def test_a_fault_names_its_place(case, tmp_path):
    old, new, expected = BROKEN[case]
    assert SOUND.count(old) == 1
    with pytest.raises(DescriptionError) as caught:
        read_cases(written(tmp_path, SOUND.replace(old, new)))
    for part in expected:
        assert part in str(caught.value)


def test_an_assembly_and_changes_of_it_are_those_of_the_series(tmp_path):
    text = SOUND.replace("tests:", "assembly: all.yaml\ntests:").replace("  second:\n    assembly: a.yaml", "  second:")
    _, second = read_cases(written(tmp_path, text.replace("  second:", "  second:\n    change: {name: other}"))).cases
    assert second.source == {"extends": str(tmp_path / "all.yaml"), "name": "other"}


def test_a_missing_file_is_reported(tmp_path):
    with pytest.raises(DescriptionError, match="there is no such file"):
        read_cases(tmp_path / "none.yaml")
