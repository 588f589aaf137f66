"""The time that each stage of a training takes, and what is left of a time limit."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

from dovetail.interfaces import logged

_FIRST_SHARE, _LEAST_SHARE = 0.45, 0.1
"""Of the regressors' time, which the first one takes if others correct it, and which each of these takes at least."""

_FRF_SHARE = 0.75
"""Of a correction's time, which its FRFs take at most."""


@dataclass
class StageTimer:
    """Wall-clock seconds of each stage of a training.

    Parameters
    ----------
    module : str
        In whose name they are logged.
    limit : float, optional
        Those that the regressors may take at most.
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

    def share_of_the_rest(self, rounds: int) -> float | None:
        """Return the seconds for the next of so many corrections."""
        if self.limit is None:
            return None
        used = [seconds for name, seconds in self.seconds.items() if name == "regressor" or "correction" in name]
        return max((self.limit - sum(used)) / rounds, _LEAST_SHARE * self.limit)

    def while_there_is_time(self, blocks: Iterable[slice], rounds: int) -> Iterator[slice]:
        """Yield the blocks of FRFs for the next of so many corrections, the first and those for which there is time."""
        limit, start = self.share_of_the_rest(rounds), time.perf_counter()
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
