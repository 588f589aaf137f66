"""Noise for synthetic measurements and for robustness tests."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["complex_noise", "data_noise"]


def complex_noise(values: ArrayLike, relative: float, seed: int | np.random.Generator) -> NDArray[np.complex128]:
    """Return complex values with circular Gaussian noise in proportion to each line's own magnitude.

    Parameters
    ----------
    values : (..., n_freq) complex array
        An FRF, in any quantity.
    relative : float
        Standard deviation of the complex noise over the magnitude of the line: 0.01 is one per cent. Real and
        imaginary part have 1/sqrt(2) of it each.
    seed : int or numpy.random.Generator
        The same seed gives the same noise.

    Returns
    -------
    (..., n_freq) complex array

    Raises
    ------
    ValueError
        `relative` is negative or not finite.
    """
    clean = np.asarray(values, dtype=np.complex128)
    generator = np.random.default_rng(seed)
    normal = generator.standard_normal(clean.shape) + 1j * generator.standard_normal(clean.shape)
    return np.asarray(clean + _checked(relative) * np.abs(clean) * normal / np.sqrt(2.0), dtype=np.complex128)


def data_noise(values: ArrayLike, level: float, seed: int | np.random.Generator) -> NDArray[np.float64]:
    """Return real data with the noise of the robustness tests: x + level * sigma * n, n ~ N(0, 1).

    Parameters
    ----------
    values : (n_samples, n_freq) array, or any other shape
        For example the amplitudes of many FRFs. sigma is the standard deviation of all of them together.
    level : float
        Standard deviation of the noise over sigma.
    seed : int or numpy.random.Generator
        The same seed gives the same noise.

    Returns
    -------
    array of the shape of `values`

    Raises
    ------
    ValueError
        `level` is negative or not finite.

    References
    ----------
    Section 3 of the reference method. Amplitudes may become negative, as they do there.
    """
    clean = np.asarray(values, dtype=np.float64)
    normal = np.random.default_rng(seed).standard_normal(clean.shape)
    return np.asarray(clean + _checked(level) * np.std(clean) * normal, dtype=np.float64)


def _checked(level: float) -> float:
    if not (np.isfinite(level) and level >= 0):
        raise ValueError(f"a noise level is finite and not negative, not {level!r}.")
    return level
