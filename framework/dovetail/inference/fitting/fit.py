"""Fits to measured FRFs: how good they are, and the best of local searches from many points in the ranges."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, TypeAlias, get_args

import numpy as np
from numpy.typing import NDArray

from dovetail.errors import Fault, ParameterError, listing
from dovetail.inference.fitting.whiteness import NOISE_ALARM, has_size_of_noise, is_white, log_improbability
from dovetail.interfaces import Estimate, Progress, silent
from dovetail.problem import Problem
from dovetail.problem.definition import bounds_reached, latin_hypercube
from dovetail.problem.least_squares import Minima, minimise
from dovetail.problem.observations import Observations
from dovetail.problem.random_error import ASSUMED_NOISE, FOURTH_DIFFERENCE

Objective: TypeAlias = Literal["frf", "weighted"]
"""Residuals that are minimised: differences of the FRFs as they are, or over their random error."""

_TOLERANCE = 0.02
"""Decrease of the sum of squares in one step that ends a search; it is small compared to the scatter of the sum."""
_MOST_STEPS = 150
"""Largest number of steps of one search; one that needs more is in a wrong valley."""
_LARGEST_NOISE = 0.1
"""Random error, over the largest value, that FRFs of practice rarely exceed: of one average at a coherence of 0.99."""
_LEAST_SCATTER = 0.5
"""Scatter from line to line, over the mean square, of white noise at least; that of a curve is far smaller."""
UNFINISHED = "the fit, which had not converged"
"""What a time limit cut short where a fit did not come to its end."""
SEARCH_SHARE = 0.6
"""Part of a time limit after which no further search begins: a fit needs a judgement and intervals too."""
_SAME_MINIMUM = 1e-3
"""Relative difference of sums of squares below which two searches ended in the same minimum."""
PACE_STEPS = 10
"""Steps by which the pace of searches is measured, and after which those of no interest end."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Fit(Estimate):
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
    degrees_of_freedom : float
        Residuals less parameters; of a table of natural frequencies, less what parameters can follow.
    variance : (n_lines,) array
        E|random error|^2 of each line; the lines of a second response follow those of the first.
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
        Number of searches, from different points; 0 for the estimate of a method that does not report them.
    agreeing : int
        How many of those that were carried to the end gave the same fit.
    steps : int
        How often FRFs and their derivatives were computed, in all searches together.
    seconds : float
        Wall-clock time.
    """

    information: NDArray[np.float64]
    chi_squared: float
    degrees_of_freedom: float
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

    def __repr__(self) -> str:
        agreeing = f", {self.agreeing} searches agree" if self.starts else ""
        return f"<Fit: chi-squared {self.chi_squared:.4g} per degree of freedom{agreeing}>"

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

    def check_belongs_to(self, problem: Problem) -> None:
        """Refuse a problem with other parameters or lines than those of the fit.

        Raises
        ------
        ParameterError
            It has more or fewer.
        """
        own, theirs = (len(self.theta), len(self.variance)), (len(problem.parameters), len(problem.values))
        if own != theirs:
            fit, given = (f"{numbers[0]} parameters and {numbers[1]} measured values" for numbers in (own, theirs))
            raise ParameterError(Fault("fit", f"it has {fit}, and the problem has {given}.", "a fit of this problem"))

    def allowing_for_unknown_noise(self, target: Observations) -> Fit:
        """Return the fit with the random error that intervals allow for where too few lines show it.

        The largest usual error counts as one more degree of freedom in addition to those of the residuals.
        """
        if not self.variance_assumed:
            return self
        freedom = max(target.residual_count(self.used) - len(self.theta), 0)
        shown = freedom * min(self.chi_squared, _LARGEST_NOISE**2 / ASSUMED_NOISE**2)
        factor = max(1.0, (shown + (_LARGEST_NOISE / ASSUMED_NOISE) ** 2) / (freedom + 1))
        return replace(self, variance=np.where(target.assumed(self.variance), factor, 1.0) * self.variance)

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


def fit_at(
    problem: Problem,
    fraction: NDArray[np.float64],
    *,
    starts: int = 0,
    agreeing: int = 0,
    steps: int = 0,
    seconds: float = 0.0,
) -> Fit:
    """Judge how well given parameters fit, by the random error of all lines.

    Parameters
    ----------
    problem : Problem
    fraction : (n_params,) array
        The parameters, in fractions of their ranges.
    starts, agreeing, steps, seconds
        As in `Fit`; by default those of parameters that were not searched for.
    """
    target = problem.observations
    variance = target.variance()
    there = problem.weighted(variance).linearise(fraction[np.newaxis])
    used = np.ones(len(variance), dtype=np.bool_)
    freedom = max(1, problem.freedom(fraction, there))
    return Fit(
        theta=problem.from_unit(fraction),
        information=there.curvature[0],
        chi_squared=float(there.cost[0]) / freedom,
        degrees_of_freedom=freedom,
        variance=variance,
        variance_known=target.variance_known,
        variance_assumed=target.assumes(variance),
        discrepancy=0.0,
        background=0.0,
        ignored=np.empty(0),
        used=used,
        at_bounds=bounds_reached(problem.parameters, fraction),
        starts=starts,
        agreeing=agreeing,
        steps=steps,
        seconds=seconds,
    )


def multistart(
    problem: Problem,
    *,
    starts: int = 64,
    seconds: float | None = None,
    objective: Objective = "frf",
    seed: int = 0,
    progress: Progress = silent,
) -> Fit:
    """Fit the parameters by bounded local searches from Latin hypercube points.

    Parameters
    ----------
    problem : Problem
    starts : int
    seconds : float, optional
        Time after which no further step begins; at most most of that of the problem's limit.
    objective : {"frf", "weighted"}
    seed : int
    progress : Progress

    Returns
    -------
    Fit
        Its chi-squared is relative to the random error, whatever the objective.

    Raises
    ------
    ParameterError
        An option is out of its range.
    """
    _check(starts, seconds, objective)
    began, limit = time.monotonic(), problem.limit.share(SEARCH_SHARE)
    limit = limit if seconds is None else limit.at_most(seconds)
    target = problem.observations
    variance = target.variance()
    misfit = problem.within(limit).weighted(
        variance if objective == "weighted" else _mean_of_response(target, variance)
    )
    minima = []
    points = latin_hypercube(starts, len(problem.parameters), np.random.default_rng(seed).spawn(1)[0])
    for number, point in enumerate(points):
        progress("fit", number, starts)
        start = point[np.newaxis]
        minima.append(minimise(misfit, start, tolerance=_TOLERANCE, most_steps=_MOST_STEPS))
        if limit.is_over:
            limit.leave_out(f"{starts - number} of {starts} searches")
            break
    ends = Minima.ranked(*minima)
    return fit_at(
        problem,
        ends.position[0],
        starts=len(minima),
        agreeing=count_agreeing(ends),
        steps=int(ends.steps.sum()),
        seconds=time.monotonic() - began,
    )


def _check(starts: int, seconds: float | None, objective: str) -> None:
    if starts < 1:
        raise ParameterError(Fault("starts", f"{starts} searches are too few.", "1 or more"))
    if seconds is not None and not seconds > 0:
        raise ParameterError(Fault("seconds", f"{seconds:g} s is not a time.", "more than 0"))
    if objective not in get_args(Objective):
        raise ParameterError(Fault("objective", f"'{objective}' is not an objective.", listing(get_args(Objective))))


def _mean_of_response(target: Observations, variance: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the mean variance of each response, repeated for all its lines."""
    return np.concatenate([np.full_like(values, values.mean()) for values in target.split(variance)])


def count_agreeing(minima: Minima) -> int:
    """Return how many searches ended in the best minimum, by the sums of squares."""
    return int(minima.searches[minima.cost <= highest_agreeing(minima.cost.min())].sum())


def highest_agreeing(cost: float) -> float:
    """Return the highest sum of squares of a search that ended in the same minimum as one with the sum `cost`."""
    return cost * (1.0 + _SAME_MINIMUM) + 1.0


class Pace:
    """Decides every ten steps which searches would not come near enough to the lowest one at their pace.

    Parameters
    ----------
    highest : callable
        Takes the lowest sum of squares to the highest one of interest.

    Attributes
    ----------
    is_measured : bool
        Whether the latest step was one after which searches end.
    """

    def __init__(self, highest: Callable[[float], float]) -> None:
        self._highest, self._earlier, self.is_measured = highest, np.empty(0), False
        self._steps = self._left = 0

    def __call__(self, minima: Minima, steps_left: int) -> NDArray[np.bool_]:
        """Return which searches (n,) end, from where all of them are; called after each step."""
        if steps_left >= self._left:  # another group of searches begins
            self._steps, self._earlier = 0, minima.cost.copy()
        self._steps, self._left = self._steps + 1, steps_left
        self.is_measured = self._steps % PACE_STEPS == 0
        if not self.is_measured:
            return np.zeros(len(minima.cost), dtype=np.bool_)
        finite = np.isfinite(minima.cost)  # others have ended
        lowest = float(minima.cost[finite].min())
        above, before = np.where(finite, minima.cost - lowest, 0.0), self._earlier - lowest
        self._earlier = minima.cost.copy()
        pace = above / np.maximum(before, np.maximum(above, np.finfo(float).tiny))
        return np.asarray(lowest + above * pace ** (steps_left / PACE_STEPS) > self._highest(lowest))


def is_noise(problem: Problem, fit: Fit) -> bool:
    """Return whether the residuals of a fit are noise: no larger, and not correlated along the frequency axis."""
    if fit.discrepancy:
        return False
    target = problem.observations
    frf, jacobian = problem.model.frf_by_fractions(fit.theta[np.newaxis])
    weighted = target.weighted(fit.variance, fit.used)
    residuals = weighted.of(frf)[0]
    blocks = target.by_line(without(residuals, weighted.jacobian(frf, jacobian)[0]))
    squares, lines = sum(float(np.sum(block**2)) for block in blocks), int(np.count_nonzero(fit.used))
    if not has_size_of_noise(squares, fit.degrees_of_freedom, lines, variance_known=fit.variance_known):
        return False
    return all(is_white(_scaled_to_scatter(block)) for block in blocks)


def shows_structure(target: Observations, fit: Fit, *, fits: bool) -> bool:
    """Return whether a measurement shows more than noise.

    Mere noise is as large as its variance, or the same on all lines if that is unknown, and white. A resonance that is
    hidden in it may still show as an improvement by a fit. It may lie on any line, and the best of them fits by chance.

    Parameters
    ----------
    target : Observations
    fit : Fit
    fits : bool
        Whether its residuals are noise.
    """
    if fit.variance_assumed or not (target.variance_known or _scatters(target)):
        return True
    variance = fit.variance if target.variance_known else _even_variance(target)
    weighted = target.weighted(variance, fit.used)
    values = weighted.of(np.zeros((1, len(variance)), dtype=np.complex128))[0]
    blocks = target.by_line(values)
    squares, lines = sum(float(np.sum(block**2)) for block in blocks), int(np.count_nonzero(fit.used))
    known = target.variance_known
    if not has_size_of_noise(squares, len(values), lines, variance_known=known) or not all(map(is_white, blocks)):
        return True
    explained = squares - fit.chi_squared * fit.degrees_of_freedom
    return fits and known and log_improbability(explained, len(fit.theta)) > np.log10(max(1, lines) / NOISE_ALARM)


def _scatters(target: Observations) -> bool:
    """Return whether all measurements scatter from line to line as much as they are large, as white noise does."""
    for frf in target.frfs:
        differences = np.abs(np.convolve(frf.values, FOURTH_DIFFERENCE, mode="valid")) ** 2
        if not differences.size or differences.mean() < _LEAST_SCATTER * np.mean(frf.amplitude**2):
            return False
    return True


def _even_variance(target: Observations) -> NDArray[np.float64]:
    """Return E|error|^2 (n_lines,) if a measurement is noise of the same size on all lines, from the median."""
    levels = [float(np.median(frf.amplitude)) ** 2 / np.log(2.0) for frf in target.frfs]
    return np.repeat(np.maximum(levels, np.finfo(float).tiny), target.counts)


def _scaled_to_scatter(residuals: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return residuals (n_freq, n), scaled down where their scatter from line to line exceeds the random error."""
    scatter = float(np.mean(np.diff(residuals, axis=0) ** 2)) / 2.0 if len(residuals) > 1 else 1.0
    return np.asarray(residuals / np.sqrt(max(1.0, scatter)))


def without(vectors: NDArray[np.float64], directions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return vectors (..., m) without their projection on the span of some directions (k, m)."""
    lengths = np.maximum(np.linalg.norm(directions, axis=1), np.finfo(float).tiny)
    basis = np.linalg.qr(directions.T / lengths)[0]
    return np.asarray(vectors - (vectors @ basis) @ basis.T)
