"""``-q`` and ``-v``, before and after the command's name; ``--json`` wherever a table is printed."""

from __future__ import annotations

import inspect
import json
import logging
import subprocess
import sys

import pytest

import dovetail
from dovetail.cli.command_group import OWN
from dovetail.registry import CommandTable


@pytest.fixture(scope="module")
def simulate(run, assemblies):
    def simulated(folder, *words, before=(), code=0):
        return run(*before, "simulate", assemblies / "sdof.yaml", "-o", folder / "frf.csv", *words, code=code)

    return simulated


@pytest.mark.parametrize("place", ["before", "behind"])
def test_quiet_suppresses_notes_but_not_results_or_errors(simulate, tmp_path, place):
    assert "Written" in simulate(tmp_path).stderr
    words = {"before": ["-q"]} if place == "before" else {}
    behind = [] if place == "before" else ["--quiet"]
    quiet = simulate(tmp_path, "--overwrite", *behind, **words)
    assert quiet.stderr == ""
    assert quiet.stdout == simulate(tmp_path, "--overwrite").stdout != ""
    assert "a file of this name already exists" in simulate(tmp_path, *behind, **words, code=1).stderr


@pytest.mark.parametrize(
    ("before", "behind", "level"),
    [([], [], 0), (["-v"], [], 1), ([], ["--verbose"], 1), (["-vv"], [], 2), (["-v"], ["-v"], 2)],
)
def test_verbose_prints_each_step(simulate, tmp_path, before, behind, level):
    said = simulate(tmp_path, *behind, before=before).stderr
    assert ("sdof.yaml read: " in said) == (level >= 1)
    assert ("sdof.yaml read ..." in said) == (level == 2)
    assert "Written" in said
    assert logging.getLogger("dovetail").level == [logging.NOTSET, logging.INFO, logging.DEBUG][level]


def test_each_command_line_begins_anew(simulate, tmp_path):
    simulate(tmp_path, before=["-q", "-vv"])
    assert simulate(tmp_path, "--overwrite").stderr.startswith("Written")


def test_python_m_dovetail_prints_its_version():
    done = subprocess.run([sys.executable, "-m", "dovetail", "--version"], capture_output=True, text=True, check=True)
    assert done.stdout == f"dovetail {dovetail.__version__}\n"


def test_every_command_that_prints_a_table_prints_json_too():
    commands = [offer.command.load() for offer in CommandTable(OWN).offers.values()]
    with_table = [c for c in commands if "    table(" in inspect.getsource(inspect.getmodule(c))]
    assert {"identify", "plot", "check", "plan"} <= {command.__name__ for command in with_table}
    assert [c.__name__ for c in with_table if "as_json" not in inspect.signature(c).parameters] == []


def test_plot_prints_what_it_read_as_json(run, assemblies):
    (found,) = json.loads(run("plot", assemblies / "measurements" / "hammer_test.uff", "--json").stdout)
    peaks, coherence = found.pop("resonances_Hz"), found.pop("mean_coherence")
    assert found == {
        "measurement": "hammer_test.uff",
        "quantity": "accelerance",
        "has_phase": True,
        "lines": 1000,
        "band_Hz": [1.0, 1000.0],
        "averages": 3,
    }
    assert len(peaks) == 8  # the table ends with the sixth
    assert peaks == pytest.approx([19.7, 98.6, 163.3, 242.0, 446.0, 557.2, 730.9, 871.9], abs=0.1)
    assert coherence == pytest.approx(0.989, abs=1e-3)
