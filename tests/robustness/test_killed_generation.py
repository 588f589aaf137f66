"""A generation killed at random moments and resumed equals the uninterrupted one bit for bit."""

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

SCRIPT = """
import json, sys, time, dovetail
assembly = dovetail.load(json.loads(open(sys.argv[1]).read()))
slowly = lambda *progress: time.sleep(0.1)  # so that the moments fall between and into all kinds of steps
dovetail.generate(assembly, sys.argv[2], samples=int(sys.argv[3]), resume=True, progress=slowly)
"""


@pytest.mark.parametrize("kills", [2, pytest.param(20, marks=pytest.mark.slow)])
def test_killed_and_resumed(collet, tmp_path, kills):
    samples = 3000 * kills
    description = tmp_path / "description.json"
    description.write_text(collet.description.text)
    command = [sys.executable, "-c", SCRIPT, str(description), str(tmp_path / "killed.zarr"), str(samples)]
    start = time.monotonic()
    subprocess.run([*command[:-2], str(tmp_path / "first.zarr"), "200"], check=True)
    launch = time.monotonic() - start
    moments, killed = random.Random(kills), 0
    while killed < kills:
        process = subprocess.Popen(command)
        time.sleep(moments.uniform(0.5 * launch, launch + 0.5))
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
    for first in range(0, samples, 3000):
        rows = slice(first, first + 3000)
        np.testing.assert_array_equal(np.asarray(resumed.amplitude[rows]), np.asarray(whole.amplitude[rows]))
    assert not list((tmp_path / "killed.zarr").rglob("*.partial"))
