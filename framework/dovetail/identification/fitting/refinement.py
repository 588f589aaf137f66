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
from dovetail.identification.fitting.fit import Fit, agreeing, at_bounds
from dovetail.identification.fitting.levenberg_marquardt import minimise
from dovetail.identification.fitting.observations import Measured
from dovetail.identification.fitting.residuals import FrfMisfit, Frfs

__all__ = ["refine"]

_FIRST_STARTS = 4
_MORE_STARTS = 8
_MOST_STARTS = 28
_AGREEING = 3
"""Searches that must end in the same place before it is taken for the best there is, where the model does not fit."""
_SEARCH_TOLERANCE, _SEARCH_STEPS = 1.0, 40
_FIT_TOLERANCE, _FIT_STEPS = 0.02, 100
_SURE = 5.0
"""Standard deviations of chi-squared within which a fit is as good as the random error allows."""
_UNSURE_SCATTER = 0.15
"""Relative error of a random variance that is told from the scatter from line to line."""
_REFITTED = 4
"""Ends of searches that are fitted again when the weights change."""
_MOST_REWEIGHTED, _SETTLED = 8, 0.02
_DISCREPANCIES = (np.log(1e-6), np.log(1e3))
"""Between which the model's relative error is sought, as logarithms."""


def refine(
    assembly: Assembly, measured: Frf | Sequence[Frf], starts: Sequence[NDArray[np.float64]] = (), *, seed: int = 0
) -> Fit:
    """Fit the parameters to a measured FRF, weighted by its random error, or to one for each response.

    Parameters
    ----------
    assembly : Assembly
        With parameters to seek.
    measured : Frf or sequence of Frf
        One for each response, on the assembly's frequencies. Its random error is taken from its variance, or coherence
        and averages, or from the scatter from line to line.
    starts : sequence of (n_params,) arrays
        SI; what lies outside the ranges is brought to their ends. The middle of the ranges and Latin hypercube points
        are tried beside them, more of them until a fit is as good as the random error allows.
    seed : int
        Of the Latin hypercube.

    Returns
    -------
    Fit

    Notes
    -----
    From each start logarithms of amplitudes are compared first, since their sum of squares is shallow, then the FRF
    itself, complex where it has a phase. Lines that stand alone are left out. Where no fit reaches the random error,
    the model itself is off, and that part of each line's magnitude is found which makes chi-squared 1: it enters the
    weights, so that the lines with the least noise do not rule alone.
    """
    return _Refinement(assembly, Measured.of(assembly, measured), seed).run(starts)


@dataclass(frozen=True, eq=False)
class _Ends:
    """Where searches ended, the best first."""

    position: NDArray[np.float64]
    cost: NDArray[np.float64]
    curvature: NDArray[np.float64]

    @staticmethod
    def of(position: NDArray[np.float64], cost: NDArray[np.float64], curvature: NDArray[np.float64]) -> _Ends:
        order = np.argsort(cost, kind="stable")
        return _Ends(position[order], cost[order], curvature[order])

    def with_others(self, other: _Ends) -> _Ends:
        pairs = ((self.position, other.position), (self.cost, other.cost), (self.curvature, other.curvature))
        return _Ends.of(*(np.concatenate(pair) for pair in pairs))


class _Refinement:
    """One refinement as it goes on: weights, lines that count, searches that ended."""

    def __init__(self, assembly: Assembly, target: Measured, seed: int) -> None:
        self._assembly = assembly
        self._frfs = Frfs.of(assembly)
        self._target = target
        self._hypercube = qmc.LatinHypercube(len(assembly.parameters), rng=np.random.default_rng(seed))
        self._known = target.known_variances()
        self._told = all(known is not None for known in self._known)
        self._variance = target.variance(self._known)
        self._model_variance = np.zeros_like(self._variance)
        self._used = np.ones(len(target.frequency), dtype=np.bool_)
        self._steps = self._starts = 0

    def run(self, starts: Sequence[NDArray[np.float64]]) -> Fit:
        began = time.perf_counter()
        ends = None
        for batch in self._batches(starts):
            found = self._searched(batch, ends)
            ends = self._reweighted(found if ends is None else ends.with_others(found))
            if self._is_noise(ends) or agreeing(ends.cost) >= _AGREEING:
                break
        assert ends is not None
        alone = self._chi_squared(ends)
        discrepancy = 0.0
        if not self._is_noise(ends):
            ends, discrepancy = self._with_discrepancy(ends)
        return Fit(
            theta=self._assembly.from_unit(ends.position[0]),
            information=ends.curvature[0],
            chi_squared=alone,
            degrees_of_freedom=self._freedom,
            variance=self._variance,
            variance_known=self._told,
            discrepancy=discrepancy,
            ignored=self._target.frequency[~self._used],
            used=self._used,
            at_bounds=at_bounds(self._assembly, ends.position[0]),
            starts=self._starts,
            agreeing=agreeing(ends.cost),
            steps=self._steps,
            seconds=time.perf_counter() - began,
        )

    def _batches(self, starts: Sequence[NDArray[np.float64]]) -> Iterator[NDArray[np.float64]]:
        count = len(self._assembly.parameters)
        given = [self._assembly.to_unit(np.maximum(start, np.finfo(float).tiny)) for start in starts]
        first = np.array([*given, np.full(count, 0.5)])
        yield np.concatenate([first, self._hypercube.random(max(1, _FIRST_STARTS - len(first)))])
        for _ in range((_MOST_STARTS - _FIRST_STARTS) // _MORE_STARTS):
            yield self._hypercube.random(_MORE_STARTS)

    def _searched(self, batch: NDArray[np.float64], ends: _Ends | None) -> _Ends:
        """Search from each start; among the first starts, only from the most promising if that is enough."""
        search = FrfMisfit(self._frfs, self._target.logarithms(self._variance))
        near = minimise(search, np.clip(batch, 0.0, 1.0), tolerance=_SEARCH_TOLERANCE, most_steps=_SEARCH_STEPS)
        self._steps += int(near.steps.sum())
        self._starts += len(batch)
        promising = near.position[np.argsort(near.cost, kind="stable")]
        if ends is not None:
            return self._fitted(promising)
        best = self._reweighted(self._fitted(promising[:1]))
        return best if self._is_noise(best) else best.with_others(self._fitted(promising[1:]))

    def _fitted(self, start: NDArray[np.float64]) -> _Ends:
        residual = self._target.weighted(self._variance + self._model_variance, self._used)
        problem = FrfMisfit(self._frfs, residual)
        found = minimise(problem, start, tolerance=_FIT_TOLERANCE, most_steps=_FIT_STEPS)
        self._steps += int(found.steps.sum())
        return _Ends.of(found.position, found.cost, found.curvature)

    def _reweighted(self, ends: _Ends) -> _Ends:
        """Tell the random error anew from what the best fit leaves, leave bad lines out, fit again if that matters."""
        if not self._told:
            self._variance = self._target.variance(self._known, self._values(ends))
        bad = np.zeros_like(self._used) if self._is_noise(ends) else self._target.isolated(self._sizes(ends))
        if self._told and np.array_equal(bad, ~self._used):
            return ends
        self._used = ~bad
        return self._fitted(ends.position[:_REFITTED])

    def _with_discrepancy(self, ends: _Ends) -> tuple[_Ends, float]:
        """Find the part of each line's magnitude by which the model is off, and fit with it."""
        discrepancy = 0.0
        for _ in range(_MOST_REWEIGHTED):
            before = discrepancy
            values = self._values(ends)
            discrepancy = self._unexplained(values)
            self._model_variance = (discrepancy * np.abs(values)) ** 2
            ends = self._fitted(ends.position[:_REFITTED])
            if abs(discrepancy - before) <= _SETTLED * discrepancy:
                break
        return ends, discrepancy

    def _unexplained(self, values: NDArray[np.complex128]) -> float:
        """Return the part of each line's magnitude that makes chi-squared 1."""
        squares = self._target.squares(values)[self._used]
        magnitude, variance = np.abs(values[self._used]), self._variance[self._used]

        def excess(logarithm: float) -> float:
            return float(np.mean(squares / (variance + (np.exp(logarithm) * magnitude) ** 2)) - 1.0)

        least, most = _DISCREPANCIES
        if excess(least) <= 0:
            return 0.0
        return float(np.exp(most if excess(most) >= 0 else brentq(excess, least, most)))

    def _values(self, ends: _Ends) -> NDArray[np.complex128]:
        return np.asarray(self._frfs.frf(self._assembly.from_unit(ends.position[:1]))[0])

    def _sizes(self, ends: _Ends) -> NDArray[np.float64]:
        """Return the size of each line's residual at the best fit, over its standard deviation."""
        everything = self._target.weighted(self._variance, np.ones_like(self._used))
        return everything.size(self._values(ends))

    @property
    def _freedom(self) -> int:
        return max(1, self._target.residuals_of(self._used) - len(self._assembly.parameters))

    def _chi_squared(self, ends: _Ends) -> float:
        return float(ends.cost[0]) / self._freedom

    def _is_noise(self, ends: _Ends) -> bool:
        """Say whether the best fit leaves no more than the random error."""
        spread = _SURE * np.sqrt(2.0 / self._freedom) + (0.0 if self._told else _UNSURE_SCATTER)
        return bool(self._chi_squared(ends) <= 1.0 + spread)
