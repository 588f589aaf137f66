"""Does a second point narrow the intervals by as much as the plan says? Random joints of the collet assembly.

    python tests/benchmarks/second_point.py [--cases 40] [--finer-mesh 4] [--model-error 0.0005]

The plan chooses two points. Each case is measured at the first alone and at both, with the noise that the plan assumes:
complex, in every line of either FRF one per cent of the standard deviation of the FRF at the described response. The
cases are the plan's own parameter vectors. With a finer mesh the measurement comes from a model with each element in
four, which the plan does not know of.
"""

from __future__ import annotations

import argparse
import json

import numpy as np
from interval_coverage import ASSEMBLY, finer

import dovetail
from dovetail.dataset import latin_hypercube
from dovetail.evaluation import plan
from dovetail.evaluation.planning import NOISE
from dovetail.identification.fitting import refine
from dovetail.identification.posterior import Posterior, quantiles, sample_posterior


def study(cases: int, mesh: int, model_error: float) -> None:
    """Print, for each parameter, how much narrower its interval becomes: as predicted, and as achieved."""
    described = dovetail.load(ASSEMBLY)
    planned = plan(described, samples=cases, seed=0)
    first, second = planned.points[0], planned.seconds[0]
    both = at_both(described, first, second)
    true = both if mesh == 1 else at_both(finer(mesh), first, second)
    theta = latin_hypercube(described, cases, seed=0)
    deviations = NOISE * described.frf(theta).std(axis=1)
    widths, inside = [], []
    for case, (one, deviation) in enumerate(zip(theta, deviations, strict=True)):
        measured = noisy(true, one, deviation, np.random.default_rng([7, case]))
        found = [posterior(both.at(0), measured[:1], model_error, case), posterior(both, measured, model_error, case)]
        ends = [quantiles(one.fraction, one.weight, [0.05, 0.95]) for one in found]
        place = described.to_unit(one)
        widths.append([high - low for low, high in ends])
        inside.append([(low < place) & (place < high) for low, high in ends])
    points = " and ".join(f"{one.substructure}, {one.position * 1e3:g} mm" for one in (first, second))
    print(f"{cases} cases, {points}; mesh {mesh} times finer, model error {model_error:g}\n")
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


def noisy(
    assembly: dovetail.Assembly, theta: np.ndarray, deviation: float, random: np.random.Generator
) -> list[dovetail.Frf]:
    """Return the FRF of each response with noise of one size."""
    normal = random.standard_normal((2, len(assembly.frequency), 2)) @ [1.0, 1.0j] / np.sqrt(2.0)
    variance = np.full(len(assembly.frequency), deviation**2)
    return [
        dovetail.Frf(assembly.frequency, values, "accelerance", variance=variance)
        for values in assembly.frfs(theta) + deviation * normal
    ]


def posterior(assembly: dovetail.Assembly, frfs: list[dovetail.Frf], model_error: float, seed: int) -> Posterior:
    """Return the posterior given the FRFs of all responses."""
    return sample_posterior(assembly, frfs, refine(assembly, frfs), model_error=model_error, seed=seed)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=int, default=40)
    parser.add_argument("--finer-mesh", type=int, default=1)
    parser.add_argument("--model-error", type=float, default=0.0)
    given = parser.parse_args()
    study(given.cases, given.finer_mesh, given.model_error)
