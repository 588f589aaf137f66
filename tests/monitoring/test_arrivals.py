"""Which files of a folder are taken, when, and in which order."""

import os

import pytest

from dovetail import DovetailError
from dovetail.monitoring.arrivals import Folder
from dovetail.monitoring.dates import date_of
from dovetail.series.description import Covariate
from dovetail.series.measured_files import covariates_of

TORQUE = {"torque": Covariate("torque", "N m"), "temperature": Covariate("temperature", "K")}


class Clock:
    now = 0.0

    def __call__(self):
        return self.now


@pytest.fixture
def clock():
    return Clock()


@pytest.fixture
def folder(tmp_path, clock):
    return Folder(tmp_path, settle=2.0, clock=clock)


def names(folder, **options):
    arrivals, waiting = folder.look(**options)
    return [arrival.name for arrival in arrivals], waiting


def test_a_file_waits_until_it_has_not_changed_for_a_while(folder, clock, tmp_path):
    file = tmp_path / "a.csv"
    file.write_text("1")
    assert names(folder) == ([], True)
    clock.now = 1.5
    file.write_text("12")
    assert names(folder) == ([], True)
    clock.now = 3.0
    assert names(folder) == ([], True)
    clock.now = 3.5
    assert names(folder) == (["a.csv"], False)


def test_a_file_that_was_changed_long_ago_is_taken_at_the_first_look_of_a_single_run(folder, tmp_path):
    for name in ("new.csv", "old.csv"):
        (tmp_path / name).write_text("1")
    os.utime(tmp_path / "old.csv", (1e9, 1e9))
    assert names(folder, trust_old=True) == (["old.csv"], True)


def test_a_known_file_is_taken_again_when_it_changes(folder, clock, tmp_path):
    file = tmp_path / "a.csv"
    file.write_text("1")
    folder.look()
    clock.now = 2.0
    (arrival,), _ = folder.look()
    folder.settled(arrival)
    assert names(folder) == ([], False)
    file.write_text("12")
    assert names(folder) == ([], True)
    clock.now = 4.0
    assert names(folder) == (["a.csv"], False)


@pytest.mark.parametrize("name", [".hidden.csv", "a.csv.part", "b.tmp", "c.csv~", "~$d.xlsx", "e.crdownload"])
def test_unfinished_files_of_other_programs_and_folders_are_passed_over(folder, tmp_path, name):
    (tmp_path / name).write_text("1")
    (tmp_path / "inner").mkdir()
    assert names(folder) == ([], False)


def test_files_are_taken_by_date_and_then_by_name(folder, tmp_path):
    changed = {"b_2026-03-01.csv": 5e8, "a_2026-03-02.csv": 4e8, "z.csv": 1e9, "y_20260301T0700.csv": 3e8}
    for name, when in changed.items():
        (tmp_path / name).write_text(name)
        os.utime(tmp_path / name, (when, when))
    taken, _ = names(folder, trust_old=True)
    assert taken == ["z.csv", "b_2026-03-01.csv", "y_20260301T0700.csv", "a_2026-03-02.csv"]


@pytest.mark.parametrize(
    ("name", "date"),
    [
        ("2026-03-01.csv", "2026-03-01T00:00:00"),
        ("spindle 20260301T0815.uff", "2026-03-01T08:15:00"),
        ("2026-03-01_08-15-30 run 3.csv", "2026-03-01T08:15:30"),
        ("run 9999-99-99.csv", "2001-09-09T01:46:40.000000"),
        ("run 12.csv", "2001-09-09T01:46:40.000000"),
    ],
)
def test_the_date_is_that_of_the_name_or_else_of_the_change(name, date):
    assert date_of(name, 1_000_000_000_000_000_000) == date


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("2026-03-01 torque=40.csv", {"torque": 40.0}),
        ("torque=0.04 kN m, temperature=300.csv", {"torque": 40.0, "temperature": 300.0}),
        ("a_torque=40_temperature=300.uff", {"torque": 40.0, "temperature": 300.0}),
        ("torque=40.5.csv", {"torque": 40.5}),
        ("mytorque=40.csv", {}),
        ("run.csv", {}),
    ],
)
def test_covariates_are_read_from_the_name(name, values):
    assert covariates_of(name, TORQUE) == pytest.approx(values)


def test_a_covariate_of_another_dimension_is_an_error():
    with pytest.raises(DovetailError, match="torque="):
        covariates_of("torque=40 kg.csv", TORQUE)


def test_a_missing_folder_is_an_error(tmp_path):
    with pytest.raises(DovetailError, match="cannot be read"):
        Folder(tmp_path / "missing").look()
