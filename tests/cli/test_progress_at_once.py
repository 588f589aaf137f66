"""On a terminal, every long command shows its progress bar soon after it starts."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path

import pytest

from dovetail.cli.command_group import OWN
from dovetail.registry import CommandTable

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="pseudo-terminals are of POSIX")

LONG = (
    "check {sdof}",
    "simulate {sdof} -o {out}/frf.png",
    "plot {measured} -o {out}/plot.png",
    "convert {measured} {out}/converted.png",
    "identify {sdof} {measured}",
    "identify {sdof} {measured} {measured}",
    "identify-series {assemblies}/series/torques.yaml",
    "predict-series {assemblies}/series/torques.yaml --at torque=70Nm",
    "compare-models {sdof} {measured} --joints spring_damper,rigid",
    "watch {assemblies}/series/mornings.yaml {assemblies}/series -o {out}/watch",
    "train {sdof} -o {out}/model",
    "generate {sdof} -o {out}/data.zarr",
    "predict {sdof} {measured}/../results",
    "validate {assemblies}/campaign/cases/parts.yaml",
    "plan {sdof}",
    "calibrate {sdof} --cases 4",
    "compare {assemblies}/campaign/cases/torques.yaml --methods refined",
    "robustness {sdof}",
    "study {assemblies}/../docs/study/bt40_er32.yaml -o {out}/study",
    "check-plugin mlp",
)
"""Commands that take longer than two seconds on a slow machine."""

QUICK = {
    "examples",
    "cite",
    "merge",
    "new-assembly",
    "describe",
    "explore",
    "schema",
    "plugins",
    "new-plugin",
    "frf",
    "spindle",
}
"""The others; these too show a bar where they take long."""


@pytest.fixture(scope="module")
def files(run, assemblies, tmp_path_factory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("long")
    files = {"assemblies": assemblies, "sdof": assemblies / "sdof.yaml", "measured": folder / "measured.uff"}
    run("simulate", files["sdof"], "--set", "k=3 MN/m", "--set", "c=40", "-o", files["measured"])
    run("identify", files["sdof"], files["measured"], "--method", "refined", "-o", folder / "results")
    return files


def test_every_command_is_tested_or_quick():
    assert set(CommandTable(OWN).offers) == {line.split()[0] for line in LONG} | QUICK


@pytest.mark.sweep(keep=8)
@pytest.mark.parametrize("line", LONG, ids=lambda line: line.split(" -")[0].replace("{", "").replace("}", ""))
def test_a_bar_is_shown_within_a_second_of_the_first(command, on_a_terminal, files, tmp_path, line):
    """Once of three times, with what the command needs to start at all, so that a busy machine does not fail.

    The command is ended at its bar.
    """
    for number in range(3):
        words = shlex.split(line.format(**files, out=tmp_path / str(number)))
        shown = on_a_terminal(command, *words, until_bar=True)
        seconds = min(shown.first_bar, shown.seconds)
        if seconds < 2.0 or seconds < 2.0 + 2.0 * on_a_terminal(command, "--version").seconds:
            return
    pytest.fail(shown.written)


SCRIPT = """
import sys
import dovetail
assembly = dovetail.load(sys.argv[1])
dovetail.generate(assembly, sys.argv[2], samples=50, progress={progress})
print("done")
"""


@pytest.mark.parametrize("progress", [True, False])
def test_python_shows_a_bar_only_on_request(on_a_terminal, files, tmp_path, progress):
    script = SCRIPT.format(progress=progress)
    shown = on_a_terminal(sys.executable, "-c", script, files["sdof"], tmp_path / "data.zarr")
    assert shown.code == 0, shown.written
    assert ("generate" in shown.written) == ("50/50" in shown.written) == progress
    assert shown.written.endswith("done\r\n")


@pytest.mark.parametrize("word", ["-q", "-v"])
def test_quiet_and_verbose_show_no_bar(command, on_a_terminal, files, tmp_path, word):
    shown = on_a_terminal(command, "generate", files["sdof"], "-o", tmp_path / "data.zarr", "--samples", 50, word)
    assert shown.code == 0, shown.written
    assert shown.first_bar == float("inf")
    assert ("50 samples of sdof" in shown.written) == (word == "-v")
    assert "samples of 2 parameters" in shown.written
