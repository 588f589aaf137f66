"""`dovetail identify` from a table of natural frequencies and damping ratios."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import pytest

import dovetail

OSCILLATOR = Path(__file__).resolve().parents[2] / "assemblies" / "oscillator.yaml"
TABLE = "frequency_Hz,damping_percent,frequency_sd_Hz,damping_sd_percent\n212.1,0.31,0.02,0.02\n"


@pytest.fixture
def modes(tmp_path: Path) -> Path:
    (tmp_path / "modes.csv").write_text(TABLE)
    return tmp_path / "modes.csv"


def test_undetermined_parameters_are_reported_with_table_and_modes(run, modes, tmp_path, monkeypatch):
    monkeypatch.setenv("COLUMNS", "160")
    answer = run("identify", OSCILLATOR, modes, "--form", "laplace", "-o", tmp_path / "result").output
    rows = {line.split()[0]: line for line in reversed(answer.splitlines()) if line.split()}
    assert "1.776" in rows["k"]
    assert "identified" in rows["k"]
    assert "response.gain: not identifiable. The measurement hardly depends on it." in answer
    assert rows["212.1"].split()[:4] == ["212.1", "0.310", "212.1", "0.310"]
    names = sorted(file.name for file in (tmp_path / "result").iterdir())
    assert names == ["SHA256SUMS", "modes.csv", "parameters.csv", "report.html", "result.json"]
    stored = json.loads((tmp_path / "result" / "result.json").read_text())
    assert (stored["method"], stored["is_trustworthy"]) == ("posterior", True)
    assert [row["name"] for row in stored["table"]] == ["k", "c", "response.gain", "response.delay"]
    header, row = (tmp_path / "result" / "modes.csv").read_text().splitlines()
    assert header == "natural_frequency,damping_ratio,measured_frequency,measured_damping"
    assert float(row.split(",")[2]) == 212.1


def test_the_truth_of_a_tied_parameter_is_in_the_table_that_is_written(run, modes, tmp_path):
    text = OSCILLATOR.read_text().replace("c: {range: [0.01 N s/m, 100 N s/m], scale: log}", "c: {value: 8.26}")
    mount = text[text.index("  mount:") : text.index("response:")]
    tied = mount.replace("  mount:", "  second:").replace(
        "{range: [2e5 N/m, 2e7 N/m], scale: log}", "{same_as: mount.k}"
    )
    (tmp_path / "two.yaml").write_text(text.replace(mount, mount + tied))
    options = ("--form", "laplace", "--truth", tmp_path / "truth.json", "-o", tmp_path / "result")
    for given, expected in (
        ('"mount.k": 8.88e5', ("888000.0", "888000.0")),
        ('"second.k": "888 kN/m"', ("", "888000.0")),
        ('"mount.k": 8.88e5, "second.k": 9e5', ("888000.0", "900000.0")),
    ):
        (tmp_path / "truth.json").write_text(f'{{"parameters": {{{given}}}}}')
        run("identify", tmp_path / "two.yaml", modes, *options)
        with (tmp_path / "result" / "parameters.csv").open() as stream:
            truths = {row["name"]: row["truth"] for row in csv.DictReader(stream)}
        assert (truths["mount.k"], truths["second.k"]) == expected


def test_a_written_result_is_read_back_and_used_for_prediction(run, modes, tmp_path):
    run("identify", OSCILLATOR, modes, "--form", "laplace", "-o", tmp_path / "result")
    written = json.loads((tmp_path / "result" / "result.json").read_text())
    result = dovetail.load_result(tmp_path / "result")
    again = json.loads(json.dumps(result.to_dict()))
    for name in ("known", "measured", "modes", "parameters", "adequacy", "warnings", "provenance"):
        assert again[name] == written[name]
    for row, before in zip(again["table"], written["table"], strict=True):
        assert row["estimate"] == pytest.approx(before["estimate"])
        assert row["verdict"] == before["verdict"]
    assert "predicted with the joint identified from" in run("predict", OSCILLATOR, tmp_path / "result").output
    broken = {**written, "measured": {**written["measured"], "frequency": [-1.0]}}
    (tmp_path / "result" / "result.json").write_text(json.dumps(broken))
    assert "frequency" in run("predict", OSCILLATOR, tmp_path / "result", code=1).stderr


def test_a_table_that_the_model_does_not_fit_exits_with_code_three(run, modes):
    modes.write_text(TABLE.replace("212.1", "21.21"))
    output = run("identify", OSCILLATOR, modes, "--form", "laplace", "--json", code=3).output
    assert '"is_trustworthy": false' in output


def test_options_for_frfs_are_refused_with_a_table_of_modes(run, modes):
    for option in (("--weights", "coherence"), ("--amplitude-only",), ("--network",), ("--index", "1")):
        assert "takes no option of an FRF" in run("identify", OSCILLATOR, modes, *option, code=2).output


def test_a_wrong_unit_is_one_error(run, modes):
    modes.write_text("frequency [rpm],zeta\n212.1,0.31\n")
    assert "the unit of 'frequency' is 'rpm'" in run("identify", OSCILLATOR, modes, code=1).output


def test_a_table_of_modes_is_divided_among_no_workers(run, modes):
    done = run("identify", OSCILLATOR, modes, "--scheduler", "tcp://nowhere:1", code=2)
    assert "a table of modal parameters takes no option of an FRF" in " ".join(done.output.split())
