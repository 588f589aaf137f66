"""Parallel work: the cores of this process, and independent tasks in several processes."""

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
"""The task of this worker process; set once, when it starts."""


def cores() -> int:
    """Return how many cores this process may use."""
    affinity = getattr(os, "sched_getaffinity", None)
    return len(affinity(0)) if affinity else os.cpu_count() or 1


def side_by_side(work: Callable[[int], Result], count: int, workers: int) -> Generator[tuple[int, Result], None, None]:
    """Yield ``(index, work(index))`` for each index below `count`, in the order in which they finish.

    Parameters
    ----------
    work : callable
        Its results must be picklable; the callable itself need not be.
    count : int
    workers : int
        Number of processes. They are forked, which is safe on Linux only; elsewhere the tasks run one after another
        in this process.

    Raises
    ------
    DovetailError
        A process was killed.

    Notes
    -----
    After Ctrl-C, or when the caller stops iterating, running tasks are finished and no others are started.
    """
    if workers == 1 or count <= 1 or sys.platform != "linux":
        yield from ((index, work(index)) for index in range(count))
        return
    with warnings.catch_warnings():
        # A forked process can hang where a thread held a lock; the threads of linear algebra hold none.
        warnings.filterwarnings("ignore", message=".*multi-threaded.*fork", category=DeprecationWarning)
        pool = ProcessPoolExecutor(min(workers, count), get_context("fork"), _begin, (work,))
        try:
            futures = {pool.submit(_run_task, index): index for index in range(count)}
            for future in as_completed(futures):
                yield futures[future], future.result()
        except BrokenProcessPool:
            remedy = "Free some memory, or let fewer work at once."
            raise DovetailError(Fault("", "a worker process was ended by the system.", remedy=remedy)) from None
        finally:
            pool.shutdown(cancel_futures=True)


def _begin(work: Callable[[int], Any]) -> None:
    """Ignore Ctrl-C, which the parent process handles, and limit linear algebra to one thread."""
    import signal

    from threadpoolctl import threadpool_limits

    global _work
    threadpool_limits(1, user_api="blas")
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    _work = work


def _run_task(index: int) -> Any:
    assert _work is not None
    return _work(index)
