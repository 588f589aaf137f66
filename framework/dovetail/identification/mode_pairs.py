"""Which modes of a model belong to which peaks of the reconstructed and of the measured FRF."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dovetail.assembly import VibrationMode
from dovetail.frf import Frf
from dovetail.frf.resonance_peaks import PairedPeaks, counterpart, resonance_peaks
from dovetail.synthesis import Point

__all__ = ["Mode", "paired_modes", "unpaired_peaks"]

_LEAST_SHARE = 0.2
"""Magnitude of a mode's part of the FRF at a peak, over the FRF's, below which the mode does not make the peak."""
_CLOSENESS = 0.15
"""Relative distance within which a natural frequency and a peak can belong together, as for two peaks."""


@dataclass(frozen=True)
class Mode:
    """A natural frequency of the identified model, with its resonance peaks.

    Parameters
    ----------
    natural_frequency : float
        Hz: the magnitude of the pole over 2 pi. NaN for a peak that belongs to no mode.
    reconstructed_peak, measured_peak : float or None
        Hz; where the amplitudes of the two accelerances peak, which damping shifts by some per cent from the natural
        frequency: compare the two. None where the mode has no clear peak, as at a node of vibration.
    damping_ratio : float or None
        Of the critical damping. None in results of earlier versions, whose natural frequencies ignore damping.
    """

    natural_frequency: float
    reconstructed_peak: float | None
    measured_peak: float | None
    damping_ratio: float | None = None


def paired_modes(
    modes: Sequence[VibrationMode], points: tuple[Point, Point], reconstructed: Frf, measured: Frf
) -> tuple[Mode, ...]:
    """Pair each mode with its peak in the reconstructed FRF, and that with its peak in the measured one.

    Parameters
    ----------
    modes : sequence of VibrationMode
        Of the identified model, by frequency.
    points : (Point, Point)
        Where the motion is measured and where the force acts.
    reconstructed, measured : Frf

    Returns
    -------
    tuple of Mode
        One for each mode.

    Notes
    -----
    A reconstructed peak belongs to the mode that contributes most to the receptance there. Of two peaks with the same
    mode the nearer one is taken. Peaks of the two FRFs are counterparts if each is the other's nearest and they are
    close.
    """
    paired = PairedPeaks.of(measured, reconstructed)
    receptance = reconstructed.to("receptance")
    peak_of: dict[int, float] = {}
    for peak in paired.modelled.tolist():
        near = [i for i, mode in enumerate(modes) if abs(mode.natural_frequency - peak) <= _CLOSENESS * peak]
        if not near:
            continue
        parts = [modes[index].contribution(*points, peak) for index in near]
        amplitude = receptance.amplitude[np.argmin(np.abs(receptance.frequency - peak))]
        largest = near[int(np.argmax(parts))]
        natural = modes[largest].natural_frequency
        if max(parts) >= _LEAST_SHARE * amplitude and not abs(peak_of.get(largest, np.inf) - natural) < abs(
            peak - natural
        ):
            peak_of[largest] = peak
    counterparts = {peak: paired.measured_for(peak) for peak in peak_of.values()}
    return tuple(
        Mode(mode.natural_frequency, peak_of.get(i), counterparts.get(peak_of.get(i, np.nan)), mode.damping_ratio)
        for i, mode in enumerate(modes)
    )


def unpaired_peaks(reconstructed: Frf, measured: Frf, modes: Sequence[Mode]) -> tuple[Mode, ...]:
    """Return the measured peaks that belong to no mode, with the reconstructed ones near by that belong to none."""
    taken = [peak for mode in modes for peak in (mode.reconstructed_peak, mode.measured_peak) if peak is not None]

    def free(frf: Frf) -> NDArray[np.float64]:
        peaks = resonance_peaks(frf)
        return peaks[[not np.isclose(peak, taken, rtol=1e-9).any() for peak in peaks]] if len(peaks) else peaks

    others, peaks = free(reconstructed), free(measured)
    return tuple(Mode(np.nan, counterpart(peak, peaks, others), peak) for peak in peaks.tolist())
