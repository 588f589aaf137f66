"""Gains of the posterior against other routes: the Fisher information, profile likelihoods, and Laplace's integral.

    python tests/benchmarks/verdicts.py [--cases 20] [--workers 2] [-o verdicts.json]

Random joints of the collet assembly, complex noise of one per cent of the FRF's standard deviation in every line.

Fisher: gain 1 - 12 (F + 12)^-1 in fractions of the ranges, F at the truth.

Profile: each parameter is moved over its range, all others are fitted anew at each place. The region is where
chi-squared lies less than 2.71 above its least. For a Gaussian the region is 3.29 standard deviations wide, so that a
gain of 0.9 is a region of 0.30 of the range, and one of 0.5 a region of 0.67.

Integrated: as the profile, but the others are integrated out at each place by Laplace's formula, in the coordinates in
which the prior is normal: what the posterior should say. Only where the other routes disagree.
"""

from __future__ import annotations

import argparse
import json
from collections import Counter
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import dovetail
from dovetail.dataset import latin_hypercube
from dovetail.inference.fitting import refine
from dovetail.inference.posterior import ModelError, sample_posterior
from dovetail.inference.posterior.likelihood import PosteriorResiduals, normal_from_unit, unit_from_normal
from dovetail.inference.posterior.mode_search import CubeResiduals
from dovetail.measurement import noisy_frf
from dovetail.problem import Problem
from dovetail.problem.least_squares import Linearisation, SumOfSquares, minimise
from dovetail.problem.residuals import FrfResiduals, Weighted

ASSEMBLY = Path(__file__).resolve().parents[2] / "assemblies" / "bt40_er32.yaml"
NOISE = 0.01
CLASSES = ("0.9 or more", "0.5 to 0.9", "below 0.5")
"""Of the gain, the share of the prior variance that the measurement removes."""
RISE = 2.71
"""Of chi-squared, within which 90 % of a Gaussian lie."""
DEVIATIONS = 3.29
"""So many standard deviations of a Gaussian hold 90 % of it."""
LONGEST, SHORTEST, FASTER, CLOSE = 0.05, 1e-3, 1.6, 0.3
JUMP = 3.0
"""Rise of chi-squared in one step from which on the search rather failed: a shorter one is tried."""


def class_of(gain: float) -> str:
    """Return the class of a gain."""
    return CLASSES[0] if gain >= 0.9 else CLASSES[1] if gain >= 0.5 else CLASSES[2]


def class_of_width(width: float) -> str:
    """Return the class of a region's width in parts of the range, by the same limits for a Gaussian."""
    return class_of(1.0 - 12.0 * (width / DEVIATIONS) ** 2)


@dataclass(frozen=True)
class Without(SumOfSquares):
    """A sum of squares with one parameter held."""

    misfit: SumOfSquares
    column: int
    value: float

    def whole(self, position: np.ndarray) -> np.ndarray:
        """Return all parameters (n, p)."""
        return np.insert(position, self.column, self.value, axis=1)

    def residuals(self, position: np.ndarray) -> np.ndarray:
        """Return residuals (n, m)."""
        return self.misfit.residuals(self.whole(position))

    def linearise(self, position: np.ndarray) -> Linearisation:
        """Return residuals and derivatives by the others."""
        at, others = self.misfit.linearise(self.whole(position)), np.arange(position.shape[1] + 1) != self.column
        return Linearisation(at.residuals, at.jacobian[:, others])


@dataclass
class Profile:
    """Places (n, p) of one parameter at which all others are fitted, and minus twice their log density, from below."""

    x: np.ndarray
    at: np.ndarray
    cost: np.ndarray

    @staticmethod
    def of(column: int, found: list[tuple[np.ndarray, float]]) -> Profile:
        """Return places sorted by one parameter."""
        ordered = sorted(found, key=lambda one: float(one[0][column]))
        at = np.array([place for place, _ in ordered])
        return Profile(at[:, column], at, np.array([cost for _, cost in ordered]))

    def region(self, least: float) -> tuple[float, float]:
        """Return the ends of the region around the least."""
        best, limit = int(np.argmin(self.cost)), np.sqrt(RISE)
        root = np.sqrt(np.maximum(self.cost - least, 0.0))
        above, below = np.flatnonzero(root[best:] > limit) + best, np.flatnonzero(root[:best] > limit)
        low, high = self.x[0], self.x[-1]
        if len(above):
            high = np.interp(limit, root[above[0] - 1 : above[0] + 1], self.x[above[0] - 1 : above[0] + 1])
        if len(below):
            low = np.interp(-limit, -root[below[-1] : below[-1] + 2], self.x[below[-1] : below[-1] + 2])
        return float(low), float(high)

    def gain(self, fraction: Callable[[np.ndarray], np.ndarray]) -> float:
        """Return the part of the prior variance that is taken away if exp(-cost / 2) is the density of x."""
        fine = np.linspace(self.x[0], self.x[-1], 4001)
        cost = np.interp(fine, self.x, self.cost)
        weight = np.exp(-(cost - cost.min()) / 2.0)
        weight /= weight.sum()
        share = fraction(fine)
        return float(1.0 - 12.0 * (weight @ (share - weight @ share) ** 2))

    def span(self, region: tuple[float, float], other: int) -> float:
        """Return how far another parameter moves, with its sign, while this one crosses its region."""
        low, high = np.interp(region, self.x, self.at[:, other])
        return float(high - low)


@dataclass(frozen=True)
class Walk:
    """Along one parameter, with all others fitted at each place.

    Parameters
    ----------
    problem : SumOfSquares
    starts : (n, p) array
        Places from the nearest of which, in the parameter, is searched too.
    longest : float
        Greatest step.
    volume : bool
        Whether the logarithm of the determinant of the others' curvature is added: Laplace's integral over them.
    """

    problem: SumOfSquares
    starts: np.ndarray
    longest: float
    volume: bool

    def along(self, column: int, best: np.ndarray, deviation: float) -> Profile:
        """Return the profile, from the best place to the ends of the cube or to where the cost has risen enough."""
        found = [self._fitted(column, float(best[column]), [best])]
        first = found[0]
        for direction in (-1.0, 1.0):
            before, (here, cost) = first[0], first
            step = min(CLOSE * deviation, self.longest)
            while cost < min(one[1] for one in found) + 4.0 * RISE and 0.0 < here[column] + 1e-12 * direction < 1.0:
                value = float(np.clip(here[column] + direction * step, 0.0, 1.0))
                moved = here[column] - before[column]
                ahead = here + (here - before) * ((value - here[column]) / moved if moved else 0.0)
                place, risen = self._fitted(column, value, [ahead, here])
                rise, step = risen - cost, min(step, abs(value - here[column]))
                if rise > JUMP and step > SHORTEST * self.longest:
                    step *= 0.5
                    continue
                before, here, cost = here, place, risen
                found.append((here, cost))
                step = min(step * (FASTER if abs(rise) < 0.5 else 1.0 if rise < 1.5 else 0.5), self.longest)
        return Profile.of(column, found)

    def _fitted(self, column: int, value: float, guesses: list[np.ndarray]) -> tuple[np.ndarray, float]:
        nearest = self.starts[np.argmin(np.abs(self.starts[:, column] - value))]
        held = Without(self.problem, column, value)
        starts = np.clip(np.delete(np.stack([*guesses, nearest]), column, axis=1), 0.0, 1.0)
        ended = minimise(held, starts, tolerance=1e-2, most_steps=150)
        row = int(np.argmin(ended.cost))
        volume = float(np.linalg.slogdet(ended.curvature[row])[1]) if self.volume else 0.0
        return held.whole(ended.position[row : row + 1])[0], float(ended.cost[row]) + volume


def one_case(index: int, count: int) -> dict[str, Any]:
    """Return what the routes say of each parameter of one random joint."""
    assembly = dovetail.load(ASSEMBLY)
    truth = latin_hypercube(assembly, count, seed=55)[index]
    clean = assembly.frf(truth)
    exact = dovetail.Frf(assembly.frequency, clean, "accelerance")
    measured = noisy_frf(exact, NOISE, np.random.default_rng([12, index]))
    fit = refine(Problem.of(assembly, measured))
    posterior = sample_posterior(Problem.of(assembly, measured), fit, model_error=ModelError(0.0), seed=index)
    misfit = FrfResiduals(assembly, Weighted.against(measured, measured.variance, np.ones(len(clean), dtype=np.bool_)))
    place = assembly.to_unit(truth)
    fisher = misfit.linearise(place[np.newaxis]).curvature[0]
    spread = np.diag(np.linalg.inv(fisher + 12.0 * np.eye(len(place))))
    deviations = np.sqrt(np.diag(np.linalg.inv(fit.information + 12.0 * np.eye(len(place)))))
    profiles = walked(misfit, posterior.fraction, assembly.to_unit(fit.theta), deviations)
    found = entries(posterior, place, 1.0 - 12.0 * spread, profiles)
    for column, one in enumerate(found.values()):
        if len({one[route] for route in ("posterior", "fisher", "profile")}) > 1:
            gain = integrated(misfit, posterior.fraction, column, float(deviations[column]))
            one.update(integrated=class_of(gain), integrated_gain=gain)
    return {"index": index, "parameters": found}


def walked(misfit: SumOfSquares, starts: np.ndarray, best: np.ndarray, deviations: np.ndarray) -> list[Profile]:
    """Return the profile of each parameter; from the best of all places again where one was better than the fit."""
    for _ in range(3):
        walk = Walk(misfit, starts, LONGEST, volume=False)
        found = [walk.along(column, best, deviation) for column, deviation in enumerate(deviations)]
        lowest = min(found, key=lambda one: float(one.cost.min()))
        if lowest.cost.min() > np.sum(misfit.residuals(best[np.newaxis]) ** 2) - 0.3:
            break
        start = lowest.at[np.argmin(lowest.cost)]
        best = minimise(misfit, start[np.newaxis], tolerance=1e-3, most_steps=300).position[0]
    return found


def integrated(misfit: SumOfSquares, samples: np.ndarray, column: int, deviation: float) -> float:
    """Return the gain of a parameter with the others integrated out by Laplace's formula at each place.

    In the coordinates in which the prior is normal (Tierney and Kadane, 1986).
    """
    problem = CubeResiduals(PosteriorResiduals(misfit))
    places = CubeResiduals.from_normal(normal_from_unit(samples))
    best = places[np.argmin(np.sum(problem.residuals(places) ** 2, axis=1))]
    best = minimise(problem, best[np.newaxis], tolerance=1e-3, most_steps=200).position[0]
    found = Walk(problem, places, LONGEST / 2.0, volume=True).along(column, best, deviation / 4.0)
    return found.gain(lambda x: unit_from_normal(CubeResiduals.to_normal(x)))


def entries(
    posterior: dovetail.Posterior, place: np.ndarray, fisher: np.ndarray, profiles: list[Profile]
) -> dict[str, dict[str, Any]]:
    """Return by parameter the gain and its class of each route, and how its partners move along the profile."""
    least = min(float(one.cost.min()) for one in profiles)
    regions = [one.region(least) for one in profiles]
    widths = np.array([high - low for low, high in regions])
    found = {}
    for i, name in enumerate(posterior.names):
        reported = posterior.verdicts[name]
        partners = [j for j, other in enumerate(posterior.names) if f" {other} (" in reported.reason]
        moved = [
            (posterior.names[j], float(posterior.correlation[i, j]), profiles[i].span(regions[i], j) / widths[j])
            for j in partners
        ]
        found[name] = {
            "posterior": class_of(reported.gain), "gain": reported.gain, "reason": reported.reason,
            "place": float(place[i]),
            "fisher": class_of(fisher[i]), "fisher_gain": float(fisher[i]),
            "profile": class_of_width(float(widths[i])), "region": regions[i], "partners": moved,
            "effective": posterior.effective_sample_size, "steps": len(profiles[i].cost),
        }  # fmt: skip
    return found


def counts(cases: list[dict[str, Any]], route: str) -> None:
    """Print how often the posterior and another route agree."""
    pairs = Counter((one["posterior"], one[route]) for case in cases for one in case["parameters"].values())
    total, same = sum(pairs.values()), sum(pairs[word, word] for word in CLASSES)
    print(f"| gain of the posterior | {route}: " + " | ".join(CLASSES) + " |")
    print("|---|---|---|---|")
    for word in CLASSES:
        print(f"| {word} | " + " | ".join(str(pairs[word, other]) for other in CLASSES) + " |")
    print(f"\nPosterior and {route} agree on {same} of {total} ({same / total:.0%}).\n")


def reasons(cases: list[dict[str, Any]]) -> None:
    """Print whether the reasons of the verdicts are seen in the profiles."""
    reported = [one for case in cases for one in case["parameters"].values()]
    partners = [partner for one in reported for partner in one["partners"]]
    moving = sum(abs(moves) >= 0.5 and moves * correlation > 0 for _, correlation, moves in partners)
    print(f"Partners named: {len(partners)}. While the parameter crosses its region, {moving} of them cross half of "
          "theirs or more, in\n  the direction of the correlation.")  # fmt: skip


def disagreements(cases: list[dict[str, Any]]) -> None:
    """Print with whom the integral goes where the routes disagree, and each disagreement."""
    separate = [one for case in cases for one in case["parameters"].values() if "integrated" in one]
    for route in ("fisher", "profile"):
        own = [one for one in separate if one["posterior"] != one[route]]
        ours, theirs = (sum(one["integrated"] == one[key] for one in own) for key in ("posterior", route))
        print(f"Of {len(own)} disagreements of posterior and {route}, the integral is with the posterior in {ours}, "
              f"with the {route} in {theirs}.")  # fmt: skip
    off = [one["gain"] - one["integrated_gain"] for one in separate]
    print(f"There the posterior's gain less the integral's: median {np.median(off):+.2f}, "
          f"quarters {np.quantile(off, 0.25):+.2f} and {np.quantile(off, 0.75):+.2f}.")  # fmt: skip
    print("\n| case | parameter | posterior | integral | Fisher | region of the profile |")
    print("|---|---|---|---|---|---|")
    for case in cases:
        for name, one in case["parameters"].items():
            if "integrated" in one:
                low, high = one["region"]
                gains = " | ".join(f"{one[key]:.2f}" for key in ("gain", "integrated_gain", "fisher_gain"))
                print(f"| {case['index']} | `{name}` | {gains} | {low:.2f} to {high:.2f} |")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=int, default=20)
    parser.add_argument("--only", type=int, help="So many of them, for a trial.")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--output", "-o", type=Path)
    given = parser.parse_args()
    chosen = range(given.cases if given.only is None else given.only)
    with ProcessPoolExecutor(given.workers) as pool:
        reported = list(pool.map(one_case, chosen, [given.cases] * len(chosen)))
    for other in ("fisher", "profile"):
        counts(reported, other)
    reasons(reported)
    disagreements(reported)
    if given.output is not None:
        given.output.write_text(json.dumps(reported, indent=1))
