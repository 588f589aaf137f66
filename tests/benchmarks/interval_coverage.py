"""Do the intervals hold the truth as often as they say? Random joints of the collet assembly with 1 % noise.

    python tests/benchmarks/interval_coverage.py [--cases 200] [--finer-mesh 4] [--model-error 0.0005]

The noise is complex, in every line one per cent of the standard deviation of the FRF. With a finer mesh the measurement
comes from a model with each element in four, the identification from the model that ships.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path

import numpy as np

import dovetail
from dovetail.dataset import latin_hypercube
from dovetail.identification.fitting import refine
from dovetail.identification.posterior import sample_posterior

ASSEMBLY = Path(__file__).resolve().parents[2] / "assemblies" / "bt40_er32.yaml"
NOISE = 0.01


def finer(factor: int) -> dovetail.Assembly:
    """Return the assembly with `factor` elements in the place of each."""
    description = json.loads(dovetail.load(ASSEMBLY).description.text)
    for part in description["substructures"].values():
        for section in part["sections"]:
            section["elements"] = int(section.get("elements", 1)) * factor
    description["joints"]["collet"]["elements_per_segment"] = factor
    return dovetail.load(description)


def study(cases: int, mesh: int, model_error: float) -> None:
    """Print coverage, R2 of the estimates and times."""
    assembly = dovetail.load(ASSEMBLY)
    truth = latin_hypercube(assembly, cases, seed=77)
    values = (assembly if mesh == 1 else finer(mesh)).frf(truth)
    places = assembly.to_unit(truth)
    inside, ranks, estimates, seconds, effective = [], [], [], [], []
    for index, clean in enumerate(values):
        deviation = NOISE * clean.std()
        normal = np.random.default_rng([9, index]).standard_normal((2, len(clean)))
        noisy = clean + deviation * (normal[0] + 1j * normal[1]) / np.sqrt(2.0)
        variance = np.full(len(clean), deviation**2)
        measured = dovetail.Frf(assembly.frequency, noisy, "accelerance", variance=variance)
        began = time.perf_counter()
        found = sample_posterior(assembly, measured, refine(assembly, measured), model_error=model_error, seed=index)
        seconds.append(time.perf_counter() - began)
        below = found.weight @ (found.fraction < places[index])
        ranks.append(below)
        inside.append((below > 0.05) & (below < 0.95))
        estimates.append(found.weight @ found.fraction)
        effective.append(found.effective)
    gains = 1.0 - 12.0 * np.mean((np.array(estimates) - places) ** 2, axis=0)
    print(f"{cases} cases, mesh {mesh} times finer, model error {model_error:g}")
    print("| parameter | 90 % intervals hold the truth | R2 of the estimate | uniform ranks, p |")
    print("|---|---|---|---|")
    for column, parameter in enumerate(assembly.parameters):
        share = np.mean([one[column] for one in inside])
        p = uniform(np.array(ranks)[:, column])
        print(f"| `{parameter.name}` | {share:.1%} | {gains[column]:.2f} | {p:.2f} |")
    print(f"| all | {np.mean(inside):.1%} | {gains.mean():.3f} | |")
    times = f"median {np.median(seconds):.1f} s, 95 % below {np.quantile(seconds, 0.95):.1f} s"
    print(
        f"\nTime of a case: {times}. Effective samples: median {np.median(effective):.0f}, least {min(effective):.0f}."
    )


def uniform(ranks: np.ndarray) -> float:
    """Return the probability that ranks as uneven as these are uniform (Kolmogorov and Smirnov)."""
    from scipy.stats import kstest

    return float(kstest(ranks, "uniform").pvalue)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=int, default=200)
    parser.add_argument("--finer-mesh", type=int, default=1)
    parser.add_argument("--model-error", type=float, default=0.0)
    given = parser.parse_args()
    study(given.cases, given.finer_mesh, given.model_error)
