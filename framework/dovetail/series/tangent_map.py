"""Randomize-then-optimize for a series: the map of the single identification, in the form of an arrow.

The map takes the unknowns z to J0^T r(z), the gradient of the residuals at an anchor, whose distribution is normal with
the covariance J0^T J0 where the residuals are. Its derivative has the form of an arrow, so that the cost of a step is
linear in the number of tests.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dovetail.inference.posterior.likelihood import Z_LIMIT, squared_norms
from dovetail.series.arrow import ArrowMatrix, arrow_vector
from dovetail.series.residuals import SeriesPoints, SeriesResiduals

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Settings:
    """Constants of the searches and of the Metropolis steps; as in the single identification."""

    steps: int = 40
    """Largest number of steps of a search."""
    longest_step: float = 2.0
    """Largest change of a coordinate in one step: the prior's standard deviation is 1."""
    probe: float = 0.1
    """Fraction of a step after which the curvature along it is measured."""
    largest_bend: float = 1.5
    """Ratio of acceleration to velocity above which a step is shortened."""
    shortened: float = 0.3
    """Factor of a step that does not come nearer to the target."""
    shortest: float = 1e-4
    """Part of a step at which a search is given up."""
    tolerance: float = 1e-6
    """Squared distance from the target, in standard deviations, at which a search ends."""
    correlation: float = 0.6
    """Correlation before and after a Metropolis step."""
    return_distance: float = 1e-2
    """Largest difference of coordinates at which a reversed step counts as back at its start."""


_SETTINGS = Settings()


class ArrowTangentMap:
    """The map from z to the gradient J0^T r(z), with J0 from one anchor for all points, or from one for each.

    Parameters
    ----------
    residuals : SeriesResiduals
    jacobians : list of (a, g + l_k, m_k) arrays
        At the anchors; a is 1 or the number of points.
    """

    def __init__(self, residuals: SeriesResiduals, jacobians: Sequence[Array]) -> None:
        self._residuals, self._jacobians = residuals, jacobians
        parts = [one @ np.swapaxes(one, 1, 2) for one in jacobians]
        count = residuals.unknowns.count
        self.covariance = ArrowMatrix.added(np.ones((len(jacobians[0]), count)), parts, residuals.shared)

    def at_rows(self, rows: NDArray[np.intp]) -> ArrowTangentMap:
        """Return the map of some of the points."""
        if len(self._jacobians[0]) == 1:
            return self
        return ArrowTangentMap(self._residuals, [one[rows] for one in self._jacobians])

    def image(self, z: Array, residuals: Sequence[Array]) -> Array:
        """Return the images (n, d) of points with these residuals."""
        parts = [(one @ part[:, :, np.newaxis])[:, :, 0] for one, part in zip(self._jacobians, residuals, strict=True)]
        return z + arrow_vector(parts, self._residuals.shared)

    def derivative(self, points: SeriesPoints) -> ArrowMatrix:
        """Return the derivatives of the map at points."""
        pairs = zip(self._jacobians, points.jacobians, strict=True)
        parts = [one @ np.swapaxes(there, 1, 2) for one, there in pairs]
        return ArrowMatrix.added(np.ones_like(points.z), parts, self._residuals.shared)

    def log_density(self, points: SeriesPoints, mean: Array | None = None, scale: float = 1.0) -> Array:
        """Return the log density (n,), up to a constant, of points whose images are normal draws.

        Parameters
        ----------
        points : SeriesPoints
        mean : (n, d) array, optional
            Of the images; 0 by default.
        scale : float
            Of their standard deviations.
        """
        image = self.image(points.z, points.residuals)
        image = image if mean is None else image - mean
        squares = self.covariance.quadratic(image) / scale**2
        log_determinant = self.derivative(points).log_determinant() - self.covariance.log_determinant() / 2.0
        return np.asarray(log_determinant - squares / 2.0)

    def solve(self, target: Array, start: SeriesPoints) -> tuple[SeriesPoints, NDArray[np.bool_]]:
        """Find points with given images (n, d), for all rows at once; return them, and which searches converged."""
        ends = start.at_rows(np.arange(len(target)))
        error = self.image(ends.z, ends.residuals) - target
        squares = self.covariance.quadratic(error)
        part = np.ones(len(target))
        active = np.flatnonzero(squares > _SETTINGS.tolerance)
        for _ in range(_SETTINGS.steps):
            if not len(active):
                break
            own, there = self.at_rows(active), ends.at_rows(active)
            step = own._step(there, error[active], target[active], part[active])
            tried = self._residuals.linearise(np.clip(there.z + step, -Z_LIMIT, Z_LIMIT))
            new_error = own.image(tried.z, tried.residuals) - target[active]
            new_squares = own.covariance.quadratic(new_error)
            better = new_squares < squares[active]
            rows = active[better]
            ends.overwrite(rows, tried.at_rows(np.flatnonzero(better)))
            error[rows], squares[rows] = new_error[better], new_squares[better]
            part[active] = np.where(better, np.minimum(1.0, 2.0 * part[active]), _SETTINGS.shortened * part[active])
            active = active[(squares[active] > _SETTINGS.tolerance) & (part[active] > _SETTINGS.shortest)]
        return ends, squares <= 100.0 * _SETTINGS.tolerance

    def _step(self, points: SeriesPoints, error: Array, target: Array, part: Array) -> Array:
        """Return Newton steps with half their geodesic acceleration."""
        derivative = self.derivative(points)
        velocity = -derivative.solve(error) * part[:, np.newaxis]
        longest = np.abs(velocity).max(axis=1)
        velocity *= np.minimum(1.0, _SETTINGS.longest_step / np.maximum(longest, 1e-300))[:, np.newaxis]
        ahead = points.z + _SETTINGS.probe * velocity
        moved = self.image(ahead, self._residuals.residuals(ahead)) - target
        linear = _times_arrow(derivative, velocity)
        bend = 2.0 / _SETTINGS.probe * ((moved - error) / _SETTINGS.probe - linear)
        acceleration = -derivative.solve(bend)
        lengths = np.sqrt(squared_norms(acceleration)), np.sqrt(squared_norms(velocity))
        shrink = np.minimum(1.0, _SETTINGS.largest_bend * lengths[1] / np.maximum(lengths[0], 1e-300))
        return np.asarray(velocity * shrink[:, np.newaxis] + acceleration * shrink[:, np.newaxis] ** 2 / 2.0)


def _times_arrow(matrix: ArrowMatrix, vector: Array) -> Array:
    """Return the products (n, d) of a matrix in the form of an arrow and vectors."""
    shared = matrix.border.shape[1]
    common = vector[:, :shared, np.newaxis]
    top, inner, first = (matrix.border @ common)[:, :, 0], [], shared
    for right, below, block in zip(matrix.right, matrix.below, matrix.blocks, strict=True):
        part = vector[:, first : first + block.shape[1], np.newaxis]
        top = top + (right @ part)[:, :, 0]
        inner.append((below @ common + block @ part)[:, :, 0])
        first += block.shape[1]
    return np.concatenate([top, *inner], axis=1)


def metropolis_step(
    residuals: SeriesResiduals, points: SeriesPoints, random: np.random.Generator
) -> tuple[SeriesPoints, float]:
    """Move each point by one step that leaves the posterior invariant; return the share of accepted steps.

    The proposal keeps the direction of a point's image in the map anchored there, with the given correlation, and is
    accepted by the rule of Metropolis and Hastings. A proposal whose reverse does not return is rejected.
    """
    scale = float(np.sqrt(1.0 - _SETTINGS.correlation**2))
    forth = ArrowTangentMap(residuals, points.jacobians)
    kept = _SETTINGS.correlation * forth.image(points.z, points.residuals)
    target = kept + scale * forth.covariance.times_root(random.standard_normal(points.z.shape))
    ends, converged = forth.solve(target, points)
    back = ArrowTangentMap(residuals, ends.jacobians)
    kept_back = _SETTINGS.correlation * back.image(ends.z, ends.residuals)
    ratio = (squared_norms(points.z) + points.squares - squared_norms(ends.z) - ends.squares) / 2.0
    ratio += back.log_density(points, kept_back, scale) - forth.log_density(ends, kept, scale)
    accepted = np.flatnonzero(converged & (np.log(random.random(len(converged))) < ratio))
    if len(accepted):
        there = back.at_rows(accepted)
        start, end = points.at_rows(accepted), ends.at_rows(accepted)
        returned, is_back = there.solve(there.image(start.z, start.residuals), end)
        is_back &= np.abs(returned.z - start.z).max(axis=1) < _SETTINGS.return_distance
        accepted = accepted[is_back]
    moved = points.at_rows(np.arange(len(points.z)))
    moved.overwrite(accepted, ends.at_rows(accepted))
    return moved, len(accepted) / len(converged)
