"""Tasks in forked processes of which one that is killed costs one task, and which end with their parent process."""

from __future__ import annotations

import os
import signal
import threading
import time
import traceback
import warnings
from collections import deque
from collections.abc import Callable, Generator, Iterator
from contextlib import suppress
from multiprocessing import get_context
from multiprocessing.connection import wait
from multiprocessing.reduction import ForkingPickler
from pathlib import Path
from typing import Any, TypeVar

from dovetail.errors import DovetailError, Fault

Result = TypeVar("Result")

_LOOK = 0.25
"""Seconds between two looks whether the parent process is still there, or a process still works."""
_IDLE = 10.0
"""Seconds without processor time after which a process is taken to wait for ever."""
_MEMORY = "The system does this when memory runs short. Free some memory, or let fewer processes work at once."


def end_with_parent(parent: int) -> None:
    """End this process soon after its parent process has ended, however that happened; POSIX only.

    Parameters
    ----------
    parent : int
        The process id of the parent.
    """

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(_LOOK)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


def run_tasks(
    work: Callable[[int], Result],
    count: int,
    workers: int,
    begin: Callable[[], object],
    lost: Callable[[int, Fault], Result] | None = None,
) -> Generator[tuple[int, Result], None, None]:
    """Run tasks in forked processes, as `dovetail.parallel.side_by_side` describes.

    `begin` is called first in each process. A process that is killed is replaced, and its task is repeated when no
    other one is running.

    Raises
    ------
    DovetailError
        A task ended its process twice, and there is no `lost`; or no process can be started.
    """
    pool = _Pool(work, begin, min(workers, count))
    waiting, again = deque(range(count)), deque[int]()
    try:
        while waiting or again or pool.busy:
            while waiting and pool.can_take():
                pool.start(waiting.popleft())
            if again and not pool.busy:
                pool.start(again[0])
            for index, answer in pool.answers():
                is_repeated = bool(again) and index == again[0]
                if is_repeated:
                    again.popleft()
                if not isinstance(answer, Fault):
                    succeeded, value = answer
                    if not succeeded:
                        raise value
                    yield index, value
                elif not is_repeated:
                    again.append(index)
                elif lost is None:
                    raise DovetailError(answer)
                else:
                    yield index, lost(index, answer)
    finally:
        pool.end()


class MeanwhileProcess:
    """A forked process that does some work while its parent goes on.

    Parameters
    ----------
    work : callable
        Its result must be picklable.
    begin : callable
        Called first in the process.
    given_up : callable
        Asked while the result is awaited: whether the work is to end early, which the process cannot know.
    """

    def __init__(self, work: Callable[[], Any], begin: Callable[[], object], given_up: Callable[[], bool]) -> None:
        self._work, self._given_up = work, given_up
        self._worker: _Worker | None = None
        with suppress(DovetailError):  # the parent does the work itself if no process can be started
            self._worker = _Worker(lambda _: work(), begin)
            self._worker.send(0)

    def result(self) -> Any:
        """Wait for the result; do the work here if that is given up, or the process was ended or waits for ever."""
        if self._worker is not None and self._worker.will_answer(self._given_up):
            answer = self._worker.receive()
            if not isinstance(answer, Fault):
                succeeded, value = answer
                if succeeded:
                    return value
                raise value
        return self._work()

    def end(self) -> None:
        """Kill the process."""
        if self._worker is not None:
            self._worker.end()


class _Pool:
    """Worker processes, each with at most one task."""

    def __init__(self, work: Callable[[int], Any], begin: Callable[[], object], size: int) -> None:
        self._work, self._begin, self._size = work, begin, size
        self._workers: list[_Worker] = []

    @property
    def busy(self) -> bool:
        """Whether any task is running."""
        return any(worker.index >= 0 for worker in self._workers)

    def can_take(self) -> bool:
        """Whether a process is idle, or can be added."""
        return sum(worker.index >= 0 for worker in self._workers) < self._size

    def start(self, index: int) -> None:
        """Give a task to an idle process, or to a new one."""
        for worker in [worker for worker in self._workers if worker.index < 0]:
            if worker.send(index):
                return
            self._workers.remove(worker)  # it was killed while it had nothing to do
        worker = _Worker(self._work, self._begin)
        self._workers.append(worker)
        worker.send(index)  # if this fails, the process has ended, which its answer shows

    def answers(self) -> Iterator[tuple[int, tuple[bool, Any] | Fault]]:
        """Wait; yield each task that has ended, with its answer or the reason why its process ended."""
        running: dict[Any, _Worker] = {worker.connection: worker for worker in self._workers if worker.index >= 0}
        running |= {worker.process.sentinel: worker for worker in running.values()}
        for worker in dict.fromkeys(running[ready] for ready in wait(list(running))):
            index, worker.index = worker.index, -1
            answer = worker.receive()
            if isinstance(answer, Fault):
                self._workers.remove(worker)
            yield index, answer

    def end(self) -> None:
        """Kill all processes."""
        for worker in self._workers:
            worker.process.kill()
        for worker in self._workers:
            worker.end()


class _Worker:
    """One process and the connection to it."""

    def __init__(self, work: Callable[[int], Any], begin: Callable[[], object]) -> None:
        context = get_context("fork")
        self.connection, theirs = context.Pipe()
        self.index = -1
        self.process = context.Process(target=_serve, args=(work, begin, theirs, os.getpid()))
        try:
            with warnings.catch_warnings():
                # A forked process can hang where a thread held a lock; the threads of linear algebra hold none.
                warnings.filterwarnings("ignore", message=".*multi-threaded.*fork", category=DeprecationWarning)
                self.process.start()
        except OSError as error:
            problem = f"no process can be started: {error.strerror or error}."
            raise DovetailError(Fault("", problem, remedy="Free some memory, or end other processes.")) from None
        theirs.close()

    def send(self, index: int) -> bool:
        """Give it a task; return whether the process was there to take it."""
        self.index = index
        try:
            self.connection.send(index)
        except OSError:
            return False
        return True

    def will_answer(self, given_up: Callable[[], bool]) -> bool:
        """Wait until the process has answered or ended; return False if it is given up or has stopped working.

        A process that is forked while another thread holds a lock may wait for it for ever.
        """
        used, idle = -1.0, 0
        while not self.connection.poll(_LOOK):
            before, used = used, _processor_time(self.process.pid)
            idle = 0 if used != before else idle + 1
            if given_up() or idle * _LOOK >= _IDLE:
                return False
        return True

    def receive(self) -> tuple[bool, Any] | Fault:
        """Return whether the task succeeded, with its result or its exception; or why the process ended."""
        content = None
        with suppress(EOFError, OSError):
            if self.process.is_alive() or self.connection.poll():
                content = self.connection.recv_bytes()
        if content is None:
            self.end()
            return _reason(self.process.exitcode or 0)
        try:
            answer: tuple[bool, Any] | Fault = ForkingPickler.loads(content)
        except Exception as error:
            answer = _unsendable(error)
        if isinstance(answer, Fault):
            self.end()
        return answer

    def end(self) -> None:
        """Kill the process, and wait until it has ended."""
        self.process.kill()
        self.connection.close()
        self.process.join()


def _processor_time(process: int | None) -> float:
    """Return the time [clock ticks] that a process has used; 0 if it has ended."""
    try:
        words = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return 0.0
    return float(words[11]) + float(words[12])


def _reason(code: int) -> Fault:
    """Return why a process ended, by its exit code, which is negative after a signal."""
    if code >= 0:
        return Fault("", f"its process ended itself with the code {code}, and again when it was repeated alone.")
    name = signal.Signals(-code).name if -code in set(signal.Signals) else f"signal {-code}"
    problem = f"its process was ended by the system ({name}), and again when it was repeated alone."
    crash = "A library has crashed: please report it, with the file."
    return Fault("", problem, remedy=_MEMORY if name in ("SIGKILL", "SIGTERM") else crash)


def _serve(work: Callable[[int], Any], begin: Callable[[], object], connection: Any, parent: int) -> None:
    """Do tasks until the process is killed. Ctrl-C is for the parent process, which then ends this one."""
    end_with_parent(parent)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    begin()
    while True:
        index = connection.recv()
        answer: tuple[bool, Any] | Fault
        try:
            answer = True, work(index)
        except Exception as error:
            error.add_note(traceback.format_exc())
            answer = False, error
        try:
            content = ForkingPickler.dumps(answer)
        except Exception as error:
            content = ForkingPickler.dumps(_unsendable(error))
        connection.send_bytes(content)


def _unsendable(error: Exception) -> Fault:
    """Return why a result cannot be pickled or unpickled, which its own code does."""
    return Fault("", f"its result cannot be sent to another process: {type(error).__name__}: {error}.")
