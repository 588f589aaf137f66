"""The most probable place of the posterior, in the coordinates in which the prior is standard normal."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dovetail.identification.fitting.least_squares import Linear, minimise
from dovetail.identification.posterior.coordinates import FURTHEST, PriorAndData

__all__ = ["InCube", "most_probable"]

_TOLERANCE, _MOST_STEPS = 1e-3, 100


def most_probable(problem: PriorAndData, start: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the most probable z (d,), sought from one place (d,)."""
    position = (start[np.newaxis] / FURTHEST + 1.0) / 2.0
    found = minimise(InCube(problem), position, tolerance=_TOLERANCE, most_steps=_MOST_STEPS)
    return _out_of_cube(found.position[0])


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
        return self._problem.residuals(_out_of_cube(position))

    def linear(self, position: NDArray[np.float64]) -> Linear:
        """Return residuals and derivatives at positions (n, d)."""
        residuals, slopes = self._problem.linear(_out_of_cube(position))
        slopes *= 2.0 * FURTHEST
        return Linear(residuals, slopes, np.einsum("npm,nm->np", slopes, residuals), slopes @ slopes.transpose(0, 2, 1))


def _out_of_cube(position: NDArray[np.float64]) -> NDArray[np.float64]:
    return (2.0 * position - 1.0) * FURTHEST
