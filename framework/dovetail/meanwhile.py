"""Parts of one computation that forked processes do while this one goes on, with the same results on any machine."""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from functools import partial
from mmap import mmap
from multiprocessing import parent_process
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from dovetail.parallel import begin_worker, core_lent, cores, one_blas_thread
from dovetail.worker_processes import MeanwhileProcess

Result = TypeVar("Result")
Task = TypeVar("Task")


@contextmanager
def meanwhile(
    work: Callable[[], Result], given_up: Callable[[], bool] = lambda: False
) -> Iterator[Callable[[], Result]]:
    """Let another process do some work while this one goes on.

    Parameters
    ----------
    work : callable
        Its result must be picklable; the callable itself need not be. What it changes is lost.
    given_up : callable
        Asked while the result is awaited: whether the work is to end early, as after Ctrl-C. If so, it is done here.

    Yields
    ------
    callable
        Waits for the result, and returns it or raises what the work raised. It does the work itself where no process
        is forked. If it is not called, the work is not completed.

    Notes
    -----
    Without a second core no process is forked. Nor is one elsewhere than on Linux and outside the main thread, where
    that is not safe, and in a process that another one has started, which then has work for all cores.
    """
    if cores() == 1 or not _can_fork():
        yield work
        return
    with ExitStack() as running:
        running.enter_context(one_blas_thread())  # in both processes
        process = MeanwhileProcess(work, partial(begin_worker, 1), given_up)
        running.enter_context(core_lent())
        running.callback(process.end)

        def result() -> Result:
            with running:
                found: Result = process.result()
                return found

        yield result


def _can_fork() -> bool:
    in_main_thread = threading.current_thread() is threading.main_thread()
    return sys.platform == "linux" and in_main_thread and parent_process() is None


def in_parts(
    work: Callable[[NDArray[np.intp]], Result],
    count: int,
    fewest: int,
    given_up: Callable[[], bool] = lambda: False,
) -> list[Result]:
    """Do work on the rows of a batch, on all cores if there are enough of them.

    Parameters
    ----------
    work : callable
        Takes some rows, in order. As in `meanwhile`.
    count : int
        Number of rows.
    fewest : int
        Smallest number of rows that is worth another process.
    given_up : callable
        As in `meanwhile`.

    Returns
    -------
    list
        What the parts return, in the order of the rows.
    """
    first, *others = np.array_split(np.arange(count), max(1, min(cores(), count // fewest)))
    with ExitStack() as stack:
        results = [stack.enter_context(meanwhile(partial(work, rows), given_up)) for rows in others]
        return [work(first), *(result() for result in results)]


def in_turn(
    work: Callable[[Task], Result], tasks: Sequence[Task], given_up: Callable[[], bool] = lambda: False
) -> Iterator[Result]:
    """Yield ``work(task)`` for each task in their order, as many as there are cores at a time.

    Parameters
    ----------
    work : callable
        As in `meanwhile`.
    tasks : sequence
        Some may be done in vain if the caller stops iterating.
    given_up : callable
        As in `meanwhile`.
    """
    at_once = cores()
    for first in range(0, len(tasks), at_once):
        own, *others = tasks[first : first + at_once]
        with ExitStack() as stack:
            results = [stack.enter_context(meanwhile(partial(work, task), given_up)) for task in others]
            yield work(own)
            for result in results:
                yield result()


class SharedProgress:
    """Progress of work that another process may do, for this process to show.

    Parameters
    ----------
    progress : callable
        Takes a stage, the steps done, their number and a note, as `dovetail.interfaces.Progress`.
    """

    def __init__(self, progress: Callable[[str, int, int, str], None]) -> None:
        self._progress, self._process, self._steps = progress, os.getpid(), shared_numbers(2)

    def __call__(self, stage: str, done: int, total: int, note: str = "") -> None:
        """Report `done` of `total` steps of `stage`, or store them where another process does the work."""
        if os.getpid() == self._process:
            self._progress(stage, done, total, note)
        else:
            self._steps[0], self._steps[1] = done, total

    def show(self, stage: str) -> None:
        """Report the steps that another process has stored last, if any."""
        done, total = self._steps
        if total:
            self._progress(stage, int(done), int(total), "")


def shared_numbers(count: int) -> memoryview[float]:
    """Return numbers, 0 at first, in memory that this process shares with those that are forked from it."""
    return memoryview(mmap(-1, 8 * count)).cast("d")
