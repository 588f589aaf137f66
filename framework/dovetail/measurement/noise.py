"""Noise for synthetic measurements and for robustness tests."""

from __future__ import annotations

import numbers
from dataclasses import replace
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dovetail.frf import Frf

NoiseKind = Literal["proportional", "uniform"]
"""Noise in proportion to each line's amplitude, or equal on all lines."""
NOISE_KINDS = get_args(NoiseKind)
"""All values of `NoiseKind`."""


def complex_noise(
    values: ArrayLike, relative: float, seed: int | np.random.Generator, *, kind: NoiseKind = "proportional"
) -> NDArray[np.complex128]:
    """Return complex values with circular Gaussian noise.

    Parameters
    ----------
    values : (..., n_freq) complex array
        An FRF, in any quantity.
    relative : float
        Standard deviation of the complex noise, relative to the reference given by `kind`: 0.01 is one per cent. Real
        and imaginary part each have 1/sqrt(2) of it.
    seed : int or numpy.random.Generator
        The same seed gives the same noise.
    kind : {"proportional", "uniform"}
        Relative to the magnitude of each line, or the same on all lines, relative to the standard deviation of the FRF
        over its lines.

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
    noise = _standard_deviation(clean, _check_level(relative), kind) * normal / np.sqrt(2.0)
    return np.asarray(clean + noise, dtype=np.complex128)


def noisy_frf(frf: Frf, relative: float, seed: int | np.random.Generator, *, kind: NoiseKind = "uniform") -> Frf:
    """Return an FRF with the noise of `complex_noise`, and with the variance of that noise.

    Parameters
    ----------
    frf : Frf
        Without noise, with phase.
    relative, seed, kind
        As in `complex_noise`.

    Returns
    -------
    Frf

    Raises
    ------
    ValueError
        `relative` is negative or not finite.
    """
    values = complex_noise(frf.values, relative, seed, kind=kind)
    variance = np.broadcast_to(_standard_deviation(frf.values, relative, kind) ** 2, frf.frequency.shape)
    return replace(frf, values=values, variance=variance)


def _standard_deviation(values: NDArray[np.complex128], relative: float, kind: NoiseKind) -> NDArray[np.float64]:
    size = np.abs(values) if kind == "proportional" else values.std(axis=-1, keepdims=True)
    return np.asarray(relative * size, dtype=np.float64)


def data_noise(values: ArrayLike, level: float, seed: int | np.random.Generator) -> NDArray[np.float64]:
    """Return real data with the noise of the robustness tests: x + level * sigma * n, n ~ N(0, 1).

    Parameters
    ----------
    values : (n_samples, n_freq) array, or any other shape
        For example the amplitudes of many FRFs; sigma is the standard deviation of all values together.
    level : float
        Standard deviation of the noise, relative to sigma.
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
    Processes 14 (2026) 1875, doi:10.3390/pr14121875, section 3. Amplitudes may become negative, as they do there.
    """
    clean = np.asarray(values, dtype=np.float64)
    normal = np.random.default_rng(seed).standard_normal(clean.shape)
    return np.asarray(clean + _check_level(level) * np.std(clean) * normal, dtype=np.float64)


def _check_level(level: float) -> float:
    if not isinstance(level, numbers.Real) or not (np.isfinite(level) and level >= 0):
        raise ValueError(f"a noise level is a number such as 0.01, finite and not negative, not {level!r}.")
    return level
