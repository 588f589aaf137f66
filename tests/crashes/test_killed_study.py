"""A study whose processes are killed at random moments loses no trial, and repeats only those that were killed."""

from __future__ import annotations

import json
import os
import random
import signal
import sqlite3
import subprocess
import sys
import time
from collections import Counter
from contextlib import closing, suppress
from pathlib import Path

import pytest

from support.packages import skip_module_without
from support.waiting import PATIENCE, wait_until

skip_module_without("optuna")
pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="Windows has no SIGKILL")
FEW, MANY = 3, 25
"""Values of one option, for a few kills and for many."""
PLUGIN = """
import os
import time
from pathlib import Path

import dovetail
from dovetail_plugins.regressors.scikit_learn import ScikitLearnRegressor


def note(word):
    with Path(os.environ["TRAININGS"]).open("a") as file:
        file.write(word)


class Noted(ScikitLearnRegressor):
    name, summary = "noted", "Notes each training, independently of the record of the study"

    def fit(self, *words, **options):
        note("b")
        time.sleep(0.5)  # long enough to be killed in
        fitted = super().fit(*words, **options)
        note("e")
        return fitted


@dovetail.hookimpl
def dovetail_components():
    return [Noted]
"""


@pytest.fixture
def place(sdof, tmp_path) -> Path:
    (tmp_path / "noted.py").write_text(PLUGIN)
    (tmp_path / "study-trainings").write_text("")
    return tmp_path


def describe(sdof, place: Path, values: int) -> None:
    """Write a study of many short trials."""
    description = json.loads(sdof.description.text)
    ridge = {"model": "noted", "estimator": "KernelRidge", "options": {"kernel": "rbf"}}
    reducer = {"model": "pca", "n_components": 2}
    description["identification"].update(samples=200, reducer=reducer, regressor=ridge)
    sweeps = {"reducer.n_components": list(range(1, 1 + values)), "regressor.options.alpha": [1e-6, 1e-4, 1e-2, 1.0]}
    study = {"sweeps": sweeps, "lease": 4}
    (place / "study.yaml").write_text(json.dumps({**description, "study": study}))


def start(place: Path, folder: str = "study") -> subprocess.Popen[bytes]:
    threads = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    environment = {**os.environ, **threads, "TRAININGS": str(place / f"{folder}-trainings")}
    words = [sys.executable, "-m", "dovetail", "study", "study.yaml", "-o", folder, "--plugin", "noted.py"]
    return subprocess.Popen(words, cwd=place, stdout=-3, stderr=-1, env=environment)


def answers(place: Path) -> dict[str, str]:
    """The answers in the record of the study, by the numbers of their trials."""
    file = place / "study" / "work" / "trials.db"
    query = (
        "SELECT number.value_json, answer.value_json FROM trial_user_attributes number, trial_user_attributes answer "
        "WHERE number.trial_id = answer.trial_id AND number.key = 'number' AND answer.key = 'answer'"
    )
    with suppress(sqlite3.OperationalError):  # there are no tables yet
        if file.exists():
            with closing(sqlite3.connect(file, timeout=PATIENCE)) as opened:
                rows = opened.execute(query).fetchall()
            assert len(rows) == len(dict(rows))
            return dict(rows)
    return {}


def wait_for(place: Path, number: int, workers: list[subprocess.Popen[bytes]]) -> None:
    """Wait until so many trials have an answer, or a process has ended."""
    wait_until(lambda: len(answers(place)) >= number or any(worker.poll() is not None for worker in workers))


def trainings(place: Path) -> Counter[str]:
    """The numbers of trainings that began, 'b', and that ended, 'e'."""
    return Counter((place / "study-trainings").read_text())


def wait_for_training(place: Path) -> None:
    """Wait until a training begins."""
    before = trainings(place)["b"]
    wait_until(lambda: trainings(place)["b"] > before)


def assert_same_as_undisturbed(place: Path) -> None:
    assert start(place, "undisturbed").wait() == 0
    other = json.loads((place / "undisturbed" / "study.json").read_text())
    done = json.loads((place / "study" / "study.json").read_text())
    errors = [[trial["answer"]["mae"] for trial in study["trials"]] for study in (done, other)]
    assert errors[0] == pytest.approx(errors[1], rel=1e-6)


@pytest.mark.parametrize(
    ("processes", "rounds", "values"), [(1, 1, FEW), pytest.param(3, 8, MANY, marks=pytest.mark.slow)]
)
def test_killed_trials_are_repeated_and_no_others(sdof, place, processes, rounds, values):
    describe(sdof, place, values)
    chance, killed, known = random.Random(rounds), 0, dict[str, str]()
    workers = [start(place) for _ in range(processes)]
    for round_ in range(rounds):
        wait_for(place, len(known) + chance.randint(1, 1 + values // rounds), workers)
        if round_ % 2 or rounds == 1:
            wait_for_training(place)
        else:
            time.sleep(chance.uniform(0.0, 0.3))
        victims = workers[: processes if round_ == rounds - 1 else chance.randint(1, processes)]
        for worker in victims:  # at once; the last time all of them
            worker.kill()
        for worker in victims:
            said = worker.communicate()[1].decode()
            assert worker.returncode == -signal.SIGKILL, said
        killed += len(victims)
        workers = [*workers[len(victims) :], *(start(place) for _ in victims)]
        now = answers(place)
        assert {number: now[number] for number in known} == known  # no answer is lost, and none is replaced
        known = now
    for worker in workers:
        said = worker.communicate()[1].decode()
        assert worker.returncode == 0, said
    now = answers(place)
    assert {number: now[number] for number in known} == known
    assert_complete(place, values, killed)
    if rounds > 2:
        assert_same_as_undisturbed(place)


def assert_complete(place: Path, values: int, killed: int) -> None:
    """Each trial is done once, and no more trainings began than there are trials and killed processes."""
    trials = json.loads((place / "study" / "study.json").read_text())["trials"]
    kinds = [trial["kind"] for trial in trials]
    assert kinds[: values + 4] == ["described", *["sweep"] * (values + 3)]
    assert kinds[values + 4 :] in (["test"], ["together", "test"])
    assert all(trial["state"] == "done" for trial in trials)
    assert len(trials) <= sum(trial["attempts"] for trial in trials) <= len(trials) + killed
    done = trainings(place)
    assert len(trials) <= done["e"] < done["b"] <= len(trials) + killed
    hidden = [path.name for folder in ("study", "study/work") for path in (place / folder).glob(".*")]
    assert hidden == []
    print(f"{len(trials)} trials, {killed} processes killed, {dict(done)} trainings begun and ended")
