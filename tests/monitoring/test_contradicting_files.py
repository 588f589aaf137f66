"""Files that contradict the series, their names or earlier files; the same measurement twice; altered states.

A mass on a mount whose stiffness follows the torque of a bolt. Twelve files have been taken; each case adds one, which
has the right parameters, is set aside, counts as a duplicate, or has a remark.
"""

from __future__ import annotations

import base64
import json
import os
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import dovetail
from dovetail import DovetailError
from dovetail.monitoring import DUPLICATE, PREDICTED, REFERENCE, SET_ASIDE, Watch, WatchOptions
from dovetail.monitoring.dates import date_of, date_remarks
from dovetail.monitoring.reference import Reference
from support.mass_on_mount import mass_on_mount

OPTIONS = WatchOptions(reference=12)
FIRST = "2026-01-13 torque=20.csv"
MODEL = mass_on_mount(
    {"start": 20.0, "stop": 59.0, "step": 1.0},
    {"k": {"range": [1e4, 1e6]}, "c": {"range": [1.0, 200.0]}},
    response={"at": "mass", "position": 0, "quantity": "receptance"},
)


def stiffness(torque):
    return 1e5 * (torque / 20.0) ** 0.5


def measurement(seed, torque=20.0, **points):
    assembly = dovetail.load(MODEL)
    values = assembly.frf({"k": stiffness(torque), "c": 20.0})
    return dovetail.noisy_frf(
        dovetail.Frf(assembly.frequency, values, "receptance", **points), 0.01, np.random.default_rng([7, seed])
    )


def write(path: Path, frf, lines="", **options):
    dovetail.write_frf(frf, path, overwrite=True, **options)
    if lines:
        path.write_text("".join(f"# {line}\n" for line in lines.split("\n")) + path.read_text())
    os.utime(path, (1.7e9, 1.7e9))


def describe(place, first=20, torque="N m", **measured):
    tests = {
        f"t{t}": {"measured": {"file": f"t{t}.csv", **measured}, "at": {"torque": first if t == 20 else t}}
        for t in (20, 40, 60)
    }
    series = {
        "dovetail_series": 1,
        "assembly": "model.yaml",
        "covariates": {"torque": torque},
        "tests": tests,
        "parameters": {"k": {"law": "power", "over": "torque"}, "c": "varying"},
    }
    (place / "series.yaml").write_text(json.dumps(series))


def look(place):
    watch = Watch(place / "series.yaml", place / "files", place / "out", OPTIONS, settle=0.0)
    known = len(watch.records)
    watch.look(trust_old=True)
    return watch.records[known:]


def prepared(place, lines=""):
    (place / "files").mkdir(parents=True)
    (place / "model.yaml").write_text(json.dumps(MODEL))
    describe(place)
    for torque in (20, 40, 60):
        write(place / f"t{torque}.csv", measurement(100 + torque, torque))
    for day in range(13):
        write(place / "files" / f"2026-01-{day + 1:02d} torque=20.csv", measurement(day), lines)
    assert [record["status"] for record in look(place)] == [REFERENCE] * 12 + [PREDICTED]
    return place


def content(series):
    """All by which the fits of two series may differ, as text."""
    tests = [
        (
            test.name,
            test.assembly.description.text,
            test.covariates,
            [(file.name, file.read_bytes(), options) for file, options in test.measured],
        )
        for test in series.tests
    ]
    return repr((tests, series.covariates, series.roles, series.other_parameters, series.seed))


@pytest.fixture(scope="module", autouse=True)
def one_fit_of_each_series():
    """Fit a series once: cases differ in the file that arrives, and the fit is nearly all that a look costs."""
    fitted, fit = {}, Reference.of

    def of(series, **options):
        key = content(series)
        if key not in fitted:
            fitted[key] = fit(series, **options)
        return replace(fitted[key], series=series)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Reference, "of", staticmethod(of))
        yield


@pytest.fixture(scope="module")
def taken(tmp_path_factory):
    return prepared(tmp_path_factory.mktemp("watch") / "taken")


@pytest.fixture
def place(taken, tmp_path):
    return Path(shutil.copytree(taken, tmp_path / "place"))


# -- covariates --------------------------------------------------------------------------------------------------------

FORTY = [
    "torque=40", "torque = 40", "Torque=40", "TORQUE=40 N m", "torque=40Nm", "torque=0.04 kN m", "torque=4e1",
    "torque=40 torque=40", "a_torque=40_20260114", "x torque=40,b", "torque=40; b", "(torque=40)",
]  # fmt: skip
UNCLEAR = [
    "torque=40, torque=20", "torque 40", "torque 40Nm", "torque40", "torque-40", "torque_40", "torque=40,5",
    "torque=1,000", "torque=1_000", "torque=", "torque=40 mm", "torque=nan", "torque=20..60", "torque=40 old",
]  # fmt: skip


@pytest.mark.sweep
@pytest.mark.parametrize("name", FORTY)
def test_a_covariate_in_the_name_is_read_in_every_spelling(place, name):
    write(place / "files" / f"2026-01-14 {name}.csv", measurement(14, 40))
    (record,) = look(place)
    assert (record["status"], record["covariates"]) == (PREDICTED, {"torque": pytest.approx(40.0)})


@pytest.mark.sweep
@pytest.mark.parametrize("name", UNCLEAR)
def test_a_name_whose_covariate_is_unclear_is_set_aside(place, name):
    write(place / "files" / f"2026-01-14 {name}.csv", measurement(14, 40))
    (record,) = look(place)
    assert record["status"] == SET_ASIDE, record


@pytest.mark.sweep
@pytest.mark.parametrize("suffix", ["csv", "npz", "uff"])
@pytest.mark.parametrize("line", ["torque: 40 N m", "Torque = 0.04 kN m", "torque [N m]: 40", "bench 4; TORQUE: 40"])
@pytest.mark.parametrize("name", ["2026-01-14", "2026-01-14 torque=20", "2026-01-14 torque=40"])
def test_a_covariate_in_the_file_is_used_and_compared_with_the_name(place, name, line, suffix):
    file, frf = place / "files" / f"{name}.{suffix}", measurement(14, 40)
    if suffix == "csv":
        write(file, frf, line)
    else:
        write(file, replace(frf, note=line))
    (record,) = look(place)
    if "20" in name.removeprefix("2026-01-14"):
        assert record["status"] == SET_ASIDE
        assert "and 20 N m in its name" in record["reason"]
    else:
        assert (record["status"], record["covariates"]) == (PREDICTED, {"torque": pytest.approx(40.0)})


# -- the same measurement, and files that are not complete -------------------------------------------------------------


@pytest.mark.sweep
@pytest.mark.parametrize("quantity", ["receptance", "mobility", "accelerance"])
@pytest.mark.parametrize("suffix", ["csv", "npz", "uff"])
@pytest.mark.parametrize("unit", [None, {"receptance": "um/N", "mobility": "in/s/lbf", "accelerance": "g/N"}])
def test_the_same_measurement_in_another_format_counts_once(place, suffix, quantity, unit):
    frf = dovetail.read_frf(place / "files" / FIRST).to(quantity)
    write(place / "files" / f"2026-01-14 torque=20.{suffix}", frf, unit=unit and unit[quantity])
    (record,) = look(place)
    assert record["status"] == DUPLICATE
    assert f"as '{FIRST}'" in record["reason"]


def test_the_same_values_with_another_remark_count_once(place):
    file = place / "files" / FIRST
    file.write_text(f"# checked\n{file.read_text()}")
    (record,) = look(place)
    assert record["reason"] == f"it has the same values as '{FIRST}', in another form."


def test_new_values_under_a_name_that_was_counted_have_a_remark(place):
    write(place / "files" / FIRST, measurement(30))
    (record,) = look(place)
    assert record["notes"] == ["A file of this name was counted before, with other values."]


def test_a_file_that_ends_within_its_last_number_is_set_aside(place):
    file = place / "files" / "2026-01-14 torque=20.csv"
    write(file, measurement(14))
    file.write_text(file.read_text().rstrip()[:-8])
    os.utime(file, (1.7e9, 1.7e9))
    (record,) = look(place)
    assert record["status"] == SET_ASIDE
    assert "its last line has no end" in record["reason"]


# -- points and dates --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("earlier", "points", "status"),
    [
        ("response: 3+x\nforce: 3+x", {"response": "4+x", "force": "4+x"}, SET_ASIDE),
        ("response: 3+x\nforce: 3+x", {"response": "3+z", "force": "3+z"}, SET_ASIDE),
        ("response: 3+x\nforce: 3+x", {"response": "3+x", "force": "3+x"}, PREDICTED),
        ("response: 3+x\nforce: 3+x", {}, PREDICTED),
        ("", {"response": "4+x", "force": "4+x"}, PREDICTED),
    ],
)
def test_the_points_of_a_file_are_compared_with_those_of_earlier_ones(tmp_path, earlier, points, status):
    place = prepared(tmp_path / "place", earlier)
    write(place / "files" / "2026-01-14 torque=20.csv", measurement(14, **points))
    (record,) = look(place)
    assert record["status"] == status


def remarks(folder, name, line=""):
    file = folder / name
    write(file, measurement(1), line)
    return list(date_remarks(name, file, file.read_text()))


@pytest.mark.parametrize(
    "line",
    ["date: 2026-03-01", "Date: 01.03.2026 08:00", "test date: 1 Mar 2026", "DATE = 20260301", "Recorded: 3/1/2026",
     "Date/Time: 2026/03/01 08:00", "timestamp: 2026-03-01T08:00", "Datum: 1.3.2026", "2026-03-01 08:00",
     "01-MAR-26 08:00:00"],
)  # fmt: skip
def test_a_file_whose_date_differs_from_its_name_is_remarked(tmp_path, line):
    (remark,) = remarks(tmp_path, "2026-01-14.csv", line)
    assert remark.startswith("Its name says 2026-01-14, and '")
    assert not remarks(tmp_path, "2026-03-01T0800.csv", line)


@pytest.mark.parametrize("name", ["2026-01-14 2026-03-01.csv", "2026-01-14_to_2026-03-01.csv"])
def test_a_name_with_two_dates_is_remarked_and_its_first_day_counts(tmp_path, name):
    assert remarks(tmp_path, name) == ["Its name has two dates, 2026-01-14 and 2026-03-01; the first counts."]
    assert date_of(name, 0) == "2026-01-14T00:00:00"


def test_the_number_of_a_sensor_is_no_second_date(tmp_path):
    assert not remarks(tmp_path, "2026-01-14 SN20200101.csv")


@pytest.mark.parametrize("line", ["date: see log", "date: 2026-01-15", "calibration date: 2020-01-01"])
def test_no_date_and_other_dates_have_no_remark(tmp_path, line):
    assert not remarks(tmp_path, "2026-01-14.csv", line)


@pytest.mark.parametrize("name", ["14.01.2026", "01-14-2026", "2026-02-30", "14Jan2026", "14 march 2026"])
def test_a_name_whose_date_is_not_read_has_a_remark(tmp_path, name):
    assert remarks(tmp_path, f"{name}.csv") == [
        "Its name has no date such as 2026-03-01; that of its last change counts."
    ]


@pytest.mark.parametrize("name", ["run 12", "PCB 352C33", "mount 20", "serial 12345678"])
def test_a_name_without_a_date_has_no_remark(tmp_path, name):
    assert not remarks(tmp_path, f"{name}.csv")


# -- files that are misread -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("turned", [np.negative, np.conj], ids=["sign", "phase"])
def test_a_file_with_another_sign_or_phase_is_set_aside(place, turned):
    frf = measurement(14)
    write(place / "files" / "2026-01-14 torque=20.csv", replace(frf, values=turned(frf.values)))
    (record,) = look(place)
    assert record["status"] == SET_ASIDE
    assert "the structure delivers 100 % of the power where it is driven" in record["reason"]


# -- states ------------------------------------------------------------------------------------------------------------


def scaled(array):
    values = np.frombuffer(base64.b64decode(array["__array__"]), array["type"]) * 0.5
    array["__array__"] = base64.b64encode(values.tobytes()).decode()


ALTERATIONS = {
    "parameters": lambda saved: scaled(saved["state"]["belief"]["mean"]),
    "covariance": lambda saved: scaled(saved["state"]["belief"]["covariance"]),
    "evidence": lambda saved: scaled(saved["state"]["detector"]["sums"]),
    "number of files": lambda saved: saved["state"].update(files=40),
    "weight": lambda saved: saved["state"]["usual"].update(count=4.0),
    "last record": lambda saved: saved["pending"][0].update(date="2025-01-01"),
}


@pytest.mark.parametrize("what", ALTERATIONS)
def test_an_altered_state_is_refused(place, what):
    saved = json.loads((place / "out" / "state.json").read_text())
    ALTERATIONS[what](saved)
    (place / "out" / "state.json").write_text(json.dumps(saved))
    with pytest.raises(DovetailError, match="it was altered since the watch wrote it"):
        look(place)


@pytest.mark.parametrize("change", ["value", "order"])
def test_an_altered_journal_is_refused(place, change):
    file = place / "out" / "files.jsonl"
    lines = file.read_text().splitlines(keepends=True)
    lines[3:5] = lines[4:2:-1] if change == "order" else [lines[3].replace('"number": 4', '"number": 5'), lines[4]]
    file.write_text("".join(lines))
    with pytest.raises(DovetailError, match="a line was altered since the watch wrote it"):
        look(place)


@pytest.mark.parametrize(
    "change", [{"first": 30}, {"torque": "mN m"}, {"accelerometer_mass": "1 g"}, {"names": {"skip": "gain"}}, "t60"]
)
def test_the_state_of_an_altered_series_is_refused(place, change):
    if change == "t60":
        write(place / "t60.csv", measurement(160, 90))
    else:
        describe(place, **change)
    with pytest.raises(DovetailError, match="the state of a watch of another series"):
        look(place)
