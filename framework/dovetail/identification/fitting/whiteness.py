"""Whether residuals are noise: a misfit is alike on neighbouring lines, and stands in one place."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

__all__ = ["assess_runs", "is_white", "log_improbability"]


@dataclass(frozen=True)
class Settings:
    """From where residuals are not noise."""

    false_alarm: float = 1e-6
    """Probability that noise has a run, anywhere, that is not taken for noise."""
    shortest_run: int = 8
    """Lines; fewer may be an interference line."""


_SETTINGS = Settings()


def is_white(residuals: NDArray[np.float64]) -> bool:
    """Return whether residuals (n_freq, n), over their standard deviation, have no run of lines that noise has not.

    Chi-squared averages over all lines. A resonance that the fit places wrongly, or another misfit in one place, is
    seen in the sum of squares of the lines there, and in their sum: neighbouring lines err alike.
    """
    return bool(assess_runs(residuals) <= np.log10(max(1, len(residuals)) / _SETTINGS.false_alarm))


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
    negative_log = -float(chi2.logsf(squares, degrees_of_freedom))
    return (negative_log if np.isfinite(negative_log) else squares / 2.0) / float(np.log(10.0))
