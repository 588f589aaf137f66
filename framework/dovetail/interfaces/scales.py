"""Scales and priors of parameters: fractions of their ranges, values, and the derivatives, of many at once."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Literal, NamedTuple, Protocol, TypeAlias

import numpy as np
import scipy  # loads a part of it when that is first used
from numpy.typing import NDArray

Scale = Literal["linear", "log"]
Prior = Literal["uniform", "normal"]

DEVIATIONS = 4.0
"""Standard deviations of a normal prior between the middle and each end of its range; 6e-5 of it lie outside."""
_TAIL = 3.167124183311986e-05
"""Share of the normal distribution below the range: scipy.special.ndtr(-4.0)."""
_Ends: TypeAlias = "float | NDArray[np.float64]"


class RangeMap(NamedTuple):
    """The map between fractions of ranges and values, of parameters with the same scale and prior.

    `low` and `high` are the ends of their ranges, or the logarithms of these; a number, or an array for the last axis.
    """

    low: _Ends
    high: _Ends
    scale: Scale
    prior: Prior

    @staticmethod
    def of(lower: _Ends, upper: _Ends, scale: Scale, prior: Prior) -> RangeMap:
        """Return the map of ranges in SI."""
        low, high = (np.log(lower), np.log(upper)) if scale == "log" else (lower, upper)
        return RangeMap(low, high, scale, prior)

    def from_unit(self, fraction: NDArray[np.float64]) -> NDArray[np.float64]:
        """Map fractions from 0 to 1, quantiles of the prior within the range, to values."""
        part = np.asarray(fraction, dtype=np.float64)
        if self.prior == "normal":
            part = (scipy.special.ndtri(_TAIL + part * (1.0 - 2.0 * _TAIL)) / DEVIATIONS + 1.0) / 2.0
        mapped = self.low + part * (self.high - self.low)
        return np.asarray(np.exp(mapped) if self.scale == "log" else mapped)

    def to_unit(self, value: NDArray[np.float64]) -> NDArray[np.float64]:
        """Map values to fractions from 0 to 1, quantiles of the prior within the range."""
        part = self._part(np.asarray(value, dtype=np.float64))
        if self.prior == "normal":
            part = (scipy.special.ndtr((2.0 * part - 1.0) * DEVIATIONS) - _TAIL) / (1.0 - 2.0 * _TAIL)
        return part

    def slope(self, value: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the derivative of `from_unit` by the fraction, at values."""
        at = np.asarray(value, dtype=np.float64)
        width = np.asarray((at if self.scale == "log" else np.ones(at.shape)) * (self.high - self.low))
        if self.prior == "normal":
            quantile = (2.0 * self._part(at) - 1.0) * DEVIATIONS
            density = np.exp(-(quantile**2) / 2.0) / np.sqrt(2.0 * np.pi)
            width = width * (1.0 - 2.0 * _TAIL) / (2.0 * DEVIATIONS * density)
        return width

    def _part(self, value: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return how far values lie between the ends, on their scale."""
        return np.asarray(((np.log(value) if self.scale == "log" else value) - self.low) / (self.high - self.low))


def normal_residual(fraction: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the standard normal residual of fractions under a normal prior, and its derivative."""
    deviations = scipy.special.ndtri(_TAIL + np.asarray(fraction, dtype=np.float64) * (1.0 - 2.0 * _TAIL))
    density = np.exp(-(deviations**2) / 2.0) / np.sqrt(2.0 * np.pi)
    return deviations, (1.0 - 2.0 * _TAIL) / density


class Range(Protocol):
    """A parameter's range, in SI, with its scale and prior."""

    @property
    def lower(self) -> float: ...  # noqa: D102
    @property
    def upper(self) -> float: ...  # noqa: D102
    @property
    def scale(self) -> Scale: ...  # noqa: D102
    @property
    def prior(self) -> Prior: ...  # noqa: D102


class ParameterScales:
    """The maps of several parameters; those with the same scale and prior are computed together.

    Parameters
    ----------
    parameters : sequence of Parameter
        In the order of the last axis of all arrays.
    """

    def __init__(self, parameters: Sequence[Range]) -> None:
        alike: dict[tuple[Scale, Prior], list[int]] = {}
        for column, parameter in enumerate(parameters):
            alike.setdefault((parameter.scale, parameter.prior), []).append(column)
        self._groups: list[tuple[list[int] | slice, RangeMap]] = []
        for (scale, prior), columns in alike.items():
            lower, upper = np.transpose([(parameters[column].lower, parameters[column].upper) for column in columns])
            rows = slice(None) if len(alike) == 1 else columns
            self._groups.append((rows, RangeMap.of(lower, upper, scale, prior)))

    def from_unit(self, fraction: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return SI values (..., n_params) for fractions of the ranges."""
        return self._each(fraction, RangeMap.from_unit)

    def to_unit(self, theta: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return fractions of the ranges (..., n_params) for SI values."""
        return self._each(theta, RangeMap.to_unit)

    def slopes(self, theta: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the derivatives (..., n_params) of SI values by the fractions."""
        return self._each(theta, RangeMap.slope)

    def _each(
        self, values: NDArray[np.float64], function: Callable[[RangeMap, NDArray[np.float64]], NDArray[np.float64]]
    ) -> NDArray[np.float64]:
        mapped = np.empty(values.shape)
        for columns, range_map in self._groups:
            mapped[..., columns] = function(range_map, values[..., columns])
        return mapped
