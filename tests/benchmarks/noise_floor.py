"""Do the fits reach the noise? Random joints of the collet assembly, complex noise in all lines.

    python tests/benchmarks/noise_floor.py [--cases 200] [--every 1]

The noise has the same standard deviation in every line, a part of that of the FRF itself, and the measurement shows it.
A measurement without phase is the amplitude of the noisy complex FRF. MultiStart gets, for each case, the time that
the refined fit took. With --every N only every N-th line is measured.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

import dovetail
from dovetail.dataset import latin_hypercube
from dovetail.inference.fitting import Fit, multistart, refine
from dovetail.measurement import noisy_frf
from dovetail.problem import Problem

ASSEMBLY = Path(__file__).resolve().parents[2] / "assemblies" / "bt40_er32.yaml"
HEADER = (
    "| noise | measured | method | chi-squared 0.95 to 1.05 | median, largest | median time | 99th percentile |\n"
    "|---|---|---|---|---|---|---|"
)


def measurement(assembly: dovetail.Assembly, values: np.ndarray, level: float, seed: int, phase: bool) -> dovetail.Frf:
    """Return an FRF with noise of `level` times its own standard deviation."""
    noisy = noisy_frf(dovetail.Frf(assembly.frequency, values, "accelerance"), level, seed)
    return replace(noisy, values=noisy.values if phase else noisy.amplitude, has_phase=phase)


def row(level: float, phase: bool, method: str, fits: list[Fit]) -> str:
    """Return one line of the table."""
    chi_squared = np.array([fit.chi_squared for fit in fits])
    seconds = np.array([fit.seconds for fit in fits])
    inside = np.count_nonzero((chi_squared > 0.95) & (chi_squared < 1.05))
    return (
        f"| {level:.0%} | {'complex' if phase else 'amplitude'} | {method} | {inside} of {len(fits)} "
        f"| {np.median(chi_squared):.3f}, {chi_squared.max():.4g} "
        f"| {np.median(seconds):.2f} s | {np.quantile(seconds, 0.99):.2f} s |"
    )


def study(cases: int, every: int, report: Callable[[str], object] = print) -> None:
    """Print the table."""
    assembly = dovetail.load(ASSEMBLY)
    assembly = assembly.on(assembly.frequency[::every])
    theta = latin_hypercube(assembly, cases, seed=11)
    values = assembly.frf(theta)
    refine(Problem.of(assembly, measurement(assembly, values[0], 0.01, 0, True)))  # compiles the kernels
    report(HEADER)
    for level in (0.01, 0.05):
        for phase in (True, False):
            measured = [measurement(assembly, frf, level, seed, phase) for seed, frf in enumerate(values)]
            fits = [refine(Problem.of(assembly, frf)) for frf in measured]
            report(row(level, phase, "refined", fits))
            for objective in ("frf", "weighted"):
                others = [
                    multistart(Problem.of(assembly, frf), starts=1000, seconds=fit.seconds, objective=objective)
                    for frf, fit in zip(measured, fits, strict=True)
                ]
                report(row(level, phase, f"multistart, {objective}", others))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=int, default=200)
    parser.add_argument("--every", type=int, default=1)
    arguments = parser.parse_args()
    study(arguments.cases, arguments.every)
