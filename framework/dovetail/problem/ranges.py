"""Values of parameters as fractions of their ranges, and the ends of the ranges."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from dovetail.interfaces import Parameter, Scale

_AT_END = 1e-6
"""Part of the range within which a value is at its end; more digits than any measurement distinguishes."""


def values_at(parameters: Sequence[Parameter], fraction: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return SI values (..., p) at fractions of the ranges (..., p)."""
    return np.stack([p.from_unit(fraction[..., i]) for i, p in enumerate(parameters)], axis=-1)


def fractions_within(parameters: Sequence[Parameter], theta: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the fractions (..., p) of SI values, those outside of their ranges brought to the nearest end."""
    columns = [p.to_unit(np.clip(theta[..., i], p.lower, p.upper)) for i, p in enumerate(parameters)]
    return np.clip(np.stack(columns, axis=-1), 0.0, 1.0)


def bounds_reached(parameters: Sequence[Parameter], fraction: NDArray[np.float64]) -> dict[str, str]:
    """Return the parameters at a bound of their range, and at which, from fractions (n_params,) of the ranges."""
    values = [float(p.from_unit(part)) for p, part in zip(parameters, fraction, strict=True)]
    pairs = zip(parameters, values, strict=True)
    ends = {p.name: end_reached(value, p.lower, p.upper, p.scale) for p, value in pairs}
    return {name: end for name, end in ends.items() if end}


def end_reached(value: float, lower: float, upper: float, scale: Scale) -> str:
    """Return the end of a range, "lower" or "upper", at which a value is within rounding; empty if at neither.

    A value is at an end that it equals in the four digits that are shown, or within a millionth of the range.
    """
    shown, low, high = (f"{number:.4g}" for number in (value, lower, upper))
    with np.errstate(divide="ignore", invalid="ignore"):
        place = float(Parameter("value", "1", lower, upper, scale).to_unit(np.array(value)))
    if abs(place) <= _AT_END or (shown == low != high):
        return "lower"
    return "upper" if abs(place - 1.0) <= _AT_END or (shown == high != low) else ""
