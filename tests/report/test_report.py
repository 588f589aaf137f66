"""The HTML report: complete, self-contained, safe, and never written in part."""

from __future__ import annotations

import base64
import hashlib
import json
import os
import re
import subprocess
import sys
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import dovetail
from dovetail.errors import DovetailError
from dovetail.frf import Frf
from dovetail.identification import Adequacy, AtPoint, Identification, Mode, ModelError
from dovetail.identification.truth import TrueValues
from dovetail.report import html_report
from dovetail.report.html_report import write_report

LARGEST, LARGEST_OF_SIX = 400_000, 450_000
"""Bytes that reports with two and with six responses may have."""

CROSS = "\N{MULTIPLICATION SIGN}"
HOSTILE = '"><script>alert(1)</script><img src=x onerror=alert(1)>{{ 7 * 7 }}&'


class Page(HTMLParser):
    """Every tag of a page with its attributes, and its text."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.text = ""
        self.source = path.read_text(encoding="utf-8")
        self.feed(self.source)

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attributes)))
        if tag in ("td", "th", "span"):
            self.text += " "

    def handle_data(self, data: str) -> None:
        self.text += data

    def attribute(self, name: str) -> list[str]:
        return [attributes[name] or "" for _, attributes in self.tags if name in attributes]


def written(result: Identification, tmp_path: Path, truth: TrueValues | None = None) -> Page:
    return Page(write_report(result, tmp_path / "report.html", truth=truth))


def after(text: str, phrase: str) -> list[str]:
    """The words behind a phrase."""
    return text[text.index(phrase) + len(phrase) :].split()


def assert_nothing_is_loaded(page: Page) -> None:
    names = {tag for tag, _ in page.tags}
    assert not names & {"link", "img", "image", "iframe", "object", "embed", "base", "form", "video", "audio"}
    loading = [value for name in ("src", "href", "xlink:href", "data", "srcset") for value in page.attribute(name)]
    assert all(value.startswith("#") for value in loading)
    assert not [name for _, attributes in page.tags for name in attributes if name.startswith("on")]
    assert not re.search(r"url\((?!#)|@import|@font-face", page.source)
    scripts = re.findall(r"<script>(.*?)</script>", page.source, flags=re.S)
    (policy,) = [text for text in page.attribute("content") if "script-src" in text]
    allowed = re.findall(r"'sha256-([^']*)'", policy)
    assert [base64.b64encode(hashlib.sha256(script.encode()).digest()).decode() for script in scripts] == allowed
    assert "unsafe" not in policy.partition("script-src")[2]
    others = [attributes for tag, attributes in page.tags if tag == "script" and attributes]
    assert len(others) + len(scripts) == sum(tag == "script" for tag, _ in page.tags)
    assert all(attributes["type"] == "application/json" for attributes in others)


def test_the_report_loads_nothing(result: Identification, truth: TrueValues, tmp_path: Path) -> None:
    page = written(result, tmp_path, truth)
    assert_nothing_is_loaded(page)
    names = ["http://www.w3.org/2000/svg", "https://github.com/leeoniya/uPlot"]  # of a namespace, and in a comment
    assert sorted(re.findall(r"https?://[\w./]+", page.source)) == names


def test_hostile_names_are_only_text(result: Identification, tmp_path: Path) -> None:
    parameters = {
        HOSTILE + name: replace(
            parameter, name=HOSTILE + name, description=HOSTILE, joint=HOSTILE, unit=HOSTILE + parameter.unit
        )
        for name, parameter in result.parameters.items()
    }
    hostile = replace(
        result,
        method=HOSTILE,
        parameters=parameters,
        known={HOSTILE: 1.0},
        measured=replace(result.measured, label=HOSTILE),
        frf=replace(result.frf, label=HOSTILE),
        warnings=(HOSTILE,),
        provenance={
            "assembly": HOSTILE,
            "measurement": HOSTILE,
            HOSTILE: {HOSTILE: HOSTILE},
            "description": HOSTILE,
            "packages": [HOSTILE],
        },
    )
    page = written(hostile, tmp_path, TrueValues(note=HOSTILE, synthetic=True))
    assert_nothing_is_loaded(page)
    assert page.text.count("<script>alert(1)</script>") > 2 * len(parameters)
    assert "49" not in re.findall(r"alert\(1\)>(\S+)", page.text)


def test_a_name_that_is_not_unicode_does_not_stop_the_report(result: Identification, tmp_path: Path) -> None:
    odd = replace(result, provenance={"measurement": "measured\udcff.uff"})
    assert r"measured\udcff.uff" in written(odd, tmp_path).text


def test_every_parameter_stands_there_with_value_unit_and_range(result: Identification, tmp_path: Path) -> None:
    page = written(result, tmp_path)
    rows = re.findall(r"<tr[^>]*>(.*?)</tr>", page.source, flags=re.S)
    for name, value, unit, lower, upper in (
        ("Dc", "35.18", "mm", "26", "40"),
        ("mn1", "61.20", "g", "20", "200"),
        ("kt_tc", "731.0", "MN/m", "100", "2000"),
        ("kr_tc", "17.02", "kN·m/rad", "2", "60"),
        ("kt_hc", "5.620", "GN/m", "0.3", "5"),
        ("ct_hc", "121.0", "N·s/m", "10", "1000"),
        ("cr_hc", "0.2160", "N·m·s/rad", "0.01", "5"),
    ):
        row = next(row for row in rows if f'<th scope="row">{name}' in row)
        cells = re.findall(r">([^<>\s][^<>]*)</td>", row)
        log = " log" if result.parameters[name].scale == "log" else ""
        assert cells == [value, unit, lower, f"{upper}{log}"]
        assert result.parameters[name].description in row
    assert all(f'<th scope="row">{name}' in page.source for name in result.parameters)


def test_a_value_outside_its_range_is_flagged(result: Identification, tmp_path: Path) -> None:
    flagged = re.findall(
        r'<th scope="row">(\w+) <span class="flag">outside its range', written(result, tmp_path).source
    )
    assert flagged == ["kt_hc"]


def test_warnings_stand_above_the_parameters(result: Identification, tmp_path: Path) -> None:
    text = written(result, tmp_path).text
    warning = "kt_hc = 5.62 x 10⁹ N/m lies outside its range, 3 x 10⁸ N/m to 5 x 10⁹ N/m.".replace("x", CROSS)
    assert 0 < text.index(warning) < text.index("Identified parameters")
    assert "Before you use these numbers" not in written(replace(result, warnings=()), tmp_path).text


@pytest.mark.parametrize("says", ["truth", "label", "provenance", "measurement"])
def test_a_synthetic_measurement_is_reported_as_synthetic(result: Identification, tmp_path: Path, says: str) -> None:
    truth = TrueValues(synthetic=True) if says == "truth" else None
    if says == "label":
        result = replace(result, measured=replace(result.measured, label="SYNTHETIC H0-J-T0"))
    if says in ("provenance", "measurement"):
        said = {"provenance": {"synthetic": True}, "measurement": {"measurement": "synthetic.csv"}}[says]
        result = replace(result, provenance={**result.provenance, **said})
    assert written(result, tmp_path, truth).text.count("This measurement is synthetic") == 1


def test_a_measurement_is_not_called_synthetic_without_reason(result: Identification, tmp_path: Path) -> None:
    assert "synthetic" not in written(result, tmp_path, TrueValues({"Dc": 35e-3})).text


def test_truth_and_error_are_listed_next_to_the_values(
    result: Identification, truth: TrueValues, tmp_path: Path
) -> None:
    text = written(result, tmp_path, truth).text
    assert after(text, "equivalent outer diameter of the collet")[:6] == ["35.18", "mm", "34.90", "+0.80", "%", "26"]
    assert truth.note in text
    assert "True," not in written(result, tmp_path).text


def test_a_truth_of_some_parameters_leaves_the_others_open(result: Identification, tmp_path: Path) -> None:
    text = written(result, tmp_path, TrueValues({"dc": 13e-3})).text
    assert after(text, "equivalent inner diameter of the collet")[:4] == ["12.40", "mm", "13.00", "\N{MINUS SIGN}4.62"]
    assert after(text, "equivalent outer diameter of the collet")[2:4] == ["\N{EN DASH}"] * 2


def test_modes_without_peaks_or_without_numbers_are_listed(result: Identification, tmp_path: Path) -> None:
    modes = (Mode(float("nan"), None, None), Mode(1352.0, 1352.4, None), Mode(6540.0, None, None))
    page = written(replace(result, modes=modes), tmp_path, TrueValues(natural_frequencies=(1330.0, 6600.0, 8240.0)))
    assert "1352.0" in page.text
    assert not re.search(r"\bnan\b", page.source, flags=re.I)
    assert "Natural frequencies" not in written(replace(result, modes=()), tmp_path).text


def test_a_measurement_without_phase_is_called_amplitude_only(amplitude_only: Identification, tmp_path: Path) -> None:
    page = written(amplitude_only, tmp_path)
    assert "amplitude only" in page.text
    assert "by their amplitudes alone" in page.text
    assert "amplitude only" not in written(replace(amplitude_only, measured=amplitude_only.frf), tmp_path).text


def test_the_network_is_evaluated_if_the_provenance_says_how_well_it_does(
    result: Identification, tmp_path: Path
) -> None:
    text = written(result, tmp_path).text
    assert "Over 1200 simulated joints" in text
    assert "0.97 0.420 mm 3.0" in " ".join(text[text.index("What the network can estimate") :].split())
    bare = {key: value for key, value in result.provenance.items() if key != "evaluation"}
    assert "What the network can estimate" not in written(replace(result, provenance=bare), tmp_path).text


def test_provenance_and_the_collapsed_description(result: Identification, tmp_path: Path) -> None:
    page = written(replace(result, provenance={**result.provenance, "identified_at": "2025-01-02"}), tmp_path)
    for text in ("c0ffee", "torch: 2.5.0", "joint collet: dovetail-frf 0.1.0", "Identified at", "2025-01-02"):
        assert text in page.text
    assert [attributes for tag, attributes in page.tags if tag == "details"] == [{}]
    assert '"start": 100.0' in page.text


def test_a_report_needs_no_provenance(result: Identification, tmp_path: Path) -> None:
    text = written(replace(result, provenance={}), tmp_path).text
    assert "h0_j_t0_60Nm.uff" in text


def test_parameters_of_several_joints_stand_by_joint(result: Identification, tmp_path: Path) -> None:
    parameters = {
        name: replace(parameter, joint="flange" if name.endswith("hc") else "collet")
        for name, parameter in result.parameters.items()
    }
    text = written(replace(result, parameters=parameters, known={"flange.mn1": 0.08}, warnings=()), tmp_path).text
    places = [text.index(word) for word in ("Of collet", "cr_tc", "Of flange", "kt_hc", "cr_hc")]
    assert places == sorted(places)
    assert "flange.mn1 = 0.08" in text
    assert "Of collet" not in written(result, tmp_path).text


def test_a_noisy_measurement_at_two_points_makes_no_large_file(result: Identification, tmp_path: Path) -> None:
    noise = np.random.default_rng(0).standard_normal((2, result.measured.frequency.size))
    values = result.measured.values * (1 + noise[0] + 1j * noise[1])
    noisy = Frf(result.measured.frequency, values, "accelerance", label="noisy")
    two = replace(result, measured=noisy, further=(AtPoint("tool, 60 mm", result.frf, noisy),))
    path = write_report(two, tmp_path / "report.html")
    assert path.stat().st_size < LARGEST
    six = replace(two, further=tuple(AtPoint(f"tool, {at} mm", result.frf, noisy) for at in range(20, 70, 10)))
    path = write_report(six, tmp_path / "report_of_six.html")
    assert path.stat().st_size < LARGEST_OF_SIX


def test_the_chart_has_the_peaks_of_the_measurement(result: Identification, tmp_path: Path) -> None:
    page = written(result, tmp_path)
    chart = json.loads(re.search(r'<script type="application/json" id="chart-1">(.*?)</script>', page.source)[1])
    arrays = {c["role"]: np.frombuffer(base64.b64decode(c["amplitude"]), "<f4") for c in chart["curves"]}
    assert arrays["measured"].max() == pytest.approx(result.measured.amplitude.max(), rel=1e-6)
    assert arrays["model"].max() == pytest.approx(result.frf.amplitude.max(), rel=1e-6)
    assert arrays["model"].size <= 3000 < result.frf.frequency.size
    assert chart["natural"] == [1352.0, 6540.0, 8330.0]


def test_the_chart_has_the_residual_in_units_of_the_noise(result: Identification, tmp_path: Path) -> None:
    variance = 0.01 * np.abs(result.frf.values) ** 2
    shifted = replace(result.measured, values=result.frf.values * 1.3, variance=variance, coherence=None)
    for measured in (shifted, replace(shifted, values=np.abs(shifted.values).astype(complex), has_phase=False)):
        page = written(replace(result, measured=measured), tmp_path)
        chart = json.loads(re.search(r'<script type="application/json" id="chart-1">(.*?)</script>', page.source)[1])
        (residual,) = (curve["residual"] for curve in chart["curves"] if "residual" in curve)
        times = 3.0 if measured.has_phase else 3.0 * np.sqrt(2.0)  # an amplitude has half of the variance
        assert np.frombuffer(base64.b64decode(residual), "<f4") == pytest.approx(times, rel=1e-5)


@pytest.mark.parametrize(
    ("spread", "word", "mark"),
    [(0.005, "identified", "good"), (0.3, "weakly identified", "rough"), (1.0, "not identifiable", "bad")],
)
def test_a_verdict_has_the_colour_of_its_mark(
    assemblies: Path, tmp_path: Path, spread: float, word: str, mark: str
) -> None:
    assembly = dovetail.load(assemblies / "sdof.yaml")
    measured = dovetail.noisy_frf(assembly.simulate({"k": 3e6, "c": 40.0}), 0.01, 0)
    found = dovetail.identify(assembly, measured, form="laplace", cause_seconds=0.0)
    middle = assembly.to_unit(found.theta) if spread < 1.0 else 0.5
    fraction = middle + spread * (np.random.default_rng(0).random(found.posterior.theta.shape) - 0.5)
    posterior = replace(found.posterior, theta=assembly.from_unit(fraction), fraction=fraction)
    page = written(replace(found, posterior=posterior), tmp_path)
    assert page.source.count(f'<span class="verdict {mark}">{word}</span>') == 2


def test_a_best_fit_outside_its_interval_is_marked_and_explained(assemblies: Path, tmp_path: Path) -> None:
    assembly = dovetail.load(assemblies / "sdof.yaml")
    measured = dovetail.noisy_frf(assembly.simulate({"k": 3e6, "c": 40.0}), 0.01, 0)
    found = dovetail.identify(assembly, measured, form="laplace", cause_seconds=0.0)
    assert "hollow diamond" not in written(found, tmp_path).text
    posterior = found.posterior
    theta = posterior.theta * np.array([1.2, 1.0])
    moved = replace(found, posterior=replace(posterior, theta=theta, fraction=assembly.to_unit(theta)))
    page = written(moved, tmp_path)
    assert page.source.count('<td class="number outside"') == 1
    assert page.source.count('stroke="var(--alert)"') == 1
    assert "The best fit of k lies outside its 90 % interval" in page.text
    assert "A hollow diamond on a range is a best fit outside its interval." in page.text
    assert re.findall(r"\d% of", page.text) == []  # as in the rest of the report: 90 %


def test_the_pair_plot_has_ticks_with_the_ends_of_the_ranges(assemblies: Path, tmp_path: Path) -> None:
    assembly = dovetail.load(assemblies / "sdof.yaml")
    measured = dovetail.noisy_frf(assembly.simulate({"k": 3e6, "c": 40.0}), 0.01, 0)
    found = dovetail.identify(assembly, measured, form="laplace", cause_seconds=0.0)
    theta = np.random.default_rng(0).multivariate_normal([3e6, 40.0], [[1e10, 9e5], [9e5, 100.0]], 400)
    posterior = replace(found.posterior, theta=theta, fraction=assembly.to_unit(theta))
    page = written(replace(found, posterior=posterior), tmp_path)
    ticks = re.findall(r'<text class="tick-label"[^>]*>([^<]*)</text>', page.source)
    assert ticks == ["0.1", "5", "10", "1", "50", "100"]
    assert "k [MN/m]" in page.text
    assert "c [N·s/m]" in page.text


def test_the_verdict_stands_before_everything_else(result: Identification, tmp_path: Path) -> None:
    text = written(result, tmp_path).text
    assert text.index("Whether the model fits was not judged") < text.index("12 parameters of")
    good = replace(result, adequacy=Adequacy("good", ModelError(0.002)))
    said = written(good, tmp_path).text
    assert "The model fits well (natural frequencies are off by 0.2 %)" in said
    bad = replace(result, adequacy=Adequacy("does not fit", ModelError(0.2)))
    assert "The model does not fit: do not trust the numbers." in written(bad, tmp_path).text


def test_ids_are_unique_and_every_reference_resolves(result: Identification, assemblies: Path, tmp_path: Path) -> None:
    assembly = dovetail.load(assemblies / "bt40_er32.yaml")
    page = Page(write_report(result, tmp_path / "report.html", assembly=assembly))
    ids = page.attribute("id")
    assert len(ids) == len(set(ids)) > 1
    references = {value[1:] for value in page.attribute("href")} | set(re.findall(r"url\(#([^)]*)\)", page.source))
    assert references | set(page.attribute("data-chart")) <= set(ids)


def test_a_report_replaces_an_earlier_one(result: Identification, tmp_path: Path) -> None:
    path = tmp_path / "report.html"
    path.write_text("earlier")
    assert write_report(result, path) == path
    assert "earlier" not in path.read_text(encoding="utf-8")
    assert [file.name for file in tmp_path.iterdir()] == ["report.html"]


@pytest.mark.parametrize(("where", "error"), [("chart_data", RuntimeError), ("replace", DovetailError)])
def test_a_failed_report_keeps_the_old_file(
    result: Identification, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, where: str, error: type[Exception]
) -> None:
    def fail(*_: Any, **__: Any) -> str:
        raise RuntimeError if where == "chart_data" else OSError("disk full")

    path = tmp_path / "report.html"
    path.write_text("earlier")
    monkeypatch.setattr(html_report if where == "chart_data" else os, where, fail)
    with pytest.raises(error):
        write_report(result, path)
    assert path.read_text() == "earlier"
    assert [file.name for file in tmp_path.iterdir()] == ["report.html"]


def test_a_report_that_cannot_be_written_is_explained(result: Identification, tmp_path: Path) -> None:
    with pytest.raises(DovetailError, match=r"missing.report\.html"):
        write_report(result, tmp_path / "missing" / "report.html")
    with pytest.raises(DovetailError, match="directory"):
        write_report(result, tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_importing_the_report_loads_nothing_heavy() -> None:
    program = (
        "import sys, dovetail.report.html_report, dovetail.report.figures, dovetail.identification.truth\n"
        "print([name for name in ('torch', 'umap', 'numba', 'matplotlib', 'jinja2') if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
