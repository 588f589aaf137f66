"""Are genuine measurements of any structure fitted down to their noise? 25 random structures, three kinds of noise.

    python tests/benchmarks/genuine_measurements.py [--cases 500] [--seed 0] [--lines 200,50000] [--only 17]

Every case draws parameters anywhere in their ranges, and a frequency axis of its own: start, step, 200 to 50,000 lines
of the band by default. The noise is 1 % of each value (multiplicative), 1 % of the FRF's standard deviation (additive),
or that of an H1 estimate from 8 to 64 averages. Half of the measurements give their variance, or coherence and
averages; for the others it has to be estimated. The table counts the cases that are reported to be fitted down to the
noise, those whose chi-squared per degree of freedom is 0.93 to 1.07, those whose fit is as good as the true
parameters, and those reported as found by few of many searches. Failures come first, with the number by which `--only`
repeats them alone.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import lru_cache, partial

import numpy as np
from random_structures import JOINTS, NOISES, Noise, draw_axis, draw_theta, measure, random_structure

import dovetail

STRUCTURES = 25
CHI_SQUARED = 0.93, 1.07
HEADER = (
    "| noise | reaches the noise | chi-squared 0.93 to 1.07 | right minimum | found by few | median time | longest |\n"
    "|---|---|---|---|---|---|---|"
)


@dataclass(frozen=True)
class Case:
    """What became of one measurement.

    Parameters
    ----------
    number : int
    noise : {"multiplicative", "additive", "H1"}
    variance_given : bool
        Whether the measurement shows its random error.
    lines, unknowns : int
    word : str
        How well the model is said to fit.
    chi_squared : float
    deviation : float
        Standard deviation of chi-squared by chance.
    at_truth : float
        Chi-squared of the true parameters, with the same variance.
    starts, agreeing : int
    found_by_few : bool
        Whether this is reported.
    seconds : float
        From the measurement to the verdict, without the planning of the engine.
    """

    number: int
    noise: Noise
    variance_given: bool
    lines: int
    unknowns: int
    word: str
    chi_squared: float
    deviation: float
    at_truth: float
    starts: int
    agreeing: int
    found_by_few: bool
    seconds: float

    @property
    def to_the_noise(self) -> bool:
        """Whether the program says so."""
        return self.word == "to the noise"

    @property
    def inside(self) -> bool:
        """Whether chi-squared is what noise leaves."""
        return CHI_SQUARED[0] <= self.chi_squared <= CHI_SQUARED[1]

    @property
    def right(self) -> bool:
        """Whether the fit is as good as the true parameters: the sum of squares is lowest near them."""
        return self.chi_squared <= 1.001 * self.at_truth

    def describe(self) -> str:
        """Return a line on what went wrong."""
        wrong = [] if self.to_the_noise else [f"said to be '{self.word}'"]
        wrong += [] if self.inside else [f"chi-squared {self.chi_squared:.3f} (by chance +-{self.deviation:.3f})"]
        wrong += [] if self.right else [f"another minimum: {self.chi_squared:.3f}, not {self.at_truth:.3f}"]
        wrong += ["reported as found by few searches"] if self.found_by_few else []
        given = "variance given" if self.variance_given else "variance unknown"
        return (
            f"case {self.number}, structure {self.number % STRUCTURES}: {'; '.join(wrong)} ({self.noise}, {given}, "
            f"{self.lines} lines, {self.unknowns} unknowns, {self.agreeing} of {self.starts} searches agree, "
            f"{self.seconds:.1f} s)"
        )


@lru_cache(maxsize=STRUCTURES)
def structure(number: int, seed: int) -> dovetail.Assembly:
    """Return one of the structures; the joints take turns in coming first."""
    return dovetail.load(random_structure(np.random.default_rng([seed, number]), JOINTS[number % len(JOINTS)]))


def drawn(number: int, seed: int, lines: tuple[int, int]) -> tuple[dovetail.Assembly, dovetail.Frf, np.ndarray]:
    """Return the assembly of a case on the measurement's lines, the measurement and the true parameters."""
    rng = np.random.default_rng([seed, STRUCTURES, number])
    assembly = structure(number % STRUCTURES, seed)
    theta = draw_theta(assembly, rng)
    assembly = assembly.on(draw_axis(assembly, rng, lines))
    noise = NOISES[number // 2 % len(NOISES)]
    return assembly, measure(assembly, theta, noise, rng, variance_given=number % 2 == 0), theta


def identified(number: int, seed: int, lines: tuple[int, int]) -> Case:
    """Draw a case and identify it."""
    assembly, measured, theta = drawn(number, seed, lines)
    assembly.frf_jacobian(theta)
    began = time.perf_counter()
    result = dovetail.identify(assembly, measured, "refined")
    seconds = time.perf_counter() - began
    assert result.fit is not None
    noise = NOISES[number // 2 % len(NOISES)]
    squares = np.abs(measured.values - assembly.frf(theta)) ** 2
    return Case(
        number,
        noise,
        number % 2 == 0,
        len(measured.frequency),
        len(theta),
        word(result),
        result.fit.chi_squared,
        float(np.sqrt(2.0 / result.fit.degrees_of_freedom)),
        float(2.0 * np.sum(result.fit.used * squares / result.fit.variance)) / result.fit.degrees_of_freedom,
        result.fit.starts,
        result.fit.agreeing,
        any("searches ended in this fit" in reason for reason in result.adequacy.reasons),
        seconds,
    )


def word(result: dovetail.Identification) -> str:
    """Return how well the model is said to fit."""
    adequacy = getattr(result, "adequacy", None)
    if adequacy is not None:
        return str(adequacy.word)
    return "to the noise" if result.is_trustworthy else "not trustworthy"


def row(name: str, cases: list[Case]) -> str:
    """Return one line of the table."""
    seconds = [case.seconds for case in cases]
    counts = [
        sum(getattr(case, what) for case in cases) for what in ("to_the_noise", "inside", "right", "found_by_few")
    ]
    cells = " | ".join(f"{count} of {len(cases)}" for count in counts)
    return f"| {name} | {cells} | {np.median(seconds):.2f} s | {max(seconds):.2f} s |"


def study(
    numbers: Iterable[int],
    seed: int,
    processes: int,
    report: Callable[[str], object] = print,
    lines: tuple[int, int] = (200, 50_000),
) -> list[Case]:
    """Identify the cases, and print the table and the failures."""
    cases = []
    for case in _each(partial(identified, seed=seed, lines=lines), numbers, processes):
        cases.append(case)
        if not (case.to_the_noise and case.inside and case.right):
            report(case.describe())
    report(HEADER)
    for noise in NOISES:
        for variance_given in (True, False):
            chosen = [case for case in cases if (case.noise, case.variance_given) == (noise, variance_given)]
            if chosen:
                report(row(f"{noise}, variance {'given' if variance_given else 'unknown'}", chosen))
    report(row("all", cases))
    return cases


def _each(one: Callable[[int], Case], numbers: Iterable[int], processes: int) -> Iterator[Case]:
    if processes == 1:
        yield from map(one, numbers)
        return
    with ProcessPoolExecutor(processes) as pool:
        yield from pool.map(one, numbers)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=int, default=500)
    parser.add_argument("--seed", type=int, default=0, help="of the structures, parameters, axes and noise")
    parser.add_argument("--processes", type=int, default=1)
    parser.add_argument("--lines", default="200,50000", help="the fewest and the most of a measurement")
    parser.add_argument("--only", type=int, help="this case alone")
    options = parser.parse_args()
    chosen = range(options.cases) if options.only is None else [options.only]
    fewest, most = map(int, options.lines.split(","))
    study(chosen, options.seed, options.processes, partial(print, flush=True), (fewest, most))
