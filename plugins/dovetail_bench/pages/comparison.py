"""The report of a comparison: one HTML file with figures 11 and 12 and tables 4 and 5 of Processes 14 (2026) 1875."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

from dovetail.evaluation import NOT_TRUSTWORTHY, joined_warnings
from dovetail.pages import (
    ABSENT,
    Column,
    Table,
    as_data,
    chart_data,
    display_unit,
    fixed,
    hertz,
    number,
    page_figure,
    write_page,
)
from dovetail_bench.evaluation.cases import Case
from dovetail_bench.evaluation.comparison import Compared, Comparison
from dovetail_bench.pages.comparison_figures import parameter_comparison

Row = list[Any]

_PARAMETERS = (
    "case", "value", "method", "parameter", "unit", "identified", "estimate", "lower", "upper", "precision",
    "verdict", "truth", "is_trustworthy",
)  # fmt: skip

_MOST_LINES = 1600
"""Largest number of lines in a chart, which has up to eight curves with all their peaks and dips."""


def write_comparison(comparison: Comparison, path: str | Path) -> Path:
    """Write a comparison as one self-contained HTML file, which loads nothing.

    Parameters
    ----------
    comparison : Comparison
    path : str or Path
        An existing file is replaced; the file is written atomically.

    Returns
    -------
    Path
    """
    figures = [
        (case.name, f"chart-{index + 1}", as_data(_chart(comparison, case)), _case_warning(comparison, case))
        for index, case in enumerate(comparison.cases)
    ]
    figure = parameter_comparison(comparison) if any(row.identification for row in comparison.rows) else None
    content = {
        "title": comparison.title,
        "warning": comparison.warning,
        "series": comparison.series,
        "cases": [case.name for case in comparison.cases],
        "methods": comparison.methods,
        "tables": comparison_tables(comparison),
        "verdicts": _verdicts(comparison),
        "parameters": figure and page_figure(figure, "parameters", "Identified parameters"),
        "figures": figures,
        "truth": bool(comparison.truth),
    }
    return write_page(path, "comparison.html.jinja", content, package="dovetail_bench.pages")


def _chart(comparison: Comparison, case: Case) -> dict[str, Any]:
    """Return the chart data of one measurement and all its reconstructions, with the agreement of each."""
    rows = comparison.of(case)
    roles = {f"method-{index}": method for index, method in enumerate(rows)}
    curves = {"measured": ("measured", next(iter(rows.values())).measured)}
    curves |= {role: (method, rows[method].frf) for role, method in roles.items()}
    agreement = {role: rows[method].coherence for role, method in roles.items()}
    title = f"Measured and reconstructed FRFs of {case.name} and their agreement"
    return chart_data(title, curves, coherence=agreement, most=_MOST_LINES)


def _case_warning(comparison: Comparison, case: Case) -> str:
    return joined_warnings((method, row.identification) for method, row in comparison.of(case).items())


def _not_trustworthy(rows: Iterable[Compared], name: Callable[[Compared], str]) -> str:
    """Return the names of the results that are not trustworthy, separated by semicolons."""
    return "; ".join(name(row) for row in rows if not row.is_trustworthy)


def comparison_tables(comparison: Comparison) -> dict[str, Table]:
    """Return mean coherence (Table 4), resonances (Table 5), times and parameters, by the names of their files."""
    method = Column("method", "method", is_number=False)
    untrusted = Column("not trustworthy", "not_trustworthy", is_number=False)
    case = Column("case", "case", is_number=False)
    peaks = [Column("mode", "mode"), Column("measured [Hz]", "measured_Hz")]
    times = [Column("training", "training_s"), Column("one identification (median)", "identification_s")]
    cases = [Column(case.name, case.name) for case in comparison.cases]
    methods = [Column(name, name) for name in comparison.methods]
    return {
        "coherence": Table([method, *cases, untrusted], list(_coherence_rows(comparison))),
        "frequencies": Table([case, *peaks, *methods, untrusted], list(_frequency_rows(comparison))),
        "times": Table([method, *times, untrusted], list(_time_rows(comparison))),
        "parameters": Table([Column(name, name) for name in _PARAMETERS], list(parameter_value_rows(comparison))),
    }


def _coherence_rows(comparison: Comparison) -> Iterator[Row]:
    """Yield method, mean coherence of each case (Table 4), and the cases with a result that is not trustworthy."""
    for method in comparison.methods:
        rows = [comparison.of(case)[method] for case in comparison.cases]
        yield [
            method,
            *(f"{row.mean_coherence:.4f}" for row in rows),
            _not_trustworthy(rows, lambda row: row.case.name),
        ]


def _frequency_rows(comparison: Comparison) -> Iterator[Row]:
    """Yield case, number and frequency of each resonance, and each method's error in per cent (Table 5).

    The last cell names the methods with a result that is not trustworthy.
    """
    for case in comparison.cases:
        compared = comparison.of(case)
        for index, (measured, _) in enumerate(next(iter(compared.values())).peaks):
            errors = [_error(compared[method].peaks[index]) for method in comparison.methods]
            untrusted = _not_trustworthy(compared.values(), lambda row: row.method)
            yield [case.name, index + 1, hertz(measured), *errors, untrusted]


def _error(peak: tuple[float, float | None]) -> str:
    measured, reconstructed = peak
    return ABSENT if reconstructed is None else fixed(100.0 * (reconstructed / measured - 1.0), 2, signed=True)


def _time_rows(comparison: Comparison) -> Iterator[Row]:
    """Yield method, seconds of training, median seconds of one identification, and the cases not trustworthy."""
    for method in comparison.methods:
        rows = [row for row in comparison.rows if row.method == method]
        times = sorted(row.seconds for row in rows)
        training = comparison.training.get(method)
        seconds = [ABSENT if training is None else f"{training:.0f}", f"{times[len(times) // 2]:.3f}"]
        yield [method, *seconds, _not_trustworthy(rows, lambda row: row.case.name)]


def parameter_value_rows(comparison: Comparison) -> Iterator[Row]:
    """Yield what each result says of each parameter, in SI, as the columns of the table of parameters have it.

    The last cell says whether the result can be trusted; if not, there is no interval.
    """
    for row in comparison.rows:
        if row.identification is None:
            continue
        posterior = row.identification.posterior
        intervals = {} if posterior is None or not row.is_trustworthy else posterior.interval()
        for index, (name, parameter) in enumerate(row.identification.parameters.items()):
            low, high = intervals.get(name, ("", ""))
            estimate = "" if posterior is None else float(posterior.estimate[index])
            judged = None if posterior is None else posterior.verdicts[name]
            words = ("", "") if judged is None else (judged.precision, judged.word)
            true = comparison.truth.get(row.case.name, {}).get(name, "")
            yield [
                row.case.name, row.case.value, row.method, name, parameter.unit, parameter.value,
                estimate, low, high, *words, true, row.is_trustworthy,
            ]  # fmt: skip


def _verdicts(comparison: Comparison) -> list[tuple[str, str, list[tuple[str, str, str]]]]:
    """Return for each parameter its name, its unit, and the results of each case with a posterior."""
    results = [(row.case.name, row.identification) for row in comparison.rows if row.identification is not None]
    known = [(name, result, result.posterior) for name, result in results if result.posterior is not None]
    if not known:
        return []
    table = []
    for index, (name, parameter) in enumerate(known[0][1].parameters.items()):
        shown = display_unit(parameter.unit, parameter.lower, parameter.upper)
        cells: list[tuple[str, str, str]] = []
        for case, _, posterior in known:
            low, high = posterior.interval()[name]
            texts = [number(value * shown.factor) for value in (float(posterior.estimate[index]), low, high)]
            true = comparison.truth.get(case, {}).get(name)
            inside = "" if true is None else ("✓" if low <= true <= high else "✗")
            interval = f"{texts[1]} to {texts[2]} {inside}".strip()
            judged = posterior.verdicts[name]
            words = ", ".join(filter(None, [judged.precision, judged.word]))
            cells.append((texts[0], "withheld" if judged.word == NOT_TRUSTWORTHY else interval, words))
        table.append((name, shown.text, cells))
    return table
