from __future__ import annotations

import csv
import json
import re

import pytest

PARTS = "campaign/cases/parts.yaml"


def test_the_parts_of_the_campaign_are_validated(run, assemblies, tmp_path):
    folder = tmp_path / "parts"
    printed = run("validate", assemblies / PARTS, "--method", "network", "-o", folder).stdout
    assert [line.split()[0] for line in printed.splitlines()[3:] if line[0] != " "] == ["T0", "T1", "T2", "T3", "H0"]
    found = json.loads((folder / "validation.json").read_text())
    errors = [peak["error"] for case in found["cases"] for peak in case["peaks"]]
    assert len(errors) == 6
    assert max(map(abs, errors)) < 0.2
    with (folder / "validation.csv").open() as stream:
        table = list(csv.DictReader(stream))
    assert [float(row["error_percent"]) for row in table] == errors
    assert (folder / "frfs.png").read_bytes().startswith(b"\x89PNG")
    assert not (folder / "series.png").exists()
    page = (folder / "validation.html").read_text(encoding="utf-8")
    assert "6 resonances are predicted within" in page
    data = [json.loads(text) for text in re.findall(r'json" id="chart-\d">(.*?)</script>', page)]
    assert [chart["title"] for chart in data] == [f"FRFs of {name}" for name in ("T0", "T1", "T2", "T3", "H0")]
    assert [curve["label"] for curve in data[0]["curves"]] == ["compensated", "as measured", "predicted"]
    assert "src=" not in page


def test_a_joint_is_identified_with_the_network_that_is_kept(run, bench, tmp_path):
    (tmp_path / "cases.yaml").write_text(f"""\
dovetail_series: 1
covariates: {{number: 1}}
tests:
  one:
    assembly: {bench.description}
    measured: {bench.measured}
    joint: {{assembly: {bench.description}, measured: {bench.measured}}}
    at: {{number: 1}}
""")
    arguments = ["validate", tmp_path / "cases.yaml", "--method", "network", "--json", "-o", tmp_path / "out"]
    first = run(*arguments)
    (case,) = json.loads(first.stdout)["cases"]
    assert case["method"] == "network"
    assert set(case["joint"]) == {"k", "c"}
    assert "Training a network" in first.stderr
    assert "Using the model trained before" in run(*arguments).stderr
    assert (tmp_path / "out" / "series.png").exists()


@pytest.mark.parametrize(
    ("arguments", "code", "found"),
    [
        (["--method", "refind"], 2, "'refind' is not a method."),
        (["-o", "."], 0, ""),
    ],
)
def test_wrong_options_are_refused(run, assemblies, tmp_path, monkeypatch, arguments, code, found):
    monkeypatch.chdir(tmp_path)
    method = [] if "--method" in arguments else ["--method", "network"]
    assert found in run("validate", assemblies / PARTS, *method, *arguments, code=code).stderr


def test_a_broken_file_of_cases_is_one_block(run, tmp_path):
    file = tmp_path / "cases.yaml"
    file.write_text("dovetail_series: 1\ntests: {a: {assembly: x.yaml}}\n")
    failed = run("validate", file, "--method", "network", code=1)
    assert "test 'a' lacks 'measured'." in failed.stderr
    assert "Traceback" not in failed.output
