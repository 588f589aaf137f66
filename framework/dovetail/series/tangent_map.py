"""Randomize-then-optimize for a series: the map of the single identification, in the form of an arrow.

The components of the residuals along their tangent space are L^-1 J0^T r, with L L^T = J0^T J0. Its derivative, but for
L, has the form of an arrow, so that the cost of a step is linear in the number of tests.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dovetail.inference.posterior.likelihood import Z_LIMIT
from dovetail.inference.posterior.randomize_then_optimize import LinearisedPoints, TangentMap
from dovetail.series.arrow import ArrowMatrix, ArrowRoot
from dovetail.series.residuals import SeriesResiduals

Array = NDArray[np.float64]


class ArrowTangentMap(TangentMap):
    """The map from z to the components of the residuals of a series along their tangent space at an anchor.

    Parameters
    ----------
    residuals : SeriesResiduals
    anchors : LinearisedPoints
        Points where the tangents are taken: one for all rows of z, or one for each row.
    held : sequence of int
        Shared unknowns that are components themselves; the others are those of the map at given values of these.
    """

    def __init__(self, residuals: SeriesResiduals, anchors: LinearisedPoints, held: Sequence[int] = ()) -> None:
        self._residuals = residuals
        self._jacobian = residuals.without_rows(anchors.jacobian, held)
        covariance = residuals.products(self._jacobian, self._jacobian, np.ones_like(anchors.z))
        self._root = covariance.root()

    def along(self, residuals: Array, rows: NDArray[np.intp]) -> Array:
        """Return the components (n, d) of residuals by the tangents of some of the rows."""
        chosen = self.at_rows(rows)
        return chosen._root.solve(self._residuals.gradient(chosen._jacobian, residuals))

    def log_determinant(self, points: LinearisedPoints) -> Array:
        """Return the logarithm (n,) of the map's Jacobian determinant at points."""
        return self._derivative(points).log_determinant() - self._root.log_determinant()

    def at_rows(self, rows: NDArray[np.intp]) -> ArrowTangentMap:
        """Return the map with the tangents of some of the rows."""
        if len(self._jacobian) == 1:
            return self
        chosen = object.__new__(ArrowTangentMap)
        chosen._residuals, chosen._jacobian = self._residuals, self._jacobian[rows]
        chosen._root = self._root.at_rows(rows)
        return chosen

    def overwrite(self, rows: NDArray[np.intp], others: TangentMap) -> None:
        """Overwrite the tangents of `rows` by as many others."""
        assert isinstance(others, ArrowTangentMap)
        self._jacobian[rows] = others._jacobian
        for mine, theirs in zip(self._root.arrays, others._root.arrays, strict=True):
            mine[rows] = theirs

    def residuals(self, z: Array) -> Array:
        """Return the residuals at points z (n, d)."""
        return self._residuals.residuals(z)

    def tried(self, z: Array) -> LinearisedPoints:
        """Linearise the residuals at points z (n, d), moved within the limits of z."""
        return self._residuals.linearise(np.clip(z, -Z_LIMIT, Z_LIMIT))

    def derivative(self, points: LinearisedPoints, rows: NDArray[np.intp]) -> ArrowDerivative:
        """Return the derivative of the components at some of the points."""
        chosen = self.at_rows(rows)
        return ArrowDerivative(chosen._root, chosen._derivative(points.at_rows(rows)))

    def _derivative(self, points: LinearisedPoints) -> ArrowMatrix:
        """Return the derivatives of J0^T r at points."""
        return self._residuals.products(self._jacobian, points.jacobian, np.ones_like(points.z))


@dataclass(frozen=True, eq=False)
class ArrowDerivative:
    """Derivatives L^-1 D of the components.

    Parameters
    ----------
    root : ArrowRoot
        L.
    matrix : ArrowMatrix
        D, those of J0^T r.
    """

    root: ArrowRoot
    matrix: ArrowMatrix

    def times(self, step: Array) -> Array:
        """Return the linear changes (n, d) of the components with steps (n, d)."""
        return self.root.solve(self.matrix.times(step))

    def solve(self, change: Array) -> Array:
        """Return the steps (n, d) with these linear changes (n, d); see `ArrowMatrix.solve` on singular derivatives."""
        return self.matrix.solve(self.root.times(change))
