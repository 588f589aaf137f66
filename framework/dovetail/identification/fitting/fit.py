"""The result of a fit to measured FRFs, and how good it is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.assembly import Assembly

__all__ = ["Fit", "bounds_reached", "count_agreeing", "highest_agreeing"]

_SAME_MINIMUM = 1e-3
"""Relative difference of sums of squares below which two searches ended in the same minimum."""


@dataclass(frozen=True, eq=False)
class Fit:
    """Parameters fitted to one measured FRF, or to one for each response.

    Parameters
    ----------
    theta : (n_params,) array
        SI, within the ranges.
    information : (n_params, n_params) array
        Fisher information of the parameters in fractions of their ranges; its inverse is their covariance.
    chi_squared : float
        Sum of the squared residuals over their random variance, per degree of freedom: 1 where only noise separates
        model and measurement. Ignored lines do not count.
    degrees_of_freedom : int
    variance : (n_lines,) array
        E|random error|^2 of each line; the lines of a second response stand behind those of the first.
    variance_known : bool
        Whether the variance came with the measurement; else it was estimated from the scatter from line to line.
    variance_assumed : bool
        Whether the variance of a response was assumed, since it has too few lines for an estimate.
    discrepancy : float
        Error of the model itself, relative to the magnitude of each line; 0 where the random error explains everything.
    background : float
        The same, relative to the median amplitude of each response: errors that do not grow with the FRF.
    ignored : (n,) array
        Frequencies [Hz] of the isolated lines, which the fit left out.
    used : (n_lines,) bool array
        Which lines were not left out.
    at_bounds : mapping of str to "lower" or "upper"
        Parameters that ended at a bound of their range.
    starts : int
        Number of searches, from different points.
    agreeing : int
        How many of those that were carried to the end gave the same fit.
    steps : int
        How often FRFs and their derivatives were computed, in all searches together.
    seconds : float
        Wall-clock time.
    """

    theta: NDArray[np.float64]
    information: NDArray[np.float64]
    chi_squared: float
    degrees_of_freedom: int
    variance: NDArray[np.float64]
    variance_known: bool
    variance_assumed: bool
    discrepancy: float
    background: float
    ignored: NDArray[np.float64]
    used: NDArray[np.bool_]
    at_bounds: Mapping[str, str]
    starts: int
    agreeing: int
    steps: int
    seconds: float

    def at(self, index: int, counts: Sequence[int]) -> Fit:
        """Return the fit with the variance and the lines of one of its responses alone.

        Parameters
        ----------
        index : int
        counts : sequence of int
            Lines of each response.
        """
        ends = np.cumsum(counts)[:-1]
        used = np.split(self.used, ends)
        ignored = np.cumsum([np.count_nonzero(~lines) for lines in used])[:-1]
        return replace(
            self,
            variance=np.split(self.variance, ends)[index],
            used=used[index],
            ignored=np.split(self.ignored, ignored)[index],
        )

    def to_dict(self) -> dict[str, Any]:
        """Return how good the fit is as plain values for JSON."""
        return {
            "chi_squared": self.chi_squared,
            "degrees_of_freedom": self.degrees_of_freedom,
            "variance_known": self.variance_known,
            "variance_assumed": self.variance_assumed,
            "discrepancy": self.discrepancy,
            "background": self.background,
            "ignored_lines_Hz": np.asarray(self.ignored).tolist(),
            "at_bounds": dict(self.at_bounds),
            "starts": self.starts,
            "agreeing": self.agreeing,
            "steps": self.steps,
            "seconds": self.seconds,
        }


def count_agreeing(costs: NDArray[np.float64]) -> int:
    """Return how many searches ended in the best minimum, from their sums of squares."""
    return int(np.count_nonzero(costs <= highest_agreeing(costs.min())))


def highest_agreeing(cost: float) -> float:
    """Return the highest sum of squares of a search that ended in the same minimum as one with the sum `cost`."""
    return cost * (1.0 + _SAME_MINIMUM) + 1.0


def fractions_within(assembly: Assembly, theta: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the fractions (..., p) of SI values, those outside of their ranges brought to the nearest end."""
    lower, upper = np.transpose([(parameter.lower, parameter.upper) for parameter in assembly.parameters])
    return np.clip(assembly.to_unit(np.clip(theta, lower, upper)), 0.0, 1.0)


def bounds_reached(assembly: Assembly, fraction: NDArray[np.float64]) -> dict[str, str]:
    """Return the parameters at a bound of their range, and at which, from fractions (n_params,) of the ranges."""
    pairs = zip(assembly.parameters, fraction.tolist(), strict=True)
    return {p.name: "lower" if at <= 0.0 else "upper" for p, at in pairs if at <= 0.0 or at >= 1.0}
