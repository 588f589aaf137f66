"""A measurement that cannot be identified, or whose process is killed, costs a batch that one measurement."""

from __future__ import annotations

import faulthandler
import multiprocessing
import os
import signal
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import dovetail
import dovetail_bench
from dovetail.errors import DovetailError, Fault, as_dovetail_error
from dovetail.identification import batch as batches_module
from dovetail.parallel import side_by_side
from dovetail_bench.evaluation import calibration
from support.batches import BAD, start, summary, write_measurements
from support.waiting import PATIENCE, wait_until

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="processes are forked on Linux only")

GOOD = tuple(f"good{number}.npz" for number in range(6))


def test_five_bad_files_and_a_killed_worker_leave_seven_results_of_twelve(sdof, tmp_path):
    write_measurements(tmp_path / "measured", sdof, *GOOD, "killed_once.npz", *BAD)
    process = start(tmp_path, "measured")
    _, messages = process.communicate(timeout=PATIENCE)
    assert process.returncode == 1
    assert summary(tmp_path) == [*GOOD, "killed_once.npz"]
    for cause in (
        "codepoint.npz  note\n  the text holds a number that is not the code of any character",
        "huge.csv:3\n  the value is 1.41e+300, which no structure has (299 such lines)",
        "cut.npz\n  the archive is damaged",
        "memory.npz\n  there is not enough memory for it.",
        "bug.npz\n  unexpected error: ValueError: nobody thought of this",
    ):
        assert cause in messages
    assert messages.count("This is a bug") == 1
    assert "Traceback" not in messages


def test_a_file_whose_worker_is_killed_twice_fails_with_the_cause_and_the_others_go_on(sdof, tmp_path):
    write_measurements(tmp_path / "measured", sdof, "killed_always.npz", GOOD[0])
    process = start(tmp_path, "measured")
    _, messages = process.communicate(timeout=PATIENCE)
    assert process.returncode == 1
    assert summary(tmp_path) == [GOOD[0]]
    said = "killed_always.npz\n  its process was ended by the system (SIGKILL), and again when it was repeated alone."
    assert said in messages


def is_alive(process: int) -> bool:
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def workers(place: Path) -> list[int]:
    return [int(file.stem) for file in (place / "marks").glob("*.worker")]


def test_ctrl_c_ends_a_batch_at_once_and_keeps_finished_results(sdof, tmp_path):
    write_measurements(tmp_path / "measured", sdof, "endless.npz", *GOOD[:2])
    process = start(tmp_path, "measured")
    results = tmp_path / "results/summary.csv"
    wait_until(lambda: results.exists() and all(name in results.read_text() for name in GOOD[:2]), process)
    process.send_signal(signal.SIGINT)
    _, messages = process.communicate(timeout=PATIENCE)  # the worker would take ten minutes
    assert process.returncode == 130
    assert summary(tmp_path) == [*GOOD[:2]]
    assert "Interrupted after 2 of 3 measurements." in messages
    wait_until(lambda: not any(map(is_alive, workers(tmp_path))))


@pytest.mark.parametrize("sign", [signal.SIGKILL, signal.SIGTERM])
def test_results_are_kept_and_workers_end_when_a_batch_is_killed(sdof, tmp_path, sign):
    write_measurements(tmp_path / "measured", sdof, "endless.npz", GOOD[0])
    process = start(tmp_path, "measured")
    wait_until((tmp_path / "results/summary.csv").exists, process)
    assert len(workers(tmp_path)) == 2
    process.send_signal(sign)
    process.communicate(timeout=PATIENCE)
    assert process.returncode == -sign
    assert summary(tmp_path) == [GOOD[0]]
    wait_until(lambda: not any(map(is_alive, workers(tmp_path))))


def test_a_calibration_goes_on_without_the_cases_that_fail(sdof, monkeypatch):
    identify = calibration.identify

    def faulty(assembly, measured, method, **options):
        if options["seed"] == 1:
            os.kill(os.getpid(), signal.SIGKILL)
        if options["seed"] == 2:
            raise MemoryError
        return identify(assembly, measured, method, **options)

    monkeypatch.setattr(calibration, "identify", faulty)
    done = dovetail_bench.calibrate(sdof, cases=4, samples=20, noise=0.1, workers=2)
    assert done.case.tolist() == [0, 3]
    assert sorted(done.failures) == [1, 2]
    assert "ended by the system (SIGKILL)" in done.failures[1]
    assert "case 3\n  there is not enough memory" in done.failures[2]
    assert done.to_dict()["failures"] == {str(index): reason for index, reason in done.failures.items()}


def test_a_calibration_of_which_every_case_fails_is_an_error(sdof, monkeypatch):
    def faulty(*_, **__):
        raise MemoryError

    monkeypatch.setattr(calibration, "identify", faulty)
    with pytest.raises(DovetailError, match="not enough memory"):
        dovetail_bench.calibrate(sdof, cases=2, samples=20, workers=1)


@pytest.mark.parametrize("processes", [1, 2])
def test_identify_many_hands_over_results_as_they_arrive(sdof, monkeypatch, processes):
    def faulty(_assembly, measured, *_, **__):
        raise {"lack": MemoryError, "bug": SystemError, "over": OverflowError}[measured.label]("odd")

    monkeypatch.setattr(batches_module, "identify", faulty)
    frfs = [dovetail.Frf([1.0, 2.0], [1.0, 2.0], "accelerance", label=label) for label in ("lack", "bug", "over")]
    arrived = {}
    batch = dovetail.identify_many(sdof, frfs, processes=processes, on_outcome=arrived.__setitem__)
    assert arrived == batch.failures
    assert batch.failures["lack"] == "lack\n  there is not enough memory for it.\n  Free some memory."
    assert "bug\n  unexpected error: SystemError: odd" in batch.failures["bug"]
    assert "over\n  its values are beyond what can be computed with: odd." in batch.failures["over"]


def test_ctrl_c_returns_a_batch_of_the_finished_measurements(sdof, monkeypatch):
    def stop(_assembly, measured, *_, **__):
        if measured.label == "second":
            raise KeyboardInterrupt
        raise MemoryError

    monkeypatch.setattr(batches_module, "identify", stop)
    frfs = [dovetail.Frf([1.0, 2.0], [1.0, 2.0], "accelerance", label=label) for label in ("first", "second", "third")]
    batch = dovetail.identify_many(sdof, frfs, processes=1)
    assert batch.interrupted
    assert list(batch.failures) == ["first"]
    with pytest.raises(KeyboardInterrupt):
        dovetail.identify_many(sdof, frfs[1:], processes=1)


class Unpicklable:
    """A result that another process cannot send, or that this one cannot receive."""

    def __init__(self, where: str) -> None:
        self.where = where

    def __reduce__(self):
        if self.where == "sent":
            raise ValueError("not to be sent")
        return int, ("not to be received",)


@pytest.mark.parametrize("where", ["sent", "received"])
def test_a_result_that_cannot_cross_to_the_caller_is_lost_alone(where):
    def work(index):
        return Unpicklable(where) if index == 1 else index

    done = dict(side_by_side(work, 4, 2, lost=lambda index, fault: fault))
    assert isinstance(done.pop(1), Fault)
    assert done == {0: 0, 2: 2, 3: 3}
    assert multiprocessing.active_children() == []


@pytest.mark.parametrize("sign", [signal.SIGKILL, signal.SIGSEGV, signal.SIGTERM, None])
def test_a_worker_that_dies_is_replaced_and_its_task_repeated_alone(tmp_path, sign):
    running = tmp_path / "running"
    running.mkdir()

    def work(index):
        faulthandler.disable()
        mark = running / f"{os.getpid()}"
        mark.touch()
        time.sleep(0.02)
        others = len(list(running.iterdir())) - 1
        if index in (2, 5):
            (tmp_path / f"{index}.others").write_text(str(others))
            mark.unlink()
            os._exit(7) if sign is None else os.kill(os.getpid(), sign)
        mark.unlink()
        return index

    done = dict(side_by_side(work, 9, 3, lost=lambda index, fault: fault.problem))
    name = "itself with the code 7" if sign is None else sign.name
    assert all(name in done[index] for index in (2, 5))
    assert [done[index] for index in (0, 1, 3, 4, 6, 7, 8)] == [0, 1, 3, 4, 6, 7, 8]
    assert multiprocessing.active_children() == []
    assert [(tmp_path / f"{index}.others").read_text() for index in (2, 5)] == ["0", "0"]


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (MemoryError(), "not enough memory"),
        (RuntimeError("[enforce fail] DefaultCPUAllocator: can't allocate memory: you tried"), "not enough memory"),
        (np.linalg.LinAlgError("Singular matrix"), "beyond what can be computed with: Singular matrix"),
        (ZeroDivisionError("division by zero"), "beyond what can be computed with"),
        (OSError(28, "No space left on device"), "the system refuses: No space left on device"),
        (UnicodeDecodeError("utf-8", b"\xff", 0, 1, "invalid"), "unexpected error: UnicodeDecodeError"),
        (DovetailError("as it is"), "as it is"),
    ],
)
def test_the_cause_of_a_failure_is_named(error, said):
    assert said in str(as_dovetail_error(error, "m.csv"))
