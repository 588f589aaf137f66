"""Refinement: the parameters whose FRF leaves nothing but the measurement's random error."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.stats import qmc

from dovetail.assembly import Assembly
from dovetail.frf import Frf
from dovetail.identification.fitting.fit import Fit, bounds_reached, count_agreeing
from dovetail.identification.fitting.least_squares import Minima, minimise
from dovetail.identification.fitting.observations import Observations
from dovetail.identification.fitting.residuals import FrfResiduals, ModelFrfs

__all__ = ["refine"]


@dataclass(frozen=True)
class Settings:
    """Tuning constants of the refinement."""

    first_starts: int = 4
    """At least. They reached the noise in each of 120 random joints of the collet; searches take most of the time."""
    more_starts: int = 8
    """In each further batch."""
    more_batches: int = 3
    """Where the model does not fit, more starts only confirm it."""
    enough_agreeing: int = 3
    """Searches that must end in the same minimum before it counts as the best one, where the model does not fit."""
    search_tolerance: float = 1.0
    """Decrease of the sum of squares, per step, that ends a search by logarithms: the fit goes on from there."""
    search_steps: int = 40
    """At most. A search that needs more is in a bad valley."""
    fit_tolerance: float = 0.02
    """Decrease of the sum of squares, per step, that ends a fit; 1 is a standard deviation of a parameter."""
    fit_steps: int = 100
    """At most; for the collet half of the fits take 14, and all of them fewer than 70."""
    significance: float = 5.0
    """Standard deviations of chi-squared within which a fit is as good as the random error allows."""
    scatter_error: float = 0.15
    """Relative error of a variance that is estimated from the scatter from line to line."""
    refitted: int = 4
    """Minima that are fitted again when the weights change: another may then be the best."""
    most_discrepancies: int = 8
    """Times that the discrepancy of the model is estimated and fitted again; it settles after 2 or 3."""
    settled: float = 0.02
    """Relative change of the discrepancy at which it has settled."""
    least_discrepancy: float = 1e-6
    """Relative error of a model below which it does not matter."""
    most_discrepancy: float = 1e3
    """Relative error of a model above which the FRF says nothing."""


_SETTINGS = Settings()


def refine(
    assembly: Assembly, measured: Frf | Sequence[Frf], starts: Sequence[NDArray[np.float64]] = (), *, seed: int = 0
) -> Fit:
    """Fit the parameters to a measured FRF, weighted by its random error, or to one for each response.

    Parameters
    ----------
    assembly : Assembly
        With parameters to identify.
    measured : Frf or sequence of Frf
        One for each response, on the assembly's frequencies. Its random error is taken from its variance, or coherence
        and averages, or from the scatter from line to line.
    starts : sequence of (n_params,) arrays
        SI; values outside the ranges are brought to their bounds. Further starts are the middle of the ranges and Latin
        hypercube points, more of them until a fit is as good as the random error allows.
    seed : int
        Of the Latin hypercube.

    Returns
    -------
    Fit

    Notes
    -----
    Each search first compares logarithms of amplitudes, whose sum of squares is shallow, then the FRF itself, complex
    where it has a phase. Isolated lines are left out. Where no fit reaches the random error, the model itself is wrong
    by some part of each line's magnitude. The part that makes chi-squared 1 enters the weights, so that the lines with
    the least noise do not dominate.
    """
    return _Refinement(assembly, Observations.of(assembly, measured), seed).run(starts)


@dataclass(frozen=True, eq=False)
class _Ranked:
    """The minima where searches ended, the lowest first."""

    position: NDArray[np.float64]
    cost: NDArray[np.float64]
    curvature: NDArray[np.float64]

    @staticmethod
    def of(*minima: Minima | _Ranked) -> _Ranked:
        order = np.argsort(np.concatenate([group.cost for group in minima]), kind="stable")
        names = ("position", "cost", "curvature")
        return _Ranked(*(np.concatenate([getattr(group, name) for group in minima])[order] for name in names))


class _Refinement:
    """The state of one refinement: the weights and the lines that count."""

    def __init__(self, assembly: Assembly, target: Observations, seed: int) -> None:
        self._assembly = assembly
        self._model = ModelFrfs.of(assembly)
        self._target = target
        self._hypercube = qmc.LatinHypercube(len(assembly.parameters), rng=np.random.default_rng(seed))
        self._variance = target.variance()
        self._model_variance = np.zeros_like(self._variance)
        self._used = np.ones(len(target.frequency), dtype=np.bool_)
        self._steps = self._starts = 0

    def run(self, starts: Sequence[NDArray[np.float64]]) -> Fit:
        began = time.perf_counter()
        first, *others = self._batches(starts)
        minima = self._reweighted(self._first_minima(first))
        for batch in others:
            if self._is_noise(minima) or count_agreeing(minima.cost) >= _SETTINGS.enough_agreeing:
                break
            minima = self._reweighted(_Ranked.of(minima, self._fitted(self._searched(batch))))
        chi_squared = self._chi_squared(minima)
        discrepancy = 0.0
        if not self._is_noise(minima):
            minima, discrepancy = self._with_discrepancy(minima)
        return Fit(
            theta=self._assembly.from_unit(minima.position[0]),
            information=minima.curvature[0],
            chi_squared=chi_squared,
            degrees_of_freedom=self._freedom,
            variance=self._variance,
            variance_known=self._target.variance_known,
            discrepancy=discrepancy,
            ignored=self._target.frequency[~self._used],
            used=self._used,
            at_bounds=bounds_reached(self._assembly, minima.position[0]),
            starts=self._starts,
            agreeing=count_agreeing(minima.cost),
            steps=self._steps,
            seconds=time.perf_counter() - began,
        )

    def _batches(self, starts: Sequence[NDArray[np.float64]]) -> Iterator[NDArray[np.float64]]:
        middle = np.full(len(self._assembly.parameters), 0.5)
        first = np.array(
            [*(self._assembly.to_unit(np.maximum(start, np.finfo(float).tiny)) for start in starts), middle]
        )
        yield np.concatenate([first, self._hypercube.random(max(1, _SETTINGS.first_starts - len(first)))])
        for _ in range(_SETTINGS.more_batches):
            yield self._hypercube.random(_SETTINGS.more_starts)

    def _searched(self, batch: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return where searches by logarithms of amplitudes ended, the most promising first."""
        search = FrfResiduals(self._model, self._target.logarithms(self._variance))
        minima = minimise(search, batch, tolerance=_SETTINGS.search_tolerance, most_steps=_SETTINGS.search_steps)
        self._steps += int(minima.steps.sum())
        self._starts += len(batch)
        return minima.position[np.argsort(minima.cost, kind="stable")]

    def _first_minima(self, batch: NDArray[np.float64]) -> _Ranked:
        """Fit from the most promising of the first starts, and from the others only if that is not enough."""
        promising = self._searched(batch)
        best = self._reweighted(self._fitted(promising[:1]))
        return best if self._is_noise(best) else _Ranked.of(best, self._fitted(promising[1:]))

    def _fitted(self, start: NDArray[np.float64]) -> _Ranked:
        residual = self._target.weighted(self._variance + self._model_variance, self._used)
        problem = FrfResiduals(self._model, residual)
        minima = minimise(problem, start, tolerance=_SETTINGS.fit_tolerance, most_steps=_SETTINGS.fit_steps)
        self._steps += int(minima.steps.sum())
        return _Ranked.of(minima)

    def _reweighted(self, minima: _Ranked) -> _Ranked:
        """Estimate the random error anew from the best fit, leave isolated lines out, fit again if that matters."""
        known = self._target.variance_known
        if not known:
            self._variance = self._target.variance(self._values(minima))
        bad = np.zeros_like(self._used) if self._is_noise(minima) else self._target.isolated(self._sizes(minima))
        if known and np.array_equal(bad, ~self._used):
            return minima
        self._used = ~bad
        return self._fitted(minima.position[: _SETTINGS.refitted])

    def _with_discrepancy(self, minima: _Ranked) -> tuple[_Ranked, float]:
        """Estimate the relative error of the model, and fit with it."""
        discrepancy = 0.0
        for _ in range(_SETTINGS.most_discrepancies):
            before = discrepancy
            values = self._values(minima)
            discrepancy = self._discrepancy(values)
            self._model_variance = (discrepancy * np.abs(values)) ** 2
            minima = self._fitted(minima.position[: _SETTINGS.refitted])
            if abs(discrepancy - before) <= _SETTINGS.settled * discrepancy:
                break
        return minima, discrepancy

    def _discrepancy(self, values: NDArray[np.complex128]) -> float:
        """Return the part of each line's magnitude that makes chi-squared 1."""
        squares = self._target.squares(values)[self._used]
        magnitude, variance = np.abs(values[self._used]), self._variance[self._used]

        def excess(logarithm: float) -> float:
            return float(np.mean(squares / (variance + (np.exp(logarithm) * magnitude) ** 2)) - 1.0)

        least, most = np.log(_SETTINGS.least_discrepancy), np.log(_SETTINGS.most_discrepancy)
        if excess(least) <= 0:
            return 0.0
        return float(np.exp(most if excess(most) >= 0 else brentq(excess, least, most)))

    def _values(self, minima: _Ranked) -> NDArray[np.complex128]:
        return np.asarray(self._model.frf(self._assembly.from_unit(minima.position[:1]))[0])

    def _sizes(self, minima: _Ranked) -> NDArray[np.float64]:
        """Return the size of each line's residual at the best fit, over its standard deviation."""
        all_lines = self._target.weighted(self._variance, np.ones_like(self._used))
        return all_lines.size(self._values(minima))

    @property
    def _freedom(self) -> int:
        return max(1, self._target.residual_count(self._used) - len(self._assembly.parameters))

    def _chi_squared(self, minima: _Ranked) -> float:
        return float(minima.cost[0]) / self._freedom

    def _is_noise(self, minima: _Ranked) -> bool:
        """Say whether the residuals of the best fit are no larger than the random error."""
        spread = _SETTINGS.significance * np.sqrt(2.0 / self._freedom)
        spread += 0.0 if self._target.variance_known else _SETTINGS.scatter_error
        return bool(self._chi_squared(minima) <= 1.0 + spread)
