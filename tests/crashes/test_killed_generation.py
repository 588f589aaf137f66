"""A generation killed at random moments and resumed is bit-identical to the uninterrupted one."""

from __future__ import annotations

import json
import random
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

import dovetail
from dovetail.dataset import generation

SCRIPT = """
import json, pathlib, sys, time, dovetail
from dovetail.dataset import generation
generation._CHUNK_BYTES = float(sys.argv[4])
assembly = dovetail.load(json.loads(open(sys.argv[1]).read()))
pathlib.Path(sys.argv[5]).touch()
slowly = lambda *progress: time.sleep(0.1)  # so that the moments fall between and into all kinds of steps
dovetail.generate(assembly, sys.argv[2], samples=int(sys.argv[3]), resume=True, progress=slowly)
"""


@pytest.mark.parametrize(
    ("kills", "part", "chunk"), [(2, 500, 4e5), pytest.param(20, 3000, 8e6, marks=pytest.mark.slow)], ids=["2", "20"]
)
def test_a_killed_generation_is_resumed_bit_for_bit(collet, tmp_path, monkeypatch, kills, part, chunk):
    """By default with chunks of a twentieth of their bytes, so that there are many of few samples."""
    monkeypatch.setattr(generation, "_CHUNK_BYTES", chunk)
    samples = part * kills
    description = tmp_path / "description.json"
    description.write_text(collet.description.text)
    begun = tmp_path / "begun"
    words = [str(description), str(tmp_path / "killed.zarr"), str(samples), str(chunk), str(begun)]
    command = [sys.executable, "-c", SCRIPT, *words]
    moments, killed = random.Random(kills), 0
    while killed < kills:
        begun.unlink(missing_ok=True)
        process = subprocess.Popen(command)
        while not begun.exists() and process.poll() is None:
            time.sleep(0.02)
        time.sleep(moments.uniform(0.0, 1.0))
        process.send_signal(signal.SIGKILL)
        killed += process.wait() == -signal.SIGKILL
        if (tmp_path / "killed.zarr").exists() and dovetail.Dataset(tmp_path / "killed.zarr").complete:
            break
    assert killed == kills
    subprocess.run(command, check=True)
    resumed = dovetail.Dataset(tmp_path / "killed.zarr")
    whole = dovetail.generate(dovetail.load(json.loads(collet.description.text)), tmp_path / "w.zarr", samples=samples)
    assert resumed.complete
    np.testing.assert_array_equal(resumed.parameters, whole.parameters)
    for first in range(0, samples, part):
        rows = slice(first, first + part)
        np.testing.assert_array_equal(np.asarray(resumed.amplitude[rows]), np.asarray(whole.amplitude[rows]))
    assert not list((tmp_path / "killed.zarr").rglob("*.partial"))
