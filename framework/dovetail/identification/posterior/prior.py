"""Coordinates in which the prior is standard normal, so that prior and measurement are both residuals.

A coordinate z is the normal quantile of a parameter's fraction of its range. The least-squares search works in the unit
cube instead, whose edges are the coordinates -8 to 8.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr, ndtri

from dovetail.identification.fitting.least_squares import Linearisation, SumOfSquares

__all__ = ["PRIOR_PRECISION", "Z_LIMIT", "CubeResiduals", "PosteriorResiduals", "normal_from_unit", "unit_from_normal"]

PRIOR_PRECISION = 12.0
"""One over the variance of a parameter's fraction of its range under the prior, which is uniform."""

Z_LIMIT = 8.0
"""Largest coordinate: there a parameter is at the end of its range, to double precision."""


@dataclass(frozen=True, eq=False)
class PosteriorResiduals:
    """Residuals of prior and measurement, ``[z, r]``. Half their sum of squares is the negative log density of z.

    Parameters
    ----------
    misfit : SumOfSquares
        Of p fractions of the ranges, over which the prior is uniform.
    """

    misfit: SumOfSquares

    def residuals(self, z: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return residuals (n, p + m) at z (n, p)."""
        return np.concatenate([z, self.misfit.residuals(unit_from_normal(z))], axis=1)

    def linearise(self, z: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return residuals (n, p + m) and their derivatives (n, p, p + m)."""
        misfit = self.misfit.linearise(unit_from_normal(z))
        density = np.exp(-(z**2) / 2.0) / np.sqrt(2.0 * np.pi)
        of_prior = np.broadcast_to(np.eye(z.shape[1]), (len(z), z.shape[1], z.shape[1]))
        jacobian = np.concatenate([of_prior, misfit.jacobian * density[:, :, np.newaxis]], axis=2)
        return np.concatenate([z, misfit.residuals], axis=1), jacobian


class CubeResiduals:
    """Residuals of prior and measurement by the position in the unit cube, for the search of posterior modes.

    Parameters
    ----------
    posterior : PosteriorResiduals
    """

    def __init__(self, posterior: PosteriorResiduals) -> None:
        self._posterior = posterior

    @staticmethod
    def from_normal(z: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the position in the unit cube of normal quantiles z."""
        return (z / Z_LIMIT + 1.0) / 2.0

    @staticmethod
    def to_normal(position: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the normal quantiles z of a position in the unit cube."""
        return (2.0 * position - 1.0) * Z_LIMIT

    def residuals(self, position: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return residuals (n, m) at positions (n, p)."""
        return self._posterior.residuals(self.to_normal(position))

    def linearise(self, position: NDArray[np.float64]) -> Linearisation:
        """Return residuals and derivatives at positions (n, p)."""
        residuals, jacobian = self._posterior.linearise(self.to_normal(position))
        jacobian *= 2.0 * Z_LIMIT
        return Linearisation(residuals, jacobian)


def normal_from_unit(fraction: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the normal quantiles z of fractions of the ranges."""
    return np.asarray(np.clip(ndtri(fraction), -Z_LIMIT, Z_LIMIT))


def unit_from_normal(z: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the fractions of the ranges of normal quantiles z."""
    return np.asarray(ndtr(z))
