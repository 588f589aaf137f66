"""The figure of a comparison: parameters over the series."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from dovetail.pages import INK, LINES, MARKERS, display_unit, panel_grid, set_title, terminal_text
from dovetail_bench.evaluation.comparison import Comparison

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_COLUMNS = 3


def _style(methods: Sequence[str], method: str) -> dict[str, Any]:
    index = methods.index(method)
    return {"color": LINES[index % len(LINES)], "marker": MARKERS[index % len(MARKERS)]}


def parameter_comparison(comparison: Comparison) -> Figure:
    """Draw each parameter over the series, with a curve for each method, and its intervals if there are any.

    Parameters
    ----------
    comparison : Comparison

    Returns
    -------
    matplotlib.figure.Figure
        The upper and lower edges of each panel are the ends of the range; values beyond are drawn at the edge.
    """
    first = next(row.identification for row in comparison.rows if row.identification is not None)
    names = list(first.parameters)
    figure, panels = panel_grid(len(names), _COLUMNS, 1.0, 2.2)
    for axes, name in zip(panels, names, strict=True):
        _draw_parameter(axes, comparison, name)
    for axes in panels[-_COLUMNS:]:
        axes.set_xlabel(terminal_text(comparison.series or "case"), parse_math=False)
    _finish(figure, panels[0], comparison.warning)
    return figure


def _finish(figure: Figure, panel: Axes, warning: str) -> None:
    """Put the legend of a panel above the figure, and a warning above the legend."""
    handles, labels = panel.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=5, fontsize=8.5)
    if warning:
        set_title(figure, warning)


def _logarithmic(axes: Axes) -> None:
    """Make the ordinate logarithmic, with plain numbers at 1, 2 and 5 of each decade."""
    from matplotlib.ticker import FormatStrFormatter, LogLocator, NullFormatter

    axes.set_yscale("log")
    axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.yaxis.set_major_formatter(FormatStrFormatter("%g"))
    axes.yaxis.set_minor_formatter(NullFormatter())


def _draw_parameter(axes: Axes, comparison: Comparison, name: str) -> None:
    positions = [case.value if case.value is not None else index for index, case in enumerate(comparison.cases)]
    parameter = next(r.identification.parameters[name] for r in comparison.rows if r.identification is not None)
    shown = display_unit(parameter.unit, parameter.lower, parameter.upper)
    low, high = parameter.lower * shown.factor, parameter.upper * shown.factor
    if parameter.scale == "log":
        _logarithmic(axes)
    for method in comparison.methods:
        identifications = [comparison.of(case)[method].identification for case in comparison.cases]
        results = [result for result in identifications if result is not None]
        if len(results) < len(identifications):
            continue
        style = _style(comparison.methods, method)
        values = np.clip([_value(result, name) * shown.factor for result in results], low, high)
        axes.plot(positions, values, **style, markersize=3.5, linewidth=1, label=method)
        withheld = (np.nan, np.nan)
        ends = [r.interval[name] if r.is_trustworthy else withheld for r in results if r.interval is not None]
        if ends:
            axes.fill_between(
                positions, *(np.array(ends).T * shown.factor), color=style["color"], alpha=0.15, linewidth=0
            )
    truth = [comparison.truth.get(case.name, {}).get(name, np.nan) * shown.factor for case in comparison.cases]
    if np.isfinite(truth).any():
        axes.plot(positions, truth, color=INK, linestyle=(0, (2, 2)), linewidth=1.6, label="true")
    axes.set_ylim(low, high)
    axes.set_title(f"{name} [{shown.text}]", fontsize=9, color=INK, loc="left", parse_math=False)


def _value(result: Any, name: str) -> float:
    """Return a method's value of one parameter: the posterior estimate, or else the best fit."""
    if result.posterior is not None:
        return float(result.posterior.estimate[result.posterior.names.index(name)])
    return float(result.parameters[name].value)
