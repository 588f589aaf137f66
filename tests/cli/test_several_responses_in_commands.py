"""Commands with a description of several responses, as a user types them."""

from __future__ import annotations

import json

import numpy as np
import pytest

import dovetail

FEW = """\
extends: {parent}
frequency: {{start: 200 Hz, stop: 9000 Hz, lines: 600}}
joints: {{collet: {{parameters: {known}}}}}
"""
KNOWN = {
    "Dc": "35 mm", "dc": "13 mm", "mn1": "60 g", "mn2": "80 g", "kr_tc": 1.8e4, "cr_tc": 1.0, "kr_hc": 5e5,
    "cr_hc": 1.5, "ct_hc": 400, "ct_tc": 300,
}  # fmt: skip


@pytest.fixture
def two(assemblies, tmp_path):
    """Only kt_tc and kt_hc are unknown."""
    file = tmp_path / "two.yaml"
    known = json.dumps({name: {"value": value} for name, value in KNOWN.items()})
    file.write_text(FEW.format(parent=assemblies / "bt40_er32_two_points.yaml", known=known))
    return file


@pytest.fixture
def measured(run, two, tmp_path):
    files = [tmp_path / "tip.uff", tmp_path / "middle.uff"]
    for number, file in enumerate(files, start=1):
        run("simulate", two, "--set", "kt_tc=5e8", "--set", "kt_hc=2e9", "--point", number, "-o", file)
    return files


def test_check_shows_every_response(run, two):
    printed = run("check", two).stdout
    assert "Response   accelerance at tool, 0 mm, direction x\n           accelerance at tool, 60 mm" in printed
    summary = json.loads(run("check", two, "--json").stdout)
    assert [one["position"] for one in (summary["response"], *summary["further_responses"])] == pytest.approx(
        [0.0, 0.06]
    )


def test_identify_takes_a_file_for_each_response(run, two, measured, tmp_path):
    folder = tmp_path / "results"
    done = run("identify", two, *measured, "--method", "refined", "-o", folder)
    assert "joint identified from tip.uff, middle.uff" in done.stdout.replace("\n", " ")
    assert "FRF at tool, 0 mm: 1.000" in done.stdout
    assert "FRF at tool, 60 mm: 1.000" in done.stdout
    assert done.stderr.endswith("frf_2.png, parameters.csv, report.html, result.json, SHA256SUMS\n")
    assert (folder / "frf_2.png").stat().st_size > 1000
    result = json.loads((folder / "result.json").read_text())
    assert result["parameters"]["kt_tc"]["value"] == pytest.approx(5e8, rel=1e-4)
    (further,) = result["further_responses"]
    assert further["point"] == "tool, 60 mm"
    second = dovetail.read_frf(measured[1])
    table = np.loadtxt(folder / "frf_2.csv", delimiter=",", skiprows=2)
    np.testing.assert_allclose(table[:, 1] + 1j * table[:, 2], second.values, rtol=1e-6)
    predicted = tmp_path / "again.uff"
    run("predict", two, folder, "--point", 2, "-o", predicted)
    np.testing.assert_allclose(dovetail.read_frf(predicted).values, second.values, rtol=1e-3)


def test_each_file_has_lines_of_its_own(run, two, measured, tmp_path):
    assembly, axes = dovetail.load(two), (np.arange(195.0, 9100.0, 12.5), np.arange(210.0, 8990.0, 16.0))
    theta, kept = {"kt_tc": 5e8, "kt_hc": 2e9}, []
    for file, axis, alone in zip(measured, axes, assembly.on(*axes).each_response, strict=True):
        dovetail.write_frf(dovetail.Frf(axis, alone.frf(theta), "accelerance"), file, overwrite=True)
        kept.append(axis[(axis >= 200.0) & (axis <= 9000.0)])
    folder = tmp_path / "results"
    run("identify", two, *measured, "--method", "refined", "-o", folder)
    for name, axis in zip(("frf.csv", "frf_2.csv"), kept, strict=True):
        table = np.loadtxt(folder / name, delimiter=",", skiprows=2)
        np.testing.assert_allclose(table[:, 0], axis, rtol=1e-12)
        np.testing.assert_allclose(table[:, 1] + 1j * table[:, 2], table[:, 3] + 1j * table[:, 4], rtol=1e-3)
    (further,) = json.loads((folder / "result.json").read_text())["further_responses"]
    np.testing.assert_allclose(further["frequency_Hz"], kept[1], rtol=1e-12)
    assert f"207.5 to 8995 Hz, {len(kept[0])} + {len(kept[1])} lines" in (folder / "report.html").read_text()


def test_one_file_with_all_frfs_is_read_by_their_numbers(run, two, measured, tmp_path):
    every = tmp_path / "all.uff"
    every.write_bytes(measured[1].read_bytes() + measured[0].read_bytes())
    found = run("identify", two, every, "--index", 2, "--index", 1, "--method", "refined", "--json")
    assert json.loads(found.stdout)["parameters"]["kt_hc"]["value"] == pytest.approx(2e9, rel=1e-4)
    refused = run("identify", two, every, "--method", "refined", code=1)
    assert "--index" in refused.stderr or "index" in refused.stderr


def test_a_wrong_number_of_files_is_refused_at_once(run, two, measured, tmp_path):
    refused = run("identify", two, measured[0], "--method", "refined", "-o", tmp_path / "out", code=1).stderr
    assert "1 measured FRF was given, and 'bt40-er32-t0-two-points' has 2 responses" in refused.replace("\n  ", " ")
    assert "2. tool, 60 mm" in refused
    assert not (tmp_path / "out").exists()
    usage = run("identify", two, *measured, "--index", 1, "--index", 1, "--index", 1, code=2).stderr
    assert "2 times for 3 FRFs" in usage


def test_an_unknown_response_is_refused(run, two):
    assert "there is no response 3" in run("simulate", two, "--point", 3, code=2).stderr


def test_plan_says_the_lines_of_a_description_with_both_points(run, two, tmp_path):
    printed = run("plan", two, "--at", "tool").stdout
    assert printed.count("(as described)") == 2
    lines = printed[printed.index("dovetail: 1") :].replace("extends: two.yaml", f"extends: {two}")
    written = tmp_path / "written.yaml"
    written.write_text(lines)
    planned = json.loads(run("plan", two, "--at", "tool", "--json").stdout)
    best = planned["points"][0]["position"], planned["with_the_first"][0]["position"]
    labels = dovetail.load(written).description.response_labels
    assert labels == tuple(f"tool, {position * 1e3:g} mm" for position in best)
    assert all(0 < share < 1.05 for share in planned["narrowing"].values())


def test_predict_lists_the_determined_sign(run, assemblies, sdof, tmp_path):
    file, measured = tmp_path / "either.yaml", tmp_path / "measured.csv"
    file.write_text(f"extends: {assemblies / 'sdof.yaml'}\nresponse: {{calibration: {{sign: unknown}}}}\n")
    dovetail.write_frf(dovetail.Frf(sdof.frequency, -sdof.frf({"k": 3e6, "c": 40.0}), "accelerance"), measured)
    run("identify", file, measured, "--method", "refined", "--cause-seconds", 0, "-o", tmp_path / "results")
    predict = ("predict", file, tmp_path / "results")
    assert ["response.sign", "-1"] in [line.split() for line in run(*predict).stdout.splitlines()]
    assert json.loads(run(*predict, "--json").stdout)["parameters"]["response.sign"] == -1.0
