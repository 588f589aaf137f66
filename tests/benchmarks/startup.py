"""Print the processor time [s] of short commands, the least of several runs, for the effect of what they import.

python tests/benchmarks/startup.py --runs 10

The first run of each command, which may still write compiled modules, is not counted. They are written even where
PYTHONDONTWRITEBYTECODE is set, as in many containers: without them Python compiles every module at each start.
"""

from __future__ import annotations

import argparse
import os
import resource
import subprocess
import sys
from pathlib import Path

ASSEMBLIES = Path(__file__).resolve().parents[2] / "assemblies"
DOVETAIL = [sys.executable, "-m", "dovetail"]
COMMANDS = {
    "python -c pass": [sys.executable, "-c", "pass"],
    "import numpy": [sys.executable, "-c", "import numpy"],
    "import dovetail; dovetail.load": [sys.executable, "-c", "import dovetail; dovetail.load"],
    "--help": [*DOVETAIL, "--help"],
    "plugins": [*DOVETAIL, "plugins"],
    "describe collet": [*DOVETAIL, "describe", "collet"],
    "check sdof.yaml": [*DOVETAIL, "check", str(ASSEMBLIES / "sdof.yaml")],
}


def processor_time(command: list[str]) -> float:
    """Return the processor time of one run; other programs hardly change it."""
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(command, stdout=subprocess.DEVNULL, check=True, env=environment)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=5)
    runs = parser.parse_args().runs
    for name, command in COMMANDS.items():
        processor_time(command)
        print(f"{name:32s} {min(processor_time(command) for _ in range(runs)):.3f}", flush=True)


if __name__ == "__main__":
    main()
