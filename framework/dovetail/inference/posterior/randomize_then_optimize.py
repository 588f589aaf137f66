"""Randomize-then-optimize: independent samples, each the solution of a least-squares problem with perturbed data.

The tangent map takes z to the components of the residuals along their tangent space at an anchor. Where the residuals
are normal these components are standard normal, however curved the valley of the posterior is. A sample is the z whose
components are a standard normal draw.

A search follows the path on which the components go straight to the target: damped Newton steps, bent as the path is,
whose lengths depend on how far the path's next step differs from the one that was expected. Lengths are measured in z,
so that narrow valleys, in which every step leaves the residuals' scale, are no obstacle.

References
----------
J. M. Bardsley, A. Solonen, H. Haario, M. Laine, Randomize-then-optimize: a method for sampling from posterior
distributions in nonlinear inverse problems, SIAM J. Sci. Comput. 36 (2014) A1895-A1910.
P. Deuflhard, Newton methods for nonlinear problems: affine invariance and adaptive algorithms (2004), sections 3.1-3.3.
M. K. Transtrum, J. P. Sethna, Improvements to the Levenberg-Marquardt algorithm for nonlinear least-squares
minimization (2012), arXiv:1201.5885: steps with half their acceleration.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from dovetail.inference.posterior.likelihood import Z_LIMIT, PosteriorResiduals, squared_norms
from dovetail.interfaces import NO_LIMIT, TimeLimit
from dovetail.meanwhile import in_parts


@dataclass(frozen=True)
class Settings:
    """Constants of the searches (damped Newton steps with half their acceleration)."""

    first_fraction: float = 0.1
    """Fraction of the first Newton step that is taken."""
    least_fraction: float = 1e-3
    """Fraction at which a search is given up: the map is about to fold over."""
    probe: float = 0.1
    """Part of a step after which the curvature of the residuals along it is measured."""
    largest_bend: float = 2.0
    """Length of half the acceleration over that of the step, up to which a step goes."""
    deviation: float = 1.0
    """Deviation from the path, over the length of the step, for which the fraction of the next step is chosen."""
    decrease: float = 0.5
    """Part of the fraction taken by which the Newton step must become shorter, or else the step is rejected."""
    rejected: tuple[float, float] = (0.1, 0.5)
    """Smallest and largest change of the fraction after a step that is rejected."""
    growth: float = 3.0
    """Largest change of the fraction after a step that is accepted."""
    rise: float = 100.0
    """Rise of chi-squared with which a step is rejected: it has left the valley, and derivatives there mislead."""
    tolerance: float = 1e-6
    """Squared distance from the target, in standard deviations, at which a search ends. A search that ends within a
    hundred times this distance has converged."""


Accepts = Callable[[NDArray[np.intp], NDArray[np.bool_], "LinearisedPoints"], NDArray[np.bool_]]
"""Takes numbers of searches, whether they have converged, and their ends; returns which of them have been found."""

_SETTINGS = Settings()
_TINY = np.finfo(float).tiny
_DERIVATIVES_APART = 100_000
"""Derivatives at the points of searches from which these take half the time in two processes, or nearly so."""


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
        there = posterior.linearise(z)
        return LinearisedPoints(z, there.residuals, there.jacobian)

    @staticmethod
    def joined(parts: Sequence[LinearisedPoints]) -> LinearisedPoints:
        """Return all points of several sets."""
        arrays = [(points.z, points.residuals, points.jacobian) for points in parts]
        return LinearisedPoints(*map(np.concatenate, zip(*arrays, strict=True)))

    @property
    def log_posterior(self) -> NDArray[np.float64]:
        """(n,) logarithms, up to a constant, of the probability density of z."""
        return np.asarray(squared_norms(self.residuals) / -2.0)

    @property
    def fewest_apart(self) -> int:
        """Number of points from which searches are worth a process of their own."""
        return -(-_DERIVATIVES_APART // max(1, self.jacobian[:1].size))

    def at_rows(self, rows: NDArray[np.intp]) -> LinearisedPoints:
        """Return copies of some of the points."""
        return LinearisedPoints(self.z[rows], self.residuals[rows], self.jacobian[rows])

    def copy(self) -> LinearisedPoints:
        """Return points that can be overwritten."""
        return LinearisedPoints(self.z.copy(), self.residuals.copy(), self.jacobian.copy())

    def overwrite(self, rows: NDArray[np.intp], others: LinearisedPoints) -> None:
        """Overwrite the points in `rows` by as many others."""
        self.z[rows], self.residuals[rows], self.jacobian[rows] = others.z, others.residuals, others.jacobian


def nearest_rows(components: NDArray[np.float64], target: NDArray[np.float64]) -> NDArray[np.intp]:
    """Return for each target (k, d) the row of the components (n, d) that is nearest to it."""
    return np.asarray(np.argmin(squared_norms(components) - 2.0 * target @ components.T, axis=1))


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
        return self.along(residuals, np.arange(len(residuals)))

    def log_determinant(self, points: LinearisedPoints) -> NDArray[np.float64]:
        """Return the logarithm (n,) of the map's Jacobian determinant at points."""
        return self.signed_log_determinant(points)[1]

    def signed_log_determinant(self, points: LinearisedPoints) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the sign and the logarithm (n,) of the map's Jacobian determinant at points."""
        sign, logarithm = np.linalg.slogdet(points.jacobian @ self._tangents)
        return sign, logarithm

    def all_components(self, residuals: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the components (n, k, d) of residuals (n, d + m) by the maps of all k anchors."""
        count, _, width = self._tangents.shape
        flat = residuals @ np.swapaxes(self._tangents, 0, 1).reshape(residuals.shape[1], -1)
        return np.asarray(flat.reshape(len(residuals), count, width))

    def log_density(self, points: LinearisedPoints) -> NDArray[np.float64]:
        """Return the log density (n,), up to a constant, of points whose components are standard normal draws."""
        return self.log_determinant(points) - squared_norms(self.components(points.residuals)) / 2.0

    def at_rows(self, rows: NDArray[np.intp]) -> TangentMap:
        """Return the map with the tangents of some of the rows."""
        chosen = copy(self)
        chosen._tangents = self._tangents_of(rows).copy()
        return chosen

    def overwrite(self, rows: NDArray[np.intp], others: TangentMap) -> None:
        """Overwrite the tangents of `rows` by as many others."""
        self._tangents[rows] = others._tangents

    def solve(
        self,
        target: NDArray[np.float64],
        start: LinearisedPoints,
        most_steps: int,
        limit: TimeLimit = NO_LIMIT,
        *,
        accepts: Accepts = lambda _rows, converged, _ends: converged,
        again: Callable[[NDArray[np.intp]], LinearisedPoints] | None = None,
    ) -> tuple[LinearisedPoints, NDArray[np.bool_]]:
        """Find z with given components, for all rows at once.

        Parameters
        ----------
        target : (n, d) array
        start : LinearisedPoints
        most_steps : int
            Of each search.
        limit : TimeLimit
            After which no further step begins.
        accepts : callable
            Takes some rows (k,), whether their searches have converged, and where these have ended; returns which ends
            count as found. All that converged do by default.
        again : callable, optional
            Takes rows that are not found to other starts, from which they are searched for once more.

        Returns
        -------
        LinearisedPoints
        (n,) bool array
            Which rows are found.
        """

        def search(rows: NDArray[np.intp]) -> tuple[LinearisedPoints, NDArray[np.bool_]]:
            searches = TangentSearches(self.at_rows(rows), target[rows], start.at_rows(rows), most_steps)
            accepted, is_first = np.zeros(len(rows), dtype=np.bool_), np.full(len(rows), again is not None)

            def settle(ended: NDArray[np.intp]) -> NDArray[np.intp]:
                accepted[ended] = accepts(rows[ended], searches.converged[ended], searches.ends.at_rows(ended))
                missed = np.asarray(ended[~accepted[ended] & is_first[ended]])
                if again is not None and len(missed):
                    is_first[missed] = False
                    searches.begin_at(missed, again(rows[missed]))
                return missed

            searches.run(settle, limit)
            return searches.ends, accepted

        parts = in_parts(search, len(target), start.fewest_apart, lambda: limit.was_stopped)
        ends, are_accepted = zip(*parts, strict=True)
        return LinearisedPoints.joined(ends), np.concatenate(are_accepted)

    def _tangents_of(self, rows: NDArray[np.intp]) -> NDArray[np.float64]:
        return self._tangents if len(self._tangents) == 1 else self._tangents[rows]

    def along(self, residuals: NDArray[np.float64], rows: NDArray[np.intp]) -> NDArray[np.float64]:
        """Return the components of residuals by the tangents of some of the rows."""
        return np.asarray((residuals[:, np.newaxis] @ self._tangents_of(rows))[:, 0])

    def residuals(self, z: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the residuals (n, d + m) at points z (n, d)."""
        return self._posterior.residuals(z)

    def tried(self, z: NDArray[np.float64]) -> LinearisedPoints:
        """Linearise the residuals at points z (n, d), moved within the limits of z."""
        return LinearisedPoints.at(self._posterior, np.clip(z, -Z_LIMIT, Z_LIMIT))

    def derivative(self, points: LinearisedPoints, rows: NDArray[np.intp]) -> MapDerivative:
        """Return the derivative of the components at some of the points."""
        return _DenseDerivative(np.swapaxes(points.jacobian[rows] @ self._tangents_of(rows), 1, 2))


class MapDerivative(Protocol):
    """The derivatives of the components by z at n points."""

    def times(self, step: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the linear changes (n, d) of the components with steps (n, d)."""
        ...

    def solve(self, change: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the steps (n, d) with these linear changes (n, d), 0 where the derivative is singular."""
        ...


class _DenseDerivative:
    """Derivatives (n, d, d)."""

    def __init__(self, matrices: NDArray[np.float64]) -> None:
        self._matrices = matrices
        self._inverse = solve_each(matrices, np.broadcast_to(np.eye(matrices.shape[1]), matrices.shape))

    def times(self, step: NDArray[np.float64]) -> NDArray[np.float64]:
        return _multiply(self._matrices, step)

    def solve(self, change: NDArray[np.float64]) -> NDArray[np.float64]:
        return _multiply(self._inverse, change)


class TangentSearches:
    """Searches, each for the point whose components by a tangent map have given values.

    Each has its own number of steps, so that one that has ended can begin again while others go on.

    Parameters
    ----------
    tangent_map : TangentMap
    target : (n, d) array
    start : LinearisedPoints
    most_steps : int

    Attributes
    ----------
    ends : LinearisedPoints
        Where the searches have come to.
    iterations : int
        Steps that all of them have taken in `run`.
    """

    def __init__(
        self, tangent_map: TangentMap, target: NDArray[np.float64], start: LinearisedPoints, most_steps: int
    ) -> None:
        self._map, self._target, self._most_steps = tangent_map, target.copy(), most_steps
        self.iterations = 0
        self.ends = start.copy()
        self._error = tangent_map.components(start.residuals) - target
        self._squares = squared_norms(self._error)
        self._fraction = np.full(len(target), _SETTINGS.first_fraction)
        self._steps = np.zeros(len(target), dtype=np.int64)

    @property
    def converged(self) -> NDArray[np.bool_]:
        """(n,) whether each search is at its target."""
        return np.asarray(self._squares <= 100.0 * _SETTINGS.tolerance)

    def run(self, settle: Callable[[NDArray[np.intp]], NDArray[np.intp]], limit: TimeLimit) -> None:
        """Advance all searches until they have ended.

        `settle` is called after each step with the searches that have ended, and returns those that begin again.
        """
        going_on = np.arange(len(self._target))
        while len(going_on) and not limit.is_over:
            active = self.active(going_on)
            self.advance(active)
            self.iterations += len(active)
            active = self.active(active)
            ended = np.setdiff1d(going_on, active, assume_unique=True)
            going_on = np.union1d(active, settle(ended)) if len(ended) else active

    def active(self, rows: NDArray[np.intp]) -> NDArray[np.intp]:
        """Return those of `rows` whose searches have not ended."""
        going_on = (self._squares[rows] > _SETTINGS.tolerance) & (self._fraction[rows] > _SETTINGS.least_fraction)
        return rows[going_on & (self._steps[rows] < self._most_steps)]

    def restart(
        self, rows: NDArray[np.intp], tangent_map: TangentMap, target: NDArray[np.float64], start: LinearisedPoints
    ) -> None:
        """Begin the searches `rows` again, with as many other tangents, targets and starts."""
        self._map.overwrite(rows, tangent_map)
        self._target[rows] = target
        self.begin_at(rows, start)

    def begin_at(self, rows: NDArray[np.intp], start: LinearisedPoints) -> None:
        """Begin the searches `rows` again, from as many other starts."""
        self.ends.overwrite(rows, start)
        self._error[rows] = self._map.along(start.residuals, rows) - self._target[rows]
        self._squares[rows] = squared_norms(self._error[rows])
        self._fraction[rows], self._steps[rows] = _SETTINGS.first_fraction, 0

    def advance(self, rows: NDArray[np.intp]) -> None:
        """Take a step in the searches `rows`."""
        fraction, derivative = self._fraction[rows], self._map.derivative(self.ends, rows)
        newton = derivative.solve(-self._error[rows])
        acceleration = self._acceleration(rows, derivative, newton)
        length, bend = _lengths(newton), _lengths(acceleration) / 2.0
        fraction /= np.maximum(1.0, fraction * bend / (_SETTINGS.largest_bend * np.maximum(length, _TINY)))
        part = fraction[:, np.newaxis]
        tried = self._map.tried(self.ends.z[rows] + part * newton + part**2 / 2.0 * acceleration)
        error = self._map.along(tried.residuals, rows) - self._target[rows]
        left = derivative.solve(-error)
        deviation = _lengths(left - (1.0 - part) * newton)
        suitable = fraction * np.sqrt(_SETTINGS.deviation * fraction * length) / np.sqrt(np.maximum(deviation, _TINY))
        nearer = _lengths(left) < (1.0 - _SETTINGS.decrease * fraction) * length
        nearer &= squared_norms(tried.residuals) <= squared_norms(self.ends.residuals[rows]) + _SETTINGS.rise
        least, most = _SETTINGS.rejected
        rejected = np.clip(suitable, least * fraction, most * fraction)
        longer = np.clip(suitable, 2.0 * _SETTINGS.least_fraction, np.minimum(_SETTINGS.growth * fraction, 1.0))
        self._fraction[rows] = np.where(nearer, longer, rejected)
        accepted = rows[nearer]
        self.ends.overwrite(accepted, tried.at_rows(np.flatnonzero(nearer)))
        self._error[accepted], self._squares[accepted] = error[nearer], squared_norms(error[nearer])
        self._steps[rows] += 1

    def _acceleration(
        self, rows: NDArray[np.intp], derivative: MapDerivative, newton: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return the accelerations (n, d) of the paths at `rows`, 0 where the whole Newton step is taken."""
        ahead = _SETTINGS.probe * self._fraction[rows, np.newaxis]
        linear, curvature = derivative.times(ahead * newton), np.zeros_like(newton)
        bent = np.flatnonzero(self._fraction[rows] < 1.0)
        if bent.size:
            some = rows[bent]
            residuals = self._map.residuals(self.ends.z[some] + ahead[bent] * newton[bent])
            change = self._map.along(residuals, some) - self._target[some] - self._error[some]
            curvature[bent] = 2.0 / ahead[bent] ** 2 * (change - linear[bent])
        return derivative.solve(-curvature)


def _lengths(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.sqrt(squared_norms(vectors))


def _multiply(matrices: NDArray[Any], vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the products (n, i) of matrices (n, i, k) and vectors (n, k)."""
    return np.asarray((matrices @ vectors[:, :, np.newaxis])[:, :, 0])


def solve_each(matrices: NDArray[np.float64], right: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the solutions (n, d, k) of systems with matrices (n, d, d); 0 where a matrix is singular."""
    try:
        return np.asarray(np.linalg.solve(matrices, right))
    except np.linalg.LinAlgError:
        solutions, regular = np.zeros(right.shape), np.linalg.det(matrices) != 0.0
        solutions[regular] = np.linalg.solve(matrices[regular], right[regular])
        return solutions
