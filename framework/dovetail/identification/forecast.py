"""A forecast of how long an identification takes, from the time of one evaluation of its model."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable

import numpy as np

from dovetail.interfaces import NO_LIMIT, Progress
from dovetail.problem import Problem

FIXED = 0.2
"""Time [s] that every identification takes."""
_TIMED = 3
"""Evaluations that are timed; the fastest counts."""
_AFTER_FIT = frozenset({"modes", "exploration", "samples", "independence"})
"""Stages of the posterior. Causes of a misfit, which have a limit of their own, are not forecast."""
_SHORT = 5.0
"""Time [s] below which only a few seconds are left."""


def evaluation_seconds(problem: Problem, clock: Callable[[], float] = time.perf_counter) -> float:
    """Return the time [s] of computing the FRFs of a problem and their derivatives once, when all is compiled."""
    middle = problem.from_unit(np.full((1, len(problem.parameters)), 0.5))
    problem.frf_jacobian(middle)
    took = []
    for _ in range(_TIMED):
        began = clock()
        problem.frf_jacobian(middle)
        took.append(clock() - began)
    return min(took)


class ForecastProgress:
    """Progress with a note on the time that is left, once the problem is known. Fulfils `Progress`.

    Parameters
    ----------
    progress : Progress
        Called with the note in addition.
    evaluations : tuple of float
        As in `IdentificationMethod.evaluations`.
    clock : callable, optional
        Returns the time [s].
    """

    def __init__(
        self,
        progress: Progress,
        evaluations: tuple[float, float],
        clock: Callable[[], float] = time.perf_counter,
    ) -> None:
        self._progress, self._evaluations, self._clock = progress, evaluations, clock
        self._posterior = self._end = 0.0
        self._limit, self._began, self._fits = NO_LIMIT, False, True

    def begin(self, problem: Problem) -> None:
        """Time an evaluation of the model, and forecast from it."""
        one, (fit_evaluations, sample_evaluations) = evaluation_seconds(problem, self._clock), self._evaluations
        self._limit, self._posterior = problem.limit, one * sample_evaluations
        self._end = self._clock() + FIXED + one * fit_evaluations + self._posterior
        self._began = self._fits = True
        logging.getLogger(__name__).info("forecast: about %.2g s", self.seconds_left)

    @property
    def seconds_left(self) -> float:
        """The time that is probably left, within the limit."""
        return float(min(max(0.0, self._end - self._clock()), self._limit.remaining))

    def __call__(self, stage: str, done: int, total: int, note: str = "") -> None:
        """Report `done` of `total` steps of `stage`, with the time that is left if there is no other note."""
        if self._fits and stage in _AFTER_FIT:
            self._fits, self._end = False, self._clock() + self._posterior
        left = in_words(self.seconds_left) if self._began else ""
        self._progress(stage, done, total, note or left)


def in_words(seconds: float) -> str:
    """Return a time that is left, to one digit."""
    if seconds < _SHORT:
        return "a few seconds left"
    if seconds < 95.0:
        return f"about {max(10.0, round(seconds, -1)):.0f} s left"
    return f"about {seconds / 60.0:.0f} min left"
