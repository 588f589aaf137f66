"""Parallel work: the cores of this process, and independent tasks in several processes or on a cluster."""

from __future__ import annotations

import gc
import os
import platform
import sys
import threading
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import CancelledError, ThreadPoolExecutor
from contextlib import AbstractContextManager, closing, contextmanager, nullcontext
from functools import lru_cache, partial
from importlib.metadata import version
from itertools import islice
from typing import Any, TypeVar

from dovetail.errors import DovetailError, Fault, require_package
from dovetail.worker_processes import run_tasks

Result = TypeVar("Result")
Task = TypeVar("Task")

FILE_MODULE = "dovetail_plugin_file_"
"""Begins the name of a module that was loaded from a plugin file. Its code goes with a task to other machines."""

_REACHED, _PATIENCE = 5.0, 60.0
"""Seconds in which a scheduler must answer, and for which it may have no worker."""
_AHEAD = 2
"""Tasks for each worker, of which one is running: what is done and not yet fetched takes memory."""
_SAME = ("dovetail-frf", "numpy", "scipy", "llvmlite")
"""Packages of which every machine must have the same version, since results would differ."""
_WHERE = "scheduler"
_KILLED = Fault(
    _WHERE, "several workers were killed during one task, by the system or a user.", remedy="Give each more memory."
)

_turn = threading.Lock()
"""Held by the task that is running in this worker: an assembly's engine is not made for several threads."""


class _Share:
    """How many cores this process uses at most, and how many of them work for it in other processes."""

    most, lent = sys.maxsize, 0


def cores() -> int:
    """Return how many cores this process may use."""
    affinity = getattr(os, "sched_getaffinity", None)
    there = len(affinity(0)) if affinity else os.cpu_count() or 1
    return max(1, min(there, _Share.most) - _Share.lent)


def use_cores(most: int) -> None:
    """Use no more than so many cores from now on."""
    _Share.most = most


@contextmanager
def core_lent() -> Iterator[None]:
    """Leave one core to another process until the context ends."""
    _Share.lent += 1
    try:
        yield
    finally:
        _Share.lent -= 1


def threads(purpose: str, count: int) -> ThreadPoolExecutor:
    """Return this process's threads for a purpose, which wait for the next work when they have finished.

    Tasks of one purpose must not wait for others of the same purpose.
    """
    return _threads(os.getpid(), purpose, count)  # a forked process has none of its parent's threads


@lru_cache(maxsize=8)
def _threads(_process: int, purpose: str, count: int) -> ThreadPoolExecutor:
    return ThreadPoolExecutor(count, f"dovetail-{purpose}")


def side_by_side(
    work: Callable[[int], Result],
    count: int,
    workers: int,
    scheduler: str | None = None,
    lost: Callable[[int, Fault], Result] | None = None,
) -> Generator[tuple[int, Result], None, None]:
    """Yield ``(index, work(index))`` for each index below `count`, in the order in which they finish.

    Parameters
    ----------
    work : callable
        Its results must be picklable; the callable itself need not be.
    count : int
    workers : int
        Number of processes. They are forked, which is safe on Linux only; elsewhere the tasks run one after another
        in this process.
    scheduler : str, optional
        Address of a Dask scheduler, whose workers do the tasks in their place.
    lost : callable, optional
        Called with the index and the reason of a task whose process was killed, and killed again when it was repeated
        alone; returns a result in its place.

    Raises
    ------
    DovetailError
        A task was lost, and there is no `lost`.

    Notes
    -----
    When the caller stops iterating, as after Ctrl-C, the processes are killed at once.
    """
    if scheduler is not None:
        yield from on_cluster(work, range(count), scheduler, lost)
    elif workers == 1 or count <= 1 or sys.platform != "linux":
        yield from ((index, work(index)) for index in range(count))
    else:
        begin = partial(begin_worker, max(1, cores() // workers))
        with one_blas_thread(), closing(run_tasks(work, count, workers, begin, lost)) as done:
            yield from done


def begin_worker(most_cores: int) -> None:
    """Use no more than so many cores in this process, and one thread for linear algebra."""
    use_cores(most_cores)
    one_blas_thread()


def one_blas_thread() -> AbstractContextManager[Any]:
    """Limit linear algebra to one thread, from now until the context that is returned ends.

    Where it has one thread already, as in a process that was forked with one, nothing is done. OpenBLAS would start a
    thread there first, which does nothing for tens of milliseconds but occupies a core.
    """
    blas = _blas()
    if all(library.num_threads == 1 for library in blas.lib_controllers if library.user_api == "blas"):
        return nullcontext()
    limit: AbstractContextManager[Any] = blas.limit(limits=1, user_api="blas")
    return limit


@lru_cache(maxsize=1)
def _blas() -> Any:
    """Find the libraries of linear algebra, which takes milliseconds; SciPy's is another one than NumPy's."""
    import scipy.linalg  # noqa: F401
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()


def on_cluster(
    work: Callable[[Task], Result],
    tasks: Iterable[Task],
    scheduler: str,
    lost: Callable[[int, Fault], Result] | None = None,
) -> Generator[tuple[int, Result], None, None]:
    """Yield ``(number, work(task))`` in the order in which the workers of a Dask scheduler finish.

    Parameters
    ----------
    work : callable
        It is sent once to each worker, with the code of plugin files that it needs.
    tasks : iterable
        Drawn as workers get free. Two for each worker are under way, so that memory is bounded.
    scheduler : str
        Its address, such as ``tcp://host:8786``.
    lost : callable, optional
        Called with the number and the reason of a task at which several workers were ended; returns a result in its
        place.

    Raises
    ------
    DovetailError
        Dask is not installed, the scheduler does not answer, there are no workers, or they have other versions.

    Notes
    -----
    A task of a worker that is killed is done by another one. A worker does one task at a time.
    """
    with _client(scheduler) as client:
        from distributed import KilledWorker, wait

        packed = client.submit(_packed, _pack(work), pure=False)
        waiting = enumerate(tasks)
        running: dict[Any, int] = {}
        while True:
            room = _AHEAD * len(client.nthreads()) - len(running)
            for number, task in islice(waiting, max(room, 0 if running else 1)):
                running[client.submit(_run_on_worker, packed, task, pure=False)] = number
            if not running:
                return
            try:
                finished = wait(list(running), timeout=_PATIENCE, return_when="FIRST_COMPLETED").done
            except TimeoutError:
                _require_workers(client.nthreads())
                continue
            for future in finished:
                number = running.pop(future)
                try:
                    result: Result = future.result()
                except KilledWorker:
                    if lost is None:
                        raise
                    result = lost(number, _KILLED)
                yield number, result
                del future  # what it holds on the cluster goes with it


def require_cluster(scheduler: str) -> None:
    """Raise a DovetailError unless `on_cluster` would find this scheduler, and workers of the same versions."""
    with _client(scheduler):
        pass


@contextmanager
def _client(address: str) -> Iterator[Any]:
    """Connect with a scheduler whose workers are those of this program."""
    require_package("distributed", "dask", _WHERE)
    from distributed import KilledWorker
    from distributed.comm import CommClosedError

    with _connect(address) as client:
        try:
            client.wait_for_workers(1, timeout=_PATIENCE)
            _require_same_versions(client.run(_versions, on_error="return"))
            yield client
        except TimeoutError:
            _require_workers({})
        except KilledWorker:
            raise DovetailError(_KILLED) from None
        except (CommClosedError, CancelledError):
            problem = "the connection with the scheduler was lost."
            raise DovetailError(Fault(_WHERE, problem, remedy="Restart it and its workers.")) from None


def _connect(address: str) -> Any:
    """Return a client of the scheduler at an address, at which any other program may answer, in any way."""
    from distributed import Client

    try:
        return Client(address, timeout=_REACHED)
    except Exception as error:
        reason = type(error).__name__
    # The client that failed is removed now. If Python did so while the next one starts, that start would fail: it waits
    # for a thread with a lock held, and the removal in that thread waits for the lock.
    gc.collect()
    problem = f"no Dask scheduler answers at '{address}' ({reason})."
    remedy = "Start one by 'dask scheduler', which prints its address."
    raise DovetailError(Fault(_WHERE, problem, "an address such as tcp://host:8786", remedy))


def _require_workers(workers: dict[str, int]) -> None:
    if not workers:
        problem = f"it has had no worker for {_PATIENCE:.0f} s."
        raise DovetailError(Fault(_WHERE, problem, remedy="Start some by 'dask worker ADDRESS', with one thread each."))


def _require_same_versions(by_worker: dict[str, Any]) -> None:
    """Raise where a worker lacks Dovetail, or has another version of what results depend on; some may have left."""
    from distributed.comm import CommClosedError

    own_versions = _versions()
    for worker, installed in by_worker.items():
        if isinstance(installed, CommClosedError):
            continue
        if not isinstance(installed, dict):
            problem = f"the worker {worker} cannot load Dovetail ({type(installed).__name__}: {installed})."
            raise DovetailError(Fault(_WHERE, problem, remedy="Install the same packages on every machine."))
        for name, wanted in own_versions.items():
            if installed.get(name) != wanted:
                problem = f"the worker {worker} has {name} {installed.get(name)}, and this process {wanted}."
                raise DovetailError(Fault(_WHERE, problem, remedy="Install the same packages on every machine."))


def _versions() -> dict[str, str]:
    return {"Python": platform.python_version().rpartition(".")[0], **{name: version(name) for name in _SAME}}


def _pack(work: Callable[..., Any]) -> bytes:
    """Pickle a callable, with the code of modules that come from plugin files."""
    import cloudpickle

    for name, module in list(sys.modules.items()):
        if name.startswith(FILE_MODULE):
            cloudpickle.register_pickle_by_value(module)
    return bytes(cloudpickle.dumps(work))


def _packed(content: bytes) -> bytes:
    """Return what was sent, as a result that other workers fetch and the scheduler can have computed again."""
    return content


@lru_cache(maxsize=1)
def _unpacked(content: bytes) -> Callable[[Any], Any]:
    import pickle

    work: Callable[[Any], Any] = pickle.loads(content)
    return work


def _run_on_worker(content: bytes, task: Any) -> Any:
    from threadpoolctl import threadpool_limits

    with _turn, threadpool_limits(1, user_api="blas"):
        return _unpacked(content)(task)
