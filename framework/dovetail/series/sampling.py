"""Samples of the posterior of a series, and the marginal likelihood, from the weights of the samples."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.inference.posterior import ModelError, Posterior
from dovetail.inference.posterior.drawn_samples import SearchEnds, move_by_weight
from dovetail.inference.posterior.evidence import Evidence, least_log_evidence
from dovetail.inference.posterior.likelihood import Z_LIMIT, ReducedResiduals, squared_norms, unit_from_normal
from dovetail.inference.posterior.randomize_then_optimize import LinearisedPoints, nearest_rows
from dovetail.inference.posterior.tangent_steps import Density
from dovetail.inference.posterior.weights import are_complete, are_even, effective_sample_size, from_logarithms
from dovetail.interfaces import Progress, logged, silent
from dovetail.series.fitted_tests import FittedTest
from dovetail.series.fitting import SeriesFit, minimise, normal_equations
from dovetail.series.residuals import SeriesResiduals
from dovetail.series.scatter import ScatterProposal, conditional_modes
from dovetail.series.tangent_map import ArrowTangentMap
from dovetail.series.unknowns import SeriesUnknowns

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Settings:
    """How the region of the posterior is explored, and when samples need Metropolis steps."""

    pilots: int = 32
    """Searches in each round of exploration."""
    rounds: int = 8
    """Largest number of rounds; they end when the reduced residuals are accurate."""
    reduction_error: float = 0.1
    """Largest accepted difference of a test's chi-squared between the reduced residuals and all lines."""
    region: float = 60.0
    """Chi-squared of a test above the smallest up to which its residuals have to be accurate."""
    most_snapshots: int = 400
    """Number of FRFs of a test, the latest ones, from which its residuals are reduced."""
    batch: int = 200
    """Searches at a time."""
    iterations: int = 60
    """Largest number of iterations of the search for one sample."""
    fewest_effective: float = 50.0
    """Effective sample size below which the ends of the intervals are rough."""


_SETTINGS = Settings()


@dataclass(frozen=True, eq=False)
class SeriesPosterior:
    """Weighted samples of all unknowns of a series.

    Parameters
    ----------
    z : (n, d) array
        Normal quantiles of the unknowns' priors.
    weight : (n,) array
        Sums to 1.
    shared : Posterior or None
        Of the unknowns that the tests have in common, if there are any.
    tests : tuple of Posterior
        Of the parameters of each test.
    evidence : Evidence or None
        The marginal likelihood; None if too few searches count for it.
    least_log_evidence : float
        A lower bound of its logarithm, which few searches suffice for.
    effective_sample_size : float
        Number of independent samples of equal weight with the same information (Kish).
    search_efficiency : float
        Effective sample size of the weights of the searches, over their number.
    searches : int
    seconds : float
    """

    z: Array
    weight: Array
    shared: Posterior | None
    tests: tuple[Posterior, ...]
    evidence: Evidence | None
    least_log_evidence: float
    effective_sample_size: float
    search_efficiency: float
    searches: int
    seconds: float

    @property
    def warnings(self) -> tuple[str, ...]:
        """What a reader of the intervals must know."""
        size = self.effective_sample_size
        if size >= _SETTINGS.fewest_effective:
            return ()
        return (f"The effective sample size is only {size:.0f}: the ends of the intervals are rough.",)

    def to_dict(self) -> dict[str, Any]:
        """Return the samples and their quality as plain values for JSON."""
        shared = () if self.shared is None else zip(self.shared.names, self.shared.theta.T.tolist(), strict=True)
        return {
            "effective_samples": self.effective_sample_size,
            "search_efficiency": self.search_efficiency,
            "evidence": None if self.evidence is None else asdict(self.evidence),
            "seconds": self.seconds,
            "weight": self.weight.tolist(),
            "unknowns": dict(shared),
        }


def sample_series(
    unknowns: SeriesUnknowns,
    tests: Sequence[FittedTest],
    fit: SeriesFit,
    *,
    samples: int = 400,
    seed: int = 0,
    progress: Progress = silent,
) -> SeriesPosterior:
    """Draw samples of the posterior of all unknowns, given all tests.

    Parameters
    ----------
    unknowns : SeriesUnknowns
    tests : sequence of FittedTest
        Their random errors and the errors of their models are those of their own identifications.
    fit : SeriesFit
    samples : int
        Number of searches, each for one sample.
    seed : int
    progress : Progress

    Notes
    -----
    As for one measurement, by randomize-then-optimize on a few lines of each test, weighted with all lines. The mean
    weight is the marginal likelihood. Where the weights are uneven, samples are drawn by weight, from annealed draws of
    the prior too, and moved by Metropolis steps.
    """
    began = time.perf_counter()
    with logged(__name__, f"{samples} samples of a series"):
        sampler = _Sampler(unknowns, tests, fit, np.random.default_rng([seed, 21]), progress)
        points, log_density = sampler.search(samples)
        z, log_weight = points.z, sampler.log_posterior(points.z) - log_density
        on_all_lines = log_weight + sampler.log_constant
        evidence, least = Evidence.from_weights(on_all_lines, samples), least_log_evidence(on_all_lines, samples)
        effective = effective_sample_size(log_weight)
        efficiency, complete = effective / samples, are_complete(len(z), samples)
        if not complete or not are_even(log_weight, samples):
            ends = SearchEnds(z, points.log_posterior - log_density, samples, complete)
            moved = move_by_weight(sampler.density, ends, samples, sampler.random, progress)
            z, log_weight = moved.z, sampler.log_posterior(moved.z) - moved.log_posterior
            effective = min(moved.effective, effective_sample_size(log_weight))
            evidence, least = moved.doubted(evidence), max(least, moved.least_log_evidence + sampler.left_out)
        weight = from_logarithms(log_weight)
        weight /= weight.sum()
        seconds = time.perf_counter() - began
        parts = sampler.posteriors(z, weight, samples, seconds)
    return SeriesPosterior(z, weight, *parts, evidence, least, effective, efficiency, samples, seconds)


class _Sampler:
    """Explores the region of the posterior of a series, and draws samples of it."""

    def __init__(
        self,
        unknowns: SeriesUnknowns,
        tests: Sequence[FittedTest],
        fit: SeriesFit,
        random: np.random.Generator,
        progress: Progress,
    ) -> None:
        self._unknowns, self._tests, self.random, self._progress = unknowns, tests, random, progress
        self._likelihoods = [test.likelihood() for test in tests]
        self._exact = SeriesResiduals(unknowns, [one.marginalised for one in self._likelihoods])
        self.log_constant = sum(one.log_constant for one in self._likelihoods)
        mode = minimise(self._exact, fit.z[np.newaxis])
        self._pool = np.concatenate([mode.z, _drawn_about(self._exact, mode, _SETTINGS.pilots, random)[0]])
        self._explore(mode.z)

    def _explore(self, mode: Array) -> None:
        """Reduce the residuals of each test to a few lines, until they are accurate where samples are."""
        fractions = self._exact.fractions(self._pool)
        frfs = [likelihood.frf(part) for likelihood, part in zip(self._likelihoods, fractions, strict=True)]
        origins, before = [part[0] for part in frfs], None
        for number in range(_SETTINGS.rounds):
            self._progress("exploration", number, _SETTINGS.rounds)
            pairs = zip(self._likelihoods, frfs, origins, strict=True)
            reduced = [ReducedResiduals(*pair) for pair in pairs]
            self.residuals = SeriesResiduals(self._unknowns, reduced)
            self._outside = [residuals.outside for residuals in reduced]
            self._mode = minimise(self.residuals, mode)
            mode = self._mode.z
            self._scatter = ScatterProposal.near(self.residuals, mode[0], self.random, before)
            before = self._scatter
            pilots, _ = self._searched(_SETTINGS.pilots)
            self._pool = np.concatenate([self._pool, pilots.z])[-_SETTINGS.most_snapshots :]
            frfs, error = self._with_pilots(frfs, pilots)
            if number >= 1 and error < _SETTINGS.reduction_error:
                break

    def _with_pilots(
        self, frfs: list[NDArray[np.complex128]], pilots: LinearisedPoints
    ) -> tuple[list[NDArray[np.complex128]], float]:
        """Add the FRFs at pilots to those of each test; return the largest error of a reduced chi-squared too."""
        worst, extended, on_few = 0.0, [], self.residuals.split_by_test(pilots.residuals)
        for index, fractions in enumerate(self._exact.fractions(pilots.z)):
            if not len(fractions):  # no search converged
                return frfs, np.inf
            likelihood, values = self._likelihoods[index], self._likelihoods[index].frf(fractions)
            squares = likelihood.marginalised.squares(likelihood.residual.of(values))
            near = squares <= squares.min() + _SETTINGS.region
            error = np.abs(squared_norms(on_few[index]) + self._outside[index] - squares)
            worst = max(worst, float(error[near].max()))
            extended.append(np.concatenate([frfs[index], values])[-_SETTINGS.most_snapshots :])
        return extended, worst

    def _searched(self, count: int) -> tuple[LinearisedPoints, Array]:
        """Return the ends of the searches for samples that converged, and the logarithms of their density."""
        target = self.random.standard_normal((count, self._unknowns.count))
        held = self._scatter.columns
        if held:
            target[:, held] = self._scatter.draw(count, self.random)
            start = conditional_modes(self.residuals, self._mode.z[0], held, target[:, held])
            tangent_map = ArrowTangentMap(self.residuals, start, held)
        else:
            tangent_map = ArrowTangentMap(self.residuals, self._mode)
            pool = self.residuals.linearise(self._pool)
            start = pool.at_rows(nearest_rows(tangent_map.components(pool.residuals), target))
        ends, converged = tangent_map.solve(target, start, _SETTINGS.iterations)
        rows = np.flatnonzero(converged)
        ends, tangent_map = ends.at_rows(rows), tangent_map.at_rows(rows)
        return ends, tangent_map.log_density(ends) + self._scatter.log_ratio(ends.z[:, held])

    def search(self, count: int) -> tuple[LinearisedPoints, Array]:
        """Return the ends of the searches that converged, and the logarithms of their density."""
        batches = []
        for first in range(0, count, _SETTINGS.batch):
            self._progress("samples", first, count)
            batches.append(self._searched(min(_SETTINGS.batch, count - first)))
        self._progress("samples", count, count)
        points, log_density = zip(*batches, strict=True)
        if not any(map(len, log_density)):
            return self._about_the_mode(count)
        return LinearisedPoints.joined(points), np.concatenate(log_density)

    def _about_the_mode(self, count: int) -> tuple[LinearisedPoints, Array]:
        """Return samples of the normal approximation at the mode, and the logarithms of their density."""
        z, log_density = _drawn_about(self.residuals, self._mode, count, self.random)
        return self.residuals.linearise(np.clip(z, -Z_LIMIT, Z_LIMIT)), log_density

    @property
    def density(self) -> Density:
        """That of the posterior, from few lines."""
        residuals = self.residuals
        return Density(residuals.residuals, residuals.linearise, partial(ArrowTangentMap, residuals))

    @property
    def left_out(self) -> float:
        """What the other lines add to the logarithm of the likelihood, with `log_constant`."""
        return self.log_constant - sum(self._outside) / 2.0

    def log_posterior(self, z: Array) -> Array:
        """Return the log density (n,), up to a constant, of z (n, d), from all lines of all tests."""
        pairs = zip(self._likelihoods, self._exact.fractions(z), strict=True)
        return np.asarray(sum(one.log(fractions) for one, fractions in pairs) - squared_norms(z) / 2.0)

    def posteriors(
        self, z: Array, weight: Array, searches: int, seconds: float
    ) -> tuple[Posterior | None, tuple[Posterior, ...]]:
        """Return the posteriors of the unknowns of the series, and of the parameters of each test."""
        known: Mapping[str, Any] = {"searches": searches, "seconds": seconds}
        definitions = [unknown.definition for unknown in self._unknowns.shared]
        lines = sum(sum(one.model.counts) for one in self._likelihoods)
        fractions_of_shared = unit_from_normal(z[:, : len(definitions)])
        shared = (
            Posterior.from_fractions(
                definitions, fractions_of_shared, weight, model_error=ModelError(0.0), lines=lines, **known
            )
            if definitions
            else None
        )
        tests = tuple(
            Posterior.from_fractions(
                test.problem.parameters,
                np.clip(fractions, 0.0, 1.0),
                weight,
                model_error=test.judged.adequacy.error_in_intervals,
                lines=sum(likelihood.model.counts),
                **known,
            )
            for test, fractions, likelihood in zip(
                self._tests, self._exact.fractions(z), self._likelihoods, strict=True
            )
        )
        return shared, tests


def _drawn_about(
    residuals: SeriesResiduals, mode: LinearisedPoints, count: int, random: np.random.Generator
) -> tuple[Array, Array]:
    """Return draws (n, d) of the normal approximation at a mode, and the logarithms of their density."""
    matrix, _ = normal_equations(residuals, mode)
    root, normal = matrix.root(), random.standard_normal((count, mode.z.shape[1]))
    return mode.z + matrix.solve(root.times(normal)), root.log_determinant() - squared_norms(normal) / 2.0
