"""Mistakes of a first-time user: one error with the place, what was found and what to do; nothing is written."""

from __future__ import annotations

import numpy as np
import pytest

import dovetail

DESCRIPTION = "Accepted: a description (YAML); measured files come after it"
SDOF, SERIES = "assemblies/sdof.yaml", "assemblies/series/torques.yaml"
MISTAKES = {
    "misspelt file": (("plot", "mesured.csv"), "mesured.csv\n  there is no such file.\n  Did you mean 'measured.csv'?"),
    "another folder": (("check", "assembly/sdof.yaml"), "There is no folder 'assembly' in '"),
    "misspelt description": (("check", "assemblies/sdoff.yaml"), "Did you mean 'assemblies/sdof.yaml'?"),
    "folder as description": (("check", "folder"), f"folder\n  this is a folder.\n  {DESCRIPTION}"),
    "measurement as description": (("check", "measured.csv"), DESCRIPTION),
    "archive as description": (("check", "measured.npz"), f"is not UTF-8.\n  {DESCRIPTION}"),
    "exchanged": (("identify", "measured.csv", SDOF), DESCRIPTION),
    "description as measurement": (("plot", SDOF), "A description comes before the measured files."),
    "assembly as series": (
        ("identify-series", SDOF),
        ":1\n  this describes an assembly, and a series of tests is needed here.\n"
        "  Accepted: a file that begins with 'dovetail_series: 1'",
    ),
    "series as assembly": (("check", SERIES), "this describes a series of tests, and an assembly is needed here."),
    "number of an FRF": (("plot", "measured.csv", "--index", "2"), "--index 2 chooses one of several FRFs"),
    "measurement as result": (
        ("predict", SDOF, "measured.csv"),
        "measured.csv\n  this is not the result of an identification.\n  Accepted: the result.json of identify",
    ),
    "other JSON as result": (("predict", SDOF, "other.json"), "this is not the result of an identification."),
    "folder as network": (("identify", "folder", "measured.csv"), "Accepted: a folder that 'dovetail train' wrote"),
    "signals as FRF": (("plot", "signals.csv"), "'dovetail frf' estimates an FRF from signals over time."),
    "FRF as signals": (("frf", "measured.csv", "-o", "new.csv"), "that of an FRF: the file has no signals"),
    "command as model": (("describe", "identify"), "'identify' is a command, not a model.\n"),
    "file as folder": (("examples", "sdof", "-o", "other.json"), "other.json\n  this is a file, not a folder."),
    "folder in a file": (
        ("examples", "sdof", "-o", "other.json/new"),
        "Check the permissions and the free space there",
    ),
    "description in a file": (("new-assembly", "other.json/new.yaml"), "nothing can be written here: Not a directory."),
    "dataset that is there": (
        ("generate", SDOF, "-o", "folder", "--samples", "2"),
        "an interrupted dataset with --resume",
    ),
}


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    dovetail.examples.copy("all", "assemblies")
    frf = dovetail.load(SDOF).simulate([2e6, 40.0])
    for name in ("measured.csv", "measured.npz"):
        dovetail.write_frf(frf, name)
    time = np.arange(500) / 5000.0
    signals = np.stack([time, np.exp(-(((time - 0.01) / 1e-3) ** 2)), np.exp(-40 * time) * np.sin(1000 * time)], axis=1)
    np.savetxt("signals.csv", signals, delimiter=",", header="time_s,force_N,response_g", comments="")
    (tmp_path / "other.json").write_text('{"a": 1}')
    (tmp_path / "folder").mkdir()
    return tmp_path


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_usual_mistake_is_one_error_that_says_what_to_do(run, folder, mistake):
    words, expected = MISTAKES[mistake]
    before = sorted(folder.rglob("*"))
    said = run(*words, code=1).stderr
    assert expected in said
    assert len([line for line in said.splitlines() if not line.startswith((" ", "Read "))]) == 1
    assert sorted(folder.rglob("*")) == before


def test_an_frf_without_force_at_some_lines_is_refused_with_the_lines(run, folder):
    table = np.loadtxt("signals.csv", delimiter=",", skiprows=1)
    table[:, 1] = 1.0
    np.savetxt("constant.csv", table, delimiter=",", header="time_s,force_N,response_g", comments="")
    said = run("frf", "constant.csv", "-o", "new.csv", code=1).stderr
    assert "constant.csv\n  at " in said
    assert "There is no FRF there.\n  Check the channels.\n" in said


@pytest.mark.parametrize("words", [("new-assembly",), ("schema", "-o"), ("simulate", SDOF, "-o")])
def test_a_folder_that_is_missing_is_made(run, folder, words):
    file = folder / "new" / {"new-assembly": "a.yaml", "schema": "a.json", "simulate": "a.csv"}[words[0]]
    run(*words, file)
    assert file.stat().st_size
