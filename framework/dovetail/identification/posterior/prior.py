"""Coordinates in which the prior is standard normal, so that prior and measurement are residuals alike."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr, ndtri

from dovetail.identification.fitting.levenberg_marquardt import Linear, SumOfSquares

__all__ = ["FURTHEST", "InCube", "PriorAndData", "fraction_of", "into_cube", "out_of_cube", "quantile_of"]

FURTHEST = 8.0
"""Coordinates beyond which nothing is looked for: the ends of the ranges, to double precision."""


@dataclass(frozen=True, eq=False)
class PriorAndData:
    """Residuals of prior and measurement: ``[z, r]``, half whose squares is the negative log density of z.

    Parameters
    ----------
    misfit : SumOfSquares
        Of p fractions of the ranges, which are uniform before the measurement.

    Notes
    -----
    z are the normal quantiles of the fractions.
    """

    misfit: SumOfSquares

    def residuals(self, z: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return residuals (n, p + m) at z (n, p)."""
        return np.concatenate([z, self.misfit.residuals(fraction_of(z))], axis=1)

    def linear(self, z: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return residuals (n, p + m) and their derivatives (n, p, p + m)."""
        found = self.misfit.linear(fraction_of(z))
        density = np.exp(-(z**2) / 2.0) / np.sqrt(2.0 * np.pi)
        own = np.broadcast_to(np.eye(z.shape[1]), (len(z), z.shape[1], z.shape[1]))
        slopes = np.concatenate([own, found.slopes * density[:, :, np.newaxis]], axis=2)
        return np.concatenate([z, found.residuals], axis=1), slopes


def quantile_of(fraction: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the normal quantiles z of fractions of the ranges."""
    return np.asarray(np.clip(ndtri(fraction), -FURTHEST, FURTHEST))


def fraction_of(z: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the fractions of the ranges of normal quantiles z."""
    return np.asarray(ndtr(z))


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
