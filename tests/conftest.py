"""Assemblies, truths and a small trained network that several folders share, and the limit of memory."""

from __future__ import annotations

import gc
import itertools
import json
import os
import sys
import tracemalloc
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

import dovetail
from dovetail.parallel import cores, use_cores
from support.waiting import processor_time

# Some surroundings forbid modules to be kept as bytecode. Each process that a test starts would then compile torch,
# scikit-learn and umap from their sources, which takes four to seven seconds, and the workers do so too.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False
# Before torch or numba load OpenMP: threads that spin while they wait starve each other on a busy machine.
os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")
# Matrices are small here: several threads gain nothing, and on a busy machine they make a test ten times slower.
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

if "PYTEST_XDIST_WORKER" in os.environ:
    use_cores(1)  # the other workers have the rest; results are the same on any number of cores

ROOT = Path(__file__).resolve().parent.parent
ASSEMBLIES = ROOT / "assemblies"


MOST_MEMORY = 3000
"""MiB that a process of the default suite takes at most: one for each core must fit into a usual machine."""
MOST_SECONDS = 20.0
"""Processor seconds, children included, above which a test is listed at the end of a run."""
LAST = ("plugins", "registry", "report", "architecture", "coupling", "frf", "description")
"""Folders of short tests, which are run when the others have begun, the one with the most short files at the very end:
no worker then has a long file left."""
RUN_BY_DEFAULT = 4
"""Of a sweep, one of so many combinations is run by default, or of fewer if a value would be in none of them."""
WHOLE_SWEEP = 30
"""Combinations below which all of a sweep are run."""
WithSettings = Callable[..., dovetail.Assembly]
TOO_MUCH = pytest.StashKey[bool]()
"""Whether a test of this process has been failed for it."""


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers() -> int | None:
    """Return one worker more than processors for `-n auto`: tests that wait for other processes leave one idle."""
    return None if "PYTEST_XDIST_AUTO_NUM_WORKERS" in os.environ else cores() + 1


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark most of each sweep as slow, and put the folders of short tests last, all else in its order."""
    sweeps: dict[str, list[pytest.Function]] = {}
    for item in items:
        if isinstance(item, pytest.Function) and item.get_closest_marker("sweep"):
            sweeps.setdefault(item.nodeid.partition("[")[0], []).append(item)
    for cases in sweeps.values():
        for case in cases_left_out(cases):
            case.add_marker(pytest.mark.slow)
    places = {folder: place for place, folder in enumerate(LAST, 1)}
    items.sort(key=lambda item: places.get(item.path.parent.name, 0))


@pytest.hookimpl(trylast=True)
def pytest_collection_finish() -> None:
    """Leave the collected tests out of garbage collections, each of which would go through all of them again."""
    gc.collect()
    gc.freeze()


@pytest.hookimpl(trylast=True)
def pytest_runtest_teardown(item: pytest.Item, nextitem: pytest.Item | None) -> None:
    """Leave what a file of tests has loaded out of the collections that follow, each of which takes up to a second."""
    if nextitem is not None and nextitem.path != item.path:
        gc.collect()
        gc.freeze()


def cases_left_out(cases: list[pytest.Function]) -> list[pytest.Function]:
    """Return most combinations of a sweep; each value of each parameter is in some of the others.

    With ``sweep(keep=n)`` at most so many of the others are left, if need be without each value.
    """
    keep = next(cases[0].iter_markers("sweep")).kwargs.get("keep")
    cases = [case for case in cases if not case.get_closest_marker("slow")]
    if not cases or (keep is None and len(cases) < WHOLE_SWEEP):
        return []
    axes = [
        list(numbered(repr([case.callspec.params[name] for name in one]) for case in cases))
        for one in axes_of(cases[0])
    ]
    sums = [sum(place) for place in zip(*axes, strict=True)]
    lengths = [max(axis) for axis in axes]
    step = min(RUN_BY_DEFAULT, *(1 + sum(lengths) - length for length in lengths))
    if keep is not None:
        step = next(step for step in itertools.count(1) if sum(total % step == 0 for total in sums) <= max(keep, 1))
    return [case for case, total in zip(cases, sums, strict=True) if total % step]


def axes_of(case: pytest.Function) -> list[list[str]]:
    """Return the names of the parameters that vary together, of the test and of its fixtures."""
    lists = [mark.args[0] for mark in case.iter_markers("parametrize")]
    names = [[name.strip() for name in one.split(",")] if isinstance(one, str) else [*one] for one in lists]
    return names + [[name] for name in case.callspec.params if not any(name in one for one in names)]


def numbered(values: Iterable[str]) -> Iterator[int]:
    """Yield the number of each value in the order in which they first appear."""
    numbers: dict[str, int] = {}
    for value in values:
        yield numbers.setdefault(value, len(numbers))


def peak_memory() -> float:
    """MiB that this process has taken at most since it began; 0 where the system does not say."""
    if sys.platform == "win32":
        return 0.0
    import resource

    unit = 1 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit / 2**20


@pytest.fixture(autouse=True)
def memory_is_bounded(request: pytest.FixtureRequest) -> Iterator[None]:
    """Fail the test in which the process passes the limit; it, or those before it, keep too much."""
    yield
    peak, slow = peak_memory(), request.node.get_closest_marker("slow") is not None
    if peak > MOST_MEMORY and not slow and TOO_MUCH not in request.config.stash:
        request.config.stash[TOO_MUCH] = True
        pytest.fail(f"this process has taken {peak:.0f} MiB by now; {MOST_MEMORY} MiB are the limit of the suite.")


@pytest.fixture(autouse=True)
def processor_time_is_recorded(request: pytest.FixtureRequest) -> Iterator[None]:
    began = processor_time()
    yield
    request.node.user_properties.append(("processor_seconds", processor_time() - began))


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """List the tests that take too long for the default suite: fewer cases may do, the others marked as slow."""
    times = {
        report.nodeid: seconds
        for report in terminalreporter.stats.get("", [])
        for name, seconds in report.user_properties
        if name == "processor_seconds" and seconds > MOST_SECONDS
    }
    if times:
        terminalreporter.section(f"more than {MOST_SECONDS:g} s of processor time")
    for nodeid in sorted(times, key=times.__getitem__, reverse=True):
        terminalreporter.write_line(f"{times[nodeid]:6.1f} s  {nodeid}")


@pytest.fixture
def peak_of() -> Callable[[Callable[[], object]], float]:
    """Return a function that returns the most memory in MB that arrays take while some work runs."""

    def megabytes(work: Callable[[], object]) -> float:
        tracemalloc.start()
        try:
            work()
            return tracemalloc.get_traced_memory()[1] / 1e6
        finally:
            tracemalloc.stop()

    return megabytes


@pytest.fixture(scope="session", autouse=True)
def one_thread_of_linear_algebra():
    """NumPy is loaded already, so that its libraries do not look at the environment again."""
    with threadpool_limits(1, user_api="blas"):
        yield


@pytest.fixture(scope="module")
def few_mode_searches() -> Iterator[None]:
    """Search modes of posteriors from two points in place of twelve: for assemblies whose posterior has one mode.

    These searches are most of the time that a posterior of two parameters takes.
    """
    from dovetail.inference.posterior import mode_search

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(mode_search, "_SETTINGS", replace(mode_search._SETTINGS, searches=2))
        yield


@pytest.fixture
def unguarded_matrices(monkeypatch: pytest.MonkeyPatch) -> None:
    """Read MATLAB and Matrix Market files in this process: sound ones need no guard, which starts slowly."""
    from dovetail_plugins.substructures import matrix_files

    monkeypatch.setattr(matrix_files, "call_guarded", lambda function, path, content, memory: function(path, content))


@pytest.fixture(scope="session")
def assemblies() -> Path:
    return ASSEMBLIES


@pytest.fixture(scope="session")
def collet() -> dovetail.Assembly:
    """The reference assembly H0-J-T0."""
    return dovetail.load(ASSEMBLIES / "bt40_er32.yaml")


@pytest.fixture(scope="session")
def sdof() -> dovetail.Assembly:
    return dovetail.load(ASSEMBLIES / "sdof.yaml")


@pytest.fixture(scope="session")
def torque_20() -> np.ndarray:
    """Ground truth at 20 N m, in the order of the collet's parameters."""
    return np.array(
        [33.306e-3, 13.181e-3, 0.083245, 0.073369, 5.9704e8, 1.7616e4, 400, 1.2, 1.3022e9, 3.5244e5, 500, 2.2]
    )


@pytest.fixture(scope="session")
def torque_100() -> np.ndarray:
    return np.array(
        [36.119e-3, 12.839e-3, 0.048748, 0.088281, 8.1204e8, 1.9413e4, 240, 0.6, 2.1673e9, 7.3429e5, 300, 1.21]
    )


@pytest.fixture(scope="session")
def with_settings(sdof: dovetail.Assembly) -> WithSettings:
    """The SDOF assembly with other identification settings."""

    def changed(**identification: Any) -> dovetail.Assembly:
        description = json.loads(sdof.description.text)
        description["identification"].update(identification)
        return dovetail.load(description)

    return changed


@pytest.fixture(scope="session")
def small(with_settings: WithSettings) -> dovetail.Assembly:
    """Settings that train in seconds."""
    return with_settings(
        samples=1500,
        reducer={"model": "pca", "n_components": 20},
        regressor={"model": "mlp", "hidden": [64, 64], "dropout": 0.0, "max_epochs": 150},
    )


@pytest.fixture(scope="session")
def dataset(small: dovetail.Assembly, tmp_path_factory: pytest.TempPathFactory) -> dovetail.Dataset:
    return dovetail.generate(small, tmp_path_factory.mktemp("dataset") / "sdof.zarr")


@pytest.fixture(scope="session")
def model(small: dovetail.Assembly, dataset: dovetail.Dataset) -> dovetail.Identifier:
    return dovetail.train(small, dataset)


@pytest.fixture(scope="session")
def truth() -> np.ndarray:
    """Stiffness [N/m] and damping [N s/m] of the joint that the tests measure."""
    return np.array([4e6, 60.0])


@pytest.fixture(scope="session")
def measured(small: dovetail.Assembly, truth: np.ndarray) -> dovetail.Frf:
    return dovetail.Frf(small.frequency, small.frf(truth), "accelerance", label="measured.csv")
