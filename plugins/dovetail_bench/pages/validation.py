"""The report of a validation: one HTML file with all measurements and predictions, and tables of resonances."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from dovetail.evaluation import NOT_TRUSTWORTHY
from dovetail.pages import Column, Table, as_data, chart_data, hertz, page_figure, write_page
from dovetail_bench.evaluation.validation import ValidatedCase, Validation
from dovetail_bench.pages.validation_figures import series_figure

_MOST_LINES = 2400
"""Largest number of lines of an FRF in a chart, including peaks and dips."""


def write_validation(validation: Validation, path: str | Path) -> Path:
    """Write a validation as one self-contained HTML file, which loads nothing.

    Parameters
    ----------
    validation : Validation
    path : str or Path
        An existing file is replaced; the file is written atomically.

    Returns
    -------
    Path
    """
    series = None
    if validation.series:
        series = page_figure(series_figure(validation), "series", "Resonances over the series")
    cases = [
        (
            f"chart-{index + 1}",
            case.case.name,
            as_data(_chart(case)),
            validation_table([case]).without("case", "joint"),
            f"{case.mean_coherence:.4f}",
            case.is_trustworthy,
        )
        for index, case in enumerate(validation.cases)
    ]
    content = {
        "title": validation.title,
        "warning": validation.warning,
        "verdict": _verdict(validation),
        "cases": cases,
        "series": series,
    }
    return write_page(path, "validation.html.jinja", content, package="dovetail_bench.pages")


def _chart(case: ValidatedCase) -> dict[str, Any]:
    curves = {
        "measured": ("compensated", case.compensated),
        "before": ("as measured", case.measured),
        "model": ("predicted", case.predicted),
    }
    return chart_data(f"FRFs of {case.case.name}", curves, natural=case.natural, most=_MOST_LINES)


def validation_table(cases: Iterable[ValidatedCase]) -> Table:
    """Return each resonance as measured, compensated and predicted, the error and the shift, case by case."""
    columns = [
        Column("case", "case", is_number=False, once=True),
        Column("", "value"),
        Column("measured [Hz]", "measured_Hz", _hertz),
        Column("compensated [Hz]", "compensated_Hz", _hertz),
        Column("predicted [Hz]", "predicted_Hz", _hertz),
        Column("error [%]", "error_percent", _percent),
        Column("shift [%]", "shift_percent", _percent),
        Column("joint", "", is_number=False, once=True),
        Column("", "is_trustworthy"),
    ]
    rows = []
    for case in cases:
        method = "" if case.joint is None else case.joint.method
        joint = method if case.is_trustworthy else f"{method}, {NOT_TRUSTWORTHY}"
        for peak in case.peaks:
            values = (peak.measured, peak.compensated, peak.predicted, peak.error, peak.shift)
            rows.append([case.case.name, case.case.value, *values, joint, case.is_trustworthy])
    return Table(columns, rows)


def _hertz(frequency: float | None) -> str:
    return "-" if frequency is None else hertz(frequency)


def _percent(value: float | None) -> str:
    return "-" if value is None else f"{value:+.2f}"


def _verdict(validation: Validation) -> str:
    """Return a sentence on the errors of the predictions and the number of resonances without a counterpart."""
    peaks = [row for case in validation.cases for row in case.peaks]
    errors = [abs(row.error) for row in peaks if row.error is not None]
    alone = len(peaks) - len(errors)
    if not errors:
        return "No resonance has a counterpart."
    said = f"{len(errors)} resonances are predicted within {max(errors):.2g} %."
    return said + (f" {alone} {'has' if alone == 1 else 'have'} no counterpart." if alone else "")
