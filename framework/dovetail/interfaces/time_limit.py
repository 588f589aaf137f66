"""The time that a computation has, and what it left out to end within it."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np


class TimeLimit:
    """The time after which repeated work ends, and what was left out or cut short because of it.

    It travels with a problem. Whatever repeats work asks `is_over` before each repetition; if it ends early, it reports
    with `leave_out` what is missing.

    Parameters
    ----------
    seconds : float, optional
        From now; None for no limit.
    clock : callable
        Returns the time [s].

    Raises
    ------
    ValueError
        `seconds` is negative or not a number.
    """

    def __init__(self, seconds: float | None = None, *, clock: Callable[[], float] = time.monotonic) -> None:
        if seconds is not None and not seconds >= 0.0:
            raise ValueError(f"{seconds:g} s is not a time limit. Accepted: 0 or more.")
        self.seconds, self._clock = seconds, clock
        self._parent: TimeLimit | None = None
        self._began = clock()
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
        """Return a limit as it is, or one of so many seconds from now."""
        return limit if isinstance(limit, TimeLimit) else TimeLimit(limit)


NO_LIMIT = TimeLimit()
"""It is never over; nobody stops it."""
