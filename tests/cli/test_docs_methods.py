"""The commands of the pages on methods and on what a measurement can identify, as a reader types them.

The pages name the reference assembly and a measurement of it. Here these names stand for the same ones made small:
every 25th line, and eight of the twelve parameters known. The commands are those of the page but for the numbers in
`SMALLER`.
"""

from __future__ import annotations

import json
import re
import shlex
from dataclasses import replace
from pathlib import Path

import pytest
import yaml
from typer.testing import CliRunner

import dovetail
from dovetail.cli.app import app

ROOT = Path(__file__).resolve().parents[2]
MEASURED = "h0_j_t0_60Nm"
UNKNOWN = ("Dc", "mn1", "kt_tc", "kr_tc")
EVERY = 25
"""Lines of which one is kept."""
SMALLER = {"--cases": "1", "--starts": "4"}


def commands(page):
    blocks = re.findall(r"```bash\n(.*?)```", (ROOT / "docs" / page).read_text(encoding="utf-8"), flags=re.S)
    lines = [line for block in blocks for line in block.replace("\\\n", " ").splitlines()]
    return [shlex.split(line)[1:] for line in lines if line.startswith("dovetail ")]


def without_those_that_others_hold(found):
    """Leave out a command of which another of the page has all words but numbers, and more."""

    def kinds(words):
        return {word for word in words if word.startswith("--") or not re.search(r"\d|/", word)}

    return [
        words
        for at, words in enumerate(found)
        if not any(
            kinds(words) < kinds(other) or (kinds(words) == kinds(other) and at < other_at)
            for other_at, other in enumerate(found)
            if other_at != at
        )
    ]


@pytest.fixture
def small(tmp_path):
    """Write a smaller assembly and measurement under the names that the pages use."""
    there, here = ROOT / "assemblies", tmp_path / "assemblies"
    (here / "measurements").mkdir(parents=True)
    truth = f"measurements/{MEASURED}.truth.json"
    reported = json.loads((there / truth).read_text())
    known = reported["parameters"]
    fixed = {name: {"value": value} for name, value in known.items() if name not in UNKNOWN}
    description = {
        "extends": str(there / "bt40_er32.yaml"),
        "name": "small",
        "frequency": {"start": "100 Hz", "stop": "9000 Hz", "step": f"{2 * EVERY} Hz"},
        "joints": {"collet": {"parameters": fixed}},
    }
    (here / "bt40_er32.yaml").write_text(yaml.safe_dump(description))
    (here / truth).write_text(json.dumps({**reported, "parameters": {name: known[name] for name in UNKNOWN}}))
    frf = dovetail.read_frf(there / f"measurements/{MEASURED}.uff")
    fewer = {"frequency": frf.frequency[::EVERY], "values": frf.values[::EVERY]}
    if frf.coherence is not None:
        fewer["coherence"] = frf.coherence[::EVERY]
    dovetail.write_frf(replace(frf, **fewer), here / f"measurements/{MEASURED}.uff")


@pytest.mark.usefixtures("small", "few_mode_searches")
@pytest.mark.parametrize("page", ["identification.md", "uncertainty.md"])
def test_each_command_runs(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    found = commands(page)
    assert len(found) >= 2
    for words in without_those_that_others_hold(found):
        placed = [SMALLER.get(option, word) for option, word in zip(["", *words], words, strict=False)]
        done = CliRunner().invoke(app, placed)
        assert done.exit_code == 0, done.output
    written = {file.name for file in (tmp_path / "results").iterdir()}
    assert {"report.html", "result.json"} <= written
