"""Progress of long computations, and their record in the log named "dovetail"."""

from __future__ import annotations

import logging
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Protocol


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
