"""The covariate, such as a torque, at which a law gives the identified parameters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dovetail.interfaces import Progress
from dovetail.monitoring.kalman import Belief
from dovetail.series.description import SeriesDescription
from dovetail.series.fitted_tests import FittedTest
from dovetail.series.fitting import SeriesFit, fit_series
from dovetail.series.unknowns import SeriesUnknowns

Array = NDArray[np.float64]

_POINTS = 401
"""Covariates at which laws are tabulated."""
_RISE = 2.706
"""Rise of the sum of squares at the ends of a 90 % interval."""


@dataclass(frozen=True)
class EquivalentCovariate:
    """The covariate at which a law gives the identified parameters, SI, with its 90 % interval.

    Parameters
    ----------
    name, unit : str
    value, low, high : float
    is_beyond : bool
        Whether it is at the end of the covariates of the tests, so that it may lie beyond.
    """

    name: str
    unit: str
    value: float
    low: float
    high: float
    is_beyond: bool

    def to_dict(self) -> dict[str, object]:
        """Return it as plain values."""
        return {
            "unit": self.unit,
            "value": self.value,
            "low": self.low,
            "high": self.high,
            "at_end": self.is_beyond,
        }


@dataclass(frozen=True, eq=False)
class LawCurve:
    """Laws over one covariate, tabulated between the ends of the tests.

    Parameters
    ----------
    covariate, unit : str
    grid : (g,) array
        Covariates, SI.
    columns : list of int
        The parameters with a law over this covariate.
    positions : (g, k) array
        Of these parameters.
    covariance : (g, k, k) array
        By the uncertainty of the laws, and the scatter about them.
    """

    covariate: str
    unit: str
    grid: Array
    columns: list[int]
    positions: Array
    covariance: Array

    @staticmethod
    def from_series(series: SeriesDescription, tests: Sequence[FittedTest], progress: Progress) -> tuple[LawCurve, ...]:
        """Return the laws of the first test's parameters, a curve for each covariate; none where there are none."""
        overs: dict[str, list[int]] = {}
        for column, parameter in enumerate(tests[0].problem.parameters):
            role = series.role_of(parameter.name)
            if role.law is not None:
                overs.setdefault(role.over, []).append(column)
        if not overs:
            return ()
        unknowns = SeriesUnknowns(series)
        fit = fit_series(unknowns, tests, progress=progress)
        return tuple(_tabulated(series, unknowns, fit, over, columns) for over, columns in overs.items())

    def at(self, covariate: float) -> Array:
        """Return the positions (k,) at a covariate; beyond the tests those at their end."""
        return np.array([np.interp(covariate, self.grid, column) for column in self.positions.T])

    def equivalent(self, belief: Belief, common: Array) -> EquivalentCovariate:
        """Return the covariate that belongs to a belief about the parameters best.

        Parameters
        ----------
        belief : Belief
            Of all parameters.
        common : (p, p) array
            Covariance by the errors of the model.
        """
        chosen = np.ix_(self.columns, self.columns)
        covariance = self.covariance + (belief.covariance + common)[chosen]
        difference = belief.mean[self.columns] - self.positions
        squares = np.einsum("gi,gi->g", difference, np.linalg.solve(covariance, difference[:, :, None])[:, :, 0])
        best = int(np.argmin(squares))
        value = _vertex(self.grid, squares, best)
        inside = np.flatnonzero(squares <= squares[best] + _RISE)
        low, high = (_crossing(self.grid, squares - squares[best] - _RISE, inside[end], end) for end in (0, -1))
        return EquivalentCovariate(self.covariate, self.unit, value, low, high, best in (0, len(self.grid) - 1))


def _tabulated(
    series: SeriesDescription, unknowns: SeriesUnknowns, fit: SeriesFit, over: str, columns: list[int]
) -> LawCurve:
    test = series.tests[0]
    grid = np.linspace(*series.ends(over), _POINTS)
    shared, known = fit.matrix.shared_covariance()[0], fit.z[: len(unknowns.shared)]
    positions = np.empty((_POINTS, len(columns)))
    covariance = np.empty((_POINTS, len(columns), len(columns)))
    for row, covariate in enumerate(grid.tolist()):
        test_map, own = unknowns.elsewhere(test, {**test.covariates, over: covariate})
        fractions, jacobian = test_map.linearise(np.append(known, np.zeros(len(own)))[np.newaxis])
        slopes = jacobian[0][columns]
        law_slopes, scatter = slopes[:, : len(known)], slopes[:, len(known) :]
        positions[row] = fractions[0, columns]
        covariance[row] = law_slopes @ shared @ law_slopes.T + scatter @ scatter.T
    return LawCurve(over, series.covariates[over].unit, grid, columns, positions, covariance)


def _vertex(grid: Array, squares: Array, best: int) -> float:
    """Return the minimum of the parabola through three points of a table."""
    if best in (0, len(grid) - 1):
        return float(grid[best])
    before, middle, after = squares[best - 1 : best + 2]
    bend = before - 2.0 * middle + after
    shift = 0.5 * (before - after) / bend if bend > 0.0 else 0.0
    return float(grid[best] + np.clip(shift, -0.5, 0.5) * (grid[1] - grid[0]))


def _crossing(grid: Array, rise: Array, inside: int, end: int) -> float:
    """Return where a function crosses zero next to the last point at which it is negative."""
    outside = inside - 1 if end == 0 else inside + 1
    if not 0 <= outside < len(grid):
        return float(grid[inside])
    share = rise[inside] / (rise[inside] - rise[outside])
    return float(grid[inside] + share * (grid[outside] - grid[inside]))
