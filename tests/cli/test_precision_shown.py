"""Precision, verdict and groups are the same words in terminal, page, CSV, JSON, batch, notebook and comparison."""

from __future__ import annotations

import contextlib
import csv
import io
import json
from dataclasses import replace
from html import unescape
from importlib import import_module
from types import SimpleNamespace

import numpy as np
import pytest

import dovetail
from dovetail.inference.posterior import Posterior, typical_model_error
from dovetail.report import content
from dovetail.report.batch import write_batch
from dovetail.report.result_files import write_results
from dovetail_bench.pages.comparison import parameter_value_rows

identify, in_batches = (import_module(f"dovetail.cli.{name}") for name in ("identify", "batch"))
K, C = (2e6, 4e6), 60.0


def printed(show):
    with contextlib.redirect_stdout(io.StringIO()) as stream:
        show()
    return stream.getvalue()


def draw(kind):
    """Samples of stiffness and damping: narrow, wide, at an end, and in groups; and where the best fit is."""
    random = np.random.default_rng(0)
    first, second = random.standard_normal((2, 400))
    stiffness = {
        "narrow": 3e6 * (1.0 + 0.02 * first),
        "wide": 3e6 * np.exp(0.3 * np.clip(first, -2.5, 2.5)),
        "at an end": 1e7 - 1e6 * np.abs(first),
        "undetermined": 1e5 + 9.9e6 * random.random(400),
        "two groups": np.where(random.random(400) < 0.4, *K) * (1.0 + 0.01 * first),
    }[kind]
    best = {"narrow": 3.4e6, "at an end": 9.99998e6}.get(kind, float(stiffness[0]))
    return np.stack([stiffness, C * (1.0 + 0.03 * second)], axis=1), np.array([best, C])


@pytest.fixture(scope="module", params=["narrow", "wide", "at an end", "undetermined", "two groups"])
def shown(request, sdof, tmp_path_factory):
    """One result, as it is shown everywhere."""
    theta, best = draw(request.param)
    frf = dovetail.Frf(sdof.frequency, sdof.frf({"k": 3e6, "c": C}), "accelerance", label="measured.csv")
    fitted = dovetail.identify(sdof, dovetail.noisy_frf(frf, 0.01, 1), form="laplace", samples=20)
    options = {"model_error": typical_model_error(0.0), "searches": 400, "lines": 600, "seconds": 0.0}
    posterior = Posterior.from_fractions(sdof.parameters, sdof.to_unit(theta), np.full(400, 1.0 / 400), **options)
    parameters = {
        name: replace(one, value=value)
        for (name, one), value in zip(fitted.parameters.items(), best.tolist(), strict=True)
    }
    result = replace(fitted, posterior=posterior, parameters=parameters)
    folder = tmp_path_factory.mktemp("shown")
    write_results(result, folder, None)
    batch = dovetail.Batch({"measured.csv": result}, {})
    compared = SimpleNamespace(
        rows=[
            SimpleNamespace(
                identification=result, is_trustworthy=True, case=SimpleNamespace(name="one", value=1), method="p"
            )
        ],
        truth={},
    )
    with (folder / "parameters.csv").open(encoding="utf-8") as stream:
        table = list(csv.DictReader(stream))
    return SimpleNamespace(
        kind=request.param,
        result=result,
        read=dovetail.load_result(folder),
        terminal=printed(lambda: identify._print(result, None)),
        page=unescape((folder / "report.html").read_text(encoding="utf-8")),
        csv=table,
        plain=json.loads((folder / "result.json").read_text(encoding="utf-8")),
        batch=printed(lambda: in_batches._print(sdof, batch)),
        summary=unescape(write_batch(batch, folder / "summary.html", "sdof", {}).read_text(encoding="utf-8")),
        notebook=unescape(result._repr_html_()),
        compared=list(parameter_value_rows(compared)),
    )


def test_one_precision_and_one_verdict_are_shown_everywhere(shown):
    for number, row in enumerate(shown.result.table):
        line = next(text for text in shown.terminal.splitlines() if text.split()[:1] == [row.name])
        assert f"   {row.precision}   " in line
        assert f"   {row.verdict}" in line
        assert (shown.csv[number]["precision"], shown.csv[number]["verdict"]) == (row.precision, row.verdict)
        for stored in (shown.plain["table"][number], shown.plain["posterior"]["parameters"][row.name]):
            assert (stored["precision"], stored["verdict"], stored["factor"]) == (
                row.precision,
                row.verdict,
                row.factor,
            )
        assert (shown.read.table[number].precision, shown.read.table[number].verdict) == (row.precision, row.verdict)
        mark = content.VERDICT_MARKS[row.verdict]
        assert f'<th scope="row">{row.name} <span class="verdict {mark}">{row.verdict}</span>' in shown.page
        assert f'<td class="precision" data-label="Precision">{row.precision}</td>' in shown.page
        assert f", {row.precision})" in shown.batch
        assert f'<td class="precision">{row.precision}</td>' in shown.summary
        assert f"<td>{row.precision}</td><td>{row.verdict}</td>" in shown.notebook
        assert shown.compared[number][9:11] == [row.precision, row.verdict]
    counted = [row.verdict for row in shown.result.table]
    sentence = content.verdict_on(shown.result)[1]
    assert all(f"{counted.count(word)} {word}" in sentence for word in counted)
    expected = {"narrow": "±", "wide": "factor", "at an end": "lower bound", "undetermined": "range only"}
    assert shown.result.table[0].precision.startswith(expected.get(shown.kind, "2 groups"))


def test_groups_are_listed_below_the_parameter(shown):
    """Each with its weight, estimate and interval; their mean, 3.2 MN/m, is nowhere."""
    if shown.kind != "two groups":
        assert all(row.groups is None for row in shown.result.table)
        assert not any("groups" in text for text in (shown.terminal, shown.page))
        return
    row, groups = shown.result.table[0], shown.result.posterior.groups["k"]
    assert row.groups == groups
    assert row.estimate == pytest.approx(K[1], rel=0.01)
    lines = shown.terminal.splitlines()
    at = next(number for number, text in enumerate(lines) if text.split()[:1] == ["k"])
    listed = json.loads(shown.csv[0]["groups"])
    for number, (group, value) in enumerate(zip(groups, K, strict=True)):
        assert group.estimate == pytest.approx(value, rel=0.01)
        words = f"{group.weight:.0%}".replace("%", " %"), f"{group.estimate / 1e6:#.4g}", group.precision
        assert all(word in lines[at + 1 + number] for word in words)
        assert f"{words[0]} of the likely values" in shown.page
        assert f'<td class="number value">{words[1]}' in shown.page
        assert listed[number]["weight"] == shown.plain["table"][0]["groups"][number]["weight"] == group.weight
    assert "3.2" not in [text.split()[1][:3] for text in lines[at : at + 3]]


def test_a_best_fit_at_a_bound_or_outside_its_interval_is_marked(shown):
    row = shown.result.table[0]
    at_end, outside = shown.kind == "at an end", shown.kind in ("narrow", "at an end")
    assert (row.best_fit_at, row.best_fit_outside) == ("upper" if at_end else "", outside)
    assert (shown.csv[0]["best_fit_at"], shown.csv[0]["best_fit_outside"]) == (row.best_fit_at, str(outside))
    where = ", ".join(["at the upper end of its range"] * at_end + ["outside its interval"] * outside)
    assert (
        (where in shown.terminal.split("best fit position")[-1]) if where else "best fit position" not in shown.terminal
    )
    assert (f"The best fit lies {where}." in shown.page) == bool(where)
    explained = "The best fit of k lies outside its 90 % interval: where many sets fit nearly equally well"
    for text in (shown.terminal, shown.page):
        assert (explained in " ".join(text.split())) == outside


@pytest.mark.parametrize("ratio", [2.0, -0.5])
def test_a_tied_parameter_has_the_same_precision_and_groups(shown, ratio):
    row = shown.result.table[0]
    parameters = import_module("dovetail.identification.parameters")
    tied = row.tied_row(parameters.TiedParameter("other.k", ratio, "", "other"))
    assert (tied.precision, tied.verdict, tied.factor) == (row.precision, row.verdict, row.factor)
    assert tied.best_fit_at == ({"upper": "lower"}.get(row.best_fit_at, "") if ratio < 0 else row.best_fit_at)
    for group, other in zip(row.groups or (), tied.groups or (), strict=True):
        assert other.estimate == ratio * group.estimate
        assert other.interval_low < other.estimate < other.interval_high
