"""Coordinates in which the prior is standard normal, so that prior and measurement are residuals alike."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr, ndtri

from dovetail.identification.fitting.least_squares import SumOfSquares

__all__ = ["FURTHEST", "PriorAndData"]

FURTHEST = 8.0
"""Coordinates beyond which nothing is looked for: the ends of the ranges, to double precision."""


@dataclass(frozen=True, eq=False)
class PriorAndData:
    """Residuals of prior and measurement: ``[z, r]``, half whose squares is the negative log density of z.

    Parameters
    ----------
    misfit : SumOfSquares
        Of p fractions of the ranges, which are uniform before the measurement.
    nuisance : (k, m) array
        What one standard deviation of each of k errors of the model adds to the residuals.

    Notes
    -----
    z are the p quantiles of the fractions and the k errors in their standard deviations.
    """

    misfit: SumOfSquares
    nuisance: NDArray[np.float64]

    def coordinates(self, fraction: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return z (..., p + k) of fractions (..., p), without errors of the model."""
        z = np.clip(ndtri(fraction), -FURTHEST, FURTHEST)
        return np.concatenate([z, np.zeros((*z.shape[:-1], len(self.nuisance)))], axis=-1)

    def fraction(self, z: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the fractions (..., p) of coordinates (..., p + k)."""
        return np.asarray(ndtr(z[..., : z.shape[-1] - len(self.nuisance)]))

    def residuals(self, z: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return residuals (n, p + k + m) at z (n, p + k)."""
        errors = z[:, z.shape[1] - len(self.nuisance) :]
        return np.concatenate([z, self.misfit.residuals(self.fraction(z)) + errors @ self.nuisance], axis=1)

    def linear(self, z: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return residuals (n, p + k + m) and their derivatives (n, p + k, p + k + m)."""
        count, size = z.shape
        p = size - len(self.nuisance)
        found = self.misfit.linear(self.fraction(z))
        density = np.exp(-(z[:, :p] ** 2) / 2.0) / np.sqrt(2.0 * np.pi)
        slopes = np.zeros((count, size, size + found.residuals.shape[1]))
        slopes[:, np.arange(size), np.arange(size)] = 1.0
        slopes[:, :p, size:] = found.slopes * density[:, :, np.newaxis]
        slopes[:, p:, size:] = self.nuisance
        return np.concatenate([z, found.residuals + z[:, p:] @ self.nuisance], axis=1), slopes
