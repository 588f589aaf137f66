from __future__ import annotations

import csv
import json

import pytest


def test_robustness_writes_all_files_and_prints_the_table(run, bench, tmp_path):
    folder = tmp_path / "study"
    arguments = ["robustness", bench.description, "--models", "none, pca", "--levels", "0,0.2", "-o", folder]
    printed = run(*arguments).stdout
    rows = [line.split() for line in printed.splitlines()][3:]
    assert [row[:2] for row in rows] == [["none", "0"], ["none", "0.2"], ["pca", "0"], ["pca", "0.2"]]
    found = json.loads((folder / "robustness.json").read_text())
    with (folder / "robustness.csv").open() as stream:
        table = list(csv.DictReader(stream))
    assert [row[2] for row in rows] == [f"{entry['r2']:.3f}" for entry in found]
    assert [float(row["r2"]) for row in table] == [entry["r2"] for entry in found]
    assert float(table[1]["rmse"]) > float(table[0]["rmse"])
    assert (folder / "robustness.png").read_bytes().startswith(b"\x89PNG")


def test_robustness_uses_a_given_dataset_and_prints_json(run, bench, tmp_path):
    data = tmp_path / "data.zarr"
    run("generate", bench.description, "-o", data, "--samples", 40)
    arguments = ["robustness", bench.description, "--data", data, "--models", "none", "--levels", "10%", "--json"]
    (row,) = json.loads(run(*arguments).stdout)
    assert (row["model"], row["level"]) == ("none", 0.1)


@pytest.mark.parametrize(
    ("arguments", "code", "found"),
    [
        (["--models", "umpa"], 1, "Did you mean 'umap'?"),
        (["--levels", "0,a"], 2, "'a' is not a number"),
        (["--levels", "-0.1"], 2, "'-0.1' is not 0 or more"),
        (["--levels", "nan"], 2, "'nan' is not 0 or more"),
    ],
)
def test_wrong_options_are_refused_before_any_work(run, bench, monkeypatch, arguments, code, found):
    import dovetail

    monkeypatch.setattr(dovetail, "generate", lambda *_, **__: pytest.fail("it generated"))
    assert found in run("robustness", bench.description, *arguments, code=code).stderr
