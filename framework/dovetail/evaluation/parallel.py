"""Many like pieces of work, side by side in processes."""

from __future__ import annotations

import os
import sys
import warnings
from collections.abc import Callable, Generator
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import get_context
from typing import Any, TypeVar

from dovetail.errors import DovetailError, Fault

__all__ = ["cores", "side_by_side"]

Result = TypeVar("Result")

_work: Callable[[int], Any] | None = None
"""What this worker process does; set once, when it starts."""


def cores() -> int:
    """Return how many processors this process may use."""
    affinity = getattr(os, "sched_getaffinity", None)
    return len(affinity(0)) if affinity else os.cpu_count() or 1


def side_by_side(work: Callable[[int], Result], count: int, workers: int) -> Generator[tuple[int, Result], None, None]:
    """Yield ``(index, work(index))`` for each index below `count`, as they come.

    Parameters
    ----------
    work : callable
        Its results must be such as can be pickled; it need not be itself.
    count : int
    workers : int
        Processes. They are copies of this one, which only Linux makes safely: elsewhere one piece follows another, in
        this process.

    Raises
    ------
    DovetailError
        A process ended before its work did.

    Notes
    -----
    After Ctrl-C, or when the caller stops asking, what is under way is finished and nothing else begun.
    """
    if workers == 1 or count == 1 or sys.platform != "linux":
        yield from ((index, work(index)) for index in range(count))
        return
    with warnings.catch_warnings():
        # Copies of a process with threads can hang where a thread held a lock; those of linear algebra do not.
        warnings.filterwarnings("ignore", message=".*multi-threaded.*fork", category=DeprecationWarning)
        pool = ProcessPoolExecutor(min(workers, count), get_context("fork"), _begin, (work,))
        try:
            futures = {pool.submit(_at, index): index for index in range(count)}
            for future in as_completed(futures):
                yield futures[future], future.result()
        except BrokenProcessPool:
            remedy = "Free some memory, or let fewer work at once."
            raise DovetailError(Fault("", "a worker process was ended by the system.", remedy=remedy)) from None
        finally:
            pool.shutdown(cancel_futures=True)


def _begin(work: Callable[[int], Any]) -> None:
    """Leave Ctrl-C to the process that all come from, and take one thread of linear algebra."""
    import signal

    from threadpoolctl import threadpool_limits

    global _work
    threadpool_limits(1, user_api="blas")
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    _work = work


def _at(index: int) -> Any:
    assert _work is not None
    return _work(index)
