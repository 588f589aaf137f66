"""Measured FRFs, one for each response of an assembly, each on its own lines within the assembly's band."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from dovetail.assembly import Assembly
from dovetail.errors import Fault, MeasurementError, listing
from dovetail.frf import Frf
from dovetail.frf.resonance_peaks import resonance_peaks
from dovetail.identification.fitting import one_per_response
from dovetail.identification.fitting.random_error import random_error_variance
from dovetail.identification.posterior.model_error import fit_resonances
from dovetail.measurement import find_gaps, find_missing_ends, on_grid, within_band

__all__ = ["MeasuredLines"]

_RECIPROCITY, _EXCESS = 0.05, 3.0
"""Relative difference of two reciprocal FRFs that is reported, and its ratio to the one that random errors explain."""
_LINES_OF_WIDTH = 2.0
"""Lines within the half-power width of a resonance below which this is reported."""
_FEWEST_OF_PEAK = 5
"""Lines of a measurement in which a peak has a width."""
_MOST_GAPS = 5
"""Largest number of gaps that a warning lists."""


@dataclass(frozen=True, eq=False)
class MeasuredLines:
    """Measured FRFs, one for each response of an assembly, and their lines within its band.

    Parameters
    ----------
    described : Assembly
        On the description's frequencies; the band reaches from the first to the last of them.
    whole : tuple of Frf
        The FRFs as they were given.
    frfs : tuple of Frf
        The FRFs on their lines within the band.
    unweighted : tuple of Frf or None
        The same with their own random error, if the user weights the lines otherwise.
    """

    described: Assembly
    whole: tuple[Frf, ...]
    frfs: tuple[Frf, ...]
    unweighted: tuple[Frf, ...] | None = None

    @staticmethod
    def of(assembly: Assembly, measured: Frf | Sequence[Frf]) -> MeasuredLines:
        """Return the lines of one FRF, or of one for each response.

        Raises
        ------
        MeasurementError
            There are more or fewer FRFs than responses; or names all that have too few lines within the band.
        """
        whole = one_per_response(assembly, measured)
        pairs = zip(whole, assembly.each_response, strict=True)
        select = partial(within_band, left_out=assembly.description.left_out)
        return MeasuredLines(assembly, whole, _each(select, pairs))

    @cached_property
    def assembly(self) -> Assembly:
        """The assembly on the measured lines of each response."""
        return self.described.on(*(frf.frequency for frf in self.frfs))

    @property
    def band(self) -> tuple[float, float]:
        """The description's first and last frequency [Hz]."""
        frequency = self.described.frequency
        return float(frequency.min()), float(frequency.max())

    def resampled(self, assembly: Assembly) -> tuple[Frf, ...]:
        """Interpolate the measurements to the frequencies of an assembly, as the features of a network need them.

        Raises
        ------
        MeasurementError
            Names all that do not cover these frequencies, or whose lines are too far apart.
        """
        pairs = zip(one_per_response(assembly, self.whole), assembly.each_response, strict=True)
        return _each(on_grid, pairs)

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings about parts of the band without lines, and about reciprocal FRFs that differ."""
        messages = []
        for frf, alone, where in self._responses:
            ends = " and from ".join(
                f"{low:.6g} to {high:.6g} Hz" for low, high in find_missing_ends(frf, alone.frequency)
            )
            if ends:
                first, last = frf.frequency[[0, -1]]
                messages.append(
                    f"The measurement{where} has no lines from {ends}: it was compared from "
                    f"{first:.6g} to {last:.6g} Hz only."
                )
            gaps = self._gaps(frf)
            if gaps:
                messages.append(
                    f"The measurement{where} lacks lines between {_listed(gaps)}: nothing was compared there."
                )
        return (*messages, *self._reciprocity_warnings())

    def narrow_resonances(self, fitted: Sequence[NDArray[np.complex128]]) -> Iterable[str]:
        """Yield a warning for each measurement with peaks that are narrower than two of its lines.

        Parameters
        ----------
        fitted : sequence of (n_freq,) complex arrays
            The model's FRF on the lines of each measurement; its poles have the width.
        """
        for (frf, _, where), values in zip(self._responses, fitted, strict=True):
            if len(frf.frequency) < _FEWEST_OF_PEAK:
                continue
            spacing, peaks = np.gradient(frf.frequency), resonance_peaks(frf)
            narrow = list[str]()
            for pole in fit_resonances([frf], [values]).poles if peaks.size else ():
                lines = float(np.interp(pole.real, frf.frequency, spacing))
                is_measured = np.min(np.abs(peaks - pole.real)) < max(lines, 2.0 * pole.imag)
                if is_measured and 2.0 * pole.imag < _LINES_OF_WIDTH * lines:
                    narrow.append(f"{pole.real:.5g} Hz ({2.0 * pole.imag:.2g} Hz wide, lines every {lines:.2g} Hz)")
            if narrow:
                yield (
                    f"The measurement{where} has resonances narrower than two of its lines, "
                    f"at {listing(narrow, _MOST_GAPS)}: their damping and height depend on one or two values. "
                    "Measure with a finer resolution."
                )

    def _reciprocity_warnings(self) -> Iterable[str]:
        """Yield a warning for each pair of reciprocal FRFs that differ by more than their random error.

        FRFs with a calibration are left out: they may differ.
        """
        calibrated = self.described.description.calibrations
        for (first, one, here), (second, other, there) in combinations(self._responses, 2):
            of_first, of_second = one.description.response, other.description.response
            exchanged = (of_first.point, of_first.force_point) == (of_second.force_point, of_second.point)
            if not exchanged or of_first.is_drive_point or {of_first.name, of_second.name} & calibrated.keys():
                continue
            apart, explained = _difference_of_reciprocals(first.to("receptance"), second.to("receptance"))
            if apart > max(_RECIPROCITY, _EXCESS * explained):
                yield (
                    f"The measurements{here} and{there} should be equal by reciprocity. Half of their lines differ by "
                    f"{100 * apart:.2g} % or more, and random errors explain {100 * explained:.2g} %: a gain, a "
                    "sensor or a point is not what the description says, or the structure is not linear."
                )

    @property
    def warnings_of_features(self) -> tuple[str, ...]:
        """Warnings about gaps over which the features of a network were interpolated."""
        return tuple(
            f"The measurement{where} lacks lines between {_listed(gaps)}: the network was given values "
            "interpolated over that."
            for frf, _, where in self._responses
            if (gaps := self._gaps(frf))
        )

    def _gaps(self, frf: Frf) -> list[tuple[float, float]]:
        """Return the gaps of a measurement apart from the bands that the description leaves out."""
        left_out = self.described.description.left_out
        return [
            (below, above)
            for below, above in find_gaps(frf)
            if not any(low < above and high > below for low, high in left_out)
        ]

    @property
    def _responses(self) -> Iterable[tuple[Frf, Assembly, str]]:
        """Measurement and assembly of each response, and words that say which one if there are several."""
        labels = self.described.description.response_labels
        places = [f" at {label}" if len(labels) > 1 else "" for label in labels]
        return zip(self.frfs, self.described.each_response, places, strict=True)


def _each(prepare: Callable[[Frf, NDArray[np.float64]], Frf], pairs: Iterable[tuple[Frf, Assembly]]) -> tuple[Frf, ...]:
    """Prepare each FRF for its response's frequencies; raise the faults of all FRFs together."""
    prepared, faults = [], list[Fault]()
    for frf, alone in pairs:
        try:
            prepared.append(prepare(frf, alone.frequency))
        except MeasurementError as error:
            faults += error.faults
    if faults:
        raise MeasurementError(*faults)
    return tuple(prepared)


def _difference_of_reciprocals(first: Frf, second: Frf) -> tuple[float, float]:
    """Return the median relative difference on common lines, and the one that random errors explain."""
    _, rows, others = np.intersect1d(first.frequency, second.frequency, return_indices=True)
    if not len(rows):
        return 0.0, 0.0
    pair = (first, rows), (second, others)
    values = [
        frf.values[lines] if first.has_phase and second.has_phase else frf.amplitude[lines] for frf, lines in pair
    ]
    size = np.maximum((np.abs(values[0]) + np.abs(values[1])) / 2.0, np.finfo(float).tiny)
    deviation = np.sqrt(sum(random_error_variance(frf)[lines] for frf, lines in pair))
    return float(np.median(np.abs(values[0] - values[1]) / size)), float(np.median(deviation / size))


def _listed(gaps: Sequence[tuple[float, float]]) -> str:
    named = ", ".join(f"{low:.6g} and {high:.6g} Hz" for low, high in gaps[:_MOST_GAPS])
    return f"{named}, and in {len(gaps) - _MOST_GAPS} further places" if len(gaps) > _MOST_GAPS else named
