"""Progress of long computations, the time that they have, and their record in the log named "dovetail"."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from numbers import Real
from typing import Protocol

import numpy as np

from dovetail.errors import Fault, Note, ParameterError, argument, listing


class Progress(Protocol):
    """Function that is called from time to time with the steps done, their total number, and a note."""

    def __call__(self, stage: str, done: int, total: int, note: str = "") -> None:
        """Report `done` of `total` steps of `stage`."""


def silent(stage: str, done: int, total: int, note: str = "") -> None:
    """Report nothing."""


@contextmanager
def progress_reporter(progress: Progress | bool | None) -> Iterator[Progress]:
    """Yield the progress function for the argument `progress` of a public function.

    True shows a bar for each stage, in a terminal or a notebook; False or None shows nothing; a function is called.
    """
    if progress is not True:
        yield progress or silent
        return
    from dovetail.progress_bars import StageBars  # loads rich

    with StageBars() as bars:
        yield bars


@contextmanager
def logged(name: str, step: str) -> Iterator[None]:
    """Log the start of a step as DEBUG and its duration as INFO, under the module's `name`."""
    logger, began = logging.getLogger(name), time.perf_counter()
    logger.debug("%s ...", step)
    yield
    logger.info("%s: %.2f s", step, time.perf_counter() - began)


class TimeLimit:
    """The time after which repeated work ends, and what was left out or cut short because of it.

    It travels with a problem. Whatever repeats work asks `is_over` before each repetition; if it ends early, it reports
    with `leave_out` what is missing.

    Parameters
    ----------
    seconds : float, optional
        From now; None for no limit.
    clock : callable, optional
        Returns the time [s]; `time.monotonic` by default.

    Raises
    ------
    ValueError
        `seconds` is negative or not a number.
    """

    def __init__(self, seconds: float | None = None, *, clock: Callable[[], float] | None = None) -> None:
        if seconds is not None and not seconds >= 0.0:
            raise ValueError(f"{seconds:g} s is not a time limit. Accepted: 0 or more.")
        self.seconds, self._clock = seconds, clock or (lambda: time.monotonic())
        self._parent: TimeLimit | None = None
        self._began = self._clock()
        self._deadline = np.inf if seconds is None else self._began + seconds
        self._stopped = False
        self._left_out: list[str] = []

    def at_most(self, seconds: float) -> TimeLimit:
        """Return a limit of some seconds from now that also ends with this one, and shares its record."""
        made = type(self)(clock=self._clock)
        made.seconds, made._deadline = seconds, made._began + seconds
        made._parent, made._left_out = self, self._left_out
        return made

    def share(self, part: float) -> TimeLimit:
        """Return a limit that ends after a part of this one's time since its beginning, and shares its record."""
        if self.seconds is None:
            return self
        return self.at_most(part * self.seconds - self.elapsed)

    def stop(self) -> None:
        """End it now, as by Ctrl-C; it may be called from another thread or from a signal handler."""
        self._stopped = True

    @property
    def elapsed(self) -> float:
        """Seconds since it began."""
        return self._clock() - self._began

    @property
    def remaining(self) -> float:
        """Seconds until it is over: infinite without a limit, and 0 at the earliest."""
        if self.was_stopped:
            return 0.0
        parent = np.inf if self._parent is None else self._parent.remaining
        return float(min(parent, max(0.0, self._deadline - self._clock())))

    @property
    def was_stopped(self) -> bool:
        """Whether `stop` was called."""
        return self._stopped or (self._parent is not None and self._parent.was_stopped)

    @property
    def is_over(self) -> bool:
        """Whether no further work should begin."""
        return self.remaining <= 0.0

    def leave_out(self, work: str) -> None:
        """Record work that was left out or cut short, in words that fit into a list."""
        if work not in self._left_out:
            self._left_out.append(work)

    @property
    def left_out(self) -> tuple[str, ...]:
        """What was left out or cut short so far."""
        return tuple(self._left_out)

    @staticmethod
    def of(limit: TimeLimit | float | None) -> TimeLimit:
        """Return a limit as it is, or one of so many seconds from now.

        Raises
        ------
        ParameterError
            It is not a positive number.
        """
        if limit is None or isinstance(limit, TimeLimit):
            return limit or TimeLimit()
        if not isinstance(limit, Real) or isinstance(limit, bool) or not limit > 0.0:
            raise ParameterError(Fault("seconds", f"{limit!r:.40} is not a time limit: it must be greater than 0."))
        return TimeLimit(float(limit))


NO_LIMIT = TimeLimit()
"""It is never over; nobody stops it."""


@dataclass(frozen=True)
class CutShort:
    """What a result lacks, and why.

    Parameters
    ----------
    left_out : tuple of str
        The steps that were left out or cut short: ``"62 of 400 samples"``.
    seconds : float
        When the work was complete, since it began.
    limit : float or None
        The time that it had [s]; None without a limit.
    by_user : bool
        Whether the user stopped it, before the time was over.
    """

    left_out: tuple[str, ...]
    seconds: float
    limit: float | None
    by_user: bool

    @staticmethod
    def of(limit: TimeLimit) -> CutShort | None:
        """Return what a time limit left out; None if it left out nothing."""
        if not limit.left_out:
            return None
        return CutShort(limit.left_out, limit.elapsed, limit.seconds, limit.was_stopped)

    @property
    def note(self) -> Note:
        """A sentence about it."""
        limit = 0.0 if self.limit is None else self.limit
        when = f"when you stopped it, after {self.seconds:.2g} s" if self.by_user else f"by the limit of {limit:.3g} s"
        remedy = "Let it run" if self.by_user else f"Allow more time ({argument('seconds')})"
        return Note(f"Cut short {when}: {listing(self.left_out)}. {remedy} for a complete answer.")
