"""Intervals of a series whose model is wrong, in the same way in all of its tests: how often they hold the true values.

    python tests/benchmarks/series_model_errors.py [--series 30] [--seed 0] [--samples 200] [--tests 5]

A clamped rod is measured at several torques. Modulus, density and diameter of the real rod differ from the described
ones by about 1 % (`--error`); the difference is that of one rod, the same in all tests of a series. The stiffness `k`
follows a law over the torque, and the other parameters are shared. For comparison, each first test is identified alone,
and in series whose tests have a rod of their own each (`--own`), errors are independent from test to test.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from processors import processor_time
from scipy.special import ndtr

import dovetail
from dovetail.inference.posterior import sample_posterior
from dovetail.registry import installed_components
from dovetail.series.description import Covariate, Role, SeriesDescription, SeriesTest
from dovetail.series.fitted_tests import fit_test
from dovetail.series.fitting import fit_series
from dovetail.series.sampling import sample_series
from dovetail.series.unknowns import SeriesUnknowns

ASSEMBLY = Path(__file__).resolve().parents[2] / "assemblies" / "series" / "clamped_rod.yaml"
LINES, NOISE = np.arange(100.0, 6000.0, 25.0), 0.01


def real_rod(random: np.random.Generator, error: float) -> dovetail.Assembly:
    """Return the assembly with a rod whose modulus, density and diameter are not quite the described ones."""
    young, density, diameter = np.exp(error * random.standard_normal(3) * [1.0, 1.0, 0.5])
    rod = {
        "model": "timoshenko_beam",
        "material": {"young": 206e9 * young, "density": 7850.0 * density, "poisson": 0.3, "loss_factor": 0.003},
        "sections": [{"length": 0.15, "outer": 0.02 * diameter, "elements": 15}],
    }
    return dovetail.load({"extends": str(ASSEMBLY), "substructures": {"rod": rod}}).on(LINES)


def outcomes(
    number: int, seed: int, samples: int, tests_each: int, error: float, *, own: bool
) -> dict[str, list[float]]:
    """Draw a series, identify it, and return whether the intervals hold the true values, by the kind of unknown."""
    random = np.random.default_rng([seed, 41, number])
    model, rod = dovetail.load(ASSEMBLY).on(LINES), real_rod(random, error)
    law = installed_components().create("law", "linear")
    torques = np.linspace(20.0, 100.0, tests_each).tolist()
    tests = tuple(SeriesTest(f"T{n}", model, (), {"torque": torque}) for n, torque in enumerate(torques))
    roles = {"k": Role("law", law, "torque")}
    described = SeriesDescription("rods", tests, {"torque": Covariate("torque", "N m")}, roles, Role("shared"))
    unknowns = SeriesUnknowns(described)
    z = 0.6 * random.standard_normal((1, unknowns.count))
    fitted = []
    for index, (test, one) in enumerate(zip(tests, unknowns.maps, strict=True)):
        theta = model.from_unit(one.fractions(unknowns.for_test(index, z)))[0]
        real = real_rod(random, error) if own else rod
        frf = dovetail.noisy_frf(dovetail.Frf(LINES, real.frf(theta), "accelerance"), NOISE, random)
        fitted.append(fit_test(test, [frf], number))
    fit = fit_series(unknowns, fitted)
    posterior = sample_series(unknowns, fitted, fit, samples=samples, seed=number)
    first = fitted[0]
    alone = sample_posterior(
        first.problem,
        first.judged.fit,
        samples=samples,
        model_error=first.judged.adequacy.error_in_intervals,
        seed=number,
    )
    found: dict[str, list[float]] = {"shared": [], "law": [], "first test alone": [], "width": []}
    assert posterior.shared is not None
    for column, unknown in enumerate(unknowns.shared):
        name = unknown.definition.name
        low, high = posterior.shared.interval()[name]
        truth = float(unknown.definition.from_unit(ndtr(z[0, column])))
        found["law" if unknown.parameter == "k" else "shared"].append(low <= truth <= high)
        if name != "k.last":
            alone_low, alone_high = alone.interval()[unknown.parameter]
            found["first test alone"].append(alone_low <= truth <= alone_high)
            found["width"].append(float(np.log(high / low) / np.log(alone_high / alone_low)))
    return found


def study(count: int, seed: int, samples: int, tests_each: int, error: float, *, own: bool) -> dict[str, list[float]]:
    """Identify the series, print the shares, and return the outcomes by kind."""
    groups: dict[str, list[float]] = {}
    began = processor_time()
    for number in range(count):
        for kind, held in outcomes(number, seed, samples, tests_each, error, own=own).items():
            groups.setdefault(kind, []).extend(held)
    print("| 90 % intervals | number | hold the truth |\n|---|---|---|")
    for kind in ("shared", "law", "first test alone"):
        held = np.array(groups[kind], dtype=float)
        error = np.sqrt(held.mean() * (1.0 - held.mean()) / len(held))
        print(f"| {kind} | {len(held)} | {held.mean():.1%} ± {error:.1%} |")
    print(f"Width of shared ones, over that of the first test alone: median {np.median(groups['width']):.2f}")
    print(f"{(processor_time() - began) / count:.1f} s of processor time a series")
    return groups


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    for option, value in (("series", 30), ("seed", 0), ("samples", 200), ("tests", 5)):
        parser.add_argument(f"--{option}", type=int, default=value)
    parser.add_argument("--error", type=float, default=0.01)
    parser.add_argument("--own", action="store_true")
    given = parser.parse_args()
    study(
        given.series,
        seed=given.seed,
        samples=given.samples,
        tests_each=given.tests,
        error=given.error,
        own=given.own,
    )
