"""Time and memory of the posterior of a series of the collet: five torques and fifty, 4451 lines each.

    python tests/benchmarks/series_cost.py [--tests 5 50] [--lines 4451] [--samples 200] [--seed 0]

The series are those of `five_torques.py`. The time is that of everything: simulation of the measurements, fit to
each test alone, fit of the series and samples. The memory is the largest that the process has had so far.
"""

from __future__ import annotations

import argparse
import resource
import time

import numpy as np
from five_torques import identified

MEGABYTE = 1024.0  # of the kilobytes in which Linux counts


def main() -> None:
    """Print a row for each number of tests."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--tests", type=int, nargs="+", default=[5, 50])
    for option, value in (("lines", 4451), ("samples", 200), ("seed", 0)):
        parser.add_argument(f"--{option}", type=int, default=value)
    options = parser.parse_args()
    lines = np.linspace(100.0, 9000.0, options.lines)
    print("| tests | unknowns | seconds | seconds of processor time | memory [MB] |\n|---|---|---|---|---|")
    for count in options.tests:
        torques = np.linspace(20.0, 100.0, count).tolist()
        wall, processor = time.perf_counter(), time.process_time()
        result, _ = identified(0, options.seed, options.samples, torques, lines)
        wall, processor = time.perf_counter() - wall, time.process_time() - processor
        memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / MEGABYTE
        print(f"| {count} | {result.unknowns.count} | {wall:.1f} | {processor:.1f} | {memory:.0f} |", flush=True)


if __name__ == "__main__":
    main()
