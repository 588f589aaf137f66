"""The report of a calibration: one HTML file with the coverage of the intervals in tables and figures."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from dovetail.pages import Column, Table, page_figure, write_page
from dovetail_bench.evaluation.calibration import CalibratedParameter, Calibration
from dovetail_bench.pages.calibration_figures import coverage_figure, rank_figure

_PERCENT, _TWO = "{:.1%}".format, "{:.2f}".format


def write_calibration(calibration: Calibration, path: str | Path, title: str) -> Path:
    """Write a calibration as one self-contained HTML file without scripts, which loads nothing.

    Parameters
    ----------
    calibration : Calibration
    path : str or Path
        An existing file is replaced; the file is written atomically.
    title : str
        Such as the assembly's name.

    Returns
    -------
    Path
    """
    figures = (
        ("coverage", "Intervals of every probability", coverage_figure(calibration), _COVERAGE_CAPTION),
        ("ranks", "Where the truth lies among the samples", rank_figure(calibration), _RANK_CAPTION),
    )
    mark, verdict = calibration_verdict(calibration)
    content = {
        "title": title,
        "mark": mark,
        "verdict": verdict,
        "setting": _setting(calibration),
        "table": calibration_table(calibration),
        "outside": [parameter.name for parameter in calibration.parameters if not _by_chance(parameter)],
        "times": calibration_times(calibration),
        "figures": [
            (heading, page_figure(figure, name, heading), caption) for name, heading, figure, caption in figures
        ],
    }
    return write_page(path, "calibration.html.jinja", content, package="dovetail_bench.pages", charts=False)


_COVERAGE_CAPTION = (
    "Below the diagonal the intervals are too narrow, above it too wide. The bands are those in which a right "
    "posterior stays with 90 and 99 % confidence, at each probability by itself."
)
_RANK_CAPTION = (
    "A hill: the posterior is less sure than it may be. A valley: it is too sure. A slope: it lies to one side. "
    "The bands are those in which 90 and 99 % of the bars of a right posterior stay."
)


def calibration_table(calibration: Calibration) -> Table:
    """Return a row for each parameter, with its coverage and the limits that chance allows, and one for all."""
    columns = [
        Column("parameter", "parameter", is_number=False),
        Column("90 % intervals hold the truth", "coverage", _PERCENT),
        Column("by chance", "", lambda ends: f"{ends[0]:.1%} to {ends[1]:.1%}"),
        Column("", "by_chance_from"),
        Column("", "by_chance_to"),
        Column("R2 of the estimate", "r2", _TWO),
        Column("uniform ranks, p", "p_uniform", _TWO),
    ]
    rows = [[p.name, p.coverage, p.by_chance, *p.by_chance, p.r2, p.p_uniform] for p in calibration.parameters]
    covered, error = calibration.coverage
    mean_r2 = calibration.to_dict()["mean_r2"]
    return Table(columns, rows, ["all", f"{covered:.1%}", f"± {error:.1%}", "", "", f"{mean_r2:.3f}", ""])


def calibration_times(calibration: Calibration) -> str:
    """Return sentences on the time of the cases, the effective samples, and the results that are not trustworthy."""
    plain = calibration.to_dict()
    seconds, effective, count = plain["seconds"], plain["effective_samples"], plain["not_trustworthy"]
    note = f" Results that are not trustworthy: {count}; they count like the others." if count else ""
    at_once = "on a cluster" if calibration.workers is None else f"{calibration.workers} at once"
    return (
        f"{plain['cases']} cases in {calibration.wall_seconds:.0f} s, {at_once}; each "
        f"{seconds['median']:.1f} s in the median, {seconds['most']:.1f} s at most. Effective samples: "
        f"{effective['median']:.0f} in the median, {effective['least']:.0f} at least.{note}"
    )


def calibration_verdict(calibration: Calibration) -> tuple[str, str]:
    """Return a mark and a sentence: whether the intervals hold the truth as often as they should.

    Returns
    -------
    mark : {"good", "rough"}
    sentence : str
    """
    parameters = calibration.parameters
    covered, error = calibration.coverage
    within = sum(map(_by_chance, parameters))
    sentence = (
        f"The 90 % intervals hold the truth in {covered:.1%} (± {error:.1%}) of the cases; of {within} of "
        f"{len(parameters)} parameters as often as chance allows."
    )
    return ("good" if within == len(parameters) else "rough"), sentence


def _by_chance(parameter: CalibratedParameter) -> bool:
    low, high = parameter.by_chance
    return low <= parameter.coverage <= high


def _setting(calibration: Calibration) -> list[tuple[str, Any]]:
    setting = calibration.setting
    kind = "of each line" if setting.noise_kind == "proportional" else "of the FRF's standard deviation"
    rows: list[tuple[str, Any]] = [
        ("Method", setting.method),
        ("Noise", f"{setting.noise:g} {kind}"),
        ("Cases", f"{len(calibration.case)} of {setting.cases}"),
        ("Seed", setting.seed),
    ]
    if setting.method == "posterior":
        rows.append(("Samples of each", setting.samples))
    if setting.model_error:
        rows.append(("Model error allowed", f"{setting.model_error:g} of natural frequencies"))
    if setting.finer_mesh > 1:
        rows.append(("Mesh of the truth", f"{setting.finer_mesh} times finer"))
    return rows
