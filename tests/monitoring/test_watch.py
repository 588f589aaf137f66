"""A watched folder: alarms, files that count once, files that are set aside, and the same result after kills."""

import json
import os
import shutil
import signal
import threading

import numpy as np
import pytest

from dovetail import DovetailError
from dovetail.monitoring import ALARM, DUPLICATE, PREDICTED, REFERENCE, SET_ASIDE, Watch, WatchOptions, journal
from support.watched_mornings import OLD, write_morning, write_series

OPTIONS = WatchOptions(false_alarms=1e-3, reference=12)


@pytest.fixture
def place(mornings, tmp_path):
    """A copy of the mornings, the description, and a folder for the results."""
    shutil.copytree(mornings[0], tmp_path, dirs_exist_ok=True)
    return tmp_path


def watch_of(place, output="out", options=OPTIONS):
    return Watch(place / "watch.yaml", place / "files", place / output, options, settle=0.0)


@pytest.fixture(scope="module")
def watched(mornings, tmp_path_factory):
    """A folder in which a watch has taken all mornings."""
    folder = tmp_path_factory.mktemp("watched")
    shutil.copytree(mornings[0], folder, dirs_exist_ok=True)
    watch_of(folder).look(trust_old=True)
    return folder


def statuses(watch):
    return [record["status"] for record in watch.records]


def test_a_sudden_loss_raises_one_alarm_at_once_and_the_drift_none(place):
    watch = watch_of(place)
    watch.look(trust_old=True)
    assert statuses(watch) == [REFERENCE] * 12 + [PREDICTED] * 8 + [ALARM] + [PREDICTED] * 7
    alarm = watch.records[20]
    assert alarm["file"] == "2026-01-21.csv"
    assert alarm["reasons"][0] == "k fell by 10 %."
    assert alarm["evidence"] > 1000.0


def test_the_parameters_follow_the_truth(place):
    watch = watch_of(place)
    watch.look(trust_old=True)
    values = np.array([record["parameters"]["k"]["value"] for record in watch.records])
    truth = 2e6 * (1.0 - 2e-5 * np.arange(28)) * np.where(np.arange(28) < 20, 1.0, 0.9)
    # the model's error is common to all mornings
    np.testing.assert_allclose(values / truth, np.mean(values / truth), rtol=1e-3)
    inside = [record["parameters"]["k"] for record in watch.records]
    assert all(one["low_total"] <= one["low"] <= one["value"] <= one["high"] <= one["high_total"] for one in inside)


def test_files_that_arrive_later_are_taken_then(place):
    late = sorted((place / "files").iterdir())[15:]
    for path in late:
        path.rename(place / path.name)
    watch = watch_of(place)
    watch.look(trust_old=True)
    assert len(watch.records) == 15
    for path in late:
        (place / path.name).rename(path)
    watch.look(trust_old=True)
    assert statuses(watch).count(ALARM) == 1
    assert [record["number"] for record in watch.records] == list(range(1, 29))


def test_the_same_content_counts_once_whatever_its_name(place):
    shutil.copy2(place / "files" / "2026-01-03.csv", place / "files" / "2026-01-03 copy.csv")
    watch = watch_of(place)
    watch.look(trust_old=True)
    assert statuses(watch).count(DUPLICATE) == 1
    assert max(record.get("number", 0) for record in watch.records) == 28
    again = watch_of(place)
    again.look(trust_old=True)
    assert len(again.records) == 29
    os.utime(place / "files" / "2026-01-03.csv", (OLD, OLD))
    (place / "files" / "2026-01-04.csv").rename(place / "files" / "renamed.csv")
    again.look(trust_old=True)
    assert [record["status"] for record in again.records[29:]] == [DUPLICATE]


def test_foreign_and_broken_files_are_set_aside_with_a_reason_and_stay(place):
    files = place / "files"
    content = (files / "2026-01-05.csv").read_text().splitlines(keepends=True)
    foreign = {
        "notes.txt": "remember the torque wrench",
        "empty.csv": "",
        "half.csv": "".join(content[: len(content) // 2]),
        "nan.csv": "".join([*content[:40], content[40].replace(content[40].split(",")[1], "nan"), *content[41:]]),
        "noise.bin": "\x00\x01\x02",
        "zero.csv": "".join(
            [line if line[0] not in "0123456789" else f"{line.split(',')[0]},0,0,1\n" for line in content]
        ),
    }
    for name, text in foreign.items():
        (files / name).write_text(text)
        os.utime(files / name, (OLD + 5.5, OLD + 5.5))
    watch = watch_of(place)
    watch.look(trust_old=True)
    aside = {record["file"]: record["reason"] for record in watch.records if record["status"] == SET_ASIDE}
    assert aside.keys() == foreign.keys()
    assert all(aside.values())
    assert "lines from 1 to" in aside["half.csv"]
    assert all((files / name).exists() for name in foreign)
    assert statuses(watch).count(ALARM) == 1


def test_a_file_that_was_incomplete_counts_when_it_is_complete(place):
    file = place / "files" / "2026-01-28.csv"
    whole = file.read_bytes()
    file.write_bytes(whole[: len(whole) // 3])
    os.utime(file, (OLD, OLD))
    watch = watch_of(place)
    watch.look(trust_old=True)
    assert statuses(watch).count(SET_ASIDE) == 1
    file.write_bytes(whole)
    watch.look()
    watch.look()
    assert watch.records[-1]["status"] == PREDICTED


def test_a_file_with_an_earlier_date_than_the_last_has_a_note(place):
    late = place / "files" / "2026-01-25.csv"
    late.rename(place / late.name)
    watch = watch_of(place)
    watch.look(trust_old=True)
    (place / late.name).rename(late)
    watch.look(trust_old=True)
    assert watch.records[-1]["notes"] == ["It came after '2026-01-28.csv', and its date is earlier."]


def killed_child(place, stops):
    """Run a watch in a child process that kills itself, and return whether it was killed."""
    child = os.fork()
    if child:
        return os.WIFSIGNALED(os.waitpid(child, 0)[1])
    try:
        stops()
        watch_of(place).look(trust_old=True)
    finally:
        os._exit(0)


class Killer:
    """Kills this process at a moment of the saving of a file, when that comes for the n-th time."""

    def __init__(self, moment, times):
        self.moment, self.left = moment, times
        self.append, self.write = journal._append, journal.write_whole

    def reach(self, moment):
        self.left -= moment == self.moment
        if not self.left:
            os.kill(os.getpid(), signal.SIGKILL)

    def append_line(self, file, record):
        self.reach("after the state")
        if self.moment == "within the line" and self.left == 1:
            with file.open("a") as stream:
                stream.write(json.dumps(record)[:50])
        self.reach("within the line")
        self.append(file, record)
        self.reach("after the line")

    def write_state(self, file, content, **options):
        self.reach("before the state")
        self.write(file, content, **options)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="kills children that it forks")
def test_the_result_is_the_same_after_ten_kills(place, monkeypatch):
    whole = watch_of(place, "undisturbed")
    whole.look(trust_old=True)
    moments = ("before the state", "after the state", "within the line", "after the line")
    for number in range(10):
        killer = Killer(moments[number % 4], 2 + number % 3)

        def stops(killer=killer):
            monkeypatch.setattr(journal, "_append", killer.append_line)
            monkeypatch.setattr(journal, "write_whole", killer.write_state)

        assert killed_child(place, stops)
    again = watch_of(place)
    assert 0 < len(again.records) < 28
    again.look(trust_old=True)
    for name in ("files.jsonl", "state.json"):
        assert (place / "out" / name).read_bytes() == (place / "undisturbed" / name).read_bytes()


def test_a_lost_line_is_restored_from_the_state_and_further_ones_are_an_error(place):
    watch_of(place).look(trust_old=True)
    file = place / "out" / "files.jsonl"
    whole = file.read_text()
    lines = whole.splitlines(keepends=True)
    file.write_text("".join(lines[:-1]))
    assert len(watch_of(place).records) == 28
    assert file.read_text() == whole
    file.write_text("".join(lines[:-2]))
    with pytest.raises(DovetailError, match="26 lines"):
        watch_of(place)
    file.write_text("".join([*lines[:5], "{broken\n", *lines[6:]]))
    with pytest.raises(DovetailError, match="the line is damaged"):
        watch_of(place)


@pytest.mark.parametrize("content", ["", "{}", "[1]", '{"format": 2}', "\x00", '{"format": 1, "fingerprint": "x"}'])
def test_a_damaged_state_is_one_clear_error(watched, tmp_path, content):
    shutil.copytree(watched, tmp_path, dirs_exist_ok=True)
    (tmp_path / "out" / "state.json").write_text(content)
    with pytest.raises(DovetailError, match=r"state\.json"):
        watch_of(tmp_path)


def test_a_state_of_other_options_or_another_series_is_refused(place):
    watch_of(place).look(trust_old=True)
    with pytest.raises(DovetailError, match="another series, or with other options"):
        watch_of(place, options=WatchOptions(reference=13))
    write_series(place, parameters="{k: varying, c: shared}")
    with pytest.raises(DovetailError, match="another series, or with other options"):
        watch_of(place)


def test_a_journal_without_a_state_is_not_overwritten(place):
    watch_of(place).look(trust_old=True)
    (place / "out" / "state.json").unlink()
    with pytest.raises(DovetailError, match="no state"):
        watch_of(place)


@pytest.mark.parametrize(
    ("parameters", "options", "message"),
    [
        ("{}", {}, "every parameter is 'free'"),
        ("{k: varying, c: varying}", {"reference": 9}, "too few to learn"),
        ("{k: varying, c: varying}", {"false_alarms": 0.5}, "not a rate of false alarms"),
        ("{k: varying, c: varying}", {"false_alarms": float("nan")}, "not a rate of false alarms"),
    ],
)
def test_options_that_cannot_be_used_are_explained(place, parameters, options, message):
    write_series(place, parameters=parameters)
    with pytest.raises(DovetailError, match=message):
        watch_of(place, options=WatchOptions(**options))


@pytest.mark.parametrize(
    ("folder", "output", "message"),
    [("missing", "out", "no such folder"), ("watch.yaml", "out", "this is a file"), ("files", "files", "is watched")],
)
def test_folders_that_cannot_be_used_are_explained(place, folder, output, message):
    with pytest.raises(DovetailError, match=message):
        Watch(place / "watch.yaml", place / folder, place / output, OPTIONS)


@pytest.mark.parametrize("role", ["varying", "shared", "free"])
def test_every_role_of_the_damping_can_be_watched(place, role):
    write_series(place, parameters=f"{{k: varying, c: {role}}}")
    watch = watch_of(place)
    watch.look(trust_old=True)
    assert watch.records[20]["status"] == ALARM
    assert statuses(watch).count(ALARM) == 1


def test_the_watch_runs_until_it_is_stopped_and_survives_a_lost_network(place):
    watch, stop, failures = watch_of(place), threading.Event(), []
    moved, looks = place / "unmounted", []

    def looked():
        looks.append(len(watch.records))
        if len(looks) == 1:
            (place / "files").rename(moved)
        elif len(looks) == 3:
            moved.rename(place / "files")
            os.utime(write_morning(place / "files", 28, 1.8e6))
        elif len(watch.records) == 29 or len(looks) > 50:
            stop.set()

    watch.run(stop, interval=0.01, looked=looked, failed=failures.append)
    assert failures
    assert watch.records[-1]["file"] == "2026-01-29.csv"
