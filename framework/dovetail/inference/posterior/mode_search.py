"""Search for the modes of the posterior, from the best fit and from points throughout the ranges."""

from __future__ import annotations

import itertools
from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.assembly import Assembly
from dovetail.inference.fitting import Fit
from dovetail.inference.fitting.fit import Pace
from dovetail.inference.fitting.searches import are_different
from dovetail.inference.posterior.likelihood import (
    Z_LIMIT,
    Likelihood,
    MarginalisedResiduals,
    PosteriorResiduals,
    build_likelihood,
    normal_from_unit,
    squared_norms,
    unit_from_normal,
)
from dovetail.inference.posterior.model_error import ModelError
from dovetail.interfaces import Progress, silent
from dovetail.problem import Problem
from dovetail.problem.definition import latin_hypercube
from dovetail.problem.least_squares import Linearisation, Minima, SumOfSquares, minimise
from dovetail.problem.residuals import FrfResiduals


@dataclass(frozen=True)
class Settings:
    """Number of searches, the lines of each, and when they end.

    A tolerance is the decrease of the sum of squares in one step at which a search ends.
    """

    searches: int = 12
    """Searches from a Latin hypercube over the ranges, in addition to the best fit."""
    lines: int = 500
    """Evenly chosen lines of the FRF for the first searches."""
    margin: float = 0.02
    """Distance, as a fraction of a range, that starts keep from its ends, where z becomes infinite."""
    least_margin: float = 1e-5
    """Distance of a further start at the best fit: a parameter that is known exactly may lie close to an end."""
    first_tolerance: float = 1.0
    first_steps: int = 40
    """Limits of the first searches, by the logarithms of amplitudes, which need only come near a mode."""
    tempering: tuple[float, ...] = (0.03, 0.1, 0.3)
    """Increasing weights of the measurement with which half of the searches approach a mode: less weight widens it."""
    tempering_steps: int = 25
    rough_tolerance: float = 0.1
    rough_steps: int = 100
    """Limits of the searches on the chosen lines."""
    refined_modes: int = 8
    """Largest number of modes on the chosen lines, the best ones, from which the search continues on all lines."""
    most_orders: int = 24
    """Largest number of orders of the values of like joints from which a search begins: all of four joints."""
    least_error: float = 1e-4
    """Variance of an error of the model along a direction of the residuals that the searches on the chosen lines leave
    out: it changes chi-squared by less than that part."""
    same: float = 1.0
    """Largest distance of two ends, in standard deviations by the curvature there, at which they are the same mode. A
    search comes within a third of that of a mode."""
    worth: float = 400.0
    """Chi-squared above the best one up to which a mode is of interest: twice as much as sampling accepts."""
    standard_errors: float = 5.0
    """Uncertainty of chi-squared from few lines, in standard errors, within which a mode may be of interest."""
    tolerance: float = 0.3
    steps: int = 100
    """Limits of the searches on all lines."""


_SETTINGS = Settings()


def likelihood_at_mode(problem: Problem, fit: Fit, model_error: ModelError) -> tuple[Likelihood, NDArray[np.float64]]:
    """Build the likelihood with the errors of the model taken at its best FRFs.

    The effect of errors on the FRFs depends on the FRFs themselves, which a fit that does not reach the noise may have
    wrong. If quantities of parts may be off, the likelihood is therefore built again at the mode near the fit.

    Returns
    -------
    Likelihood
    (p,) array
        Fractions of the ranges from which the search continues.
    """
    fraction = problem.to_unit(fit.theta)
    if not model_error.quantities:
        return build_likelihood(problem, fit, model_error), fraction
    likelihood = build_likelihood(problem, fit, replace(model_error, quantities=0.0))
    mode = maximise_posterior(likelihood.posterior, starts_near(fraction))[0]
    fraction = unit_from_normal(mode)
    there = replace(fit, theta=problem.from_unit(fraction))
    return build_likelihood(problem, there, model_error), fraction


def search_modes(
    problem: Problem,
    likelihood: Likelihood,
    best: NDArray[np.float64],
    random: np.random.Generator,
    progress: Progress = silent,
) -> NDArray[np.float64]:
    """Search for the modes of the posterior, from the best fit and from points throughout the ranges.

    Parameters
    ----------
    problem : Problem
    likelihood : Likelihood
    best : (p,) array
        Fractions of the ranges at the best fit.
    random : numpy.random.Generator
    progress : Progress
        Called after each search.

    Returns
    -------
    (n, p) array
        Normal quantiles of the fractions, the highest mode first. The same mode may occur several times. The others
        than the highest may be modes on the chosen lines only.
    """
    near_fit_starts, exchanged = starts_near(best), _within(_exchanged(problem.assembly, best), _SETTINGS.margin)
    refined = _SETTINGS.refined_modes + len(exchanged)
    total = _SETTINGS.searches * (3 + len(_SETTINGS.tempering)) + len(exchanged) + len(near_fit_starts) + refined
    searches = itertools.count(1)

    def callback() -> None:
        progress("modes", next(searches), total)

    logarithms, tempered, every = _on_few_lines(problem, likelihood)
    points = latin_hypercube(_SETTINGS.searches, len(best), random.spawn(1)[0])
    tolerance, most_steps = _SETTINGS.first_tolerance, _SETTINGS.first_steps
    near = minimise(logarithms, points, tolerance=tolerance, most_steps=most_steps, callback=callback).position
    direct = cooled = _within(near, _SETTINGS.margin)
    error = _SETTINGS.standard_errors * np.sqrt(2.0 * every * len(likelihood.variance))
    rough: dict[str, Any] = {"tolerance": _SETTINGS.rough_tolerance, "worth": _SETTINGS.worth + error}
    rough["callback"] = callback
    for weight in _SETTINGS.tempering:
        maxima = _maxima(tempered(weight), cooled, most_steps=_SETTINGS.tempering_steps, **rough)
        cooled = _different(maxima, rough["worth"])
    if problem.limit.is_over:
        return maximise_posterior(likelihood.posterior, near_fit_starts)
    ends = np.concatenate([direct, cooled, exchanged])
    ends = _different(_maxima(tempered(1.0), ends, most_steps=_SETTINGS.rough_steps, **rough))
    found = _promising(tempered(1.0), np.concatenate([near_fit_starts, ends[:refined]]), every)
    if every == 1:  # the ends are modes on all lines
        near_fit = maximise_posterior(likelihood.posterior, near_fit_starts, callback=callback)
        modes = _highest_first(likelihood.posterior, np.concatenate([near_fit, found]))
    else:
        modes = _highest_first(likelihood.posterior, found)
        modes[:1] = maximise_posterior(likelihood.posterior, modes[:1], callback=callback)
    progress("modes", total, total)  # fewer may have been different
    return modes


def _highest_first(posterior: PosteriorResiduals, z: NDArray[np.float64]) -> NDArray[np.float64]:
    return z[np.argsort(squared_norms(posterior.residuals(z)), kind="stable")]


def _on_few_lines(
    problem: Problem, likelihood: Likelihood
) -> tuple[FrfResiduals, Callable[[float], PosteriorResiduals], int]:
    """Return the logarithms' residuals on every n-th line, the posterior there with a weighted measurement, and n.

    Averages over lines are all taken: n is then 1.
    """
    step = max(1, len(likelihood.variance) // _SETTINGS.lines)
    lines = np.arange(step // 2, len(likelihood.variance), step)
    model = problem.model.at(lines)
    logarithms = FrfResiduals(model, likelihood.target.at(lines).logarithms(likelihood.variance[lines]))
    misfit, errors, full_weight = likelihood.misfit, likelihood.errors, 1.0
    if likelihood.by_line is not None:
        misfit = FrfResiduals(model, likelihood.by_line.at(lines))
        errors = errors[:, likelihood.by_line.residuals_of(lines)]
        full_weight = float(np.sqrt(step))  # with which these lines weigh as much as all
    marginalised = MarginalisedResiduals(misfit, errors, full_weight)
    every = 1 if likelihood.by_line is None else step

    def tempered(weight: float) -> PosteriorResiduals:
        return PosteriorResiduals(marginalised.weighted(weight, _SETTINGS.least_error))

    return logarithms, tempered, every


def _promising(posterior: PosteriorResiduals, z: NDArray[np.float64], every: int) -> NDArray[np.float64]:
    """Return those of the points z (n, p) that may be near modes worth having, by the posterior on every n-th line.

    A point as good as the best one has as large a standard error of chi-squared, by which it may seem to be worse.
    """
    squares = posterior.residuals(z)[:, z.shape[1] :] ** 2
    chi_squared = squares.sum(axis=1)
    best = np.argmin(chi_squared)
    error = np.sqrt((1.0 - 1.0 / every) * np.sum(squares[best] ** 2))
    return np.asarray(z[chi_squared - chi_squared[best] <= _SETTINGS.worth + _SETTINGS.standard_errors * error])


def maximise_posterior(
    posterior: PosteriorResiduals,
    starts: NDArray[np.float64],
    *,
    tolerance: float = _SETTINGS.tolerance,
    most_steps: int = _SETTINGS.steps,
    callback: Callable[[], None] = lambda: None,
) -> NDArray[np.float64]:
    """Search for a mode from each start z (n, p); return the ends of the searches (n, p), the highest first."""
    maxima = _maxima(posterior, starts, tolerance=tolerance, most_steps=most_steps, callback=callback)
    return CubeResiduals.to_normal(maxima.position)


def _maxima(
    posterior: PosteriorResiduals,
    starts: NDArray[np.float64],
    *,
    tolerance: float,
    most_steps: int,
    callback: Callable[[], None],
    worth: float = np.inf,
) -> Minima:
    """Return where searches from z (n, p) end as minima in the unit cube, the highest modes first."""
    problem, cube = CubeResiduals(posterior), CubeResiduals.from_normal(starts)
    limits: dict[str, Any] = {"tolerance": tolerance, "most_steps": most_steps, "callback": callback}
    if np.isfinite(worth):
        limits["superfluous"] = _Race(worth)
    return Minima.ranked(minimise(problem, cube, **limits))


class _Race:
    """Ends searches where another is lower, and those that would not come near enough to the lowest at their pace.

    Parameters
    ----------
    worth : float
        Sum of squares above the lowest one from which an end is of no interest.
    """

    def __init__(self, worth: float) -> None:
        self._pace = Pace(lambda lowest: lowest + worth)

    def __call__(self, minima: Minima, steps_left: int) -> NDArray[np.bool_]:
        slow = self._pace(minima, steps_left)
        return slow | ~are_different(minima, _SETTINGS.same) if self._pace.is_measured else slow


def _different(maxima: Minima, worth: float = np.inf) -> NDArray[np.float64]:
    """Return the ends z (k, p) of searches that are not at the same mode as a higher one, nor of no interest."""
    kept = are_different(maxima, _SETTINGS.same) & (maxima.cost - maxima.cost.min() <= worth)
    return CubeResiduals.to_normal(maxima.position[kept])


def _exchanged(assembly: Assembly, best: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return copies (n, p) of a point (p,), in fractions of the ranges, with the values of like joints exchanged.

    If branches of a structure are interchangeable, each order of their values may explain an FRF equally well.
    """
    numbers_of: defaultdict[str, list[int]] = defaultdict(list)
    interchangeable: defaultdict[tuple[object, ...], list[list[int]]] = defaultdict(list)
    named = assembly.description.identified_parameters
    for number, (joint, _) in enumerate(named):
        numbers_of[joint].append(number)
    for numbers in numbers_of.values():
        ranges = [(named[n][1], assembly.parameters[n].lower, assembly.parameters[n].upper) for n in numbers]
        interchangeable[tuple(ranges)].append(numbers)
    points = []
    for joints in interchangeable.values():
        for order in itertools.islice(itertools.permutations(joints), 1, _SETTINGS.most_orders):
            points.append(best.copy())
            points[-1][np.concatenate(joints)] = best[np.concatenate(order)]
    return np.reshape(points, (-1, len(best)))


def starts_near(best: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the starts z (n, p) of searches from the best fit, in fractions of the ranges (p,).

    One keeps a distance from the ends of the ranges, where a search hardly moves; if that displaces it, another is
    at the fit.
    """
    return np.unique([_within(best, margin) for margin in (_SETTINGS.margin, _SETTINGS.least_margin)], axis=0)


def _within(fraction: NDArray[np.float64], margin: float) -> NDArray[np.float64]:
    return normal_from_unit(np.clip(fraction, margin, 1.0 - margin))


class CubeResiduals(SumOfSquares):
    """Residuals of prior and measurement as functions of a position in the unit cube, for the search of modes.

    Parameters
    ----------
    posterior : PosteriorResiduals
    """

    def __init__(self, posterior: PosteriorResiduals) -> None:
        self._posterior, self.limit = posterior, posterior.misfit.limit

    @staticmethod
    def from_normal(z: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the position in the unit cube of normal quantiles z."""
        return (z / Z_LIMIT + 1.0) / 2.0

    @staticmethod
    def to_normal(position: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the normal quantiles z of a position in the unit cube."""
        return (2.0 * position - 1.0) * Z_LIMIT

    def residuals(self, position: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return residuals (n, m) at positions (n, p)."""
        return self._posterior.residuals(self.to_normal(position))

    def linearise(self, position: NDArray[np.float64]) -> Linearisation:
        """Return residuals and derivatives at positions (n, p)."""
        there = self._posterior.linearise(self.to_normal(position))
        return Linearisation(there.residuals, 2.0 * Z_LIMIT * there.jacobian)
