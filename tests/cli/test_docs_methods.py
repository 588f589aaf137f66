"""The commands of the pages on methods and on what a measurement tells, as a reader types them."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest
from typer.testing import CliRunner

from dovetail.cli import app

ROOT = Path(__file__).resolve().parents[2]


def commands(page):
    blocks = re.findall(r"```bash\n(.*?)```", (ROOT / "docs" / page).read_text(encoding="utf-8"), flags=re.S)
    return [shlex.split(line)[1:] for block in blocks for line in block.splitlines() if line.startswith("dovetail ")]


@pytest.mark.parametrize("page", ["identification.md", "uncertainty.md"])
def test_each_command_runs(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    found = commands(page)
    assert len(found) >= 2
    for words in found:
        if "--cases" in words:  # as many take a quarter of an hour
            words[words.index("--cases") + 1] = "1"
        placed = [str(ROOT / word) if word.startswith("assemblies/") else word for word in words]
        done = CliRunner().invoke(app, placed)
        assert done.exit_code == 0, done.output
    written = {file.name for file in (tmp_path / "results").iterdir()}
    assert {"report.html", "result.json"} <= written
