"""Two processes generating one dataset: the second gets an error and does not disturb the first."""

from __future__ import annotations

import signal
import subprocess
import sys

import numpy as np
import pytest

import dovetail
from dovetail.errors import DatasetError

SLOW = """
import json, sys, time, dovetail
assembly = dovetail.load(json.loads(open(sys.argv[1]).read()))
def slowly(stage, done, total, *_):
    print(done, flush=True)
    if done:
        sys.stdin.readline()
dovetail.generate(assembly, sys.argv[2], samples=int(sys.argv[3]), resume=True, progress=slowly)
"""

KILLED = """
import json, os, sys, zarr, dovetail
zarr.Group.create_array = lambda *_, **__: os.kill(os.getpid(), 9)
assembly = dovetail.load(json.loads(open(sys.argv[1]).read()))
dovetail.generate(assembly, sys.argv[2], samples=int(sys.argv[3]))
"""


@pytest.fixture
def first(collet, tmp_path):
    """A process that has computed a part of a dataset and waits."""
    (tmp_path / "description.json").write_text(collet.description.text)
    arguments = [str(tmp_path / "description.json"), str(tmp_path / "data.zarr"), "1500"]
    process = subprocess.Popen([sys.executable, "-c", SLOW, *arguments], stdin=-1, stdout=-1, text=True)
    for line in process.stdout:
        if int(line):
            break
    yield process
    process.kill()
    process.communicate()


def test_a_second_generation_of_one_dataset_is_refused(collet, tmp_path, first):
    part = tmp_path / "data.zarr" / "amplitude" / "c" / "0.partial"
    part.parent.mkdir(parents=True, exist_ok=True)
    part.write_text("of the first")
    for resume in (True, False):
        with pytest.raises(DatasetError, match=f"process {first.pid} is writing it"):
            dovetail.generate(collet, tmp_path / "data.zarr", samples=1500, resume=resume)
    assert part.read_text() == "of the first"
    part.unlink()
    first.communicate("\n" * 10)
    assert first.returncode == 0
    whole = dovetail.generate(collet, tmp_path / "whole.zarr", samples=1500)
    np.testing.assert_array_equal(dovetail.Dataset(tmp_path / "data.zarr").amplitude[:], whole.amplitude[:])
    assert sorted(path.name for path in tmp_path.iterdir()) == ["data.zarr", "description.json", "whole.zarr"]


def test_a_killed_process_holds_nothing(collet, tmp_path, first):
    first.send_signal(signal.SIGKILL)
    first.wait()
    assert dovetail.generate(collet, tmp_path / "data.zarr", samples=1500, resume=True).complete
    assert sorted(path.name for path in tmp_path.iterdir()) == ["data.zarr", "description.json"]


def test_what_a_killed_creation_leaves_is_removed(collet, tmp_path):
    (tmp_path / "description.json").write_text(collet.description.text)
    arguments = [str(tmp_path / "description.json"), str(tmp_path / "data.zarr"), "10"]
    done = subprocess.run([sys.executable, "-c", KILLED, *arguments], check=False)
    assert done.returncode == -signal.SIGKILL
    assert len(list(tmp_path.iterdir())) > 1
    dovetail.generate(collet, tmp_path / "data.zarr", samples=10)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["data.zarr", "description.json"]
