"""The measured lines within the band of a description, and the missing ones: at the ends of the band, and gaps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import ArrayLike, NDArray

from dovetail.errors import Fault, MeasurementError
from dovetail.frf import Frf, in_bands


@dataclass(frozen=True)
class Settings:
    """Which lines lie in a band, and when lines count as missing."""

    tolerance: float = 1e-9
    """Relative distance beyond the band that is allowed for rounding."""
    fewest_residuals: int = 2
    """Smallest number of real values in the band: two for a line with a phase, one without."""
    end_steps: float = 2.0
    """Largest distance of the first line from an end of the band, in measured spacings."""
    gap: float = 3.5
    """Ratio of a spacing to those on either side above which lines are missing: three missing lines are detected, and
    no step of an axis with changing or logarithmic spacing is taken for a gap."""
    neighbours: int = 3
    """Number of spacings on either side of which the median is taken."""


_SETTINGS = Settings()


def within_band(frf: Frf, frequency: ArrayLike, left_out: Sequence[tuple[float, float]] = ()) -> Frf:
    """Select the measured lines within a band, without interpolation.

    Parameters
    ----------
    frf : Frf
        The measurement.
    frequency : (n_freq,) array
        Hz; the band extends from the smallest to the largest.
    left_out : sequence of (float, float)
        Hz; bands, including their ends, in which no lines are selected.

    Returns
    -------
    Frf
        The measurement itself if all of its lines lie within the band. Values, coherence and variance are as measured.

    Raises
    ------
    MeasurementError
        No line lies within the band, or a single one without a phase.
    """
    low, high = _band(frequency)
    tolerance = _SETTINGS.tolerance
    inside = (frf.frequency >= low * (1.0 - tolerance)) & (frf.frequency <= high * (1.0 + tolerance))
    inside &= ~in_bands(frf.frequency, left_out)
    count = int(np.count_nonzero(inside))
    if count * (2 if frf.has_phase else 1) < _SETTINGS.fewest_residuals:
        lines = "no line" if not count else "a single line, without a phase,"
        but = ", without what the description leaves out" if left_out else ""
        problem = f"{lines} of the measurement is within {low:.10g} to {high:.10g} Hz{but}: {_covers(frf)}."
        remedy = "Check the unit of the frequencies, measure there, or change 'frequency' in the description."
        raise MeasurementError(Fault(frf.label, problem, remedy=remedy))
    if inside.all():
        return frf
    coherence, variance = (None if lines is None else lines[inside] for lines in (frf.coherence, frf.variance))
    return replace(
        frf, frequency=frf.frequency[inside], values=frf.values[inside], coherence=coherence, variance=variance
    )


def find_missing_ends(frf: Frf, frequency: ArrayLike) -> tuple[tuple[float, float], ...]:
    """Return the ends of a band, (lowest, highest) Hz each, where a measurement has no lines.

    Parameters
    ----------
    frf : Frf
        With lines within the band only, as `within_band` returns it.
    frequency : (n_freq,) array
        Hz; the band.

    Returns
    -------
    tuple of (float, float)
        None, one or two. An end counts if more than two of the measurement's steps are missing there.
    """
    low, high = _band(frequency)
    first, last = float(frf.frequency[0]), float(frf.frequency[-1])
    spacing = np.diff(frf.frequency) if len(frf.frequency) > 1 else np.zeros(1)
    below = (low, first) if first - low > _SETTINGS.end_steps * spacing[0] + _SETTINGS.tolerance * low else None
    above = (last, high) if high - last > _SETTINGS.end_steps * spacing[-1] + _SETTINGS.tolerance * high else None
    return tuple(end for end in (below, above) if end is not None)


def check_cover(frf: Frf, frequency: ArrayLike) -> None:
    """Check that a measurement reaches both ends of a band.

    Parameters
    ----------
    frf, frequency
        As in `find_missing_ends`.

    Raises
    ------
    MeasurementError
    """
    if find_missing_ends(frf, frequency):
        low, high = _band(frequency)
        problem = f"{_covers(frf)}, and {low:.10g} to {high:.10g} Hz are wanted."
        remedy = "Measure the whole range, or narrow 'frequency' in the description."
        raise MeasurementError(Fault(frf.label, problem, remedy=remedy))


def find_gaps(frf: Frf) -> tuple[tuple[float, float], ...]:
    """Return pairs of neighbouring lines, (lower, upper) in Hz, between which lines are missing.

    Parameters
    ----------
    frf : Frf

    Notes
    -----
    Lines are missing where the spacing is more than 3.5 times the usual one on either side, which is the median of the
    three spacings there.
    """
    spacing = np.diff(frf.frequency)
    if not spacing.size:
        return ()
    width = _SETTINGS.neighbours
    medians = np.median(sliding_window_view(np.pad(spacing, width, mode="reflect"), width), axis=1)
    usual = np.maximum(medians[: spacing.size], medians[width + 1 :])
    wide = np.flatnonzero(spacing > _SETTINGS.gap * usual)
    return tuple((float(frf.frequency[line]), float(frf.frequency[line + 1])) for line in wide)


def _band(frequency: ArrayLike) -> tuple[float, float]:
    lines: NDArray[np.float64] = np.asarray(frequency, dtype=np.float64)
    return float(lines.min()), float(lines.max())


def _covers(frf: Frf) -> str:
    return f"the measurement covers {frf.frequency[0]:.10g} to {frf.frequency[-1]:.10g} Hz"
