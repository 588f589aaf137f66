"""Randomize-then-optimize: independent samples, each the solution of a least-squares problem with perturbed data.

The tangent map takes z to the components of the residuals along their tangent space at an anchor. Where the residuals
are normal these components are standard normal, however curved the valley of the posterior is. A sample is the z whose
components are a standard normal draw. Metropolis steps by the same map, anchored at each sample, correct samples where
the map folds over.

References
----------
J. M. Bardsley, A. Solonen, H. Haario, M. Laine, Randomize-then-optimize: a method for sampling from posterior
distributions in nonlinear inverse problems, SIAM J. Sci. Comput. 36 (2014) A1895-A1910.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.inference.posterior.likelihood import Z_LIMIT, PosteriorResiduals, squared_norms
from dovetail.interfaces import Progress, silent


@dataclass(frozen=True)
class Settings:
    """Constants of the searches (damped Gauss-Newton with geodesic acceleration) and of the Metropolis steps."""

    damping: float = 1e-4
    """First damping, relative to the diagonal of the normal matrix; starts are near, so little is needed."""
    damping_factors: tuple[float, float] = (1 / 5, 3.0)
    """Change of the damping after a step that comes nearer to the target, and after one that does not."""
    longest_step: float = 2.0
    """Largest change of a coordinate in one step: the prior's standard deviation is 1."""
    probe: float = 0.1
    """Fraction of a step after which the curvature of the residuals along it is measured."""
    largest_bend: float = 1.5
    """Ratio of acceleration to velocity above which a step is not trusted."""
    tolerance: float = 1e-6
    """Squared distance from the target, in standard deviations, at which a search ends. A search that ends within a
    hundred times this distance has converged."""
    correlation: float = 0.6
    """Correlation of the components before and after a Metropolis step; the larger, the more steps are accepted."""
    metropolis_iterations: int = 40
    """Iterations after which a Metropolis step is given up; most converge after ten to thirty."""
    return_distance: float = 1e-2
    """Largest difference of coordinates at which a reversed step counts as back at its start."""
    remaining_correlation: float = 0.1
    """Correlation of moved samples with the original ones below which they count as independent."""
    most_metropolis_steps: int = 10


_SETTINGS = Settings()


@dataclass(frozen=True, eq=False)
class LinearisedPoints:
    """Points z with their residuals and the derivatives of these.

    Parameters
    ----------
    z : (n, d) array
    residuals : (n, d + m) array
    jacobian : (n, d, d + m) array
        Derivatives of the residuals, transposed: a row for each coordinate.
    """

    z: NDArray[np.float64]
    residuals: NDArray[np.float64]
    jacobian: NDArray[np.float64]

    @staticmethod
    def at(posterior: PosteriorResiduals, z: NDArray[np.float64]) -> LinearisedPoints:
        """Linearise the residuals at points z (n, d)."""
        return LinearisedPoints(z, *posterior.linearise(z))

    @staticmethod
    def joined(parts: Sequence[LinearisedPoints]) -> LinearisedPoints:
        """Return all points of several sets."""
        arrays = [(points.z, points.residuals, points.jacobian) for points in parts]
        return LinearisedPoints(*map(np.concatenate, zip(*arrays, strict=True)))

    @property
    def log_posterior(self) -> NDArray[np.float64]:
        """(n,) logarithms, up to a constant, of the probability density of z."""
        return np.asarray(squared_norms(self.residuals) / -2.0)

    def at_rows(self, rows: NDArray[np.intp]) -> LinearisedPoints:
        """Return copies of some of the points."""
        return LinearisedPoints(self.z[rows], self.residuals[rows], self.jacobian[rows])

    def copy(self) -> LinearisedPoints:
        """Return points that can be overwritten."""
        return LinearisedPoints(self.z.copy(), self.residuals.copy(), self.jacobian.copy())

    def overwrite(self, rows: NDArray[np.intp], others: LinearisedPoints) -> None:
        """Overwrite the points in `rows` by as many others."""
        self.z[rows], self.residuals[rows], self.jacobian[rows] = others.z, others.residuals, others.jacobian


class TangentMap:
    """The map from z to the components of the residuals along their tangent space at an anchor.

    Parameters
    ----------
    posterior : PosteriorResiduals
    anchors : LinearisedPoints
        Points where the tangents are taken: one for all rows of z, or one for each row.
    """

    def __init__(self, posterior: PosteriorResiduals, anchors: LinearisedPoints) -> None:
        self._posterior = posterior
        self._tangents = np.linalg.qr(anchors.jacobian.transpose(0, 2, 1))[0]

    def components(self, residuals: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the components (n, d) of residuals (n, d + m)."""
        return self._along(residuals, np.arange(len(residuals)))

    def log_determinant(self, points: LinearisedPoints) -> NDArray[np.float64]:
        """Return the logarithm (n,) of the map's Jacobian determinant at points."""
        return np.asarray(np.linalg.slogdet(points.jacobian @ self._tangents)[1])

    def log_density(self, points: LinearisedPoints) -> NDArray[np.float64]:
        """Return the log density (n,), up to a constant, of points whose components are standard normal draws."""
        return self.log_determinant(points) - squared_norms(self.components(points.residuals)) / 2.0

    def solve(
        self, target: NDArray[np.float64], start: LinearisedPoints, most_steps: int
    ) -> tuple[LinearisedPoints, NDArray[np.bool_]]:
        """Find z with given components, for all rows at once.

        Parameters
        ----------
        target : (n, d) array
        start : LinearisedPoints
        most_steps : int

        Returns
        -------
        LinearisedPoints
        (n,) bool array
            Whether each search converged.
        """
        ends = start.copy()
        error = self.components(ends.residuals) - target
        squares = squared_norms(error)
        damping, active = np.full(len(error), _SETTINGS.damping), np.flatnonzero(squares > _SETTINGS.tolerance)
        for _ in range(most_steps):
            if not len(active):
                break
            step, trusted = self._steps(ends, error[active], active, target[active], damping[active])
            tried = LinearisedPoints.at(self._posterior, np.clip(ends.z[active] + step, -Z_LIMIT, Z_LIMIT))
            new_error = self._along(tried.residuals, active) - target[active]
            new_squares = squared_norms(new_error)
            better = trusted & (new_squares < squares[active])
            accepted = active[better]
            ends.overwrite(accepted, tried.at_rows(np.flatnonzero(better)))
            error[accepted], squares[accepted] = new_error[better], new_squares[better]
            damping[active] *= np.where(better, *_SETTINGS.damping_factors)
            active = active[(squares[active] > _SETTINGS.tolerance) & (damping[active] < 1e8)]
        return ends, squares <= 100.0 * _SETTINGS.tolerance

    def _tangents_of(self, rows: NDArray[np.intp]) -> NDArray[np.float64]:
        return self._tangents if len(self._tangents) == 1 else self._tangents[rows]

    def _along(self, residuals: NDArray[np.float64], rows: NDArray[np.intp]) -> NDArray[np.float64]:
        return np.asarray((residuals[:, np.newaxis] @ self._tangents_of(rows))[:, 0])

    def _steps(
        self,
        points: LinearisedPoints,
        error: NDArray[np.float64],
        rows: NDArray[np.intp],
        target: NDArray[np.float64],
        damping: NDArray[np.float64],
    ) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Return damped steps with half their geodesic acceleration, and which of them may be trusted."""
        along = points.jacobian[rows] @ self._tangents_of(rows)
        matrix = along @ along.transpose(0, 2, 1)
        diagonal = np.einsum("ndd->nd", matrix).copy()
        np.einsum("ndd->nd", matrix)[:] += damping[:, np.newaxis] * diagonal
        to_step = -np.linalg.solve(matrix, along)
        velocity = _multiply(to_step, error)
        longest = np.abs(velocity).max(axis=1)
        velocity *= np.minimum(1.0, _SETTINGS.longest_step / np.maximum(longest, np.finfo(float).tiny))[:, np.newaxis]
        probed = self._posterior.residuals(points.z[rows] + _SETTINGS.probe * velocity)
        change = (self._along(probed, rows) - target - error) / _SETTINGS.probe
        bend = 2.0 / _SETTINGS.probe * (change - _multiply(along.transpose(0, 2, 1), velocity))
        acceleration = _multiply(to_step, bend)
        lengths = [np.einsum("nd,nd->n", diagonal, vector**2) for vector in (acceleration, velocity)]
        return velocity + acceleration / 2.0, lengths[0] <= _SETTINGS.largest_bend**2 * lengths[1]


def decorrelate(
    posterior: PosteriorResiduals,
    points: LinearisedPoints,
    random: np.random.Generator,
    progress: Progress = silent,
) -> LinearisedPoints:
    """Move points by Metropolis steps until they are independent of their starts."""
    correlation = 1.0
    for number in range(_SETTINGS.most_metropolis_steps):
        progress("independence", number, _SETTINGS.most_metropolis_steps)
        points, acceptance = metropolis_step(posterior, points, random)
        correlation *= 1.0 - (1.0 - _SETTINGS.correlation) * acceptance
        if correlation < _SETTINGS.remaining_correlation:
            break
    return points


def metropolis_step(
    posterior: PosteriorResiduals, points: LinearisedPoints, random: np.random.Generator
) -> tuple[LinearisedPoints, float]:
    """Move each point by one step that leaves the posterior invariant.

    Parameters
    ----------
    posterior : PosteriorResiduals
    points : LinearisedPoints
    random : numpy.random.Generator

    Returns
    -------
    LinearisedPoints
    float
        Fraction of the steps that were accepted.

    Notes
    -----
    In the tangent map anchored at a point, the posterior is nearly standard normal, however curved its valley is. The
    proposal therefore has the components ``0.6 u + 0.8 n``, with those of the point, u, and a standard normal draw n.
    The Metropolis-Hastings rule makes the step exact: the density of a proposal is that of its components times the
    map's determinant. A proposal whose reverse does not return, because the map folds over, is rejected.
    """
    forth = TangentMap(posterior, points)
    components = forth.components(points.residuals)
    drawn = random.standard_normal(components.shape)
    target = _SETTINGS.correlation * components + np.sqrt(1.0 - _SETTINGS.correlation**2) * drawn
    ends, converged = forth.solve(target, points, _SETTINGS.metropolis_iterations)
    back = TangentMap(posterior, ends)
    log_ratio = ends.log_posterior - points.log_posterior
    log_ratio += _log_proposal(back, ends, points) - _log_proposal(forth, points, ends)
    accepted = np.flatnonzero(converged & (np.log(random.random(len(converged))) < log_ratio))
    if len(accepted):
        accepted = accepted[_are_reversible(posterior, points.at_rows(accepted), ends.at_rows(accepted))]
    moved = points.copy()
    moved.overwrite(accepted, ends.at_rows(accepted))
    return moved, len(accepted) / len(converged)


def _log_proposal(tangent_map: TangentMap, start: LinearisedPoints, end: LinearisedPoints) -> NDArray[np.float64]:
    """Return the log density of proposals `end` from `start`, the map's anchors."""
    kept = _SETTINGS.correlation * tangent_map.components(start.residuals)
    squares = squared_norms(tangent_map.components(end.residuals) - kept)
    return np.asarray(tangent_map.log_determinant(end) - squares / (2.0 * (1.0 - _SETTINGS.correlation**2)))


def _are_reversible(posterior: PosteriorResiduals, start: LinearisedPoints, end: LinearisedPoints) -> NDArray[np.bool_]:
    """Return which steps lead back to their start when they are reversed."""
    back = TangentMap(posterior, end)
    returned, converged = back.solve(back.components(start.residuals), end, _SETTINGS.metropolis_iterations)
    return np.asarray(converged & (np.abs(returned.z - start.z).max(axis=1) < _SETTINGS.return_distance))


def _multiply(matrices: NDArray[Any], vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the products (n, i) of matrices (n, i, k) and vectors (n, k)."""
    return np.asarray((matrices @ vectors[:, :, np.newaxis])[:, :, 0])
