"""Tables and figures of the result of a series."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from dovetail.report.figures import INK, RECONSTRUCTED, panel_grid, set_title
from dovetail.report.result_files import csv_text
from dovetail.series.result import SeriesIdentification, SeriesRow

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_HEAD = ("unit", "role", "best_fit", "standard_deviation", "estimate", "low_90", "high_90", "precision", "verdict")


def unknown_table(result: SeriesIdentification) -> str:
    """Return the unknowns of the series as CSV."""
    return csv_text(("unknown", *_HEAD), ((row.name, *_cells(row)) for row in result.rows))


def parameter_table(result: SeriesIdentification) -> str:
    """Return the parameters of each test, with its covariates, as CSV."""
    units = (f"{name} [{covariate.unit}]" for name, covariate in result.series.covariates.items())
    lines = []
    for index, one in enumerate(result.tests):
        values = [one.test.covariates.get(name, "") for name in result.series.covariates]
        lines += [(one.test.name, *values, row.name, *_cells(row)) for row in result.rows_of(index)]
    return csv_text(("test", *units, "parameter", *_HEAD), lines)


def _cells(row: SeriesRow) -> Sequence[object]:
    interval = ["" if value is None else value for value in (row.estimate, row.low, row.high)]
    return (row.unit, row.role, row.fit, row.deviation, *interval, row.precision, row.verdict)


def covariate_figure(result: SeriesIdentification) -> Figure:
    """Draw every parameter over its covariate, with 90 % intervals (by the fit alone, ±1.64 standard deviations).

    A parameter is drawn over the covariate of its law, or else over the first covariate that all its tests have, or
    over the tests in their order.
    """
    names = list(dict.fromkeys(p.name for one in result.tests for p in one.test.assembly.parameters))
    rows = [row for index in range(len(result.tests)) for row in result.rows_of(index)]
    figure, panels = panel_grid(len(names), min(3, len(names)), 0.6, 2.4)
    for name, axes in zip(names, panels, strict=False):
        _draw_parameter(axes, result, name, [row for row in rows if row.name == name])
    set_title(figure, f"{result.series.name}: parameters of {len(result.tests)} tests, with 90 % intervals")
    return figure


def _draw_law(axes: Axes, result: SeriesIdentification, name: str) -> None:
    """Draw the law of a parameter between the tests, with its 90 % band; without samples, the best fit alone."""
    covariate, low, middle, high = result.law_curve(name)
    axes.plot(covariate, middle, color=RECONSTRUCTED, linewidth=1.0)
    if result.posterior is not None:
        axes.fill_between(covariate, low, high, color=RECONSTRUCTED, alpha=0.2, linewidth=0.0)


def _draw_parameter(axes: Axes, result: SeriesIdentification, name: str, rows: Sequence[SeriesRow]) -> None:
    tests = {one.test.name: one.test for one in result.tests}
    row_covariates = [tests[row.test].covariates for row in rows]
    common = [key for key in result.series.covariates if all(key in values for values in row_covariates)]
    over = result.series.role_of(name).over or (common[0] if common else "")
    positions = [values[over] for values in row_covariates] if over else list(np.arange(len(rows), dtype=float))
    middles = np.array([row.fit if row.estimate is None else row.estimate for row in rows])
    spread = [1.645 * row.deviation for row in rows]
    lows = np.array([m - s if row.low is None else row.low for m, s, row in zip(middles, spread, rows, strict=True)])
    highs = np.array([m + s if row.high is None else row.high for m, s, row in zip(middles, spread, rows, strict=True)])
    if over and result.series.role_of(name).law is not None:
        _draw_law(axes, result, name)
    axes.vlines(positions, lows, highs, color=RECONSTRUCTED, linewidth=2.0)
    axes.plot(positions, middles, "o", color=RECONSTRUCTED, markersize=4)
    axes.plot(positions, [row.fit for row in rows], "_", color=INK, markersize=9)
    unit = result.series.covariates[over].unit if over else ""
    if not over:
        axes.set_xticks(positions, [row.test for row in rows], rotation=45, ha="right")
    axes.set_xlabel(f"{over} [{unit}]" if over else "test")
    axes.set_ylabel(f"{name} [{rows[0].unit}]")
    axes.set_title(rows[0].role, loc="left", fontsize=9)
