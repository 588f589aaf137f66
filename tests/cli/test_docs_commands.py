"""Pages of commands and scripts, run from top to bottom as a reader would."""

from __future__ import annotations

import csv
import re
import shutil
from collections.abc import Callable, Mapping
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
BLOCK = re.compile(r"^```(bash|yaml|python)\n(.*?)^```", flags=re.S | re.M)


def run_page(page: str, folder: Path, type_line: Callable[[str], None], smaller: Mapping[str, str]) -> int:
    """Run the commands and scripts of a page from top to bottom, and return how many there were."""
    shutil.copytree(ROOT / "assemblies", folder / "assemblies")
    described = folder / "assemblies" / "sdof.yaml"
    described.write_text(_replaced(described.read_text(encoding="utf-8"), smaller), encoding="utf-8")
    commands: list[str] = []
    for language, text in BLOCK.findall((ROOT / "docs" / page).read_text(encoding="utf-8")):
        if language == "bash":
            commands += text.strip().splitlines()
            continue
        name = re.match(r"# (\S+)\n", text)[1]
        (folder / name).write_text(_replaced(text, smaller), encoding="utf-8")
        if language == "python":
            commands.append(f"python {name}")
    for command in commands:
        type_line(_replaced(command, smaller))
    return len(commands)


def _replaced(text: str, smaller: Mapping[str, str]) -> str:
    for size, small in smaller.items():
        text = text.replace(size, small)
    return text


def test_the_first_look_runs_from_top_to_bottom(tmp_path, type_line):
    assert run_page("first_look.md", tmp_path, type_line, {}) >= 10
    made = {"frf.csv", "frf.png", "measured.uff", "small.zarr", "small_model", "predicted.csv"}
    assert made <= {path.name for path in tmp_path.iterdir()}
    assert {"report.html", "result.json", "parameters.csv"} <= {p.name for p in (tmp_path / "results").iterdir()}
    assert {"robustness.csv", "robustness.png"} <= {p.name for p in (tmp_path / "robustness").iterdir()}


SMALLER = {
    "(20, 2)": "(2, 2)",
    "samples=2000": "samples=200",
    "--samples 2000": "--samples 200",
    "model: umap, n_components: 20, metric: euclidean": "model: pca, n_components: 20",
    "hidden: [512, 256]": "hidden: [64, 32], max_epochs: 50",
}


@pytest.mark.parametrize(("measurements", "smaller"), [(2, SMALLER), pytest.param(20, {}, marks=pytest.mark.slow)])
def test_the_script_and_the_commands_of_the_page_on_python(tmp_path, type_line, measurements, smaller):
    """By default with fewer measurements and samples, and a network that learns sooner."""
    assert run_page("python.md", tmp_path, type_line, smaller) == 8
    text = (ROOT / "docs" / "python.md").read_text(encoding="utf-8")
    (script,) = re.findall(r"^```python\n(.*?)^```", text, flags=re.S | re.M)
    assert len(script.splitlines()) <= 45
    assert len(list((tmp_path / "measured").iterdir())) == measurements
    with (tmp_path / "results_by_command" / "parameters.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    for row in rows:
        truth = float(row["measurement"][len("joint_")]) * 1e6 if row["name"] == "k" else 40.0
        assert float(row["estimate"]) == pytest.approx(truth, rel=0.05)
        assert row["network"]
    assert len(rows) == 6
