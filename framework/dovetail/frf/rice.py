"""The amplitude of a complex value with circular normal noise, which follows Rice's distribution.

References
----------
S. O. Rice, Mathematical analysis of random noise, Bell System Technical Journal 24 (1945) 46-156.

C. G. Koay, P. J. Basser, Analytically exact correction scheme for signal extraction from noisy magnitude MR signals,
J. Magn. Reson. 179 (2006) 317-322: the noise from mean square and scatter, as in `noise_in_scatter`.
"""

from __future__ import annotations

import numpy as np
import scipy  # loads a part of it when that is first used
from numpy.typing import NDArray

_CLEAR = 1e4
"""Argument of the Bessel functions above which their asymptotic series are exact to double precision."""
_LEVELS = np.linspace(0.0, 1.0, 1001)
"""Shares of noise in a mean square, for which the scatter of amplitudes is tabulated."""


def rice_mean(
    amplitude: NDArray[np.float64], variance: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the mean of |amplitude + complex noise| and its derivative by the amplitude.

    Parameters
    ----------
    amplitude : (..., n) array
        Without noise.
    variance : (n,) array
        E|noise|^2.
    """
    half = amplitude**2 / (2.0 * variance)
    bessel_0, bessel_1 = scipy.special.i0e(half), scipy.special.i1e(half)
    mean = np.sqrt(np.pi * variance) / 2.0 * ((1.0 + 2.0 * half) * bessel_0 + 2.0 * half * bessel_1)
    return mean, np.sqrt(np.pi / variance) / 2.0 * amplitude * (bessel_0 + bessel_1)


def rice_negative_log_density(
    measured: NDArray[np.float64], amplitude: NDArray[np.float64], variance: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the negative log density of measured amplitudes, up to a constant, and its derivative by the variance.

    Parameters
    ----------
    measured, amplitude : (n,) arrays
        With and without noise.
    variance : (n,) array
        E|noise|^2.
    """
    square, product = (measured - amplitude) ** 2 / variance, 2.0 * measured * amplitude / variance
    clear = product > _CLEAR
    near = np.where(clear, _CLEAR, product)
    log_bessel = np.where(clear, -0.5 * np.log(2.0 * np.pi * np.maximum(product, 1.0)), np.log(scipy.special.i0e(near)))
    slope = np.where(clear, -0.5, near * (scipy.special.i1e(near) / scipy.special.i0e(near) - 1.0))
    return np.log(variance) + square - log_bessel, (1.0 - square + slope) / variance


def noise_in_scatter(scatter: NDArray[np.float64], mean_square: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return E|noise|^2 (n,) of complex values whose amplitudes have a variance and a mean square (n,).

    For amplitudes far above the noise it is twice their variance, for pure noise 1 / (1 - pi / 4) times.
    """
    return mean_square * np.interp(
        scatter / np.maximum(mean_square, np.finfo(float).tiny), _scatter_of(_LEVELS), _LEVELS
    )


def _scatter_of(levels: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the variances of amplitudes with a mean square of 1 and these shares (n,) of noise."""
    noise = np.maximum(levels, 1e-3)
    variance = 1.0 - rice_mean(np.sqrt(1.0 - noise), noise)[0] ** 2
    return np.where(levels < noise, levels / 2.0, variance)
