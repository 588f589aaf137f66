"""How often the model that made the measurements is preferred, and a wrong one where the models coincide.

    python tests/benchmarks/model_choice.py [--comparisons 100] [--seed 0] [--samples 100] [--noise 0.05]

Each comparison has five tests of a mass on a mount over a covariate. Two models of its stiffness, one of which is
true, are drawn at random (shared, free, linear, exponential approach), and all unknowns from their priors. In as many
further comparisons a linear law is true and compared with a power law over covariates from 1 to 1.0001, where the two
coincide. The models are exact. `--noise` is a part of the mean amplitude; the larger it is, the less the models differ.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))
from processors import processor_time

from dovetail.comparison import ModelComparison
from dovetail.comparison.series_models import compared_model
from dovetail.interfaces import silent
from dovetail.registry import installed_components
from dovetail.series.description import Role
from dovetail.series.unknowns import SeriesUnknowns
from support.mounts_in_series import mount, series

RANGES = {
    "k": {"range": ["5e5 N/m", "2e6 N/m"], "scale": "log"},
    "c": {"range": ["10 N s/m", "200 N s/m"], "scale": "log"},
}
LINES, TESTS = np.arange(80.0, 280.0, 5.0), 5
MODELS = ("shared", "free", "linear", "exponential_approach")
COINCIDE = ("linear", "power")


def role(name: str) -> Role:
    """Return the role of the stiffness."""
    if name in ("shared", "free"):
        return Role(name)  # type: ignore[arg-type]
    return Role("law", installed_components().create("law", name), "level")


def comparison(names: tuple[str, str], levels: list[float], seed: int, samples: int, noise: float) -> ModelComparison:
    """Draw a series from the prior of the first model, and compare both."""
    random, assembly = np.random.default_rng([seed, 7]), mount(RANGES, LINES)
    nothing = [{"k": 1e6, "c": 40.0}] * len(levels)
    true, _ = series(assembly, nothing, {"k": role(names[0])}, noise, levels)
    unknowns = SeriesUnknowns(true)
    z = random.standard_normal((1, unknowns.count))
    fractions = [one.fractions(unknowns.for_test(number, z)) for number, one in enumerate(unknowns.maps)]
    truths = [dict(zip(("k", "c"), assembly.from_unit(fraction)[0].tolist(), strict=True)) for fraction in fractions]
    described, fitted = series(assembly, truths, {}, noise, levels, seed=1000 * seed)
    models = [described.with_roles({"k": role(name)}) for name in names]
    compared = [
        compared_model(name, model, fitted, samples, seed, silent) for name, model in zip(names, models, strict=True)
    ]
    return ModelComparison("mounts", tuple(compared))


def study(count: int, seed: int, samples: int, noise: float) -> tuple[Counter[str], Counter[str]]:
    """Return how often the right model, a wrong one or none was preferred: of different and of coinciding models."""
    different, coinciding = Counter[str](), Counter[str]()
    random = np.random.default_rng([seed, 8])
    for number in range(count):
        chosen = tuple(random.choice(MODELS, 2, replace=False).tolist())
        found = comparison(chosen, np.linspace(1.0, 5.0, TESTS).tolist(), 1000 * seed + number, samples, noise)
        gap, _ = found.difference(found.ranking[1])
        name = "none" if found.preferred is None else "right" if found.preferred.name == chosen[0] else "wrong"
        different[name] += 1
        different["log Z differs by more than 3"] += gap > 3.0
        different["right of these"] += gap > 3.0 and found.ranking[0].name == chosen[0]
        close = comparison(COINCIDE, np.linspace(1.0, 1.0001, TESTS).tolist(), 1000 * seed + number, samples, noise)
        name = "none" if close.preferred is None else "right" if close.preferred.name == COINCIDE[0] else "wrong"
        coinciding[name] += 1
    return different, coinciding


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    for option, value in (("comparisons", 100), ("seed", 0), ("samples", 100)):
        parser.add_argument(f"--{option}", type=int, default=value)
    parser.add_argument("--noise", type=float, default=0.05)
    options = parser.parse_args()
    began = processor_time()
    different, coinciding = study(options.comparisons, options.seed, options.samples, options.noise)
    print(f"Different models: {dict(different)}\nModels that coincide, preferred: {dict(coinciding)}")
    print(f"{processor_time() - began:.0f} s of processor time")
