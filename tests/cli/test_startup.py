"""The command starts fast, and heavy libraries are imported only when they are needed."""

from __future__ import annotations

import os
import re
import resource
import subprocess
import sys

import pytest

from support.waiting import PATIENCE

HEAVY = ("torch", "umap", "numba", "matplotlib")

RUN_APP = """
from dovetail.cli.app import app
try:
    app({arguments!r})
except SystemExit as exit:
    assert exit.code == 0, exit.code
"""


@pytest.mark.parametrize(
    ("module", "unloaded"),
    [
        ("dovetail_plugins.readers.hdf5_file", ["scipy.special", "scipy.sparse", "dovetail.interfaces"]),
        ("dovetail.testing.another_process", ["scipy.special", "scipy.sparse", "dovetail.testing.kit"]),
        ("dovetail.identification", ["scipy.stats", "scipy.signal"]),
        ("dovetail.commands", ["numpy", "pydantic", "dovetail.identification"]),
    ],
)
def test_what_many_short_processes_import_loads_little(module, unloaded):
    script = f"import sys, {module}; print([name for name in {unloaded} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=PATIENCE, check=True)
    assert done.stdout == "[]\n"


NOT_FOR_NAMES = ("pint", "dask", "llvmlite", "scipy.linalg", "scipy.ndimage", "scipy.optimize", "scipy.sparse")
"""Modules that take tens of milliseconds each, and which no list of names needs."""


@pytest.mark.parametrize(
    ("code", "unloaded"),
    [
        ("import dovetail; dovetail.load", NOT_FOR_NAMES),
        (RUN_APP.format(arguments=["plugins"]), NOT_FOR_NAMES),
        (RUN_APP.format(arguments=["describe", "collet"]), NOT_FOR_NAMES),
        (RUN_APP.format(arguments=["schema"]), ()),
        (RUN_APP.format(arguments=["--help"]), (*NOT_FOR_NAMES, "numpy", "pydantic", "rich")),
        (
            RUN_APP.format(arguments=["check", "sdof.yaml"]),
            ("pint", "dask", "llvmlite", "scipy.ndimage", "scipy.optimize", "scipy.spatial", "scipy.stats"),
        ),
        ("import dovetail\ndovetail.read_frf('measurements/h0_j_t0_60Nm.uff')", ("pint", "dask", "llvmlite")),
        (
            "import dovetail.dataset\ndovetail.dataset.latin_hypercube(dovetail.load('sdof.yaml'), samples=9, seed=0)",
            ("scipy.signal", "scipy.spatial", "scipy.stats"),
        ),
    ],
    ids=["dovetail.load", "plugins", "describe", "schema", "--help", "check", "read_frf", "samples"],
)
def test_what_a_command_does_not_use_stays_unloaded(assemblies, code, unloaded):
    script = f"{code}\nimport sys\nprint([name for name in {(*HEAVY, *unloaded)} if name in sys.modules])"
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, cwd=assemblies, timeout=PATIENCE
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[-1] == "[]"


@pytest.mark.parametrize(("stated", "threads"), [({}, "{1}"), ({"OPENBLAS_NUM_THREADS": "2"}, "{2}")])
def test_a_command_has_one_thread_of_linear_algebra_unless_the_environment_says_otherwise(stated, threads):
    script = """
import sys
from dovetail.__main__ import main
sys.argv = ["dovetail", "--version"]
try:
    main()
except SystemExit:
    import numpy
    from threadpoolctl import threadpool_info
    print({pool["num_threads"] for pool in threadpool_info()})
"""
    kept = {name: value for name, value in os.environ.items() if not name.endswith("_NUM_THREADS")}
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, timeout=PATIENCE, check=True, env=kept | stated
    )
    assert done.stdout.splitlines()[-1] == threads


def least(command: list[str]) -> float:
    """Return the least processor time [s] of five runs, which other programs hardly change."""
    seconds = []
    for _ in range(5):
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        subprocess.run(command, capture_output=True, check=True, timeout=PATIENCE)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        seconds.append(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
    return min(seconds)


def test_help_is_printed_within_the_time_limit(command):
    """Against Python's own start, so that a slow machine does not fail; NumPy alone takes half of what is allowed."""
    python, help_ = least([sys.executable, "-c", "pass"]), least([command, "--help"])
    print(f"dovetail --help: {help_:.3f} s; python -c pass: {python:.3f} s")
    assert help_ < 25 * python


def test_the_version_is_printed(shell):
    import dovetail

    assert shell("--version").stdout == f"dovetail {dovetail.__version__}\n"


def test_help_lists_every_command(shell):
    done = shell("--help")
    assert done.returncode == 0
    groups = dict(re.findall(r"^(\w[^\n]*):\n((?:  .*\n)+)", done.stdout.partition("--help")[2], flags=re.M))
    listed = {group: re.findall(r"^  (\S+)", rows, flags=re.M) for group, rows in groups.items()}
    assert listed == {
        "Describe an assembly": ["examples", "new-assembly", "check", "describe", "simulate", "explore", "schema"],
        "Measure": ["plot", "convert", "frf", "plan", "spindle"],
        "Identify a joint": ["identify", "identify-series", "compare-models", "train", "generate", "merge"],
        "Use the result": ["predict", "watch", "predict-series"],
        "Extend": ["plugins", "new-plugin", "check-plugin", "cite"],
        "Evaluate": ["calibrate", "compare", "robustness", "study", "validate"],
    }
    assert "..." not in done.stdout.partition("--help")[2]
    assert max(len(line) for line in done.stdout.splitlines()) <= 80
