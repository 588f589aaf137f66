"""Refinement: least-squares fits until the residuals are nothing but the measurement's random error."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, ExitStack
from dataclasses import dataclass, replace
from functools import partial
from itertools import count

import numpy as np
from numpy.typing import NDArray

from dovetail.inference.fitting.fit import SEARCH_SHARE, UNFINISHED, Fit, Pace, count_agreeing, highest_agreeing
from dovetail.inference.fitting.lines import LineWeights, with_best_delays
from dovetail.inference.fitting.modal_fit import fit_to_modes
from dovetail.inference.fitting.profiles import profiles
from dovetail.inference.fitting.searches import CONFIRMING, FURTHER, Starts, different, search_ends, searching
from dovetail.interfaces import FIT_OPTIONS, FitOptions, Progress, logged, silent
from dovetail.problem import Problem
from dovetail.problem.definition import WithPrior, bounds_reached, fractions_within
from dovetail.problem.least_squares import Minima, minimise
from dovetail.problem.modal_observations import ModalProblem
from dovetail.problem.residuals import FrfResiduals


@dataclass(frozen=True)
class Settings:
    """Tuning constants of the refinement."""

    profiled_batch: int = 2
    """The first of the further batches with profiles through the best minimum so far."""
    often: float = 1.0 / 3.0
    """Share of the searches in the best minimum above which profiles on another grid follow before searches end. Wrong
    minima that lack a hidden resonance are found often; those of wrong models are not."""
    along_profiles: int = 8
    """Largest number of minima of the profiles from which searches begin."""
    profile_steps: int = 1
    """Times that derivatives are computed at each point of a profile, where a search begins near its end."""
    widths: tuple[float, ...] = (0.01, 0.003)
    """Relative widths over which residuals are smoothed: along the profiles first, then in the searches from there."""
    first_carried: int = 2
    """Searches of the first batch whose minima are fitted first, those with the most similar FRFs; as many of those
    from parameters that are drawn anew."""
    carried: int = 4
    """Searches of each further batch whose minima are fitted."""
    released: int = 3
    """Largest number of minima, the best ones, in which parameters at ends of their ranges are drawn anew."""
    releases: int = 3
    """Largest number of times that this is done in succession, each time from better minima. Chosen on cases of seed
    777 of the benchmark of genuine measurements and on the wrong models 100 to 111 of that of wrong minima; tested on
    seeds 202614 and 202616, and on the wrong models 112 to 119."""
    trial_steps: int = 6
    """Times that derivatives are computed in a fit from there on some lines, which goes on only if it is the lowest."""
    lower: float = 1e-4
    """Relative decrease of the lowest sum of squares since, with which it is done in a further batch."""
    least_batches: int = 3
    """Smallest number of batches before the model is taken not to fit."""
    fit_lines: int = 1500
    """Approximate number of lines of each response on which minima are compared; the best is fitted on all lines."""
    refitted: int = 4
    """Minima that are fitted again when the weights change, since another one may then be the best."""
    most_discrepancies: int = 8
    """Largest number of times that the discrepancy is estimated and the fit repeated; 2 or 3 are usually enough."""
    settled: float = 0.04
    """Relative change of the discrepancy's variances at which these repetitions end."""


_SETTINGS = Settings()


def refine(
    problem: Problem,
    starts: Sequence[NDArray[np.float64]] = (),
    options: FitOptions = FIT_OPTIONS,
    *,
    seed: int = 0,
    progress: Progress = silent,
) -> Fit:
    """Fit the parameters to a measured FRF, weighted by its random error, to one for each response, or to a table.

    Parameters
    ----------
    problem : Problem
        The random error of its observations is taken from their variance, or coherence and averages, or from the
        scatter from line to line.
    starts : sequence of (n_params,) arrays
        SI; values outside the ranges are brought to their bounds. The first batch has these alone or, if none are
        given, the middle of the ranges and those points of a Latin hypercube whose FRFs are most like the measured
        ones. Further batches follow until a fit is as good as the random error allows.
    options : FitOptions
        Of a fit to FRFs; a fit to a table needs none.
    seed : int
        Of the Latin hypercube.
    progress : Progress
        Called after each search. The total grows while no fit is as good as the random error allows.

    Returns
    -------
    Fit

    Notes
    -----
    Each search first compares logarithms of amplitudes, whose sum of squares is shallow, on few lines, among them those
    around each resonance; then the FRF itself, complex where it has a phase. Isolated lines are left out. A fit is as
    good as the random error allows if chi-squared says so, and if the residuals are white: a smooth misfit is not
    taken for noise, however small. Where the measurement does not state its random error, it is then estimated from all
    residuals. Where no fit reaches the random error, the model itself is wrong: by some part of each line's
    magnitude, and by some part of the FRF's level everywhere, as by modes that it lacks. The most likely parts enter
    the weights, so that the lines with the least noise do not dominate.
    """
    progress("fit", 0, 1)
    with logged(__name__, f"fit of {len(problem.parameters)} parameters"):
        if isinstance(problem, ModalProblem):
            return fit_to_modes(problem, starts, seed=seed, progress=progress)
        return _Refinement(problem, options, seed, progress).run(starts)


class _Refinement:
    """One refinement: its searches and the weights of its fits."""

    def __init__(self, problem: Problem, options: FitOptions, seed: int, progress: Progress) -> None:
        self._problem, self._options, self._progress = problem, options, progress
        self._target = target = problem.observations
        self._from = Starts(len(problem.parameters), seed)
        self._weights = LineWeights(target, len(problem.parameters))
        self._lines = self._weights.search_lines()
        self._few, self._some = self._lines.few, self._lines.thinned(_SETTINGS.fit_lines)
        self._on_fewest = self._on_lines(self._lines.fewest)
        self._on_few, self._on_some = self._on_lines(self._few), self._on_lines(self._some)
        description, highest = problem.assembly.description, float(target.frequency.max())
        owners = [owner if name == "delay" else "" for owner, name in description.identified_parameters]
        spans = (each.upper - each.lower for each in problem.parameters)
        self._turns = {n: highest * span for n, span in enumerate(spans) if owners[n] in description.calibrations}
        self._steps = self._starts = self._searches = 0
        self._expected = options.first_starts + _SETTINGS.first_carried + 1

    def _report_search(self) -> None:
        """Report one more search; further batches are not counted in the total before they begin."""
        self._searches += 1
        self._progress("fit", self._searches, max(self._expected, self._searches + 1))

    def run(self, starts: Sequence[NDArray[np.float64]]) -> Fit:
        began = time.perf_counter()
        ends = self._searched(self._first_batch(starts))
        minima = self._compared(ends.at(slice(_SETTINGS.first_carried)))
        best = self._reweighted(self._fitted(minima.position[:1]))
        others = ends.at(slice(_SETTINGS.first_carried, None))
        if self._is_doubtful(best):
            minima, best = self._search_further(self._extended(minima, others))
            others = ends.at(slice(0))
        if not (starts or self._is_doubtful(best)):
            minima, best = self._confirmed(minima, best, others)
        chi_squared = float(np.sum(self._weights.whitened(self._values(best)) ** 2)) / self._weights.freedom
        discrepancy = background = 0.0
        if not self._is_noise(best):
            best, (discrepancy, background) = self._with_discrepancy(best, minima)
        if self._problem.limit.is_over:
            self._problem.limit.leave_out(UNFINISHED)
        return Fit(
            theta=self._problem.from_unit(best.position[0]),
            information=best.curvature[0],
            chi_squared=chi_squared,
            degrees_of_freedom=self._weights.freedom,
            variance=self._weights.variance,
            variance_known=self._target.variance_known,
            variance_assumed=self._target.assumes(self._weights.variance),
            discrepancy=discrepancy,
            background=background,
            ignored=self._target.frequency[~self._weights.used],
            used=self._weights.used,
            at_bounds=bounds_reached(self._problem.parameters, best.position[0]),
            starts=self._starts,
            agreeing=count_agreeing(minima),
            steps=self._steps,
            seconds=time.perf_counter() - began,
        )

    def _confirmed(self, minima: Minima, best: Minima, others: Minima) -> tuple[Minima, Minima]:
        """Search for a better fit than one that reaches the noise, which a wrong minimum can do as well.

        Searches along the axes come first, and those from parameters that ran away. Unless most agree, those earlier
        ones that were not fitted follow, and searches from similar FRFs.
        """
        here = self._compared(replace(minima.at(slice(1)), position=best.position))  # the weights may have changed
        ends = self._searched(self._from.along_axes(self._search, best.position[0]))
        minima = self._extended(self._with_released(here), Minima.joined([minima.at(slice(1, None)), ends]))
        if not (self._agree(minima, 0.5) or self._has_no_time()):
            similar = self._searched(self._from.similar(self._similarity, CONFIRMING)).at(slice(_SETTINGS.carried))
            minima = self._extended(minima, Minima.joined([others, similar]))
        if here.cost[0] <= highest_agreeing(minima.cost[0]):
            return minima, best
        return minima, self._reweighted(self._fitted(minima.position[:1]))

    def _search_further(self, minima: Minima) -> tuple[Minima, Minima]:
        """Search further until a fit reaches the noise, or enough searches agree that none will.

        Another process can do the searches from similar FRFs during the batch before. Returns all minima, and the best
        one fitted on all lines.
        """
        profiled, released, profiled_again = np.inf, np.inf, False
        with ExitStack() as running:
            similar = running.enter_context(self._similar_meanwhile())
            for batch in count(1):
                minima = self._compared(minima)  # the weights have changed
                if minima.cost[0] < (1.0 - _SETTINGS.lower) * released:
                    minima = self._with_released(minima)
                    released = minima.cost[0]
                best = self._reweighted(self._fitted(minima.position[:1]))
                if not self._is_doubtful(best):
                    break
                wrong = _SETTINGS.profiled_batch, self._options.batches
                first_profiled, last = (1, 1) if self._is_noise(best) else wrong
                enough = batch >= _SETTINGS.least_batches and self._agree(minima, 0.5)
                settled = enough and not self._lines.missed_resonances(self._weights.variance, self._values(best)).size
                ends, repeats = batch > last or settled, np.isfinite(profiled) and self._agree(minima, _SETTINGS.often)
                if (ends and (profiled_again or not repeats)) or self._has_no_time():
                    break
                if ends:
                    profiled_again, minima = True, self._with_profiles(minima)
                    continue
                profiled_again = False
                along = self._from.along_axes(self._search, best.position[0])
                self._expected = self._searches + len(along) + FURTHER.count + _SETTINGS.carried + len(minima.cost) + 1
                found = self._searched(along, similar)
                similar = running.enter_context(self._similar_meanwhile())
                minima = self._extended(minima, found.at(slice(_SETTINGS.carried)))
                if batch >= first_profiled and profiled > highest_agreeing(minima.cost[0]):
                    profiled, minima = minima.cost[0], self._with_profiles(minima)
        return minima, best

    def _similar_meanwhile(self) -> AbstractContextManager[Callable[[], Minima]]:
        """Search from points with similar FRFs, for the weights as they are now."""
        points = partial(self._from.apart().similar, self._similarity, FURTHER)
        return searching(self._search, points, self._report_search)

    def _has_no_time(self) -> bool:
        """Return whether most of the time has passed, which leaves out further batches of searches."""
        if late := (limit := self._problem.limit).share(SEARCH_SHARE).is_over:
            limit.leave_out("further searches for a better fit")
        return late

    def _first_batch(self, starts: Sequence[NDArray[np.float64]]) -> NDArray[np.float64]:
        """Return the given starts, which are often enough, or else the middle of the ranges and similar points."""
        if starts:
            return fractions_within(self._problem.parameters, np.array(starts))
        return self._from.first(self._similarity, self._options.first_starts)

    @property
    def _similarity(self) -> FrfResiduals:
        """The problem by which FRFs are like the measured ones: logarithms of amplitudes on the fewest lines."""
        return self._on_fewest.logarithms(self._weights.variance[self._lines.fewest])

    def _with_profiles(self, minima: Minima) -> Minima:
        """Add the best minimum along profiles through the best one so far.

        Along a profile one parameter moves, and all others are fitted. Where a resonance is hardly visible, the valley
        of the right minimum is narrow, but in a wrong minimum nearly all of the FRF is right, and it stays so along the
        profile. Smoothed residuals sense such a resonance from further away.
        """
        residual = self._weights.residual.at(self._few)
        smoothed = (self._lines.smoothed(residual, width) for width in _SETTINGS.widths)
        problems = [self._on_few.residuals(each) for each in smoothed]
        position, grid = minima.position[0], self._from.grid()
        self._expected = self._searches + len(grid) + len(problems) * _SETTINGS.along_profiles
        along = profiles(problems[0], position, grid, _SETTINGS.profile_steps, self._report_search)
        self._steps += along.steps
        if self._problem.limit.is_over:
            self._problem.limit.leave_out("searches along single parameters for a better fit")
            return minima
        if not len(points := along.low_points(position, _SETTINGS.along_profiles)):
            return minima
        for problem in problems:
            points = self._search_ends(problem, points).position
        return self._with_lowest(minima, points)

    def _with_released(self, minima: Minima) -> Minima:
        """Add a better minimum from those parameters that ran away to the ends of their ranges, drawn anew, if any."""
        for _ in range(_SETTINGS.releases):
            points = self._from.released(different(minima).at(slice(_SETTINGS.released)))
            if not len(points):
                break
            problem = self._on_fewest.residuals(self._weights.residual.at(self._lines.fewest))
            ends = self._search_ends(problem, points).at(slice(_SETTINGS.first_carried))
            trials = Minima.ranked(self._minimised(self._comparison, ends.position, _SETTINGS.trial_steps))
            lowest = minima.cost[0]
            if not trials.cost[0] < lowest:  # or not finite
                break
            minima = self._with_lowest(minima, trials.position[:1])
            if lowest <= highest_agreeing(minima.cost[0]):
                break
        return minima

    def _with_lowest(self, minima: Minima, points: NDArray[np.float64]) -> Minima:
        """Add the lowest minimum near some points, as that of one search."""
        self._starts += 1
        lowest = Minima.ranked(self._minimised(self._comparison, points)).at(slice(1))
        return Minima.ranked(minima, lowest)

    @property
    def _search(self) -> FrfResiduals:
        """The problem of the first searches: logarithms of amplitudes on few lines."""
        return self._on_few.logarithms(self._weights.variance[self._few])

    @property
    def _comparison(self) -> FrfResiduals:
        """The problem by which minima are compared: on some of the lines."""
        return self._on_some.residuals(self._weights.residual.at(self._some))

    def _searched(self, batch: NDArray[np.float64], *meanwhile: Callable[[], Minima]) -> Minima:
        """Return the different minima where searches by logarithms of amplitudes, some done meanwhile, have ended."""
        own = search_ends(self._search, batch, self._report_search)
        found = different(Minima.joined([own, *(ends() for ends in meanwhile)]))
        self._starts, self._steps = self._starts + int(found.searches.sum()), self._steps + int(found.steps.sum())
        return replace(found, position=with_best_delays(self._comparison, self._turns, found.position))

    def _search_ends(self, problem: FrfResiduals, start: NDArray[np.float64]) -> Minima:
        ends = search_ends(problem, start, self._report_search)
        self._steps += int(ends.steps.sum())
        return ends

    def _agree(self, minima: Minima, share: float) -> bool:
        """Return whether more than a share of the searches ended in the best minimum."""
        return count_agreeing(minima) > share * self._starts

    def _compared(self, ends: Minima) -> Minima:
        """Fit on some of the lines, which suffice to compare the minima where searches ended."""
        return Minima.ranked(replace(self._minimised(self._comparison, ends.position), searches=ends.searches))

    def _extended(self, minima: Minima, ends: Minima) -> Minima:
        return Minima.ranked(minima, self._compared(ends)) if len(ends.cost) else minima

    def _fitted(self, start: NDArray[np.float64]) -> Minima:
        """Fit on all lines."""
        return self._minimised(self._problem.residuals(self._weights.residual), start)

    def _minimised(self, misfit: FrfResiduals, start: NDArray[np.float64], steps: int = 0) -> Minima:
        minima = minimise(
            WithPrior(misfit, self._problem.parameters),
            start,
            tolerance=self._options.tolerance,
            most_steps=steps or self._options.steps,
            superfluous=Pace(highest_agreeing),
            callback=self._report_search,
        )
        self._steps += int(minima.steps.sum())
        return minima

    def _on_lines(self, lines: NDArray[np.intp]) -> Problem:
        return self._problem if len(lines) == len(self._weights.variance) else self._problem.at(lines)

    def _reweighted(self, best: Minima) -> Minima:
        """Estimate the random error again from the best fit, leave out isolated lines, and fit again if needed."""
        if not self._target.variance_known:
            self._weights.estimate(self._values(best))
            best = self._with_residual_variance(best)
        if not self._weights.leave_out_isolated(self._values(best)):
            return best
        best = self._fitted(best.position)
        return best if self._target.variance_known else self._with_residual_variance(best)

    def _with_residual_variance(self, best: Minima) -> Minima:
        """Estimate the random error from all residuals and fit again, if nothing but noise is left."""
        from_scatter = self._weights.variance
        if not self._weights.estimate_from_residuals(self._values(best)):
            return best
        refitted = self._fitted(best.position)
        if self._is_noise(refitted):
            return refitted
        self._weights.variance = from_scatter
        return best

    def _with_discrepancy(self, best: Minima, minima: Minima) -> tuple[Minima, tuple[float, float]]:
        """Estimate the errors of the model and fit with them, from several minima: another may then be the best."""
        starts = Minima.joined([best, minima.at(slice(1, _SETTINGS.refitted))])
        for _ in range(_SETTINGS.most_discrepancies):
            before, values = self._weights.model_variance, self._values(best)
            magnitude = np.abs(values)
            if self._problem.assembly.description.unknown_gains:
                magnitude = np.maximum(magnitude, self._target.amplitude)  # or a vanishing model would fit best
            discrepancy = self._weights.estimate_model_errors(values, magnitude)
            starts = self._compared(starts)
            best = self._fitted(starts.position[:1])
            change = np.abs(self._weights.model_variance - before)
            if np.all(change <= _SETTINGS.settled * self._weights.model_variance) or self._problem.limit.is_over:
                break
        return best, discrepancy

    def _values(self, minima: Minima) -> NDArray[np.complex128]:
        return self._problem.frf_at(self._problem.from_unit(minima.position[0]))

    def _is_noise(self, best: Minima) -> bool:
        """Return whether the residuals of the best fit are no larger than the random error, and white."""
        return self._weights.is_noise(self._values(best))

    def _is_doubtful(self, best: Minima) -> bool:
        """Return whether another minimum may be the right one."""
        return self._weights.is_doubtful(self._values(best))
