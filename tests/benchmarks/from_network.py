"""Does a network that gives intervals speed up the fit and the posterior?

    dovetail train docs/network/bt40_er32.yaml --minutes 13 -o model
    python tests/benchmarks/from_network.py model [--cases 200] [--sampled 20] [--noise 0.01 0.2] [--draws 4000]

Joints at random, complex noise proportional to each line, given with the measurement. For each level of the noise:

- the refined fit from the ranges alone, and from the network's answer: steps, and seconds;
- the sampler's posterior (of the first cases only, for it takes long), and the network's draws weighted by the exact
  likelihood (importance sampling with Pareto-smoothed weights, from the network's Gaussian in normal quantiles, a fifth
  wider): effective samples (0 where the draws have no width in some parameter: then the fit remains), the share of
  cases whose weights may be trusted (their tail's shape k below 0.7), seconds, and how many 90 % intervals hold the
  truth.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import arviz
import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr, ndtri
from scipy.stats import multivariate_normal

import dovetail
from dovetail.dataset import latin_hypercube
from dovetail.inference.fitting import refine
from dovetail.measurement import noisy_frf
from dovetail.problem import Problem

WIDER = 1.2
"""Proposal's standard deviations over the network's, so that its tails hold the posterior's."""
END = 1e-6
TRUSTED = 0.7
ROWS = 500


@dataclass
class Tally:
    """What was measured of one route."""

    seconds: list[float] = field(default_factory=list)
    counted: list[float] = field(default_factory=list)
    tails: list[float] = field(default_factory=list)
    held: list[float] = field(default_factory=list)

    def row(self, noise: float, route: str) -> str:
        """Return a line of the table."""
        held = f"{np.mean(self.held):.1%}" if self.held else ""
        tails = f"{np.mean(np.array(self.tails) < TRUSTED):.0%}" if self.tails else ""
        counted = f"{np.median(self.counted):.0f}"
        return f"| {noise:.1%} | {route} | {counted} | {tails} | {held} | {np.median(self.seconds):.2f} s |"


def importance(
    assembly: dovetail.Assembly, frf: dovetail.Frf, draws: NDArray[np.float64], count: int, seed: int
) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
    """Return draws (count, n_params) as fractions of the ranges, their weights, and the shape of the weights' tail."""
    quantiles = ndtri(np.clip(assembly.to_unit(draws), END, 1.0 - END))
    mean, covariance = quantiles.mean(axis=0), WIDER**2 * np.cov(quantiles, rowvar=False)
    proposal = multivariate_normal(mean, covariance, seed=seed)
    proposed = proposal.rvs(count).reshape(count, len(mean))
    fraction = np.clip(ndtr(proposed), END, 1.0 - END)
    theta, likelihood = assembly.from_unit(fraction), np.empty(count)
    for start in range(0, count, ROWS):
        rows = slice(start, start + ROWS)
        likelihood[rows] = -np.sum(np.abs(assembly.frf(theta[rows]) - frf.values) ** 2 / frf.variance, axis=1)
    prior = multivariate_normal(np.zeros(len(mean))).logpdf(proposed)
    smoothed, shape = arviz.psislw(likelihood + prior - proposal.logpdf(proposed))
    weight = np.exp(smoothed - smoothed.max())
    return fraction, weight / weight.sum(), float(shape)


def weighted_interval(values: NDArray[np.float64], weight: NDArray[np.float64]) -> tuple[float, float]:
    """Return the ends of the interval that holds nine tenths of the weight."""
    order = np.argsort(values)
    share = np.cumsum(weight[order])
    low, high = np.searchsorted(share, [0.05, 0.95])
    return values[order[low]], values[order[min(high, len(order) - 1)]]


def study(
    model: dovetail.Identifier,
    cases: int,
    levels: list[float],
    draws: int,
    sampled: int,
    report: Callable[[str], object] = print,
) -> None:
    """Print the table; the sampler runs on the first `sampled` cases."""
    assembly = model.assembly
    truths = latin_hypercube(assembly, cases, seed=23)
    report("| noise | route | steps or effective samples | tail below 0.7 | intervals with the truth | median time |")
    report("|---|---|---|---|---|---|")
    for noise in levels:
        tallies = {route: Tally() for route in ("refined", "refined, network's start", "sampler", "importance")}
        for seed, theta in enumerate(truths):
            clean = dovetail.Frf(assembly.frequency, assembly.frf(theta), "accelerance")
            frf = noisy_frf(clean, noise, seed, kind="proportional")
            one_case(model, frf, theta, draws, seed, tallies)
            if seed < sampled:
                sample(model.assembly, frf, theta, seed, tallies["sampler"])
        for route, tally in tallies.items():
            if tally.seconds:
                report(tally.row(noise, route))


def one_case(
    model: dovetail.Identifier,
    frf: dovetail.Frf,
    theta: NDArray[np.float64],
    draws: int,
    seed: int,
    tallies: dict[str, Tally],
) -> None:
    """Fit one measurement from both starts, and weight the network's draws."""
    assembly = model.assembly
    answer = model.identify(frf, "network")
    for route, starts in (("refined", ()), ("refined, network's start", (answer.theta,))):
        fit = refine(Problem.of(assembly, frf), starts=list(starts), seed=seed)
        tallies[route].seconds.append(fit.seconds)
        tallies[route].counted.append(fit.steps)
    if not draws:
        return
    began = time.perf_counter()
    reported = model.network.predict_samples(frf.amplitude)
    try:
        fraction, weight, shape = importance(assembly, frf, reported, draws, seed)
    except np.linalg.LinAlgError:
        tallies["importance"].seconds.append(time.perf_counter() - began)
        tallies["importance"].counted.append(0.0)
        tallies["importance"].tails.append(np.inf)
        return
    tallies["importance"].seconds.append(time.perf_counter() - began)
    tallies["importance"].counted.append(1.0 / np.sum(weight**2))
    tallies["importance"].tails.append(shape)
    true = assembly.to_unit(theta[np.newaxis])[0]
    ends = [weighted_interval(column, weight) for column in fraction.T]
    tallies["importance"].held += [low <= one <= high for (low, high), one in zip(ends, true, strict=True)]


def sample(assembly: dovetail.Assembly, frf: dovetail.Frf, theta: NDArray[np.float64], seed: int, tally: Tally) -> None:
    """Take the sampler's route for one measurement."""
    began = time.perf_counter()
    result = dovetail.identify(assembly, frf, seed=seed)
    tally.seconds.append(time.perf_counter() - began)
    tally.counted.append(result.posterior.effective_sample_size)
    ends = result.interval.values()
    tally.held += [low <= true <= high for (low, high), true in zip(ends, theta, strict=True)]


def main() -> None:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("model", type=Path)
    parser.add_argument("--cases", type=int, default=200)
    parser.add_argument("--sampled", type=int, default=20)
    parser.add_argument("--noise", type=float, nargs="+", default=[0.01, 0.2])
    parser.add_argument("--draws", type=int, default=4000, help="0 for none")
    options = parser.parse_args()
    study(dovetail.load_model(options.model), options.cases, options.noise, options.draws, options.sampled)


if __name__ == "__main__":
    main()
