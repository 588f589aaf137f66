"""The Gaussian form of the posterior: its time, how often its intervals hold the truth, and when it warns.

    python tests/benchmarks/laplace_coverage.py [--cases 200] [--sampled 40] [--finer-mesh 4] [--model-error 0.0005]

Random joints of the collet assembly with complex noise of one per cent of the FRF's standard deviation in every line.
The first `sampled` of them are sampled as well, and the intervals of both forms compared.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from processors import processor_time

import dovetail
from dovetail.dataset import latin_hypercube
from dovetail.inference.fitting import Fit, refine
from dovetail.inference.posterior import (
    Posterior,
    laplace_posterior,
    quantiles,
    sample_posterior,
    typical_model_error,
)
from dovetail.measurement import noisy_frf
from dovetail.problem import Problem
from dovetail_bench.evaluation.mesh_refinement import finer

ASSEMBLY = Path(__file__).resolve().parents[2] / "assemblies" / "bt40_er32.yaml"
NOISE = 0.01


@dataclass(frozen=True)
class Case:
    """One joint: where it is on the ranges, what was measured of it, and the fit."""

    index: int
    place: np.ndarray
    measured: dovetail.Frf
    fit: Fit


def cases(assembly: dovetail.Assembly, count: int, mesh: int) -> Iterator[Case]:
    """Yield random joints with their noisy FRFs and fits."""
    truth = latin_hypercube(assembly, count, seed=77)
    values = finer(assembly, mesh).frf(truth)
    for index, (place, clean) in enumerate(zip(assembly.to_unit(truth), values, strict=True)):
        exact = dovetail.Frf(assembly.frequency, clean, "accelerance", label=f"case {index}")
        measured = noisy_frf(exact, NOISE, np.random.default_rng([9, index]))
        yield Case(index, place, measured, refine(Problem.of(assembly, measured)))


def ends(posterior: Posterior) -> np.ndarray:
    """Return the ends (2, p) of the 90 % intervals, in fractions of the ranges."""
    return np.array(quantiles(posterior.fraction, posterior.weight, [0.05, 0.95]))


def study(count: int, sampled: int, mesh: int, model_error: float) -> None:
    """Print coverage with and without warning, times, and the intervals next to the sampled ones."""
    assembly = dovetail.load(ASSEMBLY)
    names = [parameter.name for parameter in assembly.parameters]
    held, warned, seconds, compared, same = [], [], [], [], []
    allowed = typical_model_error(model_error)
    for case in cases(assembly, count, mesh):
        began = processor_time()
        found = laplace_posterior(Problem.of(assembly, case.measured), case.fit, model_error=allowed, seed=case.index)
        seconds.append(processor_time() - began)
        low, high = ends(found)
        held.append((low < case.place) & (case.place < high))
        warned.append([name in found.unreliable for name in names])
        if case.index < sampled:
            other = sample_posterior(
                Problem.of(assembly, case.measured), case.fit, model_error=allowed, seed=case.index
            )
            other_low, other_high = ends(other)
            compared.append(
                [(high - low) / (other_high - other_low), distance_of_ends(low, high, other_low, other_high)]
            )
            same.append([found.verdicts[name].word == other.verdicts[name].word for name in names])
    print(f"{count} cases, mesh {mesh} times finer, model error {model_error:g}")
    table(names, np.array(held), np.array(warned), np.array(compared))
    times = f"median {1e3 * np.median(seconds):.0f} ms, 95 % below {1e3 * np.quantile(seconds, 0.95):.0f} ms"
    alone = np.mean(np.array(warned).all(axis=1))
    print(f"\nProcessor time after the fit: {times}. In {alone:.1%} of the cases every parameter is warned of.")
    print(f"The verdict is that of the samples for {np.mean(same):.0%} of {np.size(same)} parameters.")


def distance_of_ends(low: np.ndarray, high: np.ndarray, other_low: np.ndarray, other_high: np.ndarray) -> np.ndarray:
    """Return the larger difference of the two ends, over the width of the other interval."""
    return np.maximum(np.abs(low - other_low), np.abs(high - other_high)) / (other_high - other_low)


def table(names: list[str], held: np.ndarray, warned: np.ndarray, compared: np.ndarray) -> None:
    """Print one line for each parameter, and one for all."""
    print("| parameter | 90 % intervals hold the truth | where not warned | where warned | warned | "
          "width over the sampled one | ends apart, not warned | ends apart, warned |")  # fmt: skip
    print("|---|---|---|---|---|---|---|---|")
    rows = [(f"`{name}`", slice(column, column + 1)) for column, name in enumerate(names)] + [("all", slice(None))]
    for label, column in rows:
        inside, flagged = held[:, column], warned[:, column]
        texts = [f"{inside.mean():.1%}", share(inside[~flagged]), share(inside[flagged]), f"{flagged.mean():.0%}"]
        width, off = compared[:, 0, column], compared[:, 1, column]
        known = flagged[: len(compared)]
        texts += [f"{np.median(width):.2f}", middle(off[~known]), middle(off[known])]
        print(f"| {label} | {' | '.join(texts)} |")


def share(inside: np.ndarray) -> str:
    """Return the share that is inside, and of how many."""
    return f"{inside.mean():.1%} of {inside.size}" if inside.size else "none"


def middle(parts: np.ndarray) -> str:
    """Return the median of parts of a width."""
    return f"{np.median(parts):.0%}" if parts.size else "none"


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=int, default=200)
    parser.add_argument("--sampled", type=int, default=40, help="1 or more.")
    parser.add_argument("--finer-mesh", type=int, default=1)
    parser.add_argument("--model-error", type=float, default=0.0)
    given = parser.parse_args()
    study(given.cases, given.sampled, given.finer_mesh, given.model_error)
