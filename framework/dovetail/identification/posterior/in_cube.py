"""Prior and measurement by a place in the unit cube, in which the searches of least squares move."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dovetail.identification.fitting.least_squares import Linear
from dovetail.identification.posterior.coordinates import FURTHEST, PriorAndData

__all__ = ["InCube", "into_cube", "out_of_cube"]


class InCube:
    """Residuals of prior and measurement by a place in the unit cube, for the search of their least sum.

    Parameters
    ----------
    problem : PriorAndData
        Its z, from -8 to 8, are the edges of the cube.
    """

    def __init__(self, problem: PriorAndData) -> None:
        self._problem = problem

    def residuals(self, position: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return residuals (n, m) at positions (n, d)."""
        return self._problem.residuals(out_of_cube(position))

    def linear(self, position: NDArray[np.float64]) -> Linear:
        """Return residuals and derivatives at positions (n, d)."""
        residuals, slopes = self._problem.linear(out_of_cube(position))
        slopes *= 2.0 * FURTHEST
        return Linear(residuals, slopes, np.einsum("npm,nm->np", slopes, residuals), slopes @ slopes.transpose(0, 2, 1))


def into_cube(z: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the place in the cube of normal quantiles z."""
    return (z / FURTHEST + 1.0) / 2.0


def out_of_cube(position: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the normal quantiles z of a place in the cube."""
    return (2.0 * position - 1.0) * FURTHEST
