"""The table and the page of a watch."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from dovetail.atomic_files import write_whole
from dovetail.interfaces import Parameter
from dovetail.monitoring import ALARM, MEASURED, REFERENCE, SET_ASIDE, Watch
from dovetail.plain_text import display_unit, number, unit_text
from dovetail.report.line_charts import SIZE, Array, Marks, line_chart
from dovetail.report.pages import write_page
from dovetail.report.result_files import csv_text

TABLE, PAGE = "files.csv", "watch.html"
"""Names of the files."""
_NUMBERS = ("value", "low", "high", "low_total", "high_total")
"""Of each parameter in a record."""
_MOST_ROWS = 50
"""Largest number of rows of a table in the page."""
_LEAST_EVIDENCE, _MOST_EVIDENCE = 1e-3, 1e3
"""Ends of the chart of the evidence; the upper one over the evidence of an alarm."""


def write_watch(watch: Watch, output: Path, title: str) -> None:
    """Write the table and the page of a watch.

    Parameters
    ----------
    watch : Watch
    output : Path
    title : str
    """
    write_whole(output / TABLE, watch_table(watch).encode("utf-8", errors="replace"), overwrite=True)
    write_page(output / PAGE, "watch.html.jinja", page_content(watch, title), charts=False)


def watch_table(watch: Watch) -> str:
    """Return a line for each file as CSV; files without a measurement that counts have no values."""
    parameters = watch.reference.parameters
    covariates = watch.reference.series.covariates
    curves = [curve.covariate for curve in watch.reference.curves]
    head = ["number", "date", "file", "status", "alarm", "evidence", "probability", "residual_level"]
    head += [f"{name} [{covariate.unit}]" for name, covariate in covariates.items()]
    for parameter in parameters:
        name = f"{parameter.name} [{parameter.unit}]"
        head += [name, *(f"{parameter.name}_{end}" for end in ("low_90", "high_90", "low_90_total", "high_90_total"))]
    head += [f"equivalent_{name}{end}" for name in curves for end in ("", "_low_90", "_high_90")]
    rows = []
    for record in watch.records:
        row = [record.get("number", ""), record["date"], record["file"], record["status"], record["status"] == ALARM]
        row += [_or_empty(record.get(name)) for name in ("evidence", "probability", "residual_level")]
        row += [record.get("covariates", {}).get(name, "") for name in covariates]
        for parameter in parameters:
            known = record.get("parameters", {}).get(parameter.name, {})
            row += [known.get(key, "") for key in _NUMBERS]
        for name in curves:
            known = record.get("equivalent", {}).get(name, {})
            row += [known.get(key, "") for key in ("value", "low", "high")]
        rows.append(row)
    return csv_text(head, rows)


def _or_empty(value: float | None) -> float | str:
    return "" if value is None else value


def page_content(watch: Watch, title: str) -> dict[str, Any]:
    """Return the variables of the page's template."""
    counted = [record for record in watch.records if record["status"] in MEASURED]
    alarms = [record for record in counted if record["status"] == ALARM]
    aside = [record for record in watch.records if record["status"] == SET_ASIDE]
    learned = sum(record["status"] == REFERENCE for record in counted)
    marks = Marks(
        len(counted), learned, [record["number"] for record in alarms], [record["date"] for record in counted]
    )
    mark, verdict = _verdict(watch, counted, alarms, learned)
    return {
        "title": title,
        "folder": str(watch.folder),
        "mark": mark,
        "verdict": verdict,
        "count": len(counted),
        "threshold": number(1.0 / watch.options.false_alarms, padded=False),
        "alarms": alarms[::-1][:_MOST_ROWS],
        "aside": aside[::-1][:_MOST_ROWS],
        "more_aside": max(0, len(aside) - _MOST_ROWS),
        "duplicates": len(watch.records) - len(counted) - len(aside),
        "last": counted[-1] if counted else None,
        "rows": _last_rows(watch, counted),
        "charts": _charts(watch, counted, marks) if counted else [],
        "evidence": _evidence_chart(watch, counted, marks) if len(counted) > learned else None,
        "size": SIZE,
    }


def _verdict(
    watch: Watch, counted: Sequence[dict[str, Any]], alarms: Sequence[dict[str, Any]], learned: int
) -> tuple[str, str]:
    wanted = watch.options.reference
    if not counted:
        return "open", "No measurement yet."
    if alarms:
        last = alarms[-1]
        several = f"{len(alarms)} alarms, the last" if len(alarms) > 1 else "Alarm"
        return (
            "bad",
            f"{several} at {last['file']} ({last['date'][:16].replace('T', ' ')}). {' '.join(last['reasons'])}",
        )
    if learned == len(counted):
        return "open", f"Learning what is usual: {learned} of the first {wanted} files. No alarm is raised before."
    return "good", f"No alarm: all {len(counted) - learned} files after the first {learned} are as predicted."


def _last_rows(watch: Watch, counted: Sequence[dict[str, Any]]) -> list[dict[str, str]]:
    """Return the parameters of the last file as text."""
    rows = []
    for parameter in watch.reference.parameters if counted else ():
        unit = display_unit(parameter.unit, parameter.lower, parameter.upper)
        known = counted[-1]["parameters"][parameter.name]
        value, *ends = (number(known[key] * unit.factor, 5) for key in _NUMBERS)
        row = {"name": parameter.name, "unit": unit.text, "value": value, "role": _role(watch, parameter)}
        rows.append(row | {"interval": f"{ends[0]} to {ends[1]}", "total": f"{ends[2]} to {ends[3]}"})
    return rows


def _role(watch: Watch, parameter: Parameter) -> str:
    role = watch.reference.series.role_of(parameter.name)
    return {"shared": "constant", "free": "free"}.get(role.name, "drifts")


def _curve(known: Sequence[dict[str, Any]], factor: float = 1.0) -> tuple[Array, Array, Array]:
    value, low, high = (np.array([one[key] for one in known]) * factor for key in _NUMBERS[:3])
    return value, low, high


def _charts(watch: Watch, counted: Sequence[dict[str, Any]], marks: Marks) -> list[dict[str, Any]]:
    charts = []
    for parameter in watch.reference.parameters:
        unit = display_unit(parameter.unit, parameter.lower, parameter.upper)
        known = [record["parameters"][parameter.name] for record in counted]
        curve = _curve(known, unit.factor)
        heading = f"{parameter.name}{f' [{unit.text}]' if unit.text else ''}"
        about = f"{parameter.description}{'' if not parameter.description else '. '}".replace("..", ".")
        note = f"{about}{_role(watch, parameter).capitalize()}."
        charts.append({"heading": heading, "note": note, **line_chart(curve, marks)})
    for law in watch.reference.curves:
        with_it = [record for record in counted if law.covariate in record["equivalent"]]
        if not with_it:
            continue
        known = [record["equivalent"][law.covariate] for record in with_it]
        band = _curve(known)
        numbers = np.array([float(record["number"]) for record in with_it])
        heading = f"Equivalent {law.covariate} [{unit_text(law.unit)}]"
        note = f"The {law.covariate} at which the laws of the series give the identified parameters."
        charts.append({"heading": heading, "note": note, **line_chart(band, marks, numbers=numbers)})
    return charts


def _evidence_chart(watch: Watch, counted: Sequence[dict[str, Any]], marks: Marks) -> dict[str, Any]:
    tested = [record for record in counted if record["probability"] is not None]
    highest = _MOST_EVIDENCE / watch.options.false_alarms
    values = np.log10(np.clip([record["evidence"] for record in tested], _LEAST_EVIDENCE, highest))
    numbers = np.array([float(record["number"]) for record in tested])
    threshold = float(-np.log10(watch.options.false_alarms))
    return line_chart((values, values, values), marks, numbers=numbers, threshold=threshold)
