"""Clipped measurements: peaks cut off by an overloaded channel."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from dovetail.frf import Frf
from dovetail.identification.fitting.random_error import random_error_variance

__all__ = ["Clipping", "find_clipping", "share_near_maximum"]


@dataclass(frozen=True)
class Settings:
    """What counts as a plateau of clipped lines."""

    smoothed_lines: int = 5
    """Lines over which amplitudes are averaged, so that noise does not hide a plateau."""
    near_maximum: float = 0.75
    """Amplitude over the largest from which a line may belong to a plateau."""
    clipped: float = 0.9
    """Amplitude over the plateau's level from which a line is taken as clipped."""
    least_share: float = 0.004
    """Share of all lines that a plateau has at least; a sharp resonance has fewer."""
    most_share: float = 0.3
    """Share of all lines that a plateau has at most; a flat FRF has more."""
    unknown_deviation: float = 1e3
    """Standard deviation of the values on clipped lines, over the plateau's level: they count next to nothing."""


_SETTINGS = Settings()


@dataclass(frozen=True, eq=False)
class Clipping:
    """Where a measurement may be clipped.

    Parameters
    ----------
    level : float
        Amplitude of the plateau.
    unclipped : Frf
        The measurement with a very large variance on the clipped lines.
    """

    level: float
    unclipped: Frf


def find_clipping(target: Frf) -> Clipping | None:
    """Return where a measurement may be clipped, or None if too few or too many lines are near its maximum."""
    plateau = _near_maximum(target.amplitude)
    if not _SETTINGS.least_share <= plateau.mean() <= _SETTINGS.most_share:
        return None
    level = float(np.median(target.amplitude[plateau]))
    variance = random_error_variance(target)
    clipped = plateau | (target.amplitude > _SETTINGS.clipped * level - 3.0 * np.sqrt(variance))
    variance = np.where(clipped, (_SETTINGS.unknown_deviation * level) ** 2, variance)
    return Clipping(level, replace(target, variance=variance, coherence=None))


def share_near_maximum(amplitude: NDArray[np.float64]) -> float:
    """Return the share of the lines (n_freq,) whose amplitude is close to the largest."""
    return float(_near_maximum(amplitude).mean())


def _near_maximum(amplitude: NDArray[np.float64]) -> NDArray[np.bool_]:
    smooth = uniform_filter1d(amplitude, _SETTINGS.smoothed_lines, mode="nearest")
    return np.asarray(smooth > _SETTINGS.near_maximum * smooth.max())
