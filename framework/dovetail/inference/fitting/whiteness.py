"""Whether residuals are noise, and where they are not: those of a misfit are correlated between neighbouring lines."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

NOISE_ALARM = 1e-6
"""Probability of a false alarm: that a run of lines, or the sum of squares, of noise is taken for a misfit."""


@dataclass(frozen=True)
class Settings:
    """When residuals are not noise, and which bands of them are reported."""

    scatter_error: float = 0.15
    """Relative error of a variance that is estimated from the scatter from line to line, for any number of lines."""
    scatter_deviation: float = 5.0
    """Additional relative error, times the root of the number of lines: quantiles of few lines scatter."""
    larger: float = 2.0
    """Ratio of a line's estimated variance to the smallest one, above which it counts as larger."""
    few_larger: int = 20
    """Lines of a larger variance that are too few to estimate it."""
    shortest_run: int = 8
    """Lines of the shortest run; fewer may be a line of interference."""
    windows: tuple[int, ...] = (16, 64, 256)
    """Lines over which squared residuals are averaged, so that narrow and wide bands are detected."""
    deviations: float = 6.0
    """Standard deviations by which such an average must exceed that of noise."""
    share: float = 0.9
    """Share of the whole excess that the bands together hold."""
    clear_excess: float = 3.0
    """Excess of a single line that noise hardly ever has; such lines determine the ends of a band."""
    tail: float = 0.02
    """Share of a segment's excess that may lie outside its band at either end."""
    most_bands: int = 5
    """Largest number of bands: a sentence with more is not readable."""


_SETTINGS = Settings()


def is_of_few_lines(variance: NDArray[np.float64]) -> bool:
    """Return whether an estimated variance (n_lines,) is larger on a few lines, such as those of a sharp peak.

    Next to a wrong fit, the misfit of these lines looks like a random error in proportion to the FRF.
    """
    larger = np.count_nonzero(variance > _SETTINGS.larger * variance.min())
    return 0 < int(larger) <= _SETTINGS.few_larger


def has_size_of_noise(
    squares: float, degrees_of_freedom: float, lines: int, *, variance_known: bool, false_alarm: float = NOISE_ALARM
) -> bool:
    """Return whether a sum of squared whitened residuals is one that noise has by chance.

    Parameters
    ----------
    squares : float
    degrees_of_freedom : float
    lines : int
        Number of lines from whose scatter the variance was estimated, if it is not known.
    variance_known : bool
    false_alarm : float
        Probability of a larger sum for noise.
    """
    error = 0.0 if variance_known else _SETTINGS.scatter_error + _SETTINGS.scatter_deviation / np.sqrt(max(1, lines))
    least = max(0.0, squares - error * degrees_of_freedom)
    return bool(log_improbability(least, degrees_of_freedom) <= -np.log10(false_alarm))


def is_white(residuals: NDArray[np.float64]) -> bool:
    """Return whether whitened residuals (n_freq, n) have no run of lines that is improbable for noise.

    Chi-squared averages over all lines. A misplaced resonance, or another local misfit, shows in the sum of squares of
    the lines there, and in their sum, since neighbouring lines deviate in the same direction.
    """
    return bool(assess_runs(residuals) <= np.log10(max(1, len(residuals)) / NOISE_ALARM))


def assess_runs(residuals: NDArray[np.float64]) -> float:
    """Return the significance of the worst run of lines, as -log10 of its probability for noise.

    Parameters
    ----------
    residuals : (n_freq, n) array
        White if the model explains the measurement.
    """
    sums = np.concatenate([np.zeros((1, residuals.shape[1])), np.cumsum(residuals, axis=0)])
    squares = np.concatenate([[0.0], np.cumsum(np.sum(residuals**2, axis=1))])
    worst, length, width = 0.0, _SETTINGS.shortest_run, residuals.shape[1]
    while length <= len(residuals):
        energy = float((squares[length:] - squares[:-length]).max())
        coherent = float((np.sum((sums[length:] - sums[:-length]) ** 2, axis=1) / length).max())
        worst = max(worst, log_improbability(energy, width * length), log_improbability(coherent, width))
        length *= 2
    return worst


def log_improbability(squares: float, degrees_of_freedom: float) -> float:
    """Return -log10 of the probability that noise gives so large a sum of squares."""
    with np.errstate(divide="ignore"):
        negative_log = -float(np.log(scipy.special.chdtrc(degrees_of_freedom, squares)))
    return (negative_log if np.isfinite(negative_log) else squares / 2.0) / float(np.log(10.0))


def find_deviating_bands(
    frequency: NDArray[np.float64], residuals: NDArray[np.float64]
) -> tuple[tuple[float, float], ...]:
    """Return the bands [Hz] in which residuals exceed noise, those with the largest excess first.

    Parameters
    ----------
    frequency : (n_freq,) array
    residuals : (n_freq, n) array
        White if the model explains the measurement.

    Returns
    -------
    tuple of (float, float)
        At most five, which together hold nine tenths of the excess; none if no run of lines stands out.
    """
    excess = np.mean(residuals**2, axis=1) - 1.0
    bands = []
    for first, last in _segments(_deviates(excess, residuals.shape[1])):
        low, high = first + _ends(excess[first:last])
        bands.append((float(np.sum(excess[first:last])), float(frequency[low]), float(frequency[high])))
    bands.sort(reverse=True)
    sizes = np.array([size for size, _, _ in bands])
    needed = int(np.sum(np.cumsum(sizes) < _SETTINGS.share * sizes.sum())) + 1
    return tuple((low, high) for _, low, high in bands[: min(needed, _SETTINGS.most_bands)])


def _ends(excess: NDArray[np.float64]) -> NDArray[np.intp]:
    """Return the first and the last line of a segment between which nearly all of its clear excess lies."""
    total = np.cumsum(np.maximum(excess - _SETTINGS.clear_excess, 0.0))
    ends = np.searchsorted(total, total[-1] * np.array([_SETTINGS.tail, 1.0 - _SETTINGS.tail]))
    return np.asarray(np.minimum(ends, len(total) - 1))


def _deviates(excess: NDArray[np.float64], residuals_per_line: int) -> NDArray[np.bool_]:
    """Return which lines (n_freq,) lie in a window with a mean excess that is too large for noise."""
    deviates = np.zeros(len(excess), dtype=np.bool_)
    for length in _SETTINGS.windows:
        if length > len(excess):
            break
        means = np.convolve(excess, np.ones(length) / length, mode="valid")
        limit = _SETTINGS.deviations * np.sqrt(2.0 / (residuals_per_line * length))
        for start in np.flatnonzero(means > limit).tolist():
            deviates[start : start + length] = True
    return deviates


def _segments(deviates: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Return start and end of each run of True; the end is the line after the last."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], deviates.astype(np.int8), [0]])))
    return list(zip(edges[0::2].tolist(), edges[1::2].tolist(), strict=True))
