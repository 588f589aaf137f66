"""Generation on a Dask cluster: the same bytes as without it, even if workers are killed."""

from __future__ import annotations

import hashlib
import json
import re
import shlex
import socket
import subprocess
import sys
import threading
import weakref
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import dovetail
import dovetail_bench
from dovetail import parallel
from dovetail.cli.app import app
from dovetail.dataset import generation
from dovetail.errors import DovetailError
from support.packages import skip_module_without
from support.waiting import PATIENCE

skip_module_without("distributed")

SAMPLES, CHUNK = 300, 25
SLOW_SPRING = '''
"""A spring whose matrices take a while, so that a worker can be killed at it; only its file has it."""

import time

import numpy as np

import dovetail


class SlowSpring(dovetail.JointModel):
    """A spring."""

    name = "slow_spring"
    summary = "a spring whose matrices take a while"
    ports = (dovetail.JointPort("a", 1), dovetail.JointPort("b", 1))
    parameters = (dovetail.Parameter("k", "N/m", 1e5, 1e7, "log", "stiffness"),)

    def matrices(self, theta):
        time.sleep(0.1 if len(theta) == 25 else 0.0)
        stiffness = np.zeros((len(theta), 4, 4))
        stiffness[:, 0, 0] = stiffness[:, 2, 2] = theta[:, 0]
        stiffness[:, 0, 2] = stiffness[:, 2, 0] = -theta[:, 0]
        none = np.zeros_like(stiffness)
        return dovetail.StructuralMatrices(none, stiffness, none, none)


@dovetail.hookimpl
def dovetail_components():
    return [SlowSpring]
'''


@pytest.fixture(scope="module", autouse=True)
def twelve_chunks_and_much_patience():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(generation, "_CHUNK_BYTES", 4.0 * 391 * CHUNK)
        patch.setattr(parallel, "_REACHED", PATIENCE)
        patch.setattr(parallel, "_PATIENCE", PATIENCE)
        yield


@pytest.fixture(scope="module")
def assembly(tmp_path_factory):
    plugin = tmp_path_factory.mktemp("plugin") / "slow_spring.py"
    plugin.write_text(SLOW_SPRING)
    description = {
        "dovetail": 1,
        "name": "block",
        "frequency": {"start": 10, "stop": 400, "step": 1},
        "substructures": {"mass": {"model": "lumped", "masses": [{"mass": 1.0}]}, "base": {"model": "ground"}},
        "joints": {
            "mount": {
                "model": "slow_spring",
                "connect": {"a": {"to": "mass", "at": 0}, "b": {"to": "base", "at": 0}},
            }
        },
        "response": {"at": "mass", "position": 0, "quantity": "accelerance"},
    }
    return dovetail.load(description, plugins=[plugin])


@pytest.fixture(scope="module")
def scheduler():
    """The process of a scheduler, and its address."""
    command = [sys.executable, "-m", "dask", "scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard"]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    assert process.stderr is not None
    address = next(found[0] for line in process.stderr if (found := re.search(r"tcp://[\d.]+:\d+", line)))
    yield process, address
    process.kill()
    process.wait()


@pytest.fixture(scope="module")
def workers(scheduler):
    """The processes of three workers, which nobody starts again. Two tests kill one each."""
    command = [sys.executable, "-m", "dask", "worker", scheduler[1], "--nthreads", "1", "--no-nanny", "--no-dashboard"]
    processes = [subprocess.Popen(command, stderr=subprocess.DEVNULL) for _ in range(3)]
    from distributed import Client

    with Client(scheduler[1], set_as_default=False) as client:
        client.wait_for_workers(3, timeout=PATIENCE)
    yield processes
    for process in processes:
        process.kill()
        process.wait()


def digests(folder: Path) -> dict[str, str]:
    files = sorted(file for file in folder.rglob("*") if file.is_file())
    return {str(file.relative_to(folder)): hashlib.sha256(file.read_bytes()).hexdigest() for file in files}


def problem(error: pytest.ExceptionInfo[DovetailError]) -> str:
    return error.value.faults[0].problem


def test_a_missing_extra_is_an_error_with_the_install_command(assembly, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(DovetailError, match=re.escape('pip install "dovetail-frf[dask]"')):
        dovetail.generate(assembly, tmp_path / "data.zarr", samples=SAMPLES, scheduler="tcp://127.0.0.1:1")


UNREACHABLE = [
    "tcp://127.0.0.1:1", "tcp://127.0.0.1:99999", "tcp://127.0.0.1:word", "tcp://127.0.0.1", "tcp://", "tcp://[::1", "",
    "nonsense", "nowhere://x:1", "://", "tls://127.0.0.1:1", "http://127.0.0.1:1", "inproc://x",
    "tcp://" + 300 * "a" + ":1",
]  # fmt: skip


@pytest.mark.parametrize("address", UNREACHABLE)
def test_an_unreachable_scheduler_is_an_error(assembly, tmp_path, monkeypatch, address):
    monkeypatch.setattr(parallel, "_REACHED", 0.3)  # and not the default of Dask, 30 s
    with pytest.raises(DovetailError) as error:
        dovetail.generate(assembly, tmp_path / "data.zarr", samples=SAMPLES, scheduler=address)
    assert problem(error).startswith(f"no Dask scheduler answers at '{address}'")
    assert not list(tmp_path.iterdir())


ANSWERS = {
    "none": b"",
    "a web server": b"HTTP/1.1 400 Bad Request\r\n\r\n",
    "a shell": b"SSH-2.0-OpenSSH_9.6\r\n",
    "zeros": bytes(100),
    "ones": b"\xff" * 100,
    "an empty frame": b"\x10" + bytes(23),
}


@pytest.mark.parametrize("answer", list(ANSWERS.values()), ids=list(ANSWERS))
def test_another_program_that_answers_is_an_error(answer):
    with socket.create_server(("127.0.0.1", 0)) as server:

        def serve() -> None:
            with suppress(OSError):  # the server is closed
                while True:
                    connection, _ = server.accept()
                    connection.sendall(answer)
                    connection.close()

        threading.Thread(target=serve, daemon=True).start()
        with pytest.raises(DovetailError, match="no Dask scheduler answers at"):
            parallel.require_cluster(f"tcp://127.0.0.1:{server.getsockname()[1]}")


def test_a_client_that_failed_is_removed_before_the_next_one_starts():
    """If Python removed it during that start, both would wait for a lock, and the start would fail."""
    from distributed import Client

    kept = []

    class Watched(Client):
        def __init__(self, *words, **options):
            kept.append(weakref.ref(self))
            raise ValueError("no address")

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("distributed.Client", Watched)
        with pytest.raises(DovetailError):
            parallel.require_cluster("nonsense")
    assert [reference() for reference in kept] == [None]


def test_a_scheduler_without_workers_is_an_error(assembly, tmp_path, monkeypatch, scheduler):
    monkeypatch.setattr(parallel, "_PATIENCE", 0.3)
    with pytest.raises(DovetailError) as error:
        dovetail.generate(assembly, tmp_path / "data.zarr", samples=SAMPLES, scheduler=scheduler[1])
    assert problem(error) == "it has had no worker for 0 s."


def test_workers_of_another_version_are_refused(assembly, tmp_path, monkeypatch, scheduler, workers):
    monkeypatch.setattr(parallel, "version", lambda name: "0.0")
    with pytest.raises(DovetailError, match=r"the worker tcp://\S+ has dovetail-frf \S+, and this process 0\.0\."):
        dovetail.generate(assembly, tmp_path / "data.zarr", samples=SAMPLES, scheduler=scheduler[1])


def test_a_killed_worker_loses_nothing(assembly, tmp_path, scheduler, workers):
    """With a joint that only a plugin file has, whose code goes with the work."""
    dovetail.generate(assembly, tmp_path / "plain.zarr", samples=SAMPLES)
    done_at_death = []

    def kill_one(stage, done, total, *_):
        if done and not done_at_death:
            workers[0].kill()
            workers[0].wait()
            done_at_death.append(done)

    path = tmp_path / "data.zarr"
    dovetail.generate(assembly, path, samples=SAMPLES, scheduler=scheduler[1], progress=kill_one)
    assert done_at_death == [CHUNK]
    assert digests(path) == digests(tmp_path / "plain.zarr")


def test_a_shard_of_interpolated_complex_frfs_is_generated_by_a_cluster(
    assembly, tmp_path, monkeypatch, scheduler, workers
):
    monkeypatch.setattr(generation, "_CHUNK_BYTES", 8.0 * 391 * 50)
    options = {"samples": SAMPLES, "seed": 3, "storage": "complex", "interpolation": 1e-9, "shard": (2, 3)}
    dovetail.generate(assembly, tmp_path / "plain.zarr", **options)
    dovetail.generate(assembly, tmp_path / "data.zarr", scheduler=scheduler[1], **options)
    assert digests(tmp_path / "data.zarr") == digests(tmp_path / "plain.zarr")


@pytest.mark.slow
def test_a_calibration_by_a_cluster_has_the_same_ranks(sdof, scheduler, workers):
    setting = {"cases": 2, "samples": 40, "seed": 5}
    here = dovetail_bench.calibrate(sdof, **setting, workers=1)
    there = dovetail_bench.calibrate(sdof, **setting, scheduler=scheduler[1])
    np.testing.assert_array_equal(there.rank, here.rank)
    np.testing.assert_array_equal(there.estimate, here.estimate)
    assert (here.workers, there.workers) == (1, None)


@pytest.fixture
def network(sdof):
    regressor = {"model": "mlp", "hidden": [8], "max_epochs": 2}
    identification = {"samples": 60, "reducer": {"model": "pca", "n_components": 5}, "regressor": regressor}
    return dovetail.train(dovetail.load({**json.loads(sdof.description.text), "identification": identification}))


@pytest.mark.parametrize("method", ["refined", pytest.param("network", marks=pytest.mark.slow)])
def test_a_batch_is_identified_by_a_cluster(sdof, tmp_path, scheduler, workers, method, request):
    options = {"method": method, "model": request.getfixturevalue("network") if method == "network" else None}
    measured = [sdof.simulate({"k": 2e6}), sdof.simulate({"k": 3e6}), tmp_path / "none.uff"]
    here = dovetail.identify_many(sdof, measured, processes=1, **options)
    there = dovetail.identify_many(sdof, measured, scheduler=scheduler[1], **options)
    assert there.table == here.table
    assert len(there.results) == 2
    assert dict(there.failures) == dict(here.failures)
    assert list(there.failures) == ["none.uff"]


def test_a_worker_that_has_left_does_not_stop_the_start():
    """As one that was killed a moment ago, of which the scheduler does not know yet."""
    from distributed.comm import CommClosedError

    left = {"tcp://gone:1": CommClosedError("Address removed.")}
    parallel._require_same_versions({**left, "tcp://here:2": parallel._versions()})
    with pytest.raises(DovetailError, match=r"tcp://here:2 cannot load Dovetail"):
        parallel._require_same_versions({**left, "tcp://here:2": ImportError("no module")})


def test_a_study_by_a_cluster_gives_the_same_trials_as_one_process_if_a_worker_is_killed(
    sdof, tmp_path, scheduler, workers
):
    """The worker is killed when two trials have ended."""
    pytest.importorskip("optuna")
    regressor = {"model": "sklearn", "estimator": "KernelRidge", "options": {"alpha": 0.1, "kernel": "rbf"}}
    described = json.loads(sdof.description.text)
    described["identification"] = {"samples": 300, "reducer": {"model": "pca"}, "regressor": regressor}
    sweeps = {"reducer.n_components": [2, 4], "regressor.options.alpha": [1e-4, 10.0]}
    described["study"] = {"sweeps": sweeps, "lease": 4}
    assembly = dovetail.load(described)
    killed = []

    def kill_one(stage, done, total, note=""):
        if done >= 2 and not killed:
            killed.append(workers[-1].pid)
            workers[-1].kill()

    together = dovetail_bench.study(assembly, tmp_path / "together", scheduler=scheduler[1], progress=kill_one)
    alone = dovetail_bench.study(assembly, tmp_path / "alone")
    assert killed
    assert [trial.state for trial in together.trials] == ["done"] * len(alone.trials)
    found, expected = ({str(t.changes) + t.kind: t.answer["mae"] for t in s.trials} for s in (together, alone))
    assert found == pytest.approx(expected, rel=1e-4)  # threads of linear algebra change the last digits
    assert together.best.changes == alone.best.changes
    assert sum(trial.attempts for trial in together.trials) <= len(together.trials) + 1


def test_the_command_that_the_page_shows_lets_a_cluster_work(tmp_path, scheduler, workers):
    page = (Path(__file__).parents[2] / "docs" / "cluster.md").read_text(encoding="utf-8")
    (line,) = re.findall(r"^dovetail generate .* --scheduler .*$", page, flags=re.M)
    words = shlex.split(line.replace("--samples 3000", "--samples 60").replace("tcp://localhost:8786", scheduler[1]))
    words = [str(tmp_path / word) if word.endswith((".yaml", ".zarr")) else word for word in words]
    (tmp_path / "sdof.yaml").write_bytes((Path(__file__).parents[2] / "assemblies" / "sdof.yaml").read_bytes())
    done = CliRunner().invoke(
        app, [str(tmp_path / word) if word.endswith((".yaml", ".zarr")) else word for word in words[1:]]
    )
    assert done.exit_code == 0, done.output
    assert dovetail.Dataset(tmp_path / "data.zarr").complete


def test_an_error_of_a_task_is_that_of_the_work(scheduler, workers):
    def fail(task):
        raise DovetailError(f"task {task} cannot be done.")

    with pytest.raises(DovetailError, match="task 7 cannot be done"):
        list(parallel.on_cluster(fail, [7], scheduler[1]))


def test_a_scheduler_that_ends_is_an_error_and_the_dataset_can_be_resumed(assembly, tmp_path, scheduler, workers):
    """The last test of this scheduler."""

    def end(stage, done, total, *_):
        if done:
            scheduler[0].kill()

    path = tmp_path / "data.zarr"
    with pytest.raises(DovetailError) as error:
        dovetail.generate(assembly, path, samples=SAMPLES, scheduler=scheduler[1], progress=end)
    assert problem(error) == "the connection with the scheduler was lost."
    dovetail.generate(assembly, path, samples=SAMPLES, resume=True)
    dovetail.generate(assembly, tmp_path / "plain.zarr", samples=SAMPLES)
    assert digests(path) == digests(tmp_path / "plain.zarr")
