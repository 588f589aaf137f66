"""How often the 90 % intervals of random joints of random structures hold the true values.

    python tests/benchmarks/interval_coverage.py [--cases 1000] [--structures 30] [--seed 0] [--samples 100]

The structures, parameters, axes and kinds of noise are those of `genuine_measurements.py`, with 200 to 5,000 lines.
The true parameters are drawn evenly from their ranges, which is the prior, and the model is exact (`model_error=0`):
intervals are right if they hold nine tenths of the true values, of both well and badly determined parameters. The
tables have one line for each kind of parameter and one for each structure; `+-` is the standard error of the share.
Intervals of one measurement depend on one another, so that it is estimated from whole measurements.
"""

from __future__ import annotations

import argparse
import time
from collections import defaultdict
from collections.abc import Callable, Iterable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import lru_cache, partial

import numpy as np
from random_structures import JOINTS, NOISES, draw_axis, draw_theta, measure, random_structure

import dovetail

LINES = 200, 5_000
HEADER = "| {} | intervals | hold the truth | too low | too high |\n|---|---|---|---|---|"


@dataclass(frozen=True)
class Case:
    """The intervals of one measurement.

    Parameters
    ----------
    number, structure : int
    names : tuple of str
        Parameters as `joint.parameter`.
    below, above : (p,) bool arrays
        Whether the truth lies below or above its interval.
    verdicts : tuple of str
    seconds : float
    """

    number: int
    structure: int
    names: tuple[str, ...]
    below: np.ndarray
    above: np.ndarray
    verdicts: tuple[str, ...]
    seconds: float


@lru_cache(maxsize=32)
def structure(number: int, seed: int) -> dovetail.Assembly:
    """Return one of the structures; the joints take turns in coming first."""
    return dovetail.load(random_structure(np.random.default_rng([seed, 90, number]), JOINTS[number % len(JOINTS)]))


def identified(number: int, seed: int, structures: int, samples: int) -> Case:
    """Draw a case and identify it by the default method."""
    rng = np.random.default_rng([seed, 91, number])
    assembly = structure(number % structures, seed)
    theta = draw_theta(assembly, rng)
    assembly = assembly.on(draw_axis(assembly, rng, LINES))
    noise = NOISES[number // structures % len(NOISES)]
    measured = measure(assembly, theta, noise, rng, variance_given=number % 2 == 0)
    return outcome(number, number % structures, assembly, theta, measured, samples)


def outcome(number: int, drawn: int, assembly, theta: np.ndarray, measured, samples: int) -> Case:
    """Identify a measurement by the default method, and compare its intervals with the true parameters."""
    began = time.perf_counter()
    result = dovetail.identify(assembly, measured, samples=samples, model_error=0.0, cause_seconds=0, seed=number)
    seconds = time.perf_counter() - began
    ends = np.array(list((result.interval or {}).values()))
    return Case(
        number,
        drawn,
        tuple(parameter.name for parameter in assembly.parameters),
        theta < ends[:, 0],
        theta > ends[:, 1],
        tuple(row.verdict for row in result.table),
        seconds,
    )


def row(name: str, outcomes: np.ndarray) -> str:
    """Return one line of a table, from the number of the case, below and above (n, 3) of each interval."""
    number, below, above = outcomes.T
    missed = (below | above).astype(float)
    of_cases = np.bincount(number, missed - missed.mean())
    error = np.sqrt(np.sum(of_cases**2)) / len(missed)
    share = f"{1.0 - missed.mean():.1%} +- {error:.1%}"
    return f"| {name} | {len(missed)} | {share} | {below.mean():.1%} | {above.mean():.1%} |"


def table(title: str, cases: Iterable[Case], name_of: Callable[[Case, int], str]) -> str:
    """Return a table of the intervals by the name of their group."""
    groups = defaultdict[str, list[tuple[int, bool, bool]]](list)
    for case in cases:
        for index in range(len(case.names)):
            outcome = case.number, bool(case.below[index]), bool(case.above[index])
            groups[name_of(case, index)].append(outcome)
    return "\n".join([HEADER.format(title), *(row(name, np.array(group)) for name, group in sorted(groups.items()))])


def study(
    count: int, structures: int, seed: int, samples: int, processes: int, report: Callable[[str], object] = print
) -> list[Case]:
    """Identify the cases and print the tables."""
    one = partial(identified, seed=seed, structures=structures, samples=samples)
    if processes == 1:
        cases = [one(number) for number in range(count)]
    else:
        with ProcessPoolExecutor(processes) as pool:
            cases = list(pool.map(one, range(count)))
    report(table("all", cases, lambda case, index: "all"))
    report(table("verdict", cases, lambda case, index: case.verdicts[index]))
    report(table("parameter", cases, lambda case, index: case.names[index].rpartition(".")[2]))
    report(table("structure", cases, lambda case, index: f"{case.structure:2d}"))
    report(f"median {np.median([case.seconds for case in cases]):.2f} s a measurement")
    return cases


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=int, default=1000)
    parser.add_argument("--structures", type=int, default=30)
    parser.add_argument("--seed", type=int, default=0, help="of the structures, parameters, axes and noise")
    parser.add_argument("--samples", type=int, default=100)
    parser.add_argument("--processes", type=int, default=1)
    options = parser.parse_args()
    study(options.cases, options.structures, options.seed, options.samples, options.processes)
