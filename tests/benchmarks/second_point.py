"""Does a second point narrow the intervals by as much as the plan says? Random joints of the collet assembly.

    python tests/benchmarks/second_point.py [--cases 40]

The plan chooses two points. Each case is measured at the first alone and at both, with the noise that the plan assumes:
complex, in every line of either FRF one per cent of the standard deviation of the FRF at the described response. The
cases are the plan's own parameter vectors, and the model is exact.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import numpy as np

import dovetail
from dovetail.dataset import latin_hypercube
from dovetail.design import plan_measurements
from dovetail.design.experiment_design import NOISE
from dovetail.inference.fitting import refine
from dovetail.inference.posterior import ModelError, Posterior, quantiles, sample_posterior
from dovetail.problem import Problem

ASSEMBLY = Path(__file__).resolve().parents[2] / "assemblies" / "bt40_er32.yaml"


def study(cases: int) -> None:
    """Print, for each parameter, how much narrower its interval becomes: as predicted, and as achieved."""
    described = dovetail.load(ASSEMBLY)
    planned = plan_measurements(described, samples=cases, seed=0)
    first, second = planned.points[0], planned.seconds[0]
    both = at_both(described, first, second)
    theta = latin_hypercube(described, cases, seed=0)
    deviations = NOISE * described.frf(theta).std(axis=1)
    widths, inside = [], []
    for case, (one, deviation) in enumerate(zip(theta, deviations, strict=True)):
        measured = measure(both, one, deviation, np.random.default_rng([7, case]))
        found = [posterior(both.at(0), measured[:1], case), posterior(both, measured, case)]
        ends = [quantiles(one.fraction, one.weight, [0.05, 0.95]) for one in found]
        place = described.to_unit(one)
        widths.append([high - low for low, high in ends])
        inside.append([(low < place) & (place < high) for low, high in ends])
    points = " and ".join(f"{one.substructure}, {one.position * 1e3:g} mm" for one in (first, second))
    print(f"{cases} cases, {points}; mean width of the 90 % interval\n")
    print_table(described, np.mean(widths, axis=0), np.array(list(planned.narrowing.values())))
    alone, together = np.mean(inside, axis=(0, 2))
    print(f"The 90 % intervals hold the truth in {alone:.1%} from the first point alone, in {together:.1%} from both.")


def print_table(described: dovetail.Assembly, widths: np.ndarray, predicted: np.ndarray) -> None:
    """Print mean widths (2, n_params) of the intervals, in fractions of the ranges, and their predicted ratios."""
    achieved = widths[1] / widths[0]
    print(
        "| parameter | first point alone [% of the range] | both | ratio | ratio as planned | achieved over planned |"
    )
    print("|---|---|---|---|---|---|")
    for parameter, alone, both, ratio, planned in zip(
        described.parameters, *(100.0 * widths), achieved, predicted, strict=True
    ):
        shown = f"{alone:.2f} | {both:.2f} | {ratio:.2f} | {planned:.2f} | {ratio / planned:.2f}"
        print(f"| `{parameter.name}` | {shown} |")
    print(f"\nLargest difference: {100 * np.max(np.abs(achieved / predicted - 1)):.0f} %.")


def at_both(described: dovetail.Assembly, *points) -> dovetail.Assembly:
    """Return the assembly measured at some points."""
    whole = json.loads(described.description.text)
    own = whole.pop("response")
    places = [{"at": point.substructure, "position": point.position} for point in points]
    return dovetail.load(whole | {"responses": [own | place for place in places]})


def measure(
    assembly: dovetail.Assembly, theta: np.ndarray, deviation: float, random: np.random.Generator
) -> list[dovetail.Frf]:
    """Return the FRF of each response with noise of one size."""
    normal = random.standard_normal((2, len(assembly.frequency), 2)) @ [1.0, 1.0j] / np.sqrt(2.0)
    variance = np.full(len(assembly.frequency), deviation**2)
    return [
        dovetail.Frf(assembly.frequency, values, "accelerance", variance=variance)
        for values in assembly.frfs(theta) + deviation * normal
    ]


def posterior(assembly: dovetail.Assembly, frfs: list[dovetail.Frf], seed: int) -> Posterior:
    """Return the posterior given the FRFs of all responses."""
    return sample_posterior(
        Problem.of(assembly, frfs), refine(Problem.of(assembly, frfs)), model_error=ModelError(0.0), seed=seed
    )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=int, default=40)
    study(parser.parse_args().cases)
