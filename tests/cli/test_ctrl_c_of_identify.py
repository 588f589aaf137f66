"""Ctrl-C while `dovetail identify` runs: the first gives what there is, the second ends."""

from __future__ import annotations

import json
import signal
import sys

import pytest

from support.waiting import PATIENCE

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="signals are of POSIX")

BEGUN = "modes of the posterior:"
"""Logged when the samples begin."""


@pytest.fixture
def sampling(interruptible, run, assemblies, tmp_path):
    """Start an identification that takes minutes, and return it once it draws samples."""
    measured = tmp_path / "measured.uff"
    run("simulate", assemblies / "sdof.yaml", "--set", "k=3 MN/m", "--set", "c=40", "--noise", "1%", "-o", measured)
    words = "--samples", 40_000, "-v", "-o", tmp_path / "results"
    process = interruptible("identify", assemblies / "sdof.yaml", measured, *words)
    shown = []
    for line in process.stderr:
        shown.append(line)
        if BEGUN in line:
            break
    assert process.poll() is None, "".join(shown)
    yield process
    process.kill()


def test_the_first_ctrl_c_writes_a_result_that_says_what_it_lacks(sampling, tmp_path):
    sampling.send_signal(signal.SIGINT)
    printed, said = sampling.communicate(timeout=PATIENCE)
    assert "Stopping with what there is" in said
    assert "Traceback" not in said
    assert "Cut short when you stopped it" in printed + said
    result = json.loads((tmp_path / "results" / "result.json").read_text())
    assert result["cut_short"]["by_user"] is True
    assert any("40000 samples" in left_out or "Gaussian" in left_out for left_out in result["cut_short"]["left_out"])
    assert result["parameters"]["k"]["value"] == pytest.approx(3e6, rel=0.02)


def test_the_second_ctrl_c_ends_at_once_and_leaves_nothing_half_written(sampling, tmp_path):
    sampling.send_signal(signal.SIGINT)
    for line in sampling.stderr:
        if "Stopping with what there is" in line:
            break
    sampling.send_signal(signal.SIGINT)
    _, said = sampling.communicate(timeout=PATIENCE)
    assert "Traceback" not in said
    complete = (tmp_path / "results" / "SHA256SUMS").exists()  # if the first was quicker
    assert (sampling.returncode == 0) is complete
