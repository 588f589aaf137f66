"""Methods of identification side by side."""

from __future__ import annotations

import csv
import json
import re
from dataclasses import replace

import numpy as np
import pytest
from typer.testing import CliRunner

import dovetail
from dovetail.cli.app import app
from dovetail.errors import DovetailError, ParameterError
from dovetail_bench import compare, read_cases, read_truths
from dovetail_bench.pages.comparison import write_comparison

CASES = """\
dovetail_series: 1
name: Two springs (synthetic)
covariates: {k: N/m}
tests:
  soft: {assembly: sdof.yaml, measured: soft.csv, joint: {assembly: sdof.yaml, measured: soft.csv}, at: {k: 1}}
  stiff: {assembly: sdof.yaml, measured: stiff.csv, joint: {assembly: sdof.yaml, measured: stiff.csv}, at: {k: 2}}
"""


@pytest.fixture
def cases(tmp_path, assemblies, sdof):
    (tmp_path / "sdof.yaml").write_bytes((assemblies / "sdof.yaml").read_bytes())
    truth = {}
    for seed, (name, k) in enumerate((("soft", 1e6), ("stiff", 4e6))):
        values = sdof.frf({"k": k, "c": 20.0})
        noise = 1e-3 * values.std() * np.random.default_rng(seed).standard_normal((2, len(values)))
        frf = dovetail.Frf(sdof.frequency, values + noise[0] + 1j * noise[1], "accelerance")
        dovetail.write_frf(frf, tmp_path / f"{name}.csv")
        truth[name] = {"parameters": {"k": k, "c": 20.0}}
    (tmp_path / "truth.json").write_text(json.dumps({"tests": truth}))
    (tmp_path / "cases.yaml").write_text(CASES)
    return tmp_path


def test_every_method_meets_every_measurement(cases):
    done = compare(read_cases(cases / "cases.yaml"), ("refined", "posterior", "pca"), samples=300)
    assert [(row.case.name, row.method) for row in done.rows] == [
        (case, method) for case in ("soft", "stiff") for method in ("refined", "posterior", "pca")
    ]
    for row in done.rows:
        assert row.peaks[0][0] == pytest.approx(np.sqrt(1e6 if row.case.name == "soft" else 4e6) / 2 / np.pi, rel=0.01)
    refined, posterior, network = (done.of(done.cases[0])[name] for name in done.methods)
    assert refined.mean_coherence > 0.98  # the lowest lines are nothing but noise
    assert refined.mean_coherence > network.mean_coherence
    low, high = posterior.identification.interval["k"]
    assert low < 1e6 < high
    assert high - low < 0.02 * 1e6
    assert set(done.training) == {"pca"}


def test_a_method_of_a_plugin_with_the_name_of_a_reducer_is_called_by_its_package(cases, tmp_path):
    plugin = tmp_path / "middle.py"
    plugin.write_text(
        "import dovetail\n\n\nclass Middle(dovetail.IdentificationMethod):\n    name, summary = 'pca', 'The middle'\n\n"
        "    def identify(self, problem, *, seed, progress=dovetail.silent):\n"
        "        return dovetail.Estimate([p.from_unit(0.5) for p in problem.parameters])\n\n\n"
        "@dovetail.hookimpl\ndef dovetail_components():\n    return [Middle]\n"
    )
    done = compare(read_cases(cases / "cases.yaml"), ("pca", "middle:pca"), samples=300, plugins=[plugin])
    assert set(done.training) == {"pca"}
    assert {row.method: row.identification.method for row in done.rows} == {"pca": "network", "middle:pca": "pca"}


def test_each_measurement_is_compared_on_its_own_lines(cases, sdof):
    lines = np.arange(0.5, 620.0, 0.8)
    values = sdof.on(lines).frf({"k": 1e6, "c": 20.0})
    dovetail.write_frf(dovetail.Frf(lines, values, "accelerance"), cases / "soft.csv", overwrite=True)
    done = compare(read_cases(cases / "cases.yaml"), ("refined", "pca"), samples=300)
    inside = (lines >= 1.0) & (lines <= 600.0)
    for row in done.of(done.cases[0]).values():
        np.testing.assert_array_equal(row.measured.frequency, lines[inside])
        np.testing.assert_array_equal(row.measured.values, values[inside])
        np.testing.assert_array_equal(row.frf.frequency, lines[inside])
    assert done.of(done.cases[0])["refined"].mean_coherence > 0.999
    np.testing.assert_array_equal(done.of(done.cases[1])["refined"].measured.frequency, sdof.frequency)


def test_the_command_writes_report_and_tables(cases):
    words = ["compare", "cases.yaml", "--methods", "refined,posterior", "--truth", "truth.json", "-o", "out"]
    done = CliRunner().invoke(app, [str(cases / word) if "." in word or word == "out" else word for word in words])
    assert done.exit_code == 0, done.output
    with (cases / "out" / "parameters.csv").open(encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    assert len(rows) == 2 * 2 * 2
    stiff = next(row for row in rows if (row["case"], row["method"], row["parameter"]) == ("stiff", "posterior", "k"))
    assert 0.98 * 4e6 < float(stiff["lower"]) < 4e6 < float(stiff["upper"]) < 1.02 * 4e6
    assert float(stiff["truth"]) == 4e6
    assert stiff["verdict"] == "identified"
    page = (cases / "out" / "comparison.html").read_text(encoding="utf-8")
    for words in ("Mean coherence", "Resonances", "What each measurement shows", "amplitude, phase and coherence", "✓"):
        assert words in page
    assert page.count('data-chart="chart-') == 2
    assert 'src="' not in page
    data = json.loads(re.search(r'id="chart-1">(.*?)</script>', page)[1])
    assert [(curve["role"], curve["label"]) for curve in data["curves"]] == [
        ("measured", "measured"), ("method-0", "refined"), ("method-1", "posterior"),
    ]  # fmt: skip
    assert ["coherence" in curve for curve in data["curves"]] == [False, True, True]


def test_an_assembly_with_several_responses_is_refused_before_any_work(cases, assemblies):
    (cases / "two.yaml").write_text(f"extends: {assemblies / 'bt40_er32_two_points.yaml'}\n")
    (cases / "cases.yaml").write_text(CASES.replace("{assembly: sdof.yaml, measured", "{assembly: two.yaml, measured"))
    with pytest.raises(DovetailError, match="1 measured FRF was given, and 'bt40-er32-t0-two-points' has 2 responses"):
        compare(read_cases(cases / "cases.yaml"), ("umap",), samples=300)


def test_cases_that_cannot_be_compared_are_refused(cases):
    read = read_cases(cases / "cases.yaml")
    with pytest.raises(DovetailError, match="refind"):
        compare(read, ("refind",))
    (cases / "other.yaml").write_bytes((cases / "sdof.yaml").read_bytes())
    mixed = CASES.replace(
        "joint: {assembly: sdof.yaml, measured: stiff", "joint: {assembly: other.yaml, measured: stiff"
    )
    (cases / "cases.yaml").write_text(mixed)
    with pytest.raises(ParameterError, match="one and the same assembly"):
        compare(read_cases(cases / "cases.yaml"), ("refined",))
    (cases / "truth.json").write_text("[]")
    with pytest.raises(DovetailError, match="not a file of true parameters"):
        read_truths(cases / "truth.json")


def test_robust_training_with_a_residual_mass_keeps_phases(cases):
    with (cases / "sdof.yaml").open("a") as file:
        file.write("  augmentation: {mass: 1 g}\n")
    done = compare(read_cases(cases / "cases.yaml"), ["none+robust"], samples=20)
    assert done.methods == ("none+robust",)


def test_arguments_without_effect_on_a_comparison_are_refused(cases):
    read = read_cases(cases / "cases.yaml")
    with pytest.raises(ParameterError, match="a number was asked for, and a dataset given"):
        compare(read, ("refined",), samples=20, data=cases / "data.zarr")
    with pytest.raises(ParameterError, match="no case was measured in a file of these names"):
        compare(read, ("refined",), truth={"other": {"k": 1e6}})


def test_amplitudes_are_compared_with_amplitudes(cases):
    for name in ("soft", "stiff"):
        frf = dovetail.read_frf(cases / f"{name}.csv")
        alone = replace(frf, values=frf.amplitude.astype(complex), has_phase=False)
        dovetail.write_frf(alone, cases / f"{name}.csv", overwrite=True)
    for row in compare(read_cases(cases / "cases.yaml"), ("refined",)).rows:
        assert row.mean_coherence == pytest.approx(row.identification.mean_coherence)
        assert row.mean_coherence > 0.98


def test_a_comparison_in_which_every_method_fails_still_writes_a_page(cases):
    """As the rigid joint by itself."""
    done = compare(read_cases(cases / "cases.yaml"), ("refined",))
    nothing = replace(done, rows=tuple(replace(row, identification=None) for row in done.rows))
    page = write_comparison(nothing, cases / "rigid.html").read_text(encoding="utf-8")
    assert "Resonances" in page
    assert "Identified parameters" not in page
    assert "Identified parameters" in write_comparison(done, cases / "refined.html").read_text(encoding="utf-8")
