"""A measurement whose peaks are cut off: an overloaded channel."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from dovetail.frf import Frf
from dovetail.identification.fitting.random_error import estimated_variance, known_variance

__all__ = ["Plateau", "plateau", "share_at_top"]

_SMOOTHED = 5
"""Lines over which amplitudes are averaged, so that noise makes no plateau."""
_NEAR = 0.75
"""Part of the largest amplitude from which a line may belong to a plateau."""
_TOUCHED = 0.9
"""Part of the plateau from which a line is taken to belong to it."""
_FEWEST, _MOST = 0.004, 0.3
"""Parts of all lines that a plateau has."""
_UNKNOWN = 1e3
"""Standard deviation, over the plateau, of what the lines there would have been."""


@dataclass(frozen=True, eq=False)
class Plateau:
    """Where a measurement may be cut off.

    Parameters
    ----------
    level : float
    lines : (n_freq,) bool array
    rest : Frf
        The measurement, with nothing known on those lines.
    """

    level: float
    lines: NDArray[np.bool_]
    rest: Frf


def plateau(target: Frf) -> Plateau | None:
    """Return where a measurement may be cut off, or None where too few or too many lines are near its largest."""
    lines = _at_top(target.amplitude)
    if not _FEWEST <= lines.mean() <= _MOST:
        return None
    level = float(np.median(target.amplitude[lines]))
    known = known_variance(target)
    variance = estimated_variance(target) if known is None else known
    lines = lines | (target.amplitude > _TOUCHED * level - 3.0 * np.sqrt(variance))
    hidden = np.where(lines, (_UNKNOWN * level) ** 2, variance)
    return Plateau(level, lines, replace(target, variance=hidden, coherence=None))


def share_at_top(amplitude: NDArray[np.float64]) -> float:
    """Return the share of the lines (n_freq,) that are nearly as high as the highest."""
    return float(_at_top(amplitude).mean())


def _at_top(amplitude: NDArray[np.float64]) -> NDArray[np.bool_]:
    smooth = uniform_filter1d(amplitude, _SMOOTHED, mode="nearest")
    return np.asarray(smooth > _NEAR * smooth.max())
