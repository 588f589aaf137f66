"""The time of each stage of a training, and the remaining time if there is a limit."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

from dovetail.interfaces import logged

_FIRST_SHARE, _LEAST_SHARE = 0.45, 0.1
"""Shares of the regressors' time: for the first one if others correct it, and the least for each of these."""

_FRF_SHARE = 0.75
"""Largest share of a correction's time for its FRFs."""


@dataclass
class StageTimer:
    """Wall-clock seconds of each stage of a training.

    Parameters
    ----------
    module : str
        Logger that reports them.
    limit : float, optional
        Time limit of the regressors [s].
    seconds : dict of str to float
        By the name of the stage.
    """

    module: str
    limit: float | None = None
    seconds: dict[str, float] = field(default_factory=dict)

    @property
    def first_share(self) -> float | None:
        """Seconds for a first regressor that others correct."""
        return None if self.limit is None else _FIRST_SHARE * self.limit

    def remaining_share(self, rounds: int) -> float | None:
        """Return the seconds for the next of `rounds` remaining corrections."""
        if self.limit is None:
            return None
        used = [seconds for name, seconds in self.seconds.items() if name == "regressor" or "correction" in name]
        return max((self.limit - sum(used)) / rounds, _LEAST_SHARE * self.limit)

    def blocks_in_time(self, blocks: Iterable[slice], rounds: int) -> Iterator[slice]:
        """Yield the first block of FRFs for the next of `rounds` corrections, and further ones while time remains."""
        limit, start = self.remaining_share(rounds), time.perf_counter()
        for done, block in enumerate(blocks):
            expected = (time.perf_counter() - start) * (done + 1) / max(done, 1)
            if limit is not None and done and expected > _FRF_SHARE * limit:
                return
            yield block

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Measure a stage."""
        start = time.perf_counter()
        with logged(self.module, f"training, {name}"):
            yield
        self.seconds[name] = time.perf_counter() - start
