"""A study killed at random moments loses no trial and runs none twice."""

from __future__ import annotations

import json
import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="signals are of POSIX")
FEW, MANY = 5, 25
"""Values of one option, for a few kills and for ten."""


def described(sdof, tmp_path: Path, values: int) -> Path:
    """A folder with a study of many short trials."""
    description = json.loads(sdof.description.text)
    ridge = {"model": "sklearn", "estimator": "KernelRidge", "options": {"kernel": "rbf"}}
    reducer = {"model": "pca", "n_components": 2}
    description["identification"].update(samples=200, reducer=reducer, regressor=ridge)
    sweeps = {"reducer.n_components": list(range(1, 1 + values)), "regressor.options.alpha": [1e-6, 1e-4, 1e-2, 1.0]}
    (tmp_path / "study.yaml").write_text(json.dumps({**description, "study": {"sweeps": sweeps}}))
    return tmp_path


def start(place: Path, folder: str) -> subprocess.Popen[bytes]:
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    words = [sys.executable, "-m", "dovetail", "study", "study.yaml", "-o", folder]
    return subprocess.Popen(words, cwd=place, stdout=-3, stderr=-1, env=environment)


def trials(place: Path) -> list[dict[str, object]]:
    ledger = place / "study" / "work" / "ledger.json"
    return json.loads(ledger.read_text())["trials"] if ledger.exists() else []


def ended(place: Path) -> dict[int, str]:
    """The trials that have an answer, with it."""
    return {int(str(trial["number"])): json.dumps(trial["answer"]) for trial in trials(place) if trial["answer"]}


def assert_same_as_undisturbed(place: Path) -> None:
    without = start(place, "undisturbed")
    assert without.wait() == 0
    other = json.loads((place / "undisturbed" / "study.json").read_text())
    done = json.loads((place / "study" / "study.json").read_text())
    errors = [[trial["answer"]["mae"] for trial in study["trials"]] for study in (done, other)]
    assert errors[0] == pytest.approx(errors[1], rel=1e-6)


@pytest.mark.parametrize(("kills", "values"), [(2, FEW), pytest.param(10, MANY, marks=pytest.mark.slow)])
def test_no_trial_is_lost_or_done_twice(sdof, tmp_path, kills, values):
    place = described(sdof, tmp_path, values)
    moments, killed, known = random.Random(kills), 0, {}
    while killed < kills:
        process = start(place, "study")
        target = len(known) + moments.randint(0, 2 * values // (3 * kills))
        deadline = time.monotonic() + 100
        while len(ended(place)) < target and process.poll() is None and time.monotonic() < deadline:
            time.sleep(0.02)
        time.sleep(moments.uniform(0.0, 0.3))
        process.kill()
        said = process.communicate()[1].decode()
        assert process.returncode in (0, -signal.SIGKILL), said
        killed += process.returncode == -signal.SIGKILL
        now = ended(place)
        assert {number: now[number] for number in known} == known  # no answer is lost, and none comes anew
        known = now
        if process.returncode == 0:
            break
    assert killed == kills
    last = [start(place, "study") for _ in range(2)]  # two at once finish what is left
    for process in last:
        said = process.communicate()[1].decode()
        assert process.returncode == 0, said
    now = ended(place)
    assert {number: now[number] for number in known} == known
    kinds = [trial["kind"] for trial in trials(place)]
    assert kinds[: values + 4] == ["described", *["sweep"] * (values + 3)]
    assert kinds.count("together") <= 1
    assert kinds.count("test") == 1
    assert all(trial["state"] == "done" for trial in trials(place))
    assert sum(int(str(trial["claims"])) for trial in trials(place)) <= len(kinds) + kills
    assert sorted(path.name for path in (place / "study").iterdir() if path.name.startswith(".")) == []
    left = [path.name for path in (place / "study" / "work").iterdir() if path.name.startswith(".")]
    assert left == []
    if kills > 2:
        assert_same_as_undisturbed(place)
