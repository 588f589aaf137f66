"""Whether two files hold the same measurement, whatever their formats, units and remarks."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dovetail.problem.observations import Observations

_LINES = 8
"""Lines of which the values are compared. Random errors of 0.01 % and more make those of two measurements differ."""
_ROUNDING = 1e-5
"""Relative difference of values that is rounding, as in texts of six digits."""


def values_of_some_lines(observations: Observations) -> list[list[float]]:
    """Return real and imaginary part of the values at lines spread over a measurement."""
    lines = np.unique(np.linspace(0, len(observations.values) - 1, _LINES).astype(np.intp))
    values = observations.values[lines]
    return [[float(value.real), float(value.imag)] for value in values]


def are_same_values(first: Sequence[Sequence[float]], second: Sequence[Sequence[float]]) -> bool:
    """Return whether two measurements have the same values at these lines, but for rounding."""
    one, other = (np.array(values) @ np.array([1.0, 1.0j]) for values in (first, second))
    return one.shape == other.shape and bool(np.all(np.abs(one - other) <= _ROUNDING * np.abs(one)))
