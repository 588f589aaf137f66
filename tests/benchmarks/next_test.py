"""Predicted and achieved intervals of a joint after the test that `plan` proposes: two tools, one collet.

    python tests/benchmarks/next_test.py [--cases 8] [--seed 0] [--samples 200]

One collet with the rod T0 is measured with 1 % noise, at 600 lines; the next test is T0 again or one of the tools T1,
T2, T3. All parameters are shared. For random joints, the width of each 90 % interval with the proposed test is
compared with the prediction, on average over the cases; and for all tools, the predicted widths.
"""

from __future__ import annotations

import argparse
from collections import Counter
from pathlib import Path

import numpy as np
from processors import processor_time

import dovetail
from dovetail.design import SeriesPlan, plan_next_test
from dovetail.series.description import Role, SeriesDescription, SeriesTest
from dovetail.series.fitted_tests import FittedTest, fit_test
from dovetail.series.fitting import fit_series
from dovetail.series.result import SeriesIdentification
from dovetail.series.sampling import sample_series
from dovetail.series.unknowns import SeriesUnknowns

ASSEMBLIES = Path(__file__).resolve().parents[2] / "assemblies"
TOOLS = ("T0", "T1", "T2", "T3")
NOISE, LINES = 0.01, np.linspace(100.0, 9000.0, 600)


def tools() -> dict[str, SeriesTest]:
    """Return a test with each tool, without a measurement."""
    files = {name: ASSEMBLIES / "campaign" / f"h0_{name.lower()}.yaml" for name in TOOLS}
    return {name: SeriesTest(name, dovetail.load(file).on(LINES), ()) for name, file in files.items()}


def made(test: SeriesTest, theta: np.ndarray, seed: tuple[int, ...]) -> FittedTest:
    """Make a test, and fit it alone."""
    frf = dovetail.noisy_frf(test.assembly.simulate(theta), NOISE, np.random.default_rng(seed))
    return fit_test(test, [frf], 0, 0.0)


def identified(tests: list[FittedTest], candidates: tuple[SeriesTest, ...], samples: int) -> SeriesIdentification:
    """Identify a series in which all parameters are shared."""
    described = SeriesDescription("collet", tuple(one.test for one in tests), {}, {}, Role("shared"), 0, candidates)
    unknowns = SeriesUnknowns(described)
    fit = fit_series(unknowns, tests)
    posterior = sample_series(unknowns, tests, fit, samples=samples)
    return SeriesIdentification(described, tuple(tests), unknowns, fit, posterior)


def widths(result: SeriesIdentification) -> dict[str, float]:
    """Return the width of each interval, over the width of the range on the parameter's scale."""
    assert result.posterior is not None
    shared = result.posterior.shared
    assert shared is not None
    known = {unknown.definition.name: unknown.definition for unknown in result.unknowns.shared}
    return {name: float(np.diff(known[name].to_unit(np.array(ends)))[0]) for name, ends in shared.interval().items()}


def case(number: int, seed: int, samples: int) -> tuple[SeriesPlan, dict[str, float], dict[str, float]]:
    """Return the plan of a random joint, and the widths of the intervals before and after the proposed test."""
    tests = tools()
    fraction = np.random.default_rng([seed, number, 12]).uniform(0.15, 0.85, len(tests["T0"].assembly.parameters))
    theta = tests["T0"].assembly.from_unit(fraction)
    first = made(tests["T0"], theta, (seed, number, 0))
    result = identified([first], tuple(tests.values()), samples)
    planned = plan_next_test(result, noise=NOISE, seed=number)
    again = SeriesTest("next", tests[planned.tests[0].name].assembly, ())
    both = identified([first, made(again, theta, (seed, number, 1))], (), samples)
    return planned, widths(result), widths(both)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    for option, value in (("cases", 8), ("seed", 0), ("samples", 200)):
        parser.add_argument(f"--{option}", type=int, default=value)
    options = parser.parse_args()
    began = processor_time()
    found = [case(number, options.seed, options.samples) for number in range(options.cases)]
    proposed = Counter(planned.tests[0].name for planned, _, _ in found)
    print(f"Proposed: {dict(proposed)}\n| parameter | width with T0 | with the next test | predicted | ratio |", end="")
    print(" " + " | ".join(f"with {tool}, predicted" for tool in TOOLS) + " |\n|" + "---|" * (5 + len(TOOLS)))
    ratios = []
    for name in found[0][1]:
        before, after = (np.mean([one[index][name] for one in found]) for index in (1, 2))
        predicted = np.mean([before_one[name] * planned.tests[0].narrowing[name] for planned, before_one, _ in found])
        each = [np.mean([_narrowing(planned, tool)[name] for planned, _, _ in found]) for tool in TOOLS]
        ratios.append(after / predicted)
        print(f"| {name} | {before:.1%} | {after:.1%} | {predicted:.1%} | {ratios[-1]:.2f} |", end="")
        print(" " + " | ".join(f"{one:.2f}" for one in each) + " |")
    print(f"Achieved over predicted: mean {np.mean(ratios):.2f}, from {min(ratios):.2f} to {max(ratios):.2f}")
    print(f"{(processor_time() - began) / options.cases:.0f} s of processor time a case")


def _narrowing(planned: SeriesPlan, name: str) -> dict[str, float]:
    return next(test.narrowing for test in planned.tests if test.name == name)


if __name__ == "__main__":
    main()
