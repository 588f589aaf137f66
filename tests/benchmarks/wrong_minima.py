"""How often do fits of a wrong model end in the lowest minimum that any seed finds?

    python tests/benchmarks/wrong_minima.py [--cases 8] [--seed 112] [--fits 5]

The FRF of a machine with an end mill is fitted by a model with another tool, by as many seeds as there are fits. "In
the lowest" counts those whose chi-squared is within 2 % of the lowest one, "highest" is the largest chi-squared over
it, and the time is processor time.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))
from processors import processor_time

from dovetail.inference.fitting import refine
from dovetail.problem import Problem
from support.end_mill import measured_with_another_tool

SAME = 1.02


def main() -> None:
    """Print a row for each machine, and one for all."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    for option, value in (("cases", 8), ("seed", 112), ("fits", 5)):
        parser.add_argument(f"--{option}", type=int, default=value)
    options = parser.parse_args()
    print("| machine | in the lowest | highest | seconds a fit |\n|---|---|---|---|")
    found, began = 0, processor_time()
    for case in range(options.seed, options.seed + options.cases):
        problem, start = Problem.of(*measured_with_another_tool(case)), processor_time()
        reached = np.array([refine(problem, seed=seed).chi_squared for seed in range(options.fits)])
        reached /= reached.min()
        lowest, seconds = int(np.sum(reached < SAME)), (processor_time() - start) / options.fits
        found += lowest
        print(f"| {case} | {lowest} of {options.fits} | {reached.max():.2f} | {seconds:.1f} |", flush=True)
    count = options.cases * options.fits
    print(f"| all | {found} of {count} | | {(processor_time() - began) / count:.1f} |")


if __name__ == "__main__":
    main()
