"""Print the processor time [s] of short commands, the least of several runs, for the effect of what they import.

python tests/benchmarks/startup.py --runs 10
"""

from __future__ import annotations

import argparse
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
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(command, stdout=subprocess.DEVNULL, check=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=5)
    runs = parser.parse_args().runs
    for name, command in COMMANDS.items():
        print(f"{name:32s} {min(processor_time(command) for _ in range(runs)):.3f}", flush=True)


if __name__ == "__main__":
    main()
