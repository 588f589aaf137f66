"""Where in frequency a measurement is off."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["off_bands"]

_LENGTHS = (16, 64, 256)
"""Lines over which what is left is averaged: narrow bands and wide ones."""
_OFF = 6.0
"""Standard deviations by which the mean of the squares must be too large."""
_SHARE = 0.9
"""Part of all that is too large that the bands together hold."""
_CLEARLY = 3.0
"""Excess of a line that noise hardly has."""
_TAIL = 0.02
"""Part of a stretch's excess that may lie outside a band at either end."""
_MOST = 5


def off_bands(frequency: NDArray[np.float64], lines: NDArray[np.float64]) -> tuple[tuple[float, float], ...]:
    """Return the bands [Hz] in which residuals are larger than noise, those with the most of it first.

    Parameters
    ----------
    frequency : (n_freq,) array
    lines : (n_freq, parts) array
        White where nothing but noise is left.

    Returns
    -------
    tuple of (float, float)
        At most five, which together hold nine tenths of what is too large; none where no run of lines stands out.
    """
    excess = np.mean(lines**2, axis=1) - 1.0
    bands = []
    for first, last in _stretches(_off(excess, lines.shape[1])):
        low, high = first + _within(excess[first:last])
        bands.append((float(np.sum(excess[first:last])), float(frequency[low]), float(frequency[high])))
    bands.sort(reverse=True)
    whole, held, kept = sum(size for size, _, _ in bands), 0.0, []
    for size, low, high in bands[:_MOST]:
        kept.append((low, high))
        held += size
        if held >= _SHARE * whole:
            break
    return tuple(kept)


def _within(excess: NDArray[np.float64]) -> NDArray[np.intp]:
    """Return the first and the last line of a stretch between which nearly all lies of what is clearly too large."""
    held = np.cumsum(np.maximum(excess - _CLEARLY, 0.0))
    found = np.searchsorted(held, held[-1] * np.array([_TAIL, 1.0 - _TAIL]))
    return np.asarray(np.minimum(found, len(held) - 1))


def _off(excess: NDArray[np.float64], parts: int) -> NDArray[np.bool_]:
    off = np.zeros(len(excess), dtype=np.bool_)
    for length in _LENGTHS:
        if length > len(excess):
            break
        means = np.convolve(excess, np.ones(length) / length, mode="valid")
        for start in np.flatnonzero(means > _OFF * np.sqrt(2.0 / (parts * length))).tolist():
            off[start : start + length] = True
    return off


def _stretches(off: NDArray[np.bool_]) -> list[tuple[int, int]]:
    edges = np.flatnonzero(np.diff(np.concatenate([[0], off.astype(np.int8), [0]])))
    return list(zip(edges[0::2].tolist(), edges[1::2].tolist(), strict=True))
