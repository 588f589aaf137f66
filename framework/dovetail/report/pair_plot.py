"""What trades with what: the parameters that correlate most, two a panel, as plain numbers for the report's drawing."""

from __future__ import annotations

from typing import Any

import numpy as np

from dovetail.identification import Identification
from dovetail.report.wording import fixed

__all__ = ["pair_plot"]

_MOST, _SAMPLES, _SIZE, _GAP, _MARGIN = 6, 150, 92, 8, 86
"""Parameters and samples that are drawn; pixels of a panel, between panels, and for names."""
_LEAST = 0.3
"""Correlation below which two parameters do not trade."""


def pair_plot(result: Identification) -> dict[str, Any] | None:
    """Return panels of samples for the parameters that trade most; None without samples, or where none trades.

    Parameters
    ----------
    result : Identification
        Of one that is not to be believed nothing is drawn.
    """
    posterior = result.posterior
    if posterior is None or not result.believable or len(result.parameters) < 2:
        return None
    correlation = np.abs(np.nan_to_num(posterior.correlation)) - np.eye(len(result.parameters))
    if correlation.max() < _LEAST:
        return None
    strongest = np.argsort(-correlation.max(axis=1), kind="stable")[:_MOST]
    chosen = sorted(strongest[correlation[strongest].max(axis=1) >= _LEAST].tolist())
    definitions = [parameter.definition for parameter in result.parameters.values()]
    theta = posterior.sample(_SAMPLES)
    drawn = np.stack([definitions[column].to_unit(theta[:, column]) for column in chosen], axis=1)
    names, count = [definitions[column].name for column in chosen], len(chosen)
    panels, step = [], _SIZE + _GAP
    for row in range(1, count):
        for column in range(row):
            x, y = _MARGIN + column * step, (row - 1) * step
            dots = zip(x + _SIZE * drawn[:, column], y + _SIZE * (1.0 - drawn[:, row]), strict=True)
            path = "".join(f"M{across:.1f} {down:.1f}h0" for across, down in dots)
            value = posterior.correlation[chosen[row], chosen[column]]
            panels.append({"x": x, "y": y, "path": path, "correlation": fixed(float(value), 2, signed=True)})
    below = (count - 1) * step + 10
    labels = [
        {"x": _MARGIN - 8, "y": row * step + _SIZE // 2, "anchor": "end", "text": name}
        for row, name in enumerate(names[1:])
    ]
    labels += [
        {"x": _MARGIN + column * step + _SIZE // 2, "y": below, "anchor": "middle", "text": name}
        for column, name in enumerate(names[:-1])
    ]
    size = {"width": _MARGIN + (count - 1) * step, "height": below + 8, "size": _SIZE}
    return {**size, "panels": panels, "labels": labels, "words": f"Samples of {', '.join(names)}, two a panel"}
