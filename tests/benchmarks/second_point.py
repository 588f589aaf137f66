"""Does a second point narrow the intervals by as much as the plan says? Random joints of the collet assembly.

    python tests/benchmarks/second_point.py [--cases 40]

The plan chooses two points. Each case is measured at the first alone and at both, with the noise that the plan assumes:
complex, in every line of either FRF one per cent of the standard deviation of the FRF at the described response. The
cases are the plan's own parameter vectors.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import numpy as np

import dovetail
from dovetail.dataset import latin_hypercube
from dovetail.evaluation import plan
from dovetail.evaluation.planning import NOISE
from dovetail.identification.fitting import refine
from dovetail.identification.posterior import quantiles, sample_posterior

ASSEMBLY = Path(__file__).resolve().parents[2] / "assemblies" / "bt40_er32.yaml"


def study(cases: int) -> None:
    """Print, for each parameter, how much narrower its interval becomes: as predicted, and as achieved."""
    described = dovetail.load(ASSEMBLY)
    planned = plan(described, samples=cases, seed=0)
    first, second = planned.points[0], planned.seconds[0]
    both = at_both(described, first, second)
    theta = latin_hypercube(described, cases, seed=0)
    deviations = NOISE * described.frf(theta).std(axis=1)
    found = [
        widths(both, one, deviation, case) for case, (one, deviation) in enumerate(zip(theta, deviations, strict=True))
    ]
    alone, together = np.mean(found, axis=0)
    achieved, predicted = together / alone, np.array(list(planned.narrowing.values()))
    points = " and ".join(f"{one.substructure}, {one.position * 1e3:g} mm" for one in (first, second))
    print(f"{cases} cases; {points}; mean width of the 90 % interval from both over that from the first alone\n")
    print(
        "| parameter | first point alone [% of the range] | both | ratio | ratio as planned | achieved over planned |"
    )
    print("|---|---|---|---|---|---|")
    for row in zip(described.parameters, 100 * alone, 100 * together, achieved, predicted, strict=True):
        parameter, one, two, ratio, promised = row
        print(f"| `{parameter.name}` | {one:.2f} | {two:.2f} | {ratio:.2f} | {promised:.2f} | {ratio / promised:.2f} |")
    print(f"\nLargest difference: {100 * np.max(np.abs(achieved / predicted - 1)):.0f} %.")


def at_both(described: dovetail.Assembly, *points) -> dovetail.Assembly:
    """Return the assembly measured at some points."""
    whole = json.loads(described.description.text)
    own = whole.pop("response")
    places = [{"at": point.substructure, "position": point.position} for point in points]
    return dovetail.load(whole | {"responses": [own | place for place in places]})


def widths(both: dovetail.Assembly, theta: np.ndarray, deviation: float, case: int) -> list[np.ndarray]:
    """Return the widths of the 90 % intervals, in fractions of the ranges, from the first point and from both."""
    normal = np.random.default_rng([7, case]).standard_normal((2, len(both.frequency), 2)) @ [1, 1j] / np.sqrt(2.0)
    variance = np.full(len(both.frequency), deviation**2)
    measured = [
        dovetail.Frf(both.frequency, values, "accelerance", variance=variance)
        for values in both.frfs(theta) + deviation * normal
    ]
    found = []
    for assembly, frfs in ((both.at(0), measured[:1]), (both, measured)):
        posterior = sample_posterior(assembly, frfs, refine(assembly, frfs), model_error=0.0, seed=case)
        lower, upper = quantiles(posterior.fraction, posterior.weight, [0.05, 0.95])
        found.append(upper - lower)
    return found


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=int, default=40)
    study(parser.parse_args().cases)
