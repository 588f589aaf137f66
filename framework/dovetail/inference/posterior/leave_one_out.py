"""The leave-one-out score: how well each measured value is predicted from all others, by samples of the posterior."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dovetail.inference.posterior.likelihood import Likelihood

_AT_ONCE = 64
"""Samples whose residuals are in memory at a time."""


def line_scores(
    likelihood: Likelihood, fraction: NDArray[np.float64], weight: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the log predictive density (m,) of each residual of a measurement, given all others.

    Parameters
    ----------
    likelihood : Likelihood
    fraction : (n, p) array
        Samples of the posterior, in fractions of the ranges.
    weight : (n,) array

    Notes
    -----
    The errors of the model correlate the residuals. With their inverse covariance P, the density of one given the
    others is normal with the precision P_ii (P.-C. Buerkner, J. Gabry, A. Vehtari, Efficient leave-one-out
    cross-validation for Bayesian non-factorized normal and Student-t models, Computational Statistics 36 (2021)
    1243-1261). Samples are weighted by the inverse of this density, which removes the value from what they know. Large
    weights are truncated, so that the score of a single value with a large influence is too high (E. L. Ionides,
    Truncated importance sampling, Journal of Computational and Graphical Statistics 17 (2008) 295-311). The density is
    that of the residual; of the measured value it differs by a constant that is the same for all models.
    """
    errors = likelihood.errors
    inner = np.linalg.inv(np.eye(len(errors)) + errors @ errors.T)
    precision = 1.0 - np.einsum("km,kl,lm->m", errors, inner, errors, optimize=True)
    log_density = np.empty((len(fraction), len(precision)))
    for first in range(0, len(fraction), _AT_ONCE):
        rows = slice(first, first + _AT_ONCE)
        residuals = likelihood.misfit.residuals(fraction[rows])
        whitened = residuals - (residuals @ errors.T @ inner) @ errors
        log_density[rows] = (np.log(precision / (2.0 * np.pi)) - whitened**2 / precision) / 2.0
    log_ratio = np.log(np.maximum(weight, np.finfo(float).tiny))[:, np.newaxis] - log_density
    ratio = np.exp(log_ratio - log_ratio.max(axis=0))
    ratio = np.minimum(ratio, ratio.mean(axis=0) * np.sqrt(len(fraction)))
    highest = log_density.max(axis=0)
    predicted = np.sum(ratio * np.exp(log_density - highest), axis=0) / ratio.sum(axis=0)
    return np.asarray(np.log(np.maximum(predicted, np.finfo(float).tiny)) + highest)
