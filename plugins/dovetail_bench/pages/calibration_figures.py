"""Figures of a calibration: ranks of the truth, and nominal against achieved coverage."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dovetail.pages import INK, MEASURED, RECONSTRUCTED, panel_grid
from dovetail_bench.evaluation.calibration import Calibration

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_COLUMNS = 4
_CASES_A_BIN, _FEWEST_BINS, _MOST_BINS = 10, 4, 20
_LEVELS = np.linspace(0.02, 0.98, 49)
_BANDS = ((0.99, 0.35), (0.9, 0.6))
"""Confidence and opacity of the bands in which a correct posterior stays."""


def rank_figure(calibration: Calibration) -> Figure:
    """Draw a histogram of the truth's ranks among the samples, in a panel for each parameter.

    Parameters
    ----------
    calibration : Calibration

    Returns
    -------
    matplotlib.figure.Figure
        With the bands in which 90 and 99 % of the bars stay if the posterior is correct. A hill means that it is too
        wide, a valley that it is too narrow, a slope that it is biased.
    """
    from scipy.stats import binom

    count = len(calibration.case)
    bins = int(np.clip(count // _CASES_A_BIN, _FEWEST_BINS, _MOST_BINS))
    figure, panels = _panels(calibration)
    for axes, ranks in zip(panels, calibration.rank.T, strict=True):
        for confidence, opacity in _BANDS:
            low, high = binom.ppf([(1.0 - confidence) / 2.0, (1.0 + confidence) / 2.0], count, 1.0 / bins)
            label = f"{100 * confidence:.0f} % of the bars of a right posterior"
            axes.axhspan(low, high, color=MEASURED, alpha=opacity, linewidth=0, label=label)
        axes.hist(ranks, bins=bins, range=(0.0, 1.0), histtype="step", color=RECONSTRUCTED, linewidth=1.6)
        axes.set_xlim(0.0, 1.0)
        axes.set_ylim(bottom=0.0)
    _finish(figure, panels, "Rank of the truth [-]", "Cases")
    return figure


def coverage_figure(calibration: Calibration) -> Figure:
    """Draw the achieved against the nominal coverage of the intervals, in a panel for each parameter.

    Parameters
    ----------
    calibration : Calibration

    Returns
    -------
    matplotlib.figure.Figure
        With the bands in which a correct posterior stays with 90 and 99 % confidence, at each level alone. Below the
        diagonal the posterior is too narrow.
    """
    figure, panels = _panels(calibration)
    achieved = np.array([calibration.inside(level).mean(axis=0) for level in _LEVELS])
    for axes, curve in zip(panels, achieved.T, strict=True):
        for confidence, opacity in _BANDS:
            band = np.array([calibration.by_chance(level, confidence) for level in _LEVELS])
            label = f"{100 * confidence:.0f} % of right posteriors"
            axes.fill_between(_LEVELS, *band.T, color=MEASURED, alpha=opacity, linewidth=0, label=label)
        axes.plot([0.0, 1.0], [0.0, 1.0], color=INK, linewidth=0.8, linestyle=(0, (4, 3)))
        axes.plot(_LEVELS, curve, color=RECONSTRUCTED, linewidth=1.6)
        axes.set_xlim(0.0, 1.0)
        axes.set_ylim(0.0, 1.0)
    _finish(figure, panels, "Probability of the interval [-]", "Holds the truth [-]")
    return figure


def _panels(calibration: Calibration) -> tuple[Figure, list[Axes]]:
    columns = min(_COLUMNS, len(calibration.names))
    figure, panels = panel_grid(len(calibration.names), columns, 0.8, 1.9, share_x=True)
    for axes, name in zip(panels, calibration.names, strict=True):
        axes.set_title(name, fontsize=9, color=INK, loc="left", parse_math=False)
    return figure, panels


def _finish(figure: Figure, panels: list[Axes], across: str, up: str) -> None:
    figure.supxlabel(across, fontsize=9.5, color=INK)
    figure.supylabel(up, fontsize=9.5, color=INK)
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper right", ncols=len(labels), fontsize=8.5)
