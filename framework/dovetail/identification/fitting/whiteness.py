"""Whether residuals are noise, and where not: a misfit is alike on neighbouring lines, and stands in one place."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

__all__ = ["NOISE_ALARM", "assess_runs", "find_deviating_bands", "has_size_of_noise", "is_white", "log_improbability"]

NOISE_ALARM = 1e-6
"""Probability that noise has a run, anywhere, or a sum of squares, that is not taken for noise."""


@dataclass(frozen=True)
class Settings:
    """From where residuals are not noise, and what counts as a band of them."""

    scatter_error: float = 0.15
    """Relative error of a variance that is estimated from the scatter from line to line, of however many lines."""
    scatter_deviation: float = 5.0
    """The same over the inverse root of the number of lines, in addition: quantiles of few lines scatter."""
    shortest_run: int = 8
    """Lines; fewer may be an interference line."""
    windows: tuple[int, ...] = (16, 64, 256)
    """Lines over which squared residuals are averaged, so that narrow and wide bands are detected."""
    deviations: float = 6.0
    """Standard deviations by which such an average must exceed that of noise."""
    share: float = 0.9
    """Share of the whole excess that the bands together hold."""
    clear_excess: float = 3.0
    """Excess of a single line that noise hardly has; the ends of a band are placed by such lines."""
    tail: float = 0.02
    """Share of a segment's excess that may lie outside its band at either end."""
    most_bands: int = 5
    """More are not readable in a sentence."""


_SETTINGS = Settings()


def has_size_of_noise(
    squares: float,
    degrees_of_freedom: int,
    lines: int,
    *,
    variance_known: bool,
    false_alarm: float = NOISE_ALARM,
) -> bool:
    """Return whether a sum of squared residuals, over their variance, is what noise leaves by chance.

    Parameters
    ----------
    squares : float
    degrees_of_freedom : int
    lines : int
        From whose scatter the variance was estimated, if it is not known.
    variance_known : bool
    false_alarm : float
        Probability with which noise has a larger sum.
    """
    error = 0.0 if variance_known else _SETTINGS.scatter_error + _SETTINGS.scatter_deviation / np.sqrt(max(1, lines))
    least = max(0.0, squares - error * degrees_of_freedom)
    return bool(log_improbability(least, degrees_of_freedom) <= -np.log10(false_alarm))


def is_white(residuals: NDArray[np.float64]) -> bool:
    """Return whether residuals (n_freq, n), over their standard deviation, have no run of lines that noise has not.

    Chi-squared averages over all lines. A resonance that the fit places wrongly, or another misfit in one place, is
    seen in the sum of squares of the lines there, and in their sum: neighbouring lines err alike.
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


def log_improbability(squares: float, degrees_of_freedom: int) -> float:
    """Return -log10 of the probability that noise gives so large a sum of squares."""
    negative_log = -float(scipy.stats.chi2.logsf(squares, degrees_of_freedom))
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
    """Return which lines (n_freq,) lie in a window whose mean excess is not noise."""
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
    """Return the first line of each run of True, and the line after its last."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], deviates.astype(np.int8), [0]])))
    return list(zip(edges[0::2].tolist(), edges[1::2].tolist(), strict=True))
