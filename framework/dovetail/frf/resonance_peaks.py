"""Resonance peaks of FRFs, and the pairs of measured and modelled peaks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dovetail.frf.frequency_response import Frf


@dataclass(frozen=True)
class Settings:
    """Tuning constants of the peaks."""

    prominence: float = 6.0
    """dB by which a peak rises above the lines on either side, so that it has half-power lines."""
    floor: float = 60.0
    """Floor of the amplitude: this many standard deviations of the noise, divided by the prominence in dB (10 at 6 dB).
    At such a floor the noise of thousands of lines reaches half the prominence."""
    skewness: float = 0.25
    """Distance between the highest line and the parabola's vertex, over the width, above which a peak is skewed."""
    points_per_line: int = 50
    """Points per line at which the quartic of a skewed peak is evaluated."""
    closeness: float = 0.15
    """Relative distance within which two frequencies can belong to the same mode."""
    lines: int = 400
    """Lines over which the noise is taken as constant; it varies with frequency. A narrow peak, whose second
    differences are not noise, has far fewer."""


_SETTINGS = Settings()

_MEDIAN_COMPLEX, _MEDIAN_REAL = 1.1774, 0.6745
"""Median magnitude of noise over the standard deviation of its real part: sqrt(2 ln 2), and the normal quartile."""


def resonance_peaks(frf: Frf, prominence: float = _SETTINGS.prominence) -> NDArray[np.float64]:
    """Find the resonance peaks of an FRF.

    Parameters
    ----------
    frf : Frf
    prominence : float
        dB by which a peak must rise above the lines on either side. A smaller value finds the low peaks of modes that
        the joint damps.

    Returns
    -------
    (n_peaks,) array
        Hz, increasing.

    Notes
    -----
    The noise is estimated from the second differences of the values. The amplitude has a floor above it, so that noise
    in an antiresonance makes no peak. Each peak is placed by a parabola through ``1/|receptance|^2`` over ``omega^2``
    within the half-power lines: for a single mode that is exact, and it averages the noise. A peak that other modes
    skew, or that is too low for half-power lines (less than 6 dB), is where a quartic through the accelerance is
    highest, within half its prominence.
    """
    accelerance = frf.to("accelerance")
    if len(accelerance.frequency) < 3:
        return np.empty(0)
    floor = _SETTINGS.floor / prominence * noise_deviation(accelerance)
    level = 10.0 * np.log10(np.maximum(accelerance.amplitude**2 + floor**2, np.finfo(np.float64).tiny))
    tops, prominences = prominent_peaks(level, prominence)
    peaks = zip(tops.tolist(), prominences.tolist(), strict=True)
    return np.array([_peak_frequency(accelerance, top, height) for top, height in peaks])


def counterpart(
    frequency: float, among: NDArray[np.float64], others: NDArray[np.float64], closeness: float = _SETTINGS.closeness
) -> float | None:
    """Return the frequency in `others` that matches one in `among`: each is the other's nearest, and they are close.

    Parameters
    ----------
    frequency : float
        Hz, one of `among`.
    among, others : (n,) arrays
        Hz.
    closeness : float
        Largest relative distance of the two.

    Returns
    -------
    float or None
    """
    if not others.size:
        return None
    candidate = float(others[np.argmin(np.abs(others - frequency))])
    nearest = among[np.argmin(np.abs(among - candidate))]
    return candidate if nearest == frequency and abs(candidate - frequency) <= closeness * frequency else None


@dataclass(frozen=True, eq=False)
class PairedPeaks:
    """The resonance peaks of a measured FRF and of the model's FRF on the same lines, in pairs where they match.

    Parameters
    ----------
    measured, modelled : (n,) arrays
        Hz, increasing.
    """

    measured: NDArray[np.float64]
    modelled: NDArray[np.float64]

    def measured_for(self, peak: float) -> float | None:
        """Return the measured counterpart of a peak of the model, or None."""
        return counterpart(peak, self.modelled, self.measured)

    @property
    def unpaired(self) -> NDArray[np.float64]:
        """The measured peaks [Hz] without a counterpart."""
        paired = {self.measured_for(peak) for peak in self.modelled.tolist()}
        return np.array([peak for peak in self.measured.tolist() if peak not in paired])

    def without(self, taken: Sequence[float]) -> PairedPeaks:
        """Return the peaks except some."""
        measured, modelled = (
            peaks[[not np.isclose(peak, taken, rtol=1e-9).any() for peak in peaks]] if len(peaks) else peaks
            for peaks in (self.measured, self.modelled)
        )
        return PairedPeaks(measured, modelled)


@dataclass(frozen=True)
class PeakPair:
    """A measured resonance peak and the model's counterpart.

    Parameters
    ----------
    measured, modelled : float
        Frequencies, Hz.
    amplitudes : (float, float)
        Of the two FRFs on the lines nearest to their peaks.
    line_spacing : float
        Median distance of the measurement's lines, Hz.
    """

    measured: float
    modelled: float
    amplitudes: tuple[float, float]
    line_spacing: float

    @property
    def distance(self) -> float:
        """Distance of the two peaks, relative to the measured frequency."""
        return abs(self.modelled - self.measured) / self.measured

    @property
    def clear_distance(self) -> float:
        """The distance minus the line spacing, which limits how exactly a peak is located; at least 0."""
        return max(0.0, abs(self.modelled - self.measured) - self.line_spacing) / self.measured

    @property
    def log_ratio(self) -> float:
        """Logarithm of the ratio of measured to modelled amplitude."""
        return float(np.log(self.amplitudes[0] / self.amplitudes[1]))


def pair_peaks(measured: Frf, modelled: Frf) -> tuple[list[PeakPair], int]:
    """Return the pairs of matching peaks of two FRFs on the same lines, and the number of other measured peaks."""
    peaks, others = resonance_peaks(measured), resonance_peaks(modelled)
    spacing = float(np.median(np.diff(measured.frequency))) if len(measured.frequency) > 1 else 0.0
    candidates = [(peak, counterpart(peak, peaks, others)) for peak in peaks.tolist()]
    pairs = [
        PeakPair(peak, other, (_amplitude_at(measured, peak), _amplitude_at(modelled, other)), spacing)
        for peak, other in candidates
        if other is not None
    ]
    return pairs, len(peaks) - len(pairs)


def _amplitude_at(frf: Frf, frequency: float) -> float:
    """Return the amplitude on the line nearest to a frequency [Hz]."""
    return float(frf.amplitude[np.argmin(np.abs(frf.frequency - frequency))])


def noise_deviation(frf: Frf) -> NDArray[np.float64]:
    """Estimate the standard deviation (n_freq,) of the noise of each value's real part, from three lines or more."""
    second = np.abs(np.diff(frf.values if frf.has_phase else frf.values.real, 2))
    scale = (_MEDIAN_COMPLEX if frf.has_phase else _MEDIAN_REAL) * np.sqrt(6.0)  # a second difference has 6 variances
    count = max(1, len(second) // _SETTINGS.lines)
    middles, levels = ([np.median(part) for part in np.array_split(a, count)] for a in (frf.frequency[1:-1], second))
    return np.asarray(np.interp(frf.frequency, middles, levels) / scale)


def _peak_frequency(frf: Frf, top: int, prominence: float) -> float:
    """Place the peak around line `top` between the lines."""
    if prominence < _SETTINGS.prominence:
        return _skewed_peak(frf, _lines_above(frf, top, prominence / 2.0))
    around = _lines_above(frf, top, 10.0 * np.log10(2.0))
    if not frf.amplitude[around].all():
        return _skewed_peak(frf, around)
    squared = (frf.frequency[around] / frf.frequency[top]) ** 2
    receptance = frf.amplitude[around] / squared
    curvature, slope, _ = np.polyfit(squared - 1.0, (receptance[top - around.start] / receptance) ** 2, 2)
    vertex = 1.0 - slope / (2.0 * curvature) if curvature > 0 else np.inf
    if abs(vertex - 1.0) > _SETTINGS.skewness * (squared[-1] - squared[0]):
        return _skewed_peak(frf, around)
    return float(frf.frequency[top] * np.sqrt(vertex))


def _skewed_peak(frf: Frf, around: slice) -> float:
    """Return where a quartic through the amplitude is highest: such a peak is steep on one side, flat on the other."""
    frequency, amplitude = frf.frequency[around], frf.amplitude[around]
    position = np.linspace(-1.0, 1.0, _SETTINGS.points_per_line * frequency.size)
    middle, half = (frequency[0] + frequency[-1]) / 2.0, (frequency[-1] - frequency[0]) / 2.0
    curve = np.polyfit((frequency - middle) / half, amplitude, min(4, frequency.size - 1))
    return float(middle + half * position[np.argmax(np.polyval(curve, position))])


def _lines_above(frf: Frf, top: int, drop: float) -> slice:
    """Return the lines around a peak that are less than `drop` dB below it, and at least its neighbours."""
    upper = frf.amplitude >= frf.amplitude[top] * 10.0 ** (-drop / 20.0)
    first = last = top
    while first > 0 and upper[first - 1]:
        first -= 1
    while last < len(upper) - 1 and upper[last + 1]:
        last += 1
    return slice(max(min(first, top - 1), 0), min(max(last, top + 1), len(upper) - 1) + 1)


def prominent_peaks(level: NDArray[np.float64], prominence: float) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    """Return the peaks of a curve (n,) with a prominence of at least this size, and their prominences.

    As by `scipy.signal.find_peaks`, whose module takes half a second to load: a peak's prominence is its height above
    the higher one of the lowest values between it and the next higher ones, or the ends. The middle of a flat peak
    counts, and the ends are not peaks.
    """
    firsts = np.flatnonzero(np.concatenate([[True], level[1:] != level[:-1]]))  # of runs of equal values
    runs, lasts = level[firsts], np.append(firsts[1:], len(level)) - 1
    tops = 1 + np.flatnonzero((runs[1:-1] > runs[:-2]) & (runs[1:-1] > runs[2:]))
    heights, bases = runs[tops], np.minimum.reduceat(runs, np.concatenate([[0], tops]))
    while True:  # leave out peaks that do not rise enough above the way to a higher neighbour
        before, after = np.append(-np.inf, heights[:-1]), np.append(heights[1:], -np.inf)
        low = (before > heights) & (heights - bases[:-1] < prominence)
        low |= (after > heights) & (heights - bases[1:] < prominence)
        if not low.any():
            break
        kept = np.flatnonzero(~low)
        tops, heights = tops[kept], heights[kept]
        bases = np.minimum.reduceat(bases, np.concatenate([[0], kept + 1]))
    left, right = _lowest_before(heights, bases[:-1]), _lowest_before(heights[::-1], bases[:0:-1])[::-1]
    prominences = heights - np.maximum(left, right)
    high = prominences >= prominence
    return ((firsts[tops] + lasts[tops]) // 2)[high], prominences[high]


def _lowest_before(heights: NDArray[np.float64], bases: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the lowest value between each peak and the last higher one before it, given that before each peak."""
    lowest, waiting = [], list[tuple[float, float]]()
    for height, base in zip(heights.tolist(), bases.tolist(), strict=True):
        while waiting and waiting[-1][0] <= height:
            base = min(base, waiting.pop()[1])
        waiting.append((height, base))
        lowest.append(base)
    return np.array(lowest)
