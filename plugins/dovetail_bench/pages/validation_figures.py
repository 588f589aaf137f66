"""Figures of a validation: the FRFs of every case, and resonances over a series."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from dovetail import Frf
from dovetail.pages import (
    INK,
    LINES,
    MARKERS,
    MEASURED,
    RECONSTRUCTED,
    draw_amplitude,
    new_figure,
    set_title,
    style_axes,
    terminal_text,
)
from dovetail_bench.evaluation.validation import PeakRow, ValidatedCase, Validation

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_PANEL_HEIGHT = 2.5
"""Inches."""
_COMPENSATED = LINES[2]


def validation_figure(validation: Validation) -> Figure:
    """Draw for each case the amplitude as measured, without the accelerometer, and as predicted.

    Parameters
    ----------
    validation : Validation

    Returns
    -------
    matplotlib.figure.Figure
        Compensated and predicted peaks are marked, those without a counterpart with a cross.
    """
    count = len(validation.cases)
    figure = new_figure(0.7 + _PANEL_HEIGHT * count)
    panels = figure.subplots(count, 1, squeeze=False)[:, 0]
    for axes, case in zip(panels, validation.cases, strict=True):
        _draw_case(axes, case)
    panels[0].legend(loc="lower right", ncols=3, fontsize=9)
    set_title(figure, validation.title, validation.warning)
    panels[-1].set_xlabel("Frequency [Hz]")
    return figure


def _draw_case(axes: Axes, case: ValidatedCase) -> None:
    style_axes(axes)
    curves: tuple[tuple[Frf, dict[str, Any]], ...] = (
        (case.measured, {"color": MEASURED, "linewidth": 1.2, "linestyle": (0, (4, 2)), "label": "measured"}),
        (case.compensated, {"color": _COMPENSATED, "linewidth": 2.4, "label": "compensated"}),
        (case.predicted, {"color": RECONSTRUCTED, "linewidth": 1.1, "label": "predicted"}),
    )
    for frf, style in curves:
        draw_amplitude(axes, frf, style)
    for row in case.peaks:
        _mark(axes, case, row)
    axes.set_title(terminal_text(case.case.name), fontsize=10, color=INK, loc="left", parse_math=False)
    axes.set_xlim(float(case.predicted.frequency[0]), float(case.predicted.frequency[-1]))


def _mark(axes: Axes, case: ValidatedCase, row: PeakRow) -> None:
    alone = row.compensated is None or row.predicted is None
    for peak, frf, colour in (
        (row.compensated, case.compensated, _COMPENSATED),
        (row.predicted, case.predicted, RECONSTRUCTED),
    ):
        if peak is not None:
            height = float(np.interp(peak, frf.frequency, frf.amplitude))
            axes.plot([peak], [height], "x" if alone else "o", color=colour, markersize=6 if alone else 4)


def series_figure(validation: Validation) -> Figure:
    """Draw measured, compensated and predicted resonances over the values of the cases.

    Parameters
    ----------
    validation : Validation
        With a series.

    Returns
    -------
    matplotlib.figure.Figure
        One panel for each resonance, the lowest at the bottom; with the model's natural frequencies if there are as
        many.
    """
    cases = sorted(validation.cases, key=lambda case: case.case.value or 0.0)
    most = max(len(_compensated(case)) for case in cases)
    figure = new_figure(0.8 + 2.1 * max(most, 1))
    panels = figure.subplots(max(most, 1), 1, squeeze=False, sharex=True)[::-1, 0]
    for index, axes in enumerate(panels):
        _draw_resonance(axes, cases, index)
    panels[-1].legend(loc="best", fontsize=9)
    panels[0].set_xlabel(terminal_text(validation.series), parse_math=False)
    set_title(figure, validation.title, validation.warning)
    return figure


def _compensated(case: ValidatedCase) -> list[PeakRow]:
    return [row for row in case.peaks if row.compensated is not None]


def _draw_resonance(axes: Axes, cases: Sequence[ValidatedCase], index: int) -> None:
    style_axes(axes)
    present = [case for case in cases if index < len(_compensated(case))]
    values = [case.case.value or 0.0 for case in present]
    curves = {
        name: (colour, marker, "-", [getattr(_compensated(case)[index], name) for case in present])
        for name, colour, marker in (
            ("measured", MEASURED, MARKERS[0]),
            ("compensated", _COMPENSATED, MARKERS[1]),
            ("predicted", RECONSTRUCTED, MARKERS[2]),
        )
    }
    if all(len(case.natural) == len(_compensated(case)) for case in present):
        curves["natural, of the model"] = (INK, MARKERS[3], ":", [case.natural[index] for case in present])
    for name, (colour, marker, line, frequencies) in curves.items():
        drawn = np.array([np.nan if frequency is None else frequency for frequency in frequencies])
        axes.plot(values, drawn, color=colour, marker=marker, markersize=4.5, linestyle=line, linewidth=1.2, label=name)
    axes.set_ylabel(f"Resonance {index + 1} [Hz]")
