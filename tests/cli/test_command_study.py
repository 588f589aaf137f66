"""`dovetail study`: tables, figures, and the best settings as a description."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import pytest

import dovetail
from support.packages import skip_module_without

skip_module_without("optuna")
ASSEMBLY = Path(__file__).resolve().parents[2] / "assemblies" / "sdof.yaml"
STUDY = f"""\
extends: {ASSEMBLY}
identification:
  samples: 100
  reducer: {{model: pca, n_components: 2}}
  regressor: {{model: sklearn, estimator: KernelRidge, options: {{kernel: rbf, alpha: 100}}}}
study:
  sweeps:
    reducer: [{{model: none}}, {{model: pca}}]
    reducer.n_components: [2, 6]
    regressor.options.alpha: [0.0001, 100, 1]
"""


@pytest.fixture
def description(tmp_path) -> Path:
    (tmp_path / "study.yaml").write_text(STUDY)
    return tmp_path / "study.yaml"


def test_a_study_writes_tables_figures_and_the_best_description(run, description, tmp_path):
    done = run("study", description, "-o", tmp_path / "out")
    out = tmp_path / "out"
    files = {"study.json", "study.md", "trials.csv", "best.yaml", "sweeps.png", "work"}
    assert {file.name for file in out.iterdir()} == files
    assert "On the test part, 20 FRFs which took no part in the choice" in done.stdout
    stored = json.loads((out / "study.json").read_text())
    rows = list(csv.DictReader((out / "trials.csv").open()))
    assert [row["kind"] for row in rows] == [trial["kind"] for trial in stored["trials"]]
    least = min(float(row["mae"]) for row in rows[:-1] if row["mae"])
    best = stored["trials"][stored["best"]]
    assert best["answer"]["mae"] == pytest.approx(least)
    page = (out / "study.md").read_text()
    assert "| regressor.options.alpha | 0.0001, 100, 1 |" in page
    settings = dovetail.load(out / "best.yaml").description.identification
    assert settings.regressor.config.options["alpha"] == best["changes"].get("regressor.options.alpha", 100)
    assert (out / "sweeps.png").read_bytes().startswith(b"\x89PNG")
    again = json.loads(run("study", description, "-o", out, "--json").stdout)
    assert again == stored


def test_a_description_without_a_study_and_an_output_that_is_a_file_are_refused(run, description, tmp_path):
    assert "the description has no study" in run("study", ASSEMBLY, "-o", tmp_path / "new", code=1).stderr
    (tmp_path / "file").write_text("mine")
    assert "this is a file" in run("study", description, "-o", tmp_path / "file", code=1).stderr
    assert "--output" in run("study", description, code=2).stderr
