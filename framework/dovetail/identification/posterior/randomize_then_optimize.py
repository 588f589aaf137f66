"""Independent samples by optimisation: each solves the problem for data and prior that are drawn anew."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.identification.posterior.prior import FURTHEST, PriorAndData

__all__ = ["KEPT", "Charts", "Places", "move"]

_DAMPING, _LESS, _MORE, _MOST_DAMPING = 1e-4, 1 / 5, 3.0, 1e8
_PROBE, _MOST_BENT = 0.1, 1.5
_LONGEST = 2.0
"""Change of one coordinate in one step."""
_ARRIVED = 1e-6
"""Squared distance from the target at which a search ends; one that ends within a hundred times of it reached it."""


@dataclass(frozen=True, eq=False)
class Places:
    """Places with their residuals and the residuals' derivatives.

    Parameters
    ----------
    z : (n, d) array
    residuals : (n, d + m) array
    slopes : (n, d, d + m) array
    """

    z: NDArray[np.float64]
    residuals: NDArray[np.float64]
    slopes: NDArray[np.float64]

    @staticmethod
    def at(problem: PriorAndData, z: NDArray[np.float64]) -> Places:
        """Return the places z (n, d)."""
        return Places(z, *problem.linear(z))

    @property
    def log_posterior(self) -> NDArray[np.float64]:
        """(n,) logarithms, but for a constant, of the probability density of z."""
        return np.asarray(np.einsum("nm,nm->n", self.residuals, self.residuals) / -2.0)

    def at_rows(self, rows: NDArray[np.intp]) -> Places:
        """Return some of the places."""
        return Places(self.z[rows], self.residuals[rows], self.slopes[rows])

    def copy(self) -> Places:
        """Return places that can be overwritten."""
        return Places(self.z.copy(), self.residuals.copy(), self.slopes.copy())

    def put(self, rows: NDArray[np.intp], others: Places, taken: NDArray[np.bool_]) -> None:
        """Overwrite `rows` with those of `others` that are taken."""
        for name in ("z", "residuals", "slopes"):
            getattr(self, name)[rows] = getattr(others, name)[taken]


class Charts:
    """The map from z to the residuals' components along their tangent at one place, or at one for each row.

    Where residuals are normal these components are standard normal, however curved the valley of z is.

    Parameters
    ----------
    problem : PriorAndData
    at : Places
        Where the tangents are taken: one place for all rows, or as many as there are rows.

    References
    ----------
    J. M. Bardsley, A. Solonen, H. Haario, M. Laine, Randomize-then-optimize: a method for sampling from posterior
    distributions in nonlinear inverse problems, SIAM J. Sci. Comput. 36 (2014) A1895-A1910.
    """

    def __init__(self, problem: PriorAndData, at: Places) -> None:
        self._problem = problem
        self._tangents = np.linalg.qr(at.slopes.transpose(0, 2, 1))[0]

    def components(self, residuals: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the components (n, d) of residuals (n, d + m)."""
        return self._along(residuals, np.arange(len(residuals)))

    def log_stretch(self, places: Places) -> NDArray[np.float64]:
        """Return the logarithm (n,) of how much larger a small volume of z at places is in components."""
        return np.asarray(np.linalg.slogdet(places.slopes @ self._tangents)[1])

    def solve(self, target: NDArray[np.float64], start: Places, most_steps: int) -> tuple[Places, NDArray[np.bool_]]:
        """Find z whose components are given, all rows side by side.

        Parameters
        ----------
        target : (n, d) array
        start : Places
        most_steps : int

        Returns
        -------
        Places
        (n,) bool array
            Whether each reached its target.
        """
        ends = start.copy()
        off = self.components(ends.residuals) - target
        left = np.einsum("nd,nd->n", off, off)
        damping, active = np.full(len(off), _DAMPING), np.flatnonzero(left > _ARRIVED)
        for _ in range(most_steps):
            if not len(active):
                break
            step, trusted = self._steps(ends, off[active], active, target[active], damping[active])
            tried = Places.at(self._problem, np.clip(ends.z[active] + step, -FURTHEST, FURTHEST))
            new_off = self._along(tried.residuals, active) - target[active]
            new_left = np.einsum("nd,nd->n", new_off, new_off)
            better = trusted & (new_left < left[active])
            taken = active[better]
            ends.put(taken, tried, better)
            off[taken], left[taken] = new_off[better], new_left[better]
            damping[active] *= np.where(better, _LESS, _MORE)
            active = active[(left[active] > _ARRIVED) & (damping[active] < _MOST_DAMPING)]
        return ends, left <= 100.0 * _ARRIVED

    def _tangents_of(self, rows: NDArray[np.intp]) -> NDArray[np.float64]:
        return self._tangents if len(self._tangents) == 1 else self._tangents[rows]

    def _along(self, residuals: NDArray[np.float64], rows: NDArray[np.intp]) -> NDArray[np.float64]:
        return np.asarray((residuals[:, np.newaxis] @ self._tangents_of(rows))[:, 0])

    def _steps(
        self,
        places: Places,
        off: NDArray[np.float64],
        rows: NDArray[np.intp],
        target: NDArray[np.float64],
        damping: NDArray[np.float64],
    ) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Return damped steps, bent by half their geodesic acceleration, and which of them may be trusted."""
        along = places.slopes[rows] @ self._tangents_of(rows)
        matrix = along @ along.transpose(0, 2, 1)
        diagonal = np.einsum("ndd->nd", matrix).copy()
        np.einsum("ndd->nd", matrix)[:] += damping[:, np.newaxis] * diagonal
        to_step = -np.linalg.solve(matrix, along)
        velocity = _times(to_step, off)
        longest = np.abs(velocity).max(axis=1)
        velocity *= np.minimum(1.0, _LONGEST / np.maximum(longest, np.finfo(float).tiny))[:, np.newaxis]
        ahead = self._along(self._problem.residuals(places.z[rows] + _PROBE * velocity), rows) - target
        bend = 2.0 / _PROBE * ((ahead - off) / _PROBE - _times(along.transpose(0, 2, 1), velocity))
        acceleration = _times(to_step, bend)
        lengths = [np.einsum("nd,nd->n", diagonal, vector**2) for vector in (acceleration, velocity)]
        return velocity + acceleration / 2.0, lengths[0] <= _MOST_BENT**2 * lengths[1]


def _times(matrices: NDArray[Any], vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the products (n, i) of matrices (n, i, k) and vectors (n, k)."""
    return np.asarray((matrices @ vectors[:, :, np.newaxis])[:, :, 0])


KEPT = 0.6
"""Part of a place's components that the next one keeps; the rest is drawn."""
_STEPS = 40
"""After which a step is given up; most arrive after ten to thirty."""
_SAME = 1e-2
"""Difference of coordinates within which a step that is undone has come back."""


def move(problem: PriorAndData, places: Places, random: np.random.Generator) -> tuple[Places, float]:
    """Move each place by one step that leaves the posterior as it is.

    Parameters
    ----------
    problem : PriorAndData
    places : Places
    random : numpy.random.Generator

    Returns
    -------
    Places
    float
        Part of the steps that were taken.

    Notes
    -----
    In the chart at its own place the posterior is nearly standard normal, however bent the valley is, so components
    ``0.6 u + 0.8 n`` with u the present ones and n drawn are nearly from it. Metropolis and Hastings make it exact:
    the density of a step is that of its components times the stretch of the chart. A step that would not come back the
    same way, where the chart folds over, is not taken.
    """
    forth = Charts(problem, places)
    here = forth.components(places.residuals)
    drawn = random.standard_normal(here.shape)
    ends, reached = forth.solve(KEPT * here + np.sqrt(1.0 - KEPT**2) * drawn, places, _STEPS)
    back = Charts(problem, ends)
    log_ratio = ends.log_posterior - places.log_posterior
    log_ratio += _log_density(back, ends, places) - _log_density(forth, places, ends)
    wanted = np.flatnonzero(reached & (np.log(random.random(len(reached))) < log_ratio))
    taken = wanted[_returns(problem, places, ends, wanted)] if len(wanted) else wanted
    moved = places.copy()
    chosen = np.zeros(len(reached), dtype=np.bool_)
    chosen[taken] = True
    moved.put(taken, ends, chosen)
    return moved, len(taken) / len(reached)


def _log_density(charts: Charts, start: Places, end: Places) -> NDArray[np.float64]:
    """Return the logarithm of the density with which steps from `start`, where the charts are, end at `end`."""
    away = charts.components(end.residuals) - KEPT * charts.components(start.residuals)
    return np.asarray(charts.log_stretch(end) - np.einsum("nd,nd->n", away, away) / (2.0 * (1.0 - KEPT**2)))


def _returns(problem: PriorAndData, places: Places, ends: Places, rows: NDArray[np.intp]) -> NDArray[np.bool_]:
    """Say which steps lead back to where they began when they are undone."""
    first, last = (one.at_rows(rows) for one in (places, ends))
    back = Charts(problem, last)
    found, reached = back.solve(back.components(first.residuals), last, _STEPS)
    return np.asarray(reached & (np.abs(found.z - first.z).max(axis=1) < _SAME))
