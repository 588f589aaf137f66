"""How often the 90 % intervals of random series hold the true values: shared values, laws, scatter, values of tests.

    python tests/benchmarks/series_coverage.py [--series 200] [--seed 0] [--samples 200]

Each series has five to eight tests of a mass on a mount. Its stiffness is shared, free, scatters from test to test, or
follows one of three laws over a covariate; its damping is shared or free. All unknowns are drawn from their priors, and
the model is exact (`model_error=0`), so that right intervals hold nine tenths of the true values. `+-` is the standard
error of the share, from whole series.
"""

from __future__ import annotations

import argparse
import sys
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path

import numpy as np
from scipy.special import ndtr

sys.path.insert(0, str(Path(__file__).parents[1]))
from processors import processor_time

from dovetail.registry import installed_components
from dovetail.series.description import Role, SeriesDescription, SeriesTest
from dovetail.series.fitting import fit_series
from dovetail.series.sampling import sample_series
from dovetail.series.unknowns import SeriesUnknowns
from support.mounts_in_series import mount, series

RANGES = {
    "k": {"range": ["5e5 N/m", "2e6 N/m"], "scale": "log"},
    "c": {"range": ["10 N s/m", "200 N s/m"], "scale": "log"},
}
LINES = np.arange(80.0, 280.0, 4.0)
NOISE = 0.05
LAWS = ("linear", "power", "exponential_approach")
STIFFNESSES = ("shared", "free", "varying", "law")


def roles(random: np.random.Generator) -> dict[str, Role]:
    """Draw the roles of stiffness and damping."""
    kind = STIFFNESSES[random.integers(len(STIFFNESSES))]
    law = installed_components().create("law", LAWS[random.integers(len(LAWS))])
    of_k = {
        "shared": Role("shared"),
        "free": Role("free"),
        "varying": Role("varying"),
        "law": Role("law", law, "level"),
    }
    return {"k": of_k[kind], "c": Role(("shared", "free")[random.integers(2)])}


def identified(number: int, seed: int, samples: int) -> list[tuple[str, bool]]:
    """Draw a series, identify it, and return whether the interval of each unknown holds it, with its kind."""
    random = np.random.default_rng([seed, 95, number])
    assembly, chosen = mount(RANGES, LINES), roles(random)
    levels = np.linspace(1.0, 5.0, int(random.integers(5, 9))).tolist()
    tests = tuple(SeriesTest(f"T{n}", assembly, (), {"level": level}) for n, level in enumerate(levels))
    unknowns = SeriesUnknowns(SeriesDescription("truth", tests, {}, chosen))
    z = random.standard_normal((1, unknowns.count))
    truths = [
        assembly.from_unit(test_map.fractions(unknowns.for_test(k, z)))[0] for k, test_map in enumerate(unknowns.maps)
    ]
    named = [{"k": float(theta[0]), "c": float(theta[1])} for theta in truths]
    described, fitted = series(assembly, named, chosen, NOISE, levels, seed=1000 * number)
    fit = fit_series(unknowns := SeriesUnknowns(described), fitted)
    posterior = sample_series(unknowns, fitted, fit, samples=samples, seed=number)
    outcomes = []
    for column, unknown in enumerate(unknowns.shared):
        low, high = posterior.shared.interval()[unknown.definition.name]
        truth = float(unknown.definition.from_unit(ndtr(z[0, column])))
        outcomes.append((kind_of(unknown.kind, chosen[unknown.parameter]), low <= truth <= high))
    for of_test, theta in zip(posterior.tests, truths, strict=True):
        for name, truth in zip(of_test.names, theta.tolist(), strict=True):
            if chosen[name].name in ("free", "varying"):
                low, high = of_test.interval()[name]
                outcomes.append((f"{chosen[name].name} value of a test", low <= truth <= high))
    return outcomes


def kind_of(kind: str, role: Role) -> str:
    """Return the group of an unknown in the table."""
    if kind == "scatter":
        return "scatter"
    return "unknown of a law" if role.name == "law" else "mean" if role.name == "varying" else "shared value"


def study(
    count: int, seed: int, samples: int, report: Callable[[str], object] = print
) -> dict[str, list[tuple[int, bool]]]:
    """Identify the series and print the table; return the outcomes by kind, each with the number of its series."""
    groups, began = defaultdict[str, list[tuple[int, bool]]](list), processor_time()
    for number in range(count):
        for kind, inside in identified(number, seed, samples):
            groups[kind].append((number, inside))
    report("| unknowns | intervals | hold the truth |\n|---|---|---|")
    for kind, outcomes in sorted(groups.items()):
        numbers, inside = np.array([one for one, _ in outcomes]), np.array([held for _, held in outcomes], dtype=float)
        error = np.sqrt(np.sum(np.bincount(numbers, inside - inside.mean()) ** 2)) / len(inside)
        report(f"| {kind} | {len(inside)} | {inside.mean():.1%} +- {error:.1%} |")
    report(f"{(processor_time() - began) / count:.2f} s of processor time a series")
    return groups


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--series", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0, help="of the series, their unknowns and noise")
    parser.add_argument("--samples", type=int, default=200)
    options = parser.parse_args()
    study(options.series, options.seed, options.samples)
