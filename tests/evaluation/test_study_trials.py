"""The trials of a study in Optuna's storage: none is lost and none that has ended is repeated, whatever is killed."""

from __future__ import annotations

import json
import os
import shutil
import signal
import sqlite3
import sys
import threading
from collections.abc import Sequence
from contextlib import closing, suppress
from pathlib import Path
from typing import Any

import pytest

import dovetail
import dovetail_bench
from dovetail.description import SearchRange
from dovetail.description.study_section import SearchSection
from dovetail.errors import DovetailError
from dovetail_bench.evaluation.study_plan import StudyTrial
from support.waiting import wait_until

pytest.importorskip("optuna")
from dovetail_bench.evaluation import study_trials
from dovetail_bench.evaluation.study_search import SearchSpace
from dovetail_bench.evaluation.study_trials import TrialStore

ANSWER = {"mae": 0.5}


def propose_one(trials: Sequence[StudyTrial]) -> StudyTrial | None:
    return None if trials else StudyTrial(0, "described", {})


def open_store(folder: Path, lease: float = 3600.0) -> TrialStore:
    return TrialStore(folder, {"study": 1}, lease)


def let_leases_run_out(folder: Path) -> None:
    """Make all heartbeats a day old."""
    with closing(sqlite3.connect(folder / "trials.db")) as file, file:
        file.execute("UPDATE trial_heartbeats SET heartbeat = datetime('now', '-1 day')")


def has_leases(folder: Path) -> bool:
    """Return whether there was a heartbeat within the last hour."""
    with closing(sqlite3.connect(folder / "trials.db")) as file:
        query = "SELECT count(*) FROM trial_heartbeats WHERE heartbeat > datetime('now', '-1 hour')"
        return file.execute(query).fetchone()[0] > 0


def test_a_trial_whose_process_was_interrupted_is_begun_again_at_once(tmp_path):
    first, second = open_store(tmp_path), open_store(tmp_path)
    attempt = first.begin(propose_one)
    assert attempt is not None
    with suppress(KeyboardInterrupt), attempt.heartbeats():
        assert second.begin(propose_one) is None
        raise KeyboardInterrupt
    again = second.begin(propose_one)
    assert again is not None
    assert again.trial == StudyTrial(0, "described", {}, "running")
    assert second.trials()[0].attempts == 2


@pytest.mark.parametrize("end", ["succeed", "fail", "is_pruned"])
def test_a_trial_without_heartbeats_is_begun_again_and_its_late_result_is_refused(tmp_path, end):
    first, second = open_store(tmp_path), open_store(tmp_path)
    late = first.begin(propose_one)
    assert late is not None
    let_leases_run_out(tmp_path)
    attempt = second.begin(propose_one)
    assert attempt is not None
    with late.heartbeats():
        getattr(late, end)({"succeed": {"mae": 9.0}, "fail": "late", "is_pruned": 9.0}[end])
    assert first.trials()[0].state == "running"
    with attempt.heartbeats():
        attempt.succeed(ANSWER)
    assert first.trials() == [StudyTrial(0, "described", {}, "done", answer=ANSWER, attempts=2)]


def test_heartbeats_are_sent_while_a_trial_runs(tmp_path):
    first, second = open_store(tmp_path), open_store(tmp_path)
    first._storage.heartbeat_interval = 1
    attempt = first.begin(propose_one)
    assert attempt is not None
    with attempt.heartbeats():
        let_leases_run_out(tmp_path)
        wait_until(lambda: has_leases(tmp_path))  # by the next heartbeat
        assert second.begin(propose_one) is None
        attempt.succeed(ANSWER)
    assert second.trials()[0].attempts == 1


def test_processes_that_ask_at_once_get_each_trial_once(tmp_path):
    def propose(trials: Sequence[StudyTrial]) -> StudyTrial | None:
        number = len(trials)
        return StudyTrial(number, "sweep", {"reducer.a": number}) if number < 24 else None

    got: list[int] = []

    def work() -> None:
        store = open_store(tmp_path, 60.0)
        while (attempt := store.begin(propose)) is not None:
            got.append(attempt.trial.number)
            with attempt.heartbeats():
                attempt.succeed(ANSWER)

    threads = [threading.Thread(target=work) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert sorted(got) == list(range(24))
    assert [(trial.state, trial.attempts) for trial in open_store(tmp_path).trials()] == [("done", 1)] * 24


def killed_at(folder: Path, write: int) -> bool:
    """Work on a trial in a process that is killed before SQLite's write of this number; return whether it was."""
    process = os.fork()
    if process == 0:
        seen = 0

        def kill_in_time(sql: str) -> None:
            nonlocal seen
            seen += not sql.startswith(("SELECT", "PRAGMA"))
            if seen > write:
                os.kill(os.getpid(), signal.SIGKILL)

        def connect(*words: Any, **options: Any) -> sqlite3.Connection:
            connection = opened(*words, **options)
            connection.set_trace_callback(kill_in_time)
            return connection

        opened, study_trials.sqlite3.connect = sqlite3.connect, connect
        with suppress(BaseException):
            attempt = open_store(folder).begin(propose_one)
            assert attempt is not None
            with attempt.heartbeats():
                attempt.succeed(ANSWER)
            os._exit(0)
        os._exit(1)
    status = os.waitpid(process, 0)[1]
    assert os.WIFSIGNALED(status) or os.WEXITSTATUS(status) == 0
    return os.WIFSIGNALED(status)


def finish(folder: Path) -> bool:
    """End the trial after a process was killed; return whether it had ended, and was not begun again."""
    ended = answered(folder)
    if not ended:
        with suppress(sqlite3.OperationalError):  # killed before there are tables
            let_leases_run_out(folder)
    store = open_store(folder)
    attempt = store.begin(propose_one)
    assert (attempt is None) is ended, "the trial is lost or repeated"
    if attempt is not None:
        with attempt.heartbeats():
            attempt.succeed(ANSWER)
    assert [trial.state for trial in store.trials()] == ["done"]
    assert store.trials()[0].attempts <= 2
    return ended


@pytest.mark.skipif(sys.platform == "win32", reason="Windows cannot fork")
@pytest.mark.parametrize("stride", [2, pytest.param(1, marks=pytest.mark.slow)])
def test_a_process_killed_before_any_write_of_a_trial_leaves_it_to_be_ended_once(tmp_path, stride):
    open_store(tmp_path / "new")
    write, ended = 0, []
    while killed_at(shutil.copytree(tmp_path / "new", folder := tmp_path / str(write)), write):
        ended.append(finish(folder))
        write += stride
    assert ended.index(True) * stride > 15  # writes before the trial has an answer
    assert ended.count(True) * stride > 3  # and after it
    assert [trial.attempts for trial in open_store(folder).trials()] == [1]


@pytest.mark.skipif(sys.platform == "win32", reason="Windows cannot fork")
@pytest.mark.parametrize("write", [0, 1, 2, 5, 10, 20, 30])
def test_a_process_killed_while_it_makes_the_file_leaves_a_file_that_others_use(tmp_path, write):
    tmp_path.joinpath("study").mkdir()
    assert killed_at(tmp_path / "study", write)
    assert not finish(tmp_path / "study")


def answered(folder: Path) -> bool:
    """Whether the answer of the trial is in the file."""
    if not (folder / "trials.db").exists():
        return False
    with closing(sqlite3.connect(folder / "trials.db")) as file, suppress(sqlite3.OperationalError):
        return bool(file.execute("SELECT 1 FROM trial_user_attributes WHERE key = 'answer'").fetchall())
    return False


@pytest.mark.parametrize("name", ["with space", "a{b}", "what?", "half#", "50%", "übung", "a;b&c=d"])
def test_a_folder_may_have_any_name(tmp_path, name):
    attempt = open_store(tmp_path / name).begin(propose_one)
    assert attempt is not None
    attempt.succeed(ANSWER)
    assert open_store(tmp_path / name).trials()[0].answer == ANSWER
    assert [path.name for path in tmp_path.iterdir()] == [name]


@pytest.mark.parametrize("content", [b"[]", b"SQLite format 3\x00" + bytes(84), b"\x00" * 4096])
def test_a_file_that_is_not_of_optuna_is_refused(sdof, tmp_path, content):
    (tmp_path / "trials.db").write_bytes(content)
    description = {**json.loads(sdof.description.text), "study": {"sweeps": {"augmentation": [None]}}}
    with pytest.raises(dovetail.FileError, match="record of the trials cannot be read or written: file is not a datab"):
        dovetail_bench.study(dovetail.load(description), tmp_path)


def test_trials_of_another_program_and_of_another_study_are_refused(tmp_path):
    import optuna

    for name in ("dovetail", "other"):
        (tmp_path / name).mkdir()
        study = optuna.create_study(storage=f"sqlite:///{tmp_path / name}/trials.db", study_name=name)
        study.add_trial(optuna.create_trial(value=1.0))
    with pytest.raises(DovetailError, match="holds a study of another description"):
        open_store(tmp_path / "dovetail")
    assert open_store(tmp_path / "other").trials() == []
    with pytest.raises(DovetailError, match="holds a study of another description"):
        TrialStore(tmp_path / "other", {"study": 2}, 60.0)


@pytest.mark.parametrize(
    ("tried", "value", "inside"),
    [
        (SearchRange(range=(1, 9)), 4, True),
        (SearchRange(range=(1, 9)), 4.5, False),
        (SearchRange(range=(1, 9)), 12, False),
        (SearchRange(range=(1.0, 9.0)), 4, True),
        (SearchRange(range=(1.0, 9.0)), None, False),
        (SearchRange(range=(1.0, 9.0)), [4], False),
        ((None, [64, 32], "relu"), [64, 32], True),
        ((None, [64, 32], "relu"), None, True),
        ((None, [64, 32], "relu"), [32], False),
    ],
)
def test_a_sweep_informs_the_search_where_its_values_are_inside_it(tmp_path, tried, value, inside):
    space = SearchSpace(SearchSection(trials=5, options={"regressor.a": tried}), {"regressor.a": value}, 0)
    store = TrialStore(tmp_path, {}, 60.0, space)
    described = store.begin(propose_one)
    assert described is not None
    described.succeed(ANSWER)
    assert bool(described._asked.params) is inside
    proposed = store.begin(lambda trials: StudyTrial(1, "search", {}))
    assert proposed is not None
    assert proposed.trial.changes["regressor.a"] in tried if isinstance(tried, tuple) else True
