"""How well the time of an identification is forecast from one evaluation of its model.

    python tests/benchmarks/forecast.py [--cases 50] [--seed 10]

The structures, parameters, axes and kinds of noise are those of `interval_coverage.py`. Identifications by the default
method are timed in processor time, once the kernel is compiled, so that other programs do not change the ratio.
"""

from __future__ import annotations

import argparse
import time

import numpy as np
from interval_coverage import LINES, structure
from processors import processor_time
from random_structures import NOISES, draw_axis, draw_theta, measure

import dovetail
from dovetail.identification.forecast import FIXED, evaluation_seconds
from dovetail.problem import Problem
from dovetail_plugins.methods.posterior import PosteriorMethod

STRUCTURES = 30


def ratio(number: int, seed: int) -> float:
    """Return the time of one identification over its forecast."""
    rng = np.random.default_rng([seed, 91, number])
    assembly = structure(number % STRUCTURES, seed)
    theta = draw_theta(assembly, rng)
    assembly = assembly.on(draw_axis(assembly, rng, LINES))
    noise = NOISES[number // STRUCTURES % len(NOISES)]
    measured = measure(assembly, theta, noise, rng, variance_given=number % 2 == 0)
    one = evaluation_seconds(Problem.of(assembly, measured), time.process_time)
    expected = FIXED + one * sum(PosteriorMethod(PosteriorMethod.Config()).evaluations)
    began = processor_time()
    dovetail.identify(assembly, measured, cause_seconds=0)
    return (processor_time() - began) / expected


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=int, default=50)
    parser.add_argument("--seed", type=int, default=10, help="of the structures, parameters, axes and noise")
    options = parser.parse_args()
    ratios = np.array([ratio(number, options.seed) for number in range(options.cases)])
    print("| cases | time over forecast, 5 % | 50 % | 95 % | within a factor of two |\n|---|---|---|---|---|")
    low, middle, high = np.quantile(ratios, [0.05, 0.5, 0.95])
    within = np.mean((ratios > 0.5) & (ratios < 2.0))
    print(f"| {len(ratios)} | {low:.2f} | {middle:.2f} | {high:.2f} | {within:.0%} |")


if __name__ == "__main__":
    main()
