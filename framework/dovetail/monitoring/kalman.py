"""Extended Kalman filter of the parameters: random walks from file to file, and their step sizes from the first files.

All positions are fractions of the parameters' ranges.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import NDArray

Array = NDArray[np.float64]

RANGE_VARIANCE = 1.0 / 12.0
"""Variance of a position of which only the range is known."""
NEARBY_VARIANCE = 0.1**2
"""Variance of a position about the fit of the first test, or about the level before a change: a tenth of the range.
Parameters that no file determines stay where they were."""


@dataclass(frozen=True)
class Settings:
    """Constants of the estimate of the step sizes; chosen by their meaning, not on data."""

    typical_step: float = 3e-4
    """Median of the prior of a step's standard deviation, in fractions of the range."""
    decades: float = 1.5
    """Standard deviation of the decimal logarithm of that step: the prior excludes only absurd steps."""
    smallest_step: float = 1e-6
    """Below this a step is none; it keeps the filter able to follow."""


_SETTINGS = Settings()


@dataclass(frozen=True, eq=False)
class Belief:
    """A normal distribution of the parameters' positions.

    Parameters
    ----------
    mean : (p,) array
    covariance : (p, p) array
    """

    mean: Array
    covariance: Array

    @staticmethod
    def about(mean: Array) -> Belief:
        """Return the belief before the first file, about a fit."""
        return Belief(mean, np.eye(len(mean)) * NEARBY_VARIANCE)

    def reset(self, changed: NDArray[np.bool_], variance: float) -> Belief:
        """Return the belief in which some parameters have another variance, independent of all others."""
        covariance = self.covariance.copy()
        covariance[changed] = 0.0
        covariance[:, changed] = 0.0
        covariance[changed, changed] = variance
        return Belief(self.mean, covariance)

    def deviation(self, common: Array | None = None) -> Array:
        """Return the standard deviations (p,), with a covariance that all files have in common added."""
        total = self.covariance if common is None else self.covariance + common
        return np.asarray(np.sqrt(np.maximum(np.diag(total), 0.0)))


@dataclass(frozen=True, eq=False)
class LinearMeasurement:
    """What one file says about the parameters, linearised: ``target = root @ position + error``.

    Parameters
    ----------
    root : (p, p) array
        Its rows after the first `free` do not depend on parameters that are free.
    target : (p,) array
    noise : (p, p) array
        Covariance of the error that the random error of the file causes.
    free : int
    squares : float
        Sum of the squared residuals where it was linearised.
    """

    root: Array
    target: Array
    noise: Array
    free: int
    squares: float

    def shifted(self, offset: Array) -> LinearMeasurement:
        """Return the measurement of positions less an offset (p,)."""
        return replace(self, target=self.target - self.root @ offset)

    def innovation(self, prior: Belief, scale: float = 1.0) -> tuple[Array, Array]:
        """Return the deviation from a prediction (p - free,) and the factor (lower triangle) of its covariance."""
        rows = slice(self.free, None)
        root = self.root[rows]
        covariance = root @ prior.covariance @ root.T + scale**2 * self.noise[rows, rows]
        return self.target[rows] - root @ prior.mean, np.asarray(np.linalg.cholesky(covariance), dtype=np.float64)

    def update(self, prior: Belief, scale: float = 1.0) -> Belief:
        """Return the belief after the measurement, whose noise has `scale` times its standard deviation."""
        noise = scale**2 * self.noise
        covariance = self.root @ prior.covariance @ self.root.T + noise
        gain = scipy.linalg.solve(covariance, self.root @ prior.covariance, assume_a="pos").T
        kept = np.eye(len(prior.mean)) - gain @ self.root
        mean = prior.mean + gain @ (self.target - self.root @ prior.mean)
        return Belief(mean, kept @ prior.covariance @ kept.T + gain @ noise @ gain.T)


@dataclass(frozen=True, eq=False)
class RandomWalk:
    """How the parameters may move from one file to the next.

    Parameters
    ----------
    step : (p,) array
        Standard deviations; 0 for parameters that are constant.
    is_free : (p,) bool array
        Parameters of which the earlier files say nothing.
    noise_scale : float
        Standard deviation of the scatter of the files over that of their random errors.
    """

    step: Array
    is_free: NDArray[np.bool_]
    noise_scale: float = 1.0

    def predict(self, belief: Belief) -> Belief:
        """Return the belief about the next file."""
        covariance = belief.covariance + np.diag(self.step**2)
        wide = np.sqrt(RANGE_VARIANCE / np.maximum(np.diag(covariance), RANGE_VARIANCE))
        covariance = covariance * np.outer(wide, wide)  # no wider than the range
        return Belief(belief.mean, covariance).reset(self.is_free, RANGE_VARIANCE)

    def follow(self, start: Belief, measurements: Sequence[LinearMeasurement]) -> Iterator[tuple[Array, Array, Belief]]:
        """Yield for each measurement the innovation, the factor of its covariance and the belief after it."""
        belief = start
        for measurement in measurements:
            predicted = self.predict(belief)
            innovation, factor = measurement.innovation(predicted, self.noise_scale)
            belief = measurement.update(predicted, self.noise_scale)
            yield innovation, factor, belief


def learn_walk(start: Belief, measurements: Sequence[LinearMeasurement], walk: RandomWalk) -> RandomWalk:
    """Return the most probable random walk of some files.

    Parameters
    ----------
    start : Belief
        Before the first file.
    measurements : sequence of LinearMeasurement
    walk : RandomWalk
        Steps that are 0 stay 0.

    Notes
    -----
    Maximum of the likelihood of the innovations times a wide log-normal prior of the steps. The scale of the noise is
    estimated with the steps: the scatter of the files counts, not the random error that a file claims.
    """
    moving = np.flatnonzero((walk.step > 0.0) & ~walk.is_free)

    def walk_of(logs: Array) -> RandomWalk:
        step = walk.step.copy()
        step[moving] = 10.0 ** logs[:-1]
        return RandomWalk(step, walk.is_free, float(10.0 ** logs[-1]))

    def negative_log(logs: Array) -> float:
        total = 0.5 * float(np.sum(((logs[:-1] - np.log10(_SETTINGS.typical_step)) / _SETTINGS.decades) ** 2))
        for innovation, factor, _ in walk_of(logs).follow(start, measurements):
            whitened = scipy.linalg.solve_triangular(factor, innovation, lower=True)
            total += 0.5 * float(whitened @ whitened) + float(np.sum(np.log(np.diag(factor))))
        return total

    first = np.append(np.full(len(moving), np.log10(_SETTINGS.typical_step)), 0.0)
    bounds = [(np.log10(_SETTINGS.smallest_step), -0.5)] * len(moving) + [(-2.0, 2.0)]
    found = scipy.optimize.minimize(
        negative_log, first, method="L-BFGS-B", bounds=bounds, options={"maxiter": 30, "ftol": 1e-6}
    )
    return walk_of(found.x)
