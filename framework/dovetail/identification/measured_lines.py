"""What is compared: measured FRFs on their own lines within the band, and the assembly computed there."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from dovetail.assembly import Assembly
from dovetail.errors import Fault, MeasurementError
from dovetail.frf import Frf
from dovetail.identification.fitting import one_per_response
from dovetail.measurement import find_gaps, find_missing_ends, on_grid, within_band

__all__ = ["MeasuredLines"]

_MOST_GAPS = 5
"""Gaps of a measurement that a warning lists."""


@dataclass(frozen=True, eq=False)
class MeasuredLines:
    """Measured FRFs, one for each response of an assembly, and their lines within its band.

    Parameters
    ----------
    described : Assembly
        On the description's frequencies, from the first to the last of which the band reaches.
    whole : tuple of Frf
        As they were given.
    frfs : tuple of Frf
        The same with their lines within the band only.
    """

    described: Assembly
    whole: tuple[Frf, ...]
    frfs: tuple[Frf, ...]

    @staticmethod
    def of(assembly: Assembly, measured: Frf | Sequence[Frf]) -> MeasuredLines:
        """Take one FRF, or one for each response.

        Raises
        ------
        MeasurementError
            There are more or fewer than responses; or all that have too few lines within the band.
        """
        whole = one_per_response(assembly, measured)
        pairs = zip(whole, assembly.each_response, strict=True)
        return MeasuredLines(assembly, whole, _each(within_band, pairs))

    @cached_property
    def assembly(self) -> Assembly:
        """The assembly on the measured lines, those of each response."""
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
            All that do not cover these frequencies, or have lines too far apart.
        """
        pairs = zip(one_per_response(assembly, self.whole), assembly.each_response, strict=True)
        return _each(on_grid, pairs)

    @property
    def warnings(self) -> tuple[str, ...]:
        """Which parts of the band have not been compared, for want of lines."""
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
            gaps = find_gaps(frf)
            if gaps:
                messages.append(
                    f"The measurement{where} lacks lines between {_listed(gaps)}: nothing was compared there."
                )
        return tuple(messages)

    @property
    def warnings_of_features(self) -> tuple[str, ...]:
        """Where the features of a network were interpolated over a gap."""
        return tuple(
            f"The measurement{where} lacks lines between {_listed(gaps)}: the network was given values "
            "interpolated over that."
            for frf, _, where in self._responses
            if (gaps := find_gaps(frf))
        )

    @property
    def _responses(self) -> Iterable[tuple[Frf, Assembly, str]]:
        """The measurement of each response, the assembly there, and words for where it is if there are several."""
        labels = self.described.description.response_labels
        places = [f" at {label}" if len(labels) > 1 else "" for label in labels]
        return zip(self.frfs, self.described.each_response, places, strict=True)


def _each(prepare: Callable[[Frf, NDArray[np.float64]], Frf], pairs: Iterable[tuple[Frf, Assembly]]) -> tuple[Frf, ...]:
    """Return each FRF prepared for its response's frequencies; raise the faults of all together."""
    prepared, faults = [], list[Fault]()
    for frf, alone in pairs:
        try:
            prepared.append(prepare(frf, alone.frequency))
        except MeasurementError as error:
            faults += error.faults
    if faults:
        raise MeasurementError(*faults)
    return tuple(prepared)


def _listed(gaps: Sequence[tuple[float, float]]) -> str:
    named = ", ".join(f"{low:.6g} and {high:.6g} Hz" for low, high in gaps[:_MOST_GAPS])
    return f"{named}, and in {len(gaps) - _MOST_GAPS} further places" if len(gaps) > _MOST_GAPS else named
