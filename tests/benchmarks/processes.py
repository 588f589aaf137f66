"""Work measured in a process of its own: wall-clock time from its start to its end, and peak memory."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ASSEMBLY = Path(__file__).resolve().parents[2] / "assemblies" / "bt40_er32.yaml"

FIRST_FRF = """
import sys, dovetail
dovetail.load(sys.argv[1]).frf()
"""

DATASET = """
import json, re, resource, sys, time, dovetail
assembly = dovetail.load(sys.argv[1])
start = time.perf_counter()
dataset = dovetail.generate(assembly, sys.argv[2], samples=int(sys.argv[3]), **json.loads(sys.argv[4]))
seconds = time.perf_counter() - start
try:
    kilobytes = int(re.search(r"VmHWM:\\s+(\\d+)", open("/proc/self/status").read())[1])
except OSError:  # a process that was forked from a large one would count that one's memory too
    kilobytes = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
print(json.dumps([seconds, kilobytes * 1024]))
"""


def run(script: str, *arguments: object, **environment: str) -> tuple[float, str]:
    """Run Python code in a fresh process; return its wall-clock seconds and what it printed."""
    command = [sys.executable, "-c", script, *map(str, arguments)]
    start = time.perf_counter()
    done = subprocess.run(command, env={**os.environ, **environment}, check=True, capture_output=True, text=True)
    return time.perf_counter() - start, done.stdout


def first_frf() -> tuple[float, float]:
    """Return the seconds to the first FRF ever (no cache, no bytecode), and to the first of a later process."""
    with tempfile.TemporaryDirectory() as folder:
        caches = ("DOVETAIL_CACHE_DIR", "NUMBA_CACHE_DIR", "XDG_CACHE_HOME", "PYTHONPYCACHEPREFIX")
        places = {name: str(Path(folder) / name) for name in caches}
        ever, _ = run(FIRST_FRF, ASSEMBLY, **places)
        later = min(run(FIRST_FRF, ASSEMBLY, **places)[0] for _ in range(3))
    return ever, later


def written_dataset(samples: int, **options: object) -> tuple[float, float, float]:
    """Return the seconds that a dataset takes to be computed and written, its bytes, and the process's peak memory."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "data.zarr"
        _, printed = run(DATASET, ASSEMBLY, path, samples, json.dumps(options))
        size = sum(file.stat().st_size for file in path.rglob("*") if file.is_file())
    seconds, memory = json.loads(printed)
    return seconds, size, memory
