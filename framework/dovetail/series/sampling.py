"""Samples of the posterior of a series, and the marginal likelihood, from the weights of the samples."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.inference.posterior import ModelError, Posterior
from dovetail.inference.posterior.likelihood import (
    Likelihood,
    ReducedResiduals,
    squared_norms,
    unit_from_normal,
)
from dovetail.inference.posterior.verdicts import drawn_by_weight, effective_sample_size
from dovetail.interfaces import Progress, logged, silent
from dovetail.series.fitted_tests import FittedTest
from dovetail.series.fitting import SeriesFit, minimise
from dovetail.series.residuals import SeriesPoints, SeriesResiduals
from dovetail.series.tangent_map import ArrowTangentMap, metropolis_step
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
    batch: int = 100
    """Searches at a time."""
    even_weights: float = 0.4
    """Effective samples over searches above which samples need no Metropolis steps."""
    clipped: float = 0.975
    """Quantile at which weights are clipped before samples are moved."""
    moves: int = 8
    """Largest number of Metropolis steps."""
    remaining: float = 0.1
    """Correlation with the start below which moved samples count as independent."""
    moved_at_once: int = 50
    """Samples that are moved together: each has derivatives of its own."""


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
    shared : Posterior
        Of the unknowns that the tests have in common.
    tests : tuple of Posterior
        Of the parameters of each test.
    log_evidence, log_evidence_error : float
        Logarithm of the marginal likelihood [with the constants of the measurements], and its standard error.
    search_efficiency : float
        Effective sample size of the weights of the searches, over their number.
    searches : int
    seconds : float
    """

    z: Array
    weight: Array
    shared: Posterior
    tests: tuple[Posterior, ...]
    log_evidence: float
    log_evidence_error: float
    search_efficiency: float
    searches: int
    seconds: float

    @property
    def effective_sample_size(self) -> float:
        """Number of independent samples of equal weight with the same information (Kish)."""
        return float(1.0 / np.sum(self.weight**2))

    @property
    def warnings(self) -> tuple[str, ...]:
        """What a reader of the intervals must know."""
        size = self.effective_sample_size
        if size >= 50.0:
            return ()
        return (f"The effective sample size is only {size:.0f}: the ends of the intervals are rough.",)

    def to_dict(self) -> dict[str, Any]:
        """Return the samples and their quality as plain values for JSON."""
        theta = {name: self.shared.theta[:, column].tolist() for column, name in enumerate(self.shared.names)}
        return {
            "effective_samples": self.effective_sample_size,
            "search_efficiency": self.search_efficiency,
            "log_evidence": self.log_evidence,
            "log_evidence_error": self.log_evidence_error,
            "seconds": self.seconds,
            "weight": self.weight.tolist(),
            "unknowns": theta,
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
    weight is the marginal likelihood. Where the weights are uneven, samples are drawn by weight and moved by Metropolis
    steps.
    """
    began = time.perf_counter()
    with logged(__name__, f"{samples} samples of a series"):
        sampler = _Sampler(unknowns, tests, fit, np.random.default_rng([seed, 21]), progress)
        points, log_weight = sampler.search(samples)
        evidence = _evidence(log_weight, samples, sampler.log_constant)
        efficiency = effective_sample_size(log_weight) / samples
        if efficiency < _SETTINGS.even_weights:
            points, log_weight = sampler.move(points, log_weight, samples)
        weight = np.exp(log_weight - log_weight.max())
        weight /= weight.sum()
        seconds = time.perf_counter() - began
        parts = sampler.posteriors(points.z, weight, samples, seconds)
    return SeriesPosterior(points.z, weight, *parts, *evidence, efficiency, samples, seconds)


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
        self._unknowns, self._tests, self._random, self._progress = unknowns, tests, random, progress
        self._likelihoods = [test.likelihood() for test in tests]
        self._exact = SeriesResiduals(unknowns, [one.marginalised for one in self._likelihoods])
        self.log_constant = sum(_log_constant(one) for one in self._likelihoods)
        ones = np.ones(unknowns.count)
        mode, matrix = minimise(self._exact, fit.z, ones)
        normal = random.standard_normal((_SETTINGS.pilots, unknowns.count))
        scattered = mode + matrix.solve(matrix.times_root(normal))
        self._pool = np.concatenate([mode[np.newaxis], scattered])
        self._explore(mode)

    def _explore(self, mode: Array) -> None:
        """Reduce the residuals of each test to a few lines, until they are accurate where samples are."""
        fractions = self._exact.fractions(self._pool)
        frfs = [likelihood.frf(part) for likelihood, part in zip(self._likelihoods, fractions, strict=True)]
        origins = [part[0] for part in frfs]
        for number in range(_SETTINGS.rounds):
            self._progress("exploration", number, _SETTINGS.rounds)
            pairs = zip(self._likelihoods, frfs, origins, strict=True)
            reduced = [ReducedResiduals(*pair) for pair in pairs]
            self.residuals = SeriesResiduals(self._unknowns, reduced)
            self._outside = [residuals.outside for residuals in reduced]
            mode, _ = minimise(self.residuals, mode, np.ones(len(mode)))
            self._centre = self.residuals.linearise(mode[np.newaxis])
            self._map = ArrowTangentMap(self.residuals, self._centre.jacobians)
            target = self._map.covariance.times_root(self._random.standard_normal((_SETTINGS.pilots, len(mode))))
            pilots, converged = self._map.solve(target, self._repeated(len(target)))
            self._pool = np.concatenate([self._pool, pilots.z[converged]])[-_SETTINGS.most_snapshots :]
            frfs, error = self._with_pilots(frfs, pilots)
            if number >= 1 and error < _SETTINGS.reduction_error:
                break

    def _repeated(self, count: int) -> SeriesPoints:
        return self._centre.at_rows(np.zeros(count, dtype=np.intp))

    def _with_pilots(
        self, frfs: list[NDArray[np.complex128]], pilots: SeriesPoints
    ) -> tuple[list[NDArray[np.complex128]], float]:
        """Add the FRFs at pilots to those of each test; return the largest error of a reduced chi-squared too."""
        worst, extended = 0.0, []
        for index, fractions in enumerate(self._exact.fractions(pilots.z)):
            likelihood, values = self._likelihoods[index], self._likelihoods[index].frf(fractions)
            squares = -2.0 * likelihood.log(fractions)
            on_few = squared_norms(pilots.residuals[index]) + self._outside[index]
            near = squares <= squares.min() + _SETTINGS.region
            worst = max(worst, float(np.abs(on_few - squares)[near].max()))
            extended.append(np.concatenate([frfs[index], values])[-_SETTINGS.most_snapshots :])
        return extended, worst

    def search(self, count: int) -> tuple[SeriesPoints, Array]:
        """Return the ends of the searches that converged, and the logarithms of their weights with all lines."""
        batches, weights = [], []
        pool = self.residuals.linearise(self._pool)
        images = self._map.image(pool.z, pool.residuals)
        whitened = self._map.covariance.solve(images)
        for first in range(0, count, _SETTINGS.batch):
            self._progress("samples", first, count)
            size = min(_SETTINGS.batch, count - first)
            target = self._map.covariance.times_root(self._random.standard_normal((size, pool.z.shape[1])))
            distance = np.sum(images * whitened, axis=1) - 2.0 * target @ whitened.T
            ends, converged = self._map.solve(target, pool.at_rows(np.argmin(distance, axis=1)))
            ends = ends.at_rows(np.flatnonzero(converged))
            batches.append(ends)
            weights.append(self._log_posterior(ends.z) - self._map.log_density(ends))
        self._progress("samples", count, count)
        return SeriesPoints.joined(batches), np.concatenate(weights)

    def move(self, points: SeriesPoints, log_weight: Array, count: int) -> tuple[SeriesPoints, Array]:
        """Return samples drawn by weight and moved by Metropolis steps, and the logarithms of their new weights."""
        clipped = np.minimum(log_weight, np.quantile(log_weight, _SETTINGS.clipped))
        chosen = drawn_by_weight(np.exp(clipped - clipped.max()), count, self._random)
        moved = []
        for first in range(0, count, _SETTINGS.moved_at_once):
            self._progress("independence", first, count)
            part, correlation = points.at_rows(chosen[first : first + _SETTINGS.moved_at_once]), 1.0
            for _ in range(_SETTINGS.moves):
                part, acceptance = metropolis_step(self.residuals, part, self._random)
                correlation *= 1.0 - 0.4 * acceptance
                if correlation < _SETTINGS.remaining:
                    break
            moved.append(part)
        ends = SeriesPoints.joined(moved)
        on_few = -(squared_norms(ends.z) + ends.squares + sum(self._outside)) / 2.0
        return ends, self._log_posterior(ends.z) - on_few

    def _log_posterior(self, z: Array) -> Array:
        """Return the log density (n,), up to a constant, of z (n, d), from all lines of all tests."""
        pairs = zip(self._likelihoods, self._exact.fractions(z), strict=True)
        return np.asarray(sum(one.log(fractions) for one, fractions in pairs) - squared_norms(z) / 2.0)

    def posteriors(
        self, z: Array, weight: Array, searches: int, seconds: float
    ) -> tuple[Posterior, tuple[Posterior, ...]]:
        """Return the posteriors of the unknowns of the series, and of the parameters of each test."""
        known: Mapping[str, Any] = {"searches": searches, "seconds": seconds}
        definitions = [unknown.definition for unknown in self._unknowns.shared]
        shared = Posterior.from_fractions(
            definitions,
            unit_from_normal(z[:, : len(definitions)]),
            weight,
            model_error=ModelError(0.0),
            lines=sum(sum(one.model.counts) for one in self._likelihoods),
            **known,
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


def _log_constant(likelihood: Likelihood) -> float:
    """Return the constant of a log-likelihood: the normalisation of random errors and errors of the model."""
    errors = likelihood.errors
    inner = np.linalg.slogdet(np.eye(len(errors)) + errors @ errors.T)[1] if len(errors) else 0.0
    return float(-inner / 2.0 - np.sum(np.log(likelihood.variance)))


def _evidence(log_weight: Array, searches: int, constant: float) -> tuple[float, float]:
    """Return the logarithm of the mean weight, searches that did not converge counting 0, and its standard error."""
    if not len(log_weight):
        return float("nan"), float("inf")
    highest = log_weight.max()
    weight = np.zeros(searches)
    weight[: len(log_weight)] = np.exp(log_weight - highest)
    mean = float(weight.mean())
    error = float(weight.std(ddof=1) / np.sqrt(searches) / mean)
    return float(np.log(mean) + highest + constant), error
