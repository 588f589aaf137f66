"""Work that another process does meanwhile: its result is the same, whatever happens to that process."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import time
from dataclasses import replace
from multiprocessing import get_context

import numpy as np
import pytest

import dovetail
from dovetail import worker_processes
from dovetail.inference.fitting import refine
from dovetail.inference.fitting.searches import FURTHER
from dovetail.inference.posterior import metropolis, randomize_then_optimize
from dovetail.inference.posterior.annealing import Annealing
from dovetail.inference.posterior.drawn_samples import SearchEnds, move_by_weight
from dovetail.inference.posterior.randomize_then_optimize import LinearisedPoints
from dovetail.inference.posterior.tangent_mixture import TangentMixture
from dovetail.inference.posterior.tangent_steps import Density
from dovetail.meanwhile import in_parts, in_turn, meanwhile
from dovetail.parallel import _Share, cores, use_cores
from dovetail.problem import Problem
from dovetail.problem.least_squares import Linearisation
from support.noisy_measurements import noisy
from support.waiting import wait_until

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="processes are forked on Linux only")


@pytest.fixture(params=[1, 2, 4], autouse=True)
def available(request, monkeypatch):
    """So many cores, whether this machine has them or not."""
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: range(request.param))
    before = _Share.most
    use_cores(sys.maxsize)
    yield request.param
    assert cores() == request.param  # all are there again
    use_cores(before)


def here(rows):
    return os.getpid(), rows.tolist()


def test_another_process_does_the_work_if_there_is_a_core_for_it(available):
    with meanwhile(lambda: (os.getpid(), cores())) as found:
        own = cores()
        process, theirs = found()
    assert (process == os.getpid()) == (available == 1)
    assert (own, theirs) == ((1, 1) if available < 3 else (3, 1))


def test_the_other_process_has_no_threads_of_linear_algebra():
    """OpenBLAS starts them anew after a fork when their number is set; each keeps a core busy for a while."""
    code = """
import os, dovetail.parallel
os.sched_getaffinity = lambda _: range(2)
from dovetail.meanwhile import meanwhile
import numpy
def work():
    numpy.ones((2, 2)) @ numpy.ones((2, 2))
    return os.getpid(), len(os.listdir("/proc/self/task"))
with meanwhile(work) as found:
    process, threads = found()
print(process == os.getpid(), threads)
"""
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "2", "OMP_NUM_THREADS": "2"}
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["False", "2"]  # the second one watches whether its parent is still there


def test_no_process_is_forked_beside_another_thread_that_works():
    done = []

    def work():
        with meanwhile(os.getpid) as found:
            done.append(found())

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert done == [os.getpid()]


def who_works(_):
    with meanwhile(os.getpid) as found:
        return os.getpid(), found()


def test_no_process_is_forked_in_one_of_a_pool():
    """Daemons must have no children, and others of the pool use the cores."""
    with get_context("fork").Pool(1) as pool:
        process, done_by = pool.apply(who_works, [None])
    assert done_by == process


def test_what_the_work_raises_is_raised_here():
    def work():
        raise dovetail.ParameterError("k is negative.")

    with meanwhile(work) as found, pytest.raises(dovetail.ParameterError, match="k is negative"):
        found()


def test_work_is_done_here_if_its_process_is_killed():
    parent = os.getpid()

    def work():
        if os.getpid() != parent:
            os.kill(os.getpid(), signal.SIGKILL)
        return "done"

    with meanwhile(work) as found:
        assert found() == "done"


def test_work_is_done_here_if_its_process_waits_for_ever(monkeypatch):
    """As for a lock that another thread held when the process was forked."""
    monkeypatch.setattr(worker_processes, "_IDLE", 0.5)
    lock, parent = threading.Lock(), os.getpid()
    lock.acquire()

    def work():
        if os.getpid() != parent:
            lock.acquire()
        return "done"

    with meanwhile(work) as found:
        assert found() == "done"


def test_a_process_that_works_is_waited_for(monkeypatch, available):
    monkeypatch.setattr(worker_processes, "_IDLE", 0.5)

    def work():
        end = time.monotonic() + 1.5
        while time.monotonic() < end:
            sum(range(1000))
        return os.getpid()

    with meanwhile(work) as found:
        assert (found() == os.getpid()) == (available == 1)


def test_work_that_is_given_up_ends_here():
    parent, asked = os.getpid(), []

    def work():
        if os.getpid() != parent:
            time.sleep(600.0)
        return "ended early"

    def given_up():
        asked.append(None)
        return len(asked) > 1

    with meanwhile(work, given_up) as found:
        assert found() == "ended early"


def test_a_process_whose_result_is_not_needed_is_ended(available, tmp_path):
    parent = os.getpid()

    def work():
        (tmp_path / str(os.getpid())).touch()
        time.sleep(600.0 if os.getpid() != parent else 0.0)

    with meanwhile(work):
        wait_until(lambda: available == 1 or list(tmp_path.iterdir()))
    for process in tmp_path.iterdir():
        with pytest.raises(ProcessLookupError):
            os.kill(int(process.name), 0)


@pytest.mark.parametrize("count", [0, 1, 5, 12])
def test_parts_are_in_the_order_of_their_rows(available, count):
    parts = in_parts(here, count, 3)
    assert len({process for process, _ in parts}) == len(parts) == max(1, min(available, count // 3))
    assert [row for _, rows in parts for row in rows] == list(range(count))


def test_tasks_are_done_in_turn_until_no_more_are_wanted(available):
    assert list(in_turn(lambda task: task**2, range(7))) == [task**2 for task in range(7)]
    results = in_turn(lambda task: (task, os.getpid()), range(100))
    assert [next(results)[0] for _ in range(3)] == [0, 1, 2]
    results.close()


@pytest.mark.parametrize("deviation", [0.01, 0.3])
def test_an_identification_is_the_same_on_any_number_of_cores(sdof, deviation, available):
    frf = noisy(sdof, sdof.frf(np.array([3e6, 40.0])), deviation)
    steps = []
    shown = dovetail.identify(
        sdof, frf, progress=lambda stage, done, total, note="": steps.append((stage, done, total))
    )
    use_cores(1)
    alone = dovetail.identify(sdof, frf)
    use_cores(sys.maxsize)
    assert shown.theta.tolist() == alone.theta.tolist()
    np.testing.assert_array_equal(shown.posterior.fraction, alone.posterior.fraction)
    assert max(total for stage, _, total in steps if stage == "modes") > 1


def test_a_fit_that_searches_further_is_the_same_on_any_number_of_cores(sdof, available):
    """Another resonance, which the model lacks; searches that another process does are counted too."""
    other = 0.3 * sdof.frf(np.array([6e6, 40.0]))
    problem = Problem.of(sdof, noisy(sdof, sdof.frf(np.array([3e6, 40.0])) + other))
    steps = []
    shown = refine(problem, progress=lambda stage, done, total, note="": steps.append((done, total)))
    use_cores(1)
    alone = refine(problem)
    use_cores(sys.maxsize)
    assert shown.theta.tolist() == alone.theta.tolist()
    assert (shown.starts, shown.steps, shown.agreeing) == (alone.starts, alone.steps, alone.agreeing)
    assert shown.discrepancy > 0.0
    done = [number for number, _ in steps]
    assert done == list(range(len(done)))
    assert len(done) > shown.starts > FURTHER.count
    assert all(number < total for number, total in steps)


def test_a_network_is_the_same_on_any_number_of_cores(sdof, available):
    regressor = {"model": "mlp", "hidden": [8], "max_epochs": 3}
    identification = {"samples": 300, "reducer": {"model": "pca", "n_components": 5}, "regressor": regressor}
    described = dovetail.load({**json.loads(sdof.description.text), "identification": identification})
    shown = dovetail.train(described)
    use_cores(1)
    alone = dovetail.train(described)
    use_cores(sys.maxsize)
    np.testing.assert_array_equal(shown.novelty.limits, alone.novelty.limits)
    frf = sdof.frf(np.array([3e6, 40.0]))
    np.testing.assert_array_equal(*(one.network.predict(np.abs(frf)[np.newaxis]) for one in (shown, alone)))


class Valley:
    """A posterior of two coordinates in a curved valley, whose searches have uneven weights."""

    def residuals(self, z):
        return np.stack([z[:, 0], z[:, 1], (z[:, 1] - z[:, 0] ** 2 + 1.0) / 0.05], axis=1)

    def linearise(self, z):
        jacobian = np.zeros((len(z), 2, 3))
        jacobian[:, 0, 0] = jacobian[:, 1, 1] = 1.0
        jacobian[:, 0, 2], jacobian[:, 1, 2] = -2.0 * z[:, 0] / 0.05, 1.0 / 0.05
        return Linearisation(self.residuals(z), jacobian)


def test_samples_that_are_moved_are_the_same_on_any_number_of_cores(monkeypatch):
    monkeypatch.setattr(randomize_then_optimize, "_DERIVATIVES_APART", 60)  # ten points
    monkeypatch.setattr(metropolis, "_SETTINGS", replace(metropolis.Settings(), apart=100))

    def moved():
        random, posterior = np.random.default_rng(0), Valley()
        mixture = TangentMixture(
            posterior, LinearisedPoints.at(posterior, np.array([[0.0, -1.0]])), np.zeros((1, 2)), random
        )
        annealing = Annealing(Density.of(posterior), 2, random.spawn(1)[0], 200)
        with annealing:
            annealing.begin()
            mixture.sample(200, 100)
            ends = SearchEnds.of(mixture)
            return move_by_weight(Density.of(posterior), ends, 200, random, annealing=annealing)

    shown = moved()
    use_cores(1)
    alone = moved()
    use_cores(sys.maxsize)
    np.testing.assert_array_equal(shown.z, alone.z)
    assert np.isfinite(alone.annealed)
    assert shown.annealed == alone.annealed
