"""Laws between the values at the smallest and at the largest covariate: linear, power, exponential approach."""

from __future__ import annotations

from abc import abstractmethod

import numpy as np
from numpy.typing import NDArray

import dovetail

_FIRST = dovetail.LawUnknown("first", "Value at the smallest covariate")
_LAST = dovetail.LawUnknown("last", "Value at the largest covariate")


class Constant(dovetail.Law):
    """The same value at every covariate."""

    name = "constant"
    summary = "The same value at every covariate"

    @property
    def unknowns(self) -> tuple[dovetail.LawUnknown, ...]:
        """The value."""
        return (dovetail.LawUnknown("value", "Value at every covariate"),)

    def evaluate(
        self, covariate: float, ends: tuple[float, float], unknowns: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the value."""
        del covariate, ends
        return unknowns[:, 0], np.ones((len(unknowns), 1))


class _Interpolating(dovetail.Law):
    """A value that goes from one end to the other in shares from 0 to 1."""

    numbers: tuple[dovetail.LawUnknown, ...] = ()

    @property
    def unknowns(self) -> tuple[dovetail.LawUnknown, ...]:
        """The values at both ends, and the numbers of the law."""
        return (_FIRST, _LAST, *self.numbers)

    @abstractmethod
    def share(
        self, covariate: float, ends: tuple[float, float], numbers: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the shares (n,) of the way that are covered, and their derivatives (n, k) by the numbers (n, k)."""

    def evaluate(
        self, covariate: float, ends: tuple[float, float], unknowns: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the interpolated values."""
        first, last = unknowns[:, 0], unknowns[:, 1]
        share, slopes = self.share(covariate, ends, unknowns[:, 2:])
        derivatives = np.column_stack([1.0 - share, share, (last - first)[:, np.newaxis] * slopes])
        return first + (last - first) * share, derivatives


class Linear(_Interpolating):
    """A straight line over the covariate; on a logarithmic scale, an exponential function."""

    name = "linear"
    summary = "A straight line over the covariate, on the parameter's scale"

    def share(
        self, covariate: float, ends: tuple[float, float], numbers: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the share of the distance between the ends."""
        share = (covariate - ends[0]) / (ends[1] - ends[0])
        return np.full(len(numbers), share), np.zeros(numbers.shape)


class Power(_Interpolating):
    """A straight line over the logarithm of the covariate; on a logarithmic scale, a power of the covariate."""

    name = "power"
    summary = "A power of the covariate (on a linear scale: linear in the covariate's logarithm)"

    def share(
        self, covariate: float, ends: tuple[float, float], numbers: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the share of the distance between the logarithms of the ends."""
        share = np.log(covariate / ends[0]) / np.log(ends[1] / ends[0])
        return np.full(len(numbers), share), np.zeros(numbers.shape)

    def objection(self, covariates: NDArray[np.float64]) -> str:
        """Return an objection to covariates that are not positive."""
        return "" if covariates.min() > 0.0 else "a power needs positive covariates."


class ExponentialApproach(_Interpolating):
    """An approach to a limit: the change that remains falls exponentially with the covariate."""

    name = "exponential_approach"
    summary = "An exponential approach to a limit, which saturates"
    numbers = (
        dovetail.LawUnknown(
            "span_constant",
            "Covariate over which the remaining change falls to 1/e, as a part of the span of the tests",
            0.05,
            5.0,
            "log",
        ),
    )

    def share(
        self, covariate: float, ends: tuple[float, float], numbers: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return (1 - exp(-s / c)) / (1 - exp(-1 / c)) for the part s of the span."""
        part, constant = (covariate - ends[0]) / (ends[1] - ends[0]), numbers[:, 0]
        done, whole = -np.expm1(-part / constant), -np.expm1(-1.0 / constant)
        slope_done = -part / constant**2 * np.exp(-part / constant)
        slope_whole = -1.0 / constant**2 * np.exp(-1.0 / constant)
        slopes = (slope_done * whole - done * slope_whole) / whole**2
        return done / whole, slopes[:, np.newaxis]
