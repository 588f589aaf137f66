"""What is shown on a terminal, and what is left out in a pipe."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from dovetail.cli.app import app
from support.waiting import PATIENCE, wait_until

CONTROL = re.compile(r"[\x00-\x09\x0b-\x1f\x7f]")


def test_a_pipe_gets_results_without_control_characters(capfd, bench, tmp_path):
    words = "identify", bench.description, bench.measured, "--method", "network", "-o", tmp_path / "results"
    capfd.readouterr()
    assert app([str(word) for word in words], standalone_mode=False) in (None, 0)
    printed, said = capfd.readouterr()
    assert "parameter" in printed
    assert not CONTROL.search(printed)
    assert said == (
        "Training a network for 'small' on 200 simulated FRFs; it is kept for the next time.\n"
        f"Written to {tmp_path / 'results'}: frf.csv, frf.png, parameters.csv, report.html, result.json, SHA256SUMS\n"
    )


@pytest.mark.skipif(sys.platform == "win32", reason="pseudo-terminals are of POSIX")
def test_a_terminal_shows_a_bar_the_stage_and_the_remaining_time(command, on_a_terminal, bench, tmp_path):
    shown = on_a_terminal(command, "train", bench.description, "-o", tmp_path / "model")
    assert shown.code == 0, shown.written
    plain = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", shown.written)
    final = plain[plain.rindex("generate") : plain.index("small: errors on 40 test samples")]
    stages = [line.split() for line in final.replace("\r", "").splitlines() if line.strip()]
    assert [stage[0] for stage in stages][:3] == ["generate", "features", "reducer"]
    assert [stage[0] for stage in stages][-2:] == ["evaluation", "novelty"]
    assert len(stages) == 7
    assert stages[0][2] == "200/200"
    assert all(any(re.fullmatch(r"\d\d:\d\d", word) for word in stage[2:4]) for stage in stages)
    assert "validation loss" in final
    assert max(len(line) for line in final.replace("\r", "").splitlines()) <= 80


ENDLESS = """
import time
from pathlib import Path
import dovetail


class Endless(dovetail.Regressor):
    name = "endless"
    summary = "A regressor that is never done"

    def fit(self, features, targets, *, seed, progress=dovetail.silent):
        Path(__file__).with_name("begun").touch()
        while True:
            time.sleep(0.01)

    def restore(self, state):
        raise NotImplementedError


@dovetail.hookimpl
def dovetail_components():
    return [Endless]
"""


@pytest.mark.skipif(sys.platform == "win32", reason="signals are of POSIX")
def test_ctrl_c_in_training_ends_without_a_traceback(interruptible, bench, tmp_path):
    plugin, description = tmp_path / "endless.py", tmp_path / "endless.yaml"
    plugin.write_text(ENDLESS)
    small = bench.description.read_text()
    description.write_text(small[: small.index("  regressor:")] + "  regressor: {model: endless}\n")
    process = interruptible("identify", description, bench.measured, "--method", "network", "--plugin", plugin)
    wait_until((tmp_path / "begun").exists, process)
    process.send_signal(signal.SIGINT)
    printed, said = process.communicate(timeout=PATIENCE)
    assert process.returncode == 130
    assert printed == ""
    assert said.splitlines()[1:] == ["", "Interrupted."]
    assert not [file for file in (tmp_path / "cache").rglob("*") if file.is_file()]


def test_a_pipe_that_closes_early_is_not_an_error(command, environment):
    reader, writer = os.pipe()
    os.close(reader)
    done = subprocess.run(
        [command, "describe", "collet"],
        stdout=writer,
        stderr=subprocess.PIPE,
        text=True,
        env=environment,
        timeout=PATIENCE,
    )
    os.close(writer)
    assert done.stderr == ""
    assert done.returncode == 1


def test_a_stage_that_ends_early_is_shown_as_done():
    from dovetail.progress_bars import StageBars

    with StageBars() as bars:
        bars("regressor", 30, 200, "validation loss 0.1")
        bars("evaluation", 1, 4)
        assert [task.finished for task in bars._bars.tasks] == [True, False]
    assert [task.finished for task in bars._bars.tasks] == [True, True]


INTERRUPTED = """
import sys
class Interruption:
    def find_spec(name, *_):
        if name == sys.argv[1]:
            raise KeyboardInterrupt
sys.meta_path.insert(0, Interruption)
import runpy
runpy.run_module("dovetail", run_name="__main__")
"""


@pytest.mark.parametrize("module", ["dovetail.cli", "typer", "dovetail.cli.command_group"])
def test_ctrl_c_during_the_imports_ends_without_a_traceback(module):
    done = subprocess.run([sys.executable, "-c", INTERRUPTED, module], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "\nInterrupted.\n")


def test_the_installed_command_is_the_one_that_answers_ctrl_c():
    settings = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text(encoding="utf-8"))
    assert settings["project"]["scripts"] == {"dovetail": "dovetail.__main__:main"}
