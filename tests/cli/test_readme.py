"""The README's example description and script, taken from the page and used as the page says."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest

import dovetail

ROOT = Path(__file__).resolve().parents[2]


def test_the_example_description_is_checked_and_simulated(run, tmp_path):
    text = re.search(r"```yaml\n(.*?)```", (ROOT / "README.md").read_text(encoding="utf-8"), flags=re.S)[1]
    shutil.copy(ROOT / "assemblies" / "bt40_er32.yaml", tmp_path)
    description = tmp_path / "my_assembly.yaml"
    description.write_text(text, encoding="utf-8")
    checked = run("check", description).stdout
    assert "0 to 120 by 10" in checked
    assert re.search(r"collet\.mn1|mn1 +0\.08 kg", checked)
    run("simulate", description, "--set", "Dc=30mm", "-o", tmp_path / "frf.csv")
    assert (tmp_path / "frf.csv").read_text().count("\n") > 4451


@pytest.mark.parametrize("page", ["README.md", "docs/index.md"])
def test_the_ten_lines_of_python_run(page, tmp_path, monkeypatch, capsys):
    script = re.search(r"```python\n(.*?)```", (ROOT / page).read_text(encoding="utf-8"), flags=re.S)[1]
    assert len(script.splitlines()) <= 10
    shutil.copytree(ROOT / "assemblies", tmp_path / "assemblies")
    monkeypatch.chdir(tmp_path)
    frf = dovetail.load("assemblies/sdof.yaml").simulate({"k": 2.5e6, "c": 40.0})
    dovetail.write_frf(dovetail.noisy_frf(frf, 0.01, 0), re.search(r'"(measured\.\w+)"', script)[1])
    exec(compile(script, page, "exec"), {})
    assert capsys.readouterr().out.count("identified") == 2
    assert (tmp_path / "report.html").exists()
