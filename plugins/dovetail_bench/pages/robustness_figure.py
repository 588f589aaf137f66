"""Figure of a test of robustness: accuracy over the noise level."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from dovetail.pages import DASHES, LINES, MARKERS, new_figure, style_axes

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_WORST_R2, _WORST_RMSE = -0.6, 0.45
"""Limits of the axes in figures of robustness; guessing the middle of the range gives 0 and 0.29."""


def robustness_figure(table: Sequence[Mapping[str, Any]]) -> Figure:
    """Draw R2 and RMSE over the noise level, with one line for each model.

    Parameters
    ----------
    table : sequence of mappings
        Each with ``model``, ``level``, ``r2`` and ``rmse`` (relative to the range); None or NaN leaves a gap.

    Returns
    -------
    matplotlib.figure.Figure
        Values far worse than guessing the middle of the range are outside the axes.
    """
    figure = new_figure(3.6)
    r2_axes, rmse_axes = figure.subplots(1, 2)
    for index, model in enumerate(dict.fromkeys(str(row["model"]) for row in table)):
        rows = sorted((row for row in table if str(row["model"]) == model), key=lambda row: float(row["level"]))
        levels = np.array([row["level"] for row in rows], dtype=np.float64)
        style = {
            "color": LINES[index % len(LINES)],
            "linestyle": DASHES[index % len(DASHES)],
            "marker": MARKERS[index % len(MARKERS)],
            "markersize": 5,
            "linewidth": 1.6,
        }
        for axes, key in ((r2_axes, "r2"), (rmse_axes, "rmse")):
            axes.plot(levels, np.array([row[key] for row in rows], dtype=np.float64), label=model, **style)
    for axes, quantity in ((r2_axes, "R² [-]"), (rmse_axes, "RMSE, part of the range [-]")):
        style_axes(axes)
        axes.set_xlabel("Noise level, part of the data's standard deviation [-]")
        axes.set_ylabel(quantity)
    if r2_axes.get_ylim()[0] < _WORST_R2:
        r2_axes.set_ylim(_WORST_R2, 1.05)
    if rmse_axes.get_ylim()[1] > _WORST_RMSE:
        rmse_axes.set_ylim(0.0, _WORST_RMSE)
    if table:
        for text in r2_axes.legend(loc="best", fontsize=9.5).get_texts():
            text.set_parse_math(False)
    return figure
