"""Randomize-then-optimize: independent samples, each the solution of a least-squares problem with perturbed data.

The tangent map takes z to the components of the residuals along their tangent space at an anchor. Where the residuals
are normal these components are standard normal, however curved the valley of the posterior is. A sample is the z whose
components are a standard normal draw.

References
----------
J. M. Bardsley, A. Solonen, H. Haario, M. Laine, Randomize-then-optimize: a method for sampling from posterior
distributions in nonlinear inverse problems, SIAM J. Sci. Comput. 36 (2014) A1895-A1910.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.inference.posterior.likelihood import Z_LIMIT, PosteriorResiduals, squared_norms
from dovetail.interfaces import NO_LIMIT, TimeLimit


@dataclass(frozen=True)
class Settings:
    """Constants of the searches (damped Gauss-Newton with geodesic acceleration)."""

    damping: float = 1e-4
    """First damping, relative to the diagonal of the normal matrix; starts are near, so little is needed."""
    damping_factors: tuple[float, float] = (1 / 5, 3.0)
    """Change of the damping after a step that comes nearer to the target, and after one that does not."""
    longest_step: float = 0.7
    """Largest change of a coordinate in one step: the prior's standard deviation is 1."""
    probe: float = 0.1
    """Fraction of a step after which the curvature of the residuals along it is measured."""
    largest_bend: float = 1.5
    """Ratio of acceleration to velocity above which a step is not trusted."""
    tolerance: float = 1e-6
    """Squared distance from the target, in standard deviations, at which a search ends. A search that ends within a
    hundred times this distance has converged."""
    most_damping: float = 1e8
    """Damping at which a search is given up."""
    patience: int = 20
    """Steps within which the squared distance from the target must fall, or else a search is given up."""
    least_fall: float = 0.1
    """Part by which it must fall. Of 5260 searches on the collet that end within 200 steps, some of which lead along a
    valley in steps that hardly come nearer, 0.7 % fall less."""


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
    ) -> tuple[LinearisedPoints, NDArray[np.bool_]]:
        """Find z with given components, for all rows at once.

        Parameters
        ----------
        target : (n, d) array
        start : LinearisedPoints
        most_steps : int
        limit : TimeLimit
            After which no further step begins.

        Returns
        -------
        LinearisedPoints
        (n,) bool array
            Whether each search converged.
        """
        searches = TangentSearches(self, target, start, most_steps)
        active = searches.active(np.arange(len(target)))
        while len(active) and not limit.is_over:
            searches.advance(active)
            active = searches.active(active)
        return searches.ends, searches.converged

    def _tangents_of(self, rows: NDArray[np.intp]) -> NDArray[np.float64]:
        return self._tangents if len(self._tangents) == 1 else self._tangents[rows]

    def along(self, residuals: NDArray[np.float64], rows: NDArray[np.intp]) -> NDArray[np.float64]:
        """Return the components of residuals by the tangents of some of the rows."""
        return np.asarray((residuals[:, np.newaxis] @ self._tangents_of(rows))[:, 0])

    def tried(self, z: NDArray[np.float64]) -> LinearisedPoints:
        """Linearise the residuals at points z (n, d), moved within the limits of z."""
        return LinearisedPoints.at(self._posterior, np.clip(z, -Z_LIMIT, Z_LIMIT))

    def steps(
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
        return bent_step(
            to_step=lambda change: _multiply(to_step, change),
            linear=lambda step: _multiply(along.transpose(0, 2, 1), step),
            components=lambda z: self.along(self._posterior.residuals(z), rows) - target,
            z=points.z[rows],
            error=error,
            diagonal=diagonal,
        )


def bent_step(
    *,
    to_step: Callable[[NDArray[np.float64]], NDArray[np.float64]],
    linear: Callable[[NDArray[np.float64]], NDArray[np.float64]],
    components: Callable[[NDArray[np.float64]], NDArray[np.float64]],
    z: NDArray[np.float64],
    error: NDArray[np.float64],
    diagonal: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Return damped steps with half their geodesic acceleration, and which of them may be trusted.

    Parameters
    ----------
    to_step : callable
        Takes changes of the components (n, d) to the damped steps (n, d) that remove them.
    linear : callable
        Takes steps to the linear changes of the components.
    components : callable
        The difference of the components at points (n, d) from their targets.
    z, error : (n, d) arrays
        Where the steps begin, and this difference there.
    diagonal : (n, d) array
        Squared scale of each coordinate, for the lengths of steps.
    """
    velocity = to_step(error)
    longest = np.abs(velocity).max(axis=1)
    velocity *= np.minimum(1.0, _SETTINGS.longest_step / np.maximum(longest, np.finfo(float).tiny))[:, np.newaxis]
    change = (components(z + _SETTINGS.probe * velocity) - error) / _SETTINGS.probe
    acceleration = to_step(2.0 / _SETTINGS.probe * (change - linear(velocity)))
    lengths = [np.einsum("nd,nd->n", diagonal, vector**2) for vector in (acceleration, velocity)]
    return velocity + acceleration / 2.0, lengths[0] <= _SETTINGS.largest_bend**2 * lengths[1]


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
    """

    def __init__(
        self, tangent_map: TangentMap, target: NDArray[np.float64], start: LinearisedPoints, most_steps: int
    ) -> None:
        self._map, self._target, self._most_steps = tangent_map, target.copy(), most_steps
        self.ends = start.copy()
        self._error = tangent_map.components(start.residuals) - target
        self._squares = squared_norms(self._error)
        self._damping, self._steps = np.full(len(target), _SETTINGS.damping), np.zeros(len(target), dtype=np.int64)
        self._before = np.full(len(target), np.inf)  # squared distances when they were last compared
        self._hopeless = np.zeros(len(target), dtype=np.bool_)

    @property
    def converged(self) -> NDArray[np.bool_]:
        """(n,) whether each search is at its target."""
        return np.asarray(self._squares <= 100.0 * _SETTINGS.tolerance)

    def active(self, rows: NDArray[np.intp]) -> NDArray[np.intp]:
        """Return those of `rows` whose searches have not ended."""
        going_on = (self._squares[rows] > _SETTINGS.tolerance) & (self._damping[rows] < _SETTINGS.most_damping)
        return rows[going_on & ~self._hopeless[rows] & (self._steps[rows] < self._most_steps)]

    def restart(
        self, rows: NDArray[np.intp], tangent_map: TangentMap, target: NDArray[np.float64], start: LinearisedPoints
    ) -> None:
        """Begin the searches `rows` again, with as many other tangents, targets and starts."""
        self._map.overwrite(rows, tangent_map)
        self.ends.overwrite(rows, start)
        self._target[rows], self._error[rows] = target, tangent_map.components(start.residuals) - target
        self._squares[rows] = squared_norms(self._error[rows])
        self._damping[rows], self._steps[rows] = _SETTINGS.damping, 0
        self._before[rows], self._hopeless[rows] = np.inf, False

    def advance(self, rows: NDArray[np.intp]) -> None:
        """Take a step in the searches `rows`."""
        target, ends = self._target[rows], self.ends
        step, trusted = self._map.steps(ends, self._error[rows], rows, target, self._damping[rows])
        tried = self._map.tried(ends.z[rows] + step)
        error = self._map.along(tried.residuals, rows) - target
        squares = squared_norms(error)
        better = trusted & (squares < self._squares[rows])
        accepted = rows[better]
        ends.overwrite(accepted, tried.at_rows(np.flatnonzero(better)))
        self._error[accepted], self._squares[accepted] = error[better], squares[better]
        self._damping[rows] *= np.where(better, *_SETTINGS.damping_factors)
        self._steps[rows] += 1
        self._compare(rows[self._steps[rows] % _SETTINGS.patience == 0])

    def _compare(self, rows: NDArray[np.intp]) -> None:
        """Give up those of `rows` that hardly came nearer to their targets since they were last compared."""
        squares = self._squares[rows]
        self._hopeless[rows] = squares > (1.0 - _SETTINGS.least_fall) * self._before[rows]
        self._before[rows] = squares


def _multiply(matrices: NDArray[Any], vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the products (n, i) of matrices (n, i, k) and vectors (n, k)."""
    return np.asarray((matrices @ vectors[:, :, np.newaxis])[:, :, 0])
