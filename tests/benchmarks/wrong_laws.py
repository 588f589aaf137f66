"""How often a wrong law is noticed: a straight line is fitted where the stiffness saturates over the covariate.

    python tests/benchmarks/wrong_laws.py [--cases 200] [--seed 0] [--compared 40] [--samples 100]

Each series has five tests of a mass on a mount. The true stiffness approaches its last value exponentially, its
unknowns are drawn from their priors, and the noise is between 1 and 100 % of the mean amplitude. A wrong law is noticed
if the fit of the series reports a contradiction. Whether it can be noticed does not depend on Dovetail: SciPy searches
for the straight line whose FRFs, by the formula of a mass on a spring and a damper, come nearest to the true ones
without noise. The rise of the sum of squares has a noncentral chi-squared distribution with this distance, which gives
the probability that the best test at the same false-alarm rate notices the law. A case is distinguishable if it is 95 %
or more. As many series with a true straight line count the false alarms. Of the first `--compared` distinguishable
cases, `compare-models` ranks both laws.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import scipy

sys.path.insert(0, str(Path(__file__).parents[1]))
from processors import processor_time

from dovetail.comparison import ModelComparison
from dovetail.comparison.series_models import compared_model
from dovetail.interfaces import silent
from dovetail.registry import installed_components
from dovetail.series.description import Role, SeriesDescription
from dovetail.series.fitted_tests import FittedTest
from dovetail.series.fitting import CONTRADICTION, fit_series
from dovetail.series.unknowns import SeriesUnknowns
from support.mounts_in_series import mount, series

RANGES = {
    "k": {"range": ["5e5 N/m", "2e6 N/m"], "scale": "log"},
    "c": {"range": ["10 N s/m", "200 N s/m"], "scale": "log"},
}
BOUNDS = np.log([(5e5, 2e6), (5e5, 2e6), (10.0, 200.0)]).T
"""Of a straight line's unknowns: first and last stiffness, and the damping, as logarithms."""
LINES, LEVELS = np.arange(80.0, 280.0, 5.0), np.linspace(1.0, 5.0, 5)
NOISE = 0.01, 1.0
CERTAIN = 0.95
"""Probability with which the best test notices the wrong law of a distinguishable case."""
FREEDOM = 2 * len(LEVELS) - 3
"""Two values for each test, of which a line and a shared damping leave three."""


@dataclass(frozen=True, eq=False)
class Case:
    """A series that is identified with a straight line as its law.

    Parameters
    ----------
    described : SeriesDescription
    fitted : tuple of FittedTest
        One for each test.
    distance : float
        Least sum of squares of a straight line without noise, where each real and imaginary part has a variance of 1.
    """

    described: SeriesDescription
    fitted: tuple[FittedTest, ...]
    distance: float

    @property
    def noticed(self) -> bool:
        """Whether the fit reports a contradiction."""
        return fit_series(SeriesUnknowns(self.described), self.fitted).contradiction < CONTRADICTION

    @property
    def probability(self) -> float:
        """Probability with which the best test notices a wrong law."""
        return float(scipy.stats.ncx2.sf(scipy.stats.chi2.isf(CONTRADICTION, FREEDOM), FREEDOM, self.distance))

    def preferred(self, samples: int, seed: int) -> str:
        """Return the law that `compare-models` prefers; empty if it cannot tell."""
        models = []
        for name in ("linear", "exponential_approach"):
            series_with_law = self.described.with_roles({"k": law(name)})
            models.append(compared_model(name, series_with_law, self.fitted, samples, seed, silent))
        found = ModelComparison("mounts", tuple(models)).preferred
        return "" if found is None else found.name


def law(name: str) -> Role:
    """Return the role of a stiffness that follows a law."""
    return Role("law", installed_components().create("law", name), "level")


def case(true: str, number: int, seed: int) -> Case:
    """Draw a series whose stiffness follows a true law."""
    random, assembly = np.random.default_rng([seed, number, 81]), mount(RANGES, LINES)
    noise, levels = float(np.exp(random.uniform(*np.log(NOISE)))), LEVELS.tolist()
    nothing = [{"k": 1e6, "c": 40.0}] * len(levels)
    roles = {"k": law(true), "c": Role("shared")}
    unknowns = SeriesUnknowns(series(assembly, nothing, roles, noise, levels)[0])
    z = random.standard_normal((1, unknowns.count))
    fractions = [one.fractions(unknowns.for_test(test, z)) for test, one in enumerate(unknowns.maps)]
    truths = np.concatenate([assembly.from_unit(fraction) for fraction in fractions])
    named = [dict(zip(("k", "c"), theta.tolist(), strict=True)) for theta in truths]
    roles = {"k": law("linear"), "c": Role("shared")}
    described, fitted = series(assembly, named, roles, noise, levels, seed=1000 * (1000 * seed + number))
    return Case(described, fitted, distance_from_lines(truths, noise))


def accelerance(k: np.ndarray, c: np.ndarray) -> np.ndarray:
    """Return the FRFs (n_tests, n_lines) of a mass of 1 kg on springs and dampers, by the formula."""
    omega = 2.0 * np.pi * LINES
    return -(omega**2) / (k[:, np.newaxis] - omega**2 + 1j * omega * c[:, np.newaxis])


def distance_from_lines(truths: np.ndarray, noise: float) -> float:
    """Return the least sum of squares between true FRFs, for k and c (n_tests, 2), and those of a straight line."""
    exact = accelerance(*truths.T)
    weight = np.sqrt(2.0) / (noise * np.abs(exact).mean(axis=1, keepdims=True))
    share = (LEVELS - LEVELS[0]) / np.ptp(LEVELS)

    def residuals(logarithms: np.ndarray) -> np.ndarray:
        first, last, damping = logarithms
        k, c = np.exp(first + (last - first) * share), np.full(len(share), np.exp(damping))
        return ((accelerance(k, c) - exact) * weight).view(np.float64).ravel()

    ends = np.log([truths[0, 0], truths[-1, 0], truths[0, 1]])
    middle = np.log([truths[:, 0].mean(), truths[:, 0].mean(), truths[0, 1]])
    starts = np.clip([ends, middle, (ends + middle) / 2.0], BOUNDS[0] + 1e-9, BOUNDS[1] - 1e-9)
    return min(2.0 * scipy.optimize.least_squares(residuals, start, bounds=BOUNDS).cost for start in starts)


def study(cases: int, seed: int, compared: int, samples: int) -> list[str]:
    """Return the lines of the table."""
    wrong = [case("exponential_approach", number, seed) for number in range(cases)]
    right = [case("linear", number, seed + 1) for number in range(cases)]
    clear = [one for one in wrong if one.probability >= CERTAIN]
    hardly = [one for one in wrong if one.probability < CERTAIN]
    rows = [("saturates, distinguishable", clear), ("saturates, not distinguishable", hardly), ("straight line", right)]
    lines = ["| true law | series | a straight line is noticed as wrong | by the best test |", "|---|---|---|---|"]
    for name, group in rows:
        noticed, expected = sum(one.noticed for one in group), sum(one.probability for one in group)
        lines.append(f"| {name} | {len(group)} | {noticed} | {expected:.1f} |")
    chosen = Counter(one.preferred(samples, number) for number, one in enumerate(clear[:compared]))
    ranked = f"{chosen['exponential_approach']} times the saturating law, {chosen['linear']} times the straight line"
    return [*lines, f"Of {len(clear[:compared])} distinguishable series `compare-models` prefers {ranked}."]


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    for option, value in (("cases", 200), ("seed", 0), ("compared", 40), ("samples", 100)):
        parser.add_argument(f"--{option}", type=int, default=value)
    options = parser.parse_args()
    began = processor_time()
    print("\n".join(study(options.cases, options.seed, options.compared, options.samples)))
    print(f"{processor_time() - began:.0f} s of processor time")
