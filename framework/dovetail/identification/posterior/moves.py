"""Steps of a Markov chain along a curved valley: each solves for components that are drawn around its own."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dovetail.identification.posterior.coordinates import PriorAndData
from dovetail.identification.posterior.optimised import Charts, Places

__all__ = ["KEPT", "move"]

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
