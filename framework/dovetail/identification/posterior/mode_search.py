"""Where the posterior has its peaks: searches from all over the ranges, not only from the best fit."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from dovetail.assembly import Assembly
from dovetail.identification.fitting.levenberg_marquardt import minimise
from dovetail.identification.fitting.observations import Measured
from dovetail.identification.fitting.residuals import FrfMisfit, Frfs, SideBySide, Weighted
from dovetail.identification.posterior.likelihood import WithErrors
from dovetail.identification.posterior.prior import InCube, PriorAndData, into_cube, out_of_cube, quantile_of

__all__ = ["climb", "search_modes"]

_SEARCHES, _CARRIED_ON = 12, 4
_LINES = 1000
"""Of the FRF, evenly chosen, by which the first searches go."""
_WITHIN = 0.02
"""Fractions of the ranges that searches keep away from their ends, where no prior probability is left."""
_SEARCH_TOLERANCE, _SEARCH_STEPS = 1.0, 40
_ROUGH_TOLERANCE, _ROUGH_STEPS = 0.1, 100
_COOLING, _COOLING_STEPS = (0.03, 0.1, 0.3), 25
"""Weights of the measurement by which half of the searches near the peak: it is the wider, the less weight."""
_TOLERANCE, _STEPS = 1e-2, 100


def search_modes(
    assembly: Assembly,
    target: Measured,
    variance: NDArray[np.float64],
    residual: Weighted | SideBySide[Weighted],
    errors: NDArray[np.float64],
    best: NDArray[np.float64],
    random: np.random.Generator,
) -> NDArray[np.float64]:
    """Search the peaks of the posterior, from the best fit and from points all over the ranges.

    Parameters
    ----------
    assembly : Assembly
    target : Measured
    variance : (n_lines,) array
        E|error|^2 of its complex values.
    residual : Weighted or SideBySide
        Of all lines of all responses.
    errors : (k, m) array
        What one standard deviation of each error of the model adds to the residuals.
    best : (p,) array
        Fractions of the ranges at the best fit.
    random : numpy.random.Generator

    Returns
    -------
    (n, p) array
        Normal quantiles of the fractions, the most probable place first. Several may be one and the same peak.
    """
    step = max(1, len(variance) // _LINES)
    lines = np.arange(step // 2, len(variance), step)
    on_lines, few, rows = Frfs.of(assembly).at(lines), residual.at(lines), residual.residuals_of(lines)
    points = qmc.LatinHypercube(len(best), rng=random).random(_SEARCHES)
    search = FrfMisfit(on_lines, target.at(lines).logarithms(variance[lines]))
    near = minimise(search, points, tolerance=_SEARCH_TOLERANCE, most_steps=_SEARCH_STEPS).position

    def weighted(weight: float) -> PriorAndData:
        factor = weight * np.sqrt(step)  # with weight 1 these lines tell as much as all
        return PriorAndData(WithErrors(FrfMisfit(on_lines, few.scaled(factor)), factor * errors[:, rows]))

    direct = cooled = quantile_of(_inside(near))
    for weight in _COOLING:
        cooled, _ = climb(weighted(weight), cooled, tolerance=_ROUGH_TOLERANCE, most_steps=_COOLING_STEPS)
    both = np.concatenate([direct, cooled])
    rough, _ = climb(weighted(1.0), both, tolerance=_ROUGH_TOLERANCE, most_steps=_ROUGH_STEPS)
    whole = PriorAndData(WithErrors(FrfMisfit(assembly, residual), errors))
    starts = np.concatenate([quantile_of(_inside(best))[np.newaxis], rough[:_CARRIED_ON]])
    return climb(whole, starts)[0]


def climb(
    problem: PriorAndData, starts: NDArray[np.float64], *, tolerance: float = _TOLERANCE, most_steps: int = _STEPS
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Climb from each start to a peak; return the ends (n, p), the highest first, and their sums of squares."""
    found = minimise(InCube(problem), into_cube(starts), tolerance=tolerance, most_steps=most_steps)
    order = np.argsort(found.cost, kind="stable")
    return out_of_cube(found.position[order]), found.cost[order]


def _inside(fraction: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.clip(fraction, _WITHIN, 1.0 - _WITHIN)
