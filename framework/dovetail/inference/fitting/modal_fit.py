"""The fit to a table of natural frequencies, from searches all over the ranges."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dovetail.inference.fitting.fit import UNFINISHED, Fit, count_agreeing, fit_at
from dovetail.inference.fitting.searches import different_points
from dovetail.interfaces import Progress, silent
from dovetail.problem.definition import fractions_within, latin_hypercube
from dovetail.problem.least_squares import Minima, minimise
from dovetail.problem.modal_observations import SETTINGS, ModalProblem


@dataclass(frozen=True)
class Settings:
    """Constants of the search."""

    starts: int = 24
    """Number of searches, from the best of eight times as many points of a Latin hypercube over the ranges."""
    apart: float = 0.03
    """Difference of a fraction of the ranges above which two ends are distinct."""
    region: float = 20.0
    """Sum of squares above the lowest one up to which the search continues."""
    rough_tolerance: float = 1e-2
    tolerance: float = 1e-4
    steps: int = 100
    """Limits of the searches with large errors allowed, and of the others."""


_SETTINGS = Settings()


def fit_to_modes(
    problem: ModalProblem,
    starts: Sequence[NDArray[np.float64]] = (),
    *,
    seed: int = 0,
    progress: Progress = silent,
) -> Fit:
    """Fit the parameters to a table of natural frequencies; arguments as of `refine`.

    Notes
    -----
    The first searches allow large errors. Modes of the table belong to the nearest ones of the model.
    """
    began, rough = time.monotonic(), problem.allowing(SETTINGS.rough)
    count, size = 8 * _SETTINGS.starts, len(problem.parameters)
    points = latin_hypercube(count, size, np.random.default_rng([seed, 7]).spawn(1)[0])
    points = points[np.argsort(np.sum(rough.residuals(points) ** 2, axis=1))[: _SETTINGS.starts]]
    if starts:
        points = np.concatenate([fractions_within(problem.parameters, np.array(starts)), points])
    ends = minimise(rough, points, tolerance=_SETTINGS.rough_tolerance, most_steps=_SETTINGS.steps)
    progress("fit", 1, 2)
    minima = fit_with_errors(problem, _distinct(ends), SETTINGS.least)
    progress("fit", 2, 2)
    if problem.limit.is_over:
        problem.limit.leave_out(UNFINISHED)
    return fit_at(
        problem,
        minima.position[0],
        starts=len(points),
        agreeing=count_agreeing(ends),
        steps=int(ends.steps.sum() + minima.steps.sum()),
        seconds=time.monotonic() - began,
    )


def fit_with_errors(problem: ModalProblem, start: NDArray[np.float64], errors: Sequence[float]) -> Minima:
    """Return the fits from starts (n, p), in fractions of the ranges, with relative errors of each group allowed."""
    misfit, tolerance = problem.allowing(errors), _SETTINGS.tolerance
    return Minima.ranked(minimise(misfit, start, tolerance=tolerance, most_steps=_SETTINGS.steps))


def _distinct(ends: Minima) -> NDArray[np.float64]:
    """Return the distinct ends of searches (n, p) that are nearly as good as the best one, the best first."""
    ranked = Minima.ranked(ends)
    return different_points(ranked.position[ranked.cost < ranked.cost[0] + _SETTINGS.region], _SETTINGS.apart)
