"""Independent samples by optimisation: each solves the problem for data and prior that are drawn anew."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dovetail.identification.posterior.coordinates import FURTHEST, PriorAndData

__all__ = ["Chart", "Solved"]

_DAMPING, _LESS, _MORE, _MOST_DAMPING = 1e-2, 1 / 5, 2.0, 1e8
_PROBE, _MOST_BENT = 0.1, 1.5
_LONGEST = 2.0
"""Change of one coordinate in one step."""
_ARRIVED = 1e-6
"""Squared distance from the target at which a search ends; a sample within a hundred times of it counts as solved."""


@dataclass(frozen=True, eq=False)
class Solved:
    """Where searches ended.

    Parameters
    ----------
    z : (n, d) array
    reached : (n,) bool array
        Whether the target was reached.
    residuals : (n, d + m) array
    log_density : (n,) array
        Logarithm, but for a constant, of the density with which such samples are drawn.
    """

    z: NDArray[np.float64]
    reached: NDArray[np.bool_]
    residuals: NDArray[np.float64]
    log_density: NDArray[np.float64]


class Chart:
    """The map from z to the residuals' components along their tangent at one place.

    Where residuals are normal these components are standard normal, however curved the valley of z is.

    Parameters
    ----------
    problem : PriorAndData
    at : (d,) array
        Where the tangent is taken, best at the most probable z.

    References
    ----------
    J. M. Bardsley, A. Solonen, H. Haario, M. Laine, Randomize-then-optimize: a method for sampling from posterior
    distributions in nonlinear inverse problems, SIAM J. Sci. Comput. 36 (2014) A1895-A1910.
    """

    def __init__(self, problem: PriorAndData, at: NDArray[np.float64]) -> None:
        self._problem = problem
        _, slopes = problem.linear(at[np.newaxis])
        self._tangent = np.linalg.qr(slopes[0].T)[0]

    def components(self, z: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the components (n, d) of the residuals at z (n, d)."""
        return np.asarray(self._problem.residuals(z) @ self._tangent)

    def solve(self, target: NDArray[np.float64], start: NDArray[np.float64], most_steps: int) -> Solved:
        """Find z whose components are given, all rows side by side.

        Parameters
        ----------
        target, start : (n, d) arrays
        most_steps : int
        """
        z = start.copy()
        residuals, slopes = self._problem.linear(z)
        off, along = residuals @ self._tangent - target, slopes @ self._tangent
        left = np.einsum("nd,nd->n", off, off)
        damping, active = np.full(len(z), _DAMPING), np.flatnonzero(left > _ARRIVED)
        for _ in range(most_steps):
            if not len(active):
                break
            step, trusted = self._steps(z[active], off[active], along[active], target[active], damping[active])
            end = np.clip(z[active] + step, -FURTHEST, FURTHEST)
            new_residuals, new_slopes = self._problem.linear(end)
            new_off = new_residuals @ self._tangent - target[active]
            new_left = np.einsum("nd,nd->n", new_off, new_off)
            better = trusted & (new_left < left[active])
            taken = active[better]
            z[taken], residuals[taken], off[taken] = end[better], new_residuals[better], new_off[better]
            along[taken], left[taken] = new_slopes[better] @ self._tangent, new_left[better]
            damping[active] *= np.where(better, _LESS, _MORE)
            active = active[(left[active] > _ARRIVED) & (damping[active] < _MOST_DAMPING)]
        components = residuals @ self._tangent
        log_density = np.linalg.slogdet(along)[1] - np.einsum("nd,nd->n", components, components) / 2.0
        return Solved(z, left <= 100.0 * _ARRIVED, residuals, log_density)

    def _steps(
        self,
        z: NDArray[np.float64],
        off: NDArray[np.float64],
        along: NDArray[np.float64],
        target: NDArray[np.float64],
        damping: NDArray[np.float64],
    ) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Return damped steps, bent by half their geodesic acceleration, and which of them may be trusted."""
        matrix = along @ along.transpose(0, 2, 1)
        diagonal = np.einsum("ndd->nd", matrix).copy()
        np.einsum("ndd->nd", matrix)[:] += damping[:, np.newaxis] * diagonal
        inverse = np.linalg.inv(matrix)
        velocity = -np.einsum("nde,nek,nk->nd", inverse, along, off)
        longest = np.abs(velocity).max(axis=1)
        velocity *= np.minimum(1.0, _LONGEST / np.maximum(longest, np.finfo(float).tiny))[:, np.newaxis]
        ahead = self.components(z + _PROBE * velocity) - target
        bend = 2.0 / _PROBE * ((ahead - off) / _PROBE - np.einsum("ndk,nd->nk", along, velocity))
        acceleration = -np.einsum("nde,nek,nk->nd", inverse, along, bend)
        lengths = [np.einsum("nd,nd->n", diagonal, vector**2) for vector in (acceleration, velocity)]
        return velocity + acceleration / 2.0, lengths[0] <= _MOST_BENT**2 * lengths[1]
