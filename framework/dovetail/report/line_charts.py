"""Small line charts over the number of a file, as SVG paths for the template of a page."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.plain_text import number

Array = NDArray[np.float64]

WIDTH, HEIGHT = 720, 190
LEFT, RIGHT, TOP, BOTTOM = 78, 8, 8, 26
"""Free parts of a chart, in its own units; texts are as large on a telephone as they are elsewhere."""
SIZE = {"width": WIDTH, "height": HEIGHT, "left": LEFT, "right": WIDTH - RIGHT, "top": TOP, "bottom": HEIGHT - BOTTOM}
"""Size of a chart, and the edges of its panel."""
_MOST_POINTS = 480
"""Points of a curve; of more files, each point represents several."""
_TICKS, _PLACES = 4, 4
"""Labels at the side and below."""
_MARGIN = 0.08
"""Free part of the height above and below the curve."""


@dataclass(frozen=True)
class Marks:
    """What all charts of a page show.

    Parameters
    ----------
    files : int
        The last number.
    learned : int
        The last of the first files.
    alarms : sequence of int
        Numbers of the files that raised an alarm.
    dates : sequence of str
        Of all files.
    """

    files: int
    learned: int
    alarms: Sequence[int]
    dates: Sequence[str]


def line_chart(
    curve: tuple[Array, Array, Array],
    marks: Marks,
    *,
    numbers: Array | None = None,
    threshold: float | None = None,
) -> dict[str, Any]:
    """Return the paths and labels of a chart.

    Parameters
    ----------
    curve : three (n,) arrays
        Values, and the lower and the upper end of a band about them.
    marks : Marks
    numbers : (n,) array, optional
        Numbers of the files; all by default.
    threshold : float, optional
        A level to mark.
    """
    x = np.arange(1.0, len(curve[0]) + 1.0) if numbers is None else numbers
    x, values, low, high = _thinned(x, *curve)
    ends = [*low, *high] + ([] if threshold is None else [threshold])
    bottom, top = float(np.min(ends)), float(np.max(ends))
    room = _MARGIN * (top - bottom) or max(abs(top) * 1e-3, 1e-12)
    bottom, top = bottom - room, top + room

    def across(numbers: Array) -> Array:
        return LEFT + (numbers - 1.0) / max(marks.files - 1.0, 1.0) * (WIDTH - LEFT - RIGHT)

    def down(levels: Array) -> Array:
        return TOP + (top - levels) / (top - bottom) * (HEIGHT - TOP - BOTTOM)

    xs = across(x)
    band = [*zip(xs, down(high), strict=True), *zip(xs[::-1], down(low)[::-1], strict=True)]
    middle = float(across(np.array([marks.learned + 0.5]))[0])
    return {
        "line": _path(zip(xs, down(values), strict=True)),
        "dots": "".join(f"M{a:.1f} {b:.1f}h0" for a, b in zip(xs, down(values), strict=True)),
        "band": _path(band) + "Z",
        "learned": max(0.0, min(middle, WIDTH - RIGHT) - LEFT) if marks.learned else 0.0,
        "alarms": [round(float(place), 1) for place in across(np.array(marks.alarms, dtype=float))],
        "threshold": None if threshold is None else round(float(down(np.array([threshold]))[0]), 1),
        "levels": [
            {"y": round(float(down(np.array([level]))[0]), 1), "text": text} for level, text in _ticks(bottom, top)
        ],
        "places": _places(marks, across),
    }


def _thinned(x: Array, *curves: Array) -> tuple[Array, ...]:
    """Return at most `_MOST_POINTS` points: means of the values, the lowest and highest ends of the band."""
    if len(x) <= _MOST_POINTS:
        return (x, *curves)
    groups = np.array_split(np.arange(len(x)), _MOST_POINTS)
    values, low, high = curves
    means = (np.array([each[rows].mean() for rows in groups]) for each in (x, values))
    ends = np.array([low[rows].min() for rows in groups]), np.array([high[rows].max() for rows in groups])
    return (*means, *ends)


def _path(points: Any) -> str:
    return "M" + "L".join(f"{across:.1f} {down:.1f}" for across, down in points)


def _ticks(bottom: float, top: float) -> list[tuple[float, str]]:
    raw = (top - bottom) / _TICKS
    power = 10.0 ** math.floor(math.log10(raw))
    step = next(power * factor for factor in (1.0, 2.0, 5.0, 10.0) if power * factor >= raw)
    levels = np.arange(math.ceil(bottom / step), math.floor(top / step) + 1) * step
    digits = max(3, 1 + math.ceil(math.log10(max(abs(top), abs(bottom), step) / step)))
    return [(float(level), number(float(level), min(digits, 9), padded=False)) for level in levels]


def _places(marks: Marks, across: Any) -> list[dict[str, Any]]:
    """Return labels below the chart: numbers of files, the first and the last with the date."""
    count = min(_PLACES, marks.files)
    numbers = np.unique(np.linspace(1, marks.files, count).round().astype(int)).tolist()
    labels = []
    for one in numbers:
        anchor = "start" if one == numbers[0] else "end" if one == numbers[-1] else "middle"
        text = f"{one} ({marks.dates[one - 1][:10]})" if anchor != "middle" or count == 1 else str(one)
        labels.append({"x": round(float(across(np.array([float(one)]))[0]), 1), "anchor": anchor, "text": text})
    return labels
