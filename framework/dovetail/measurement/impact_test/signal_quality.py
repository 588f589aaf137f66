"""What is wrong with the records of an impact test: overload, a second hit, a response that rings on."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = ["Complaint", "complaints"]

_CLIPPED_SAMPLES = 3
"""Samples at the highest level from which a record counts as clipped."""
_SECOND_HIT = 0.02
"""Of the pulse's peak; a smaller second hit does not count."""
_RINGING = 0.01
"""Of the highest response; a vibration of more than that in the record's last twentieth is leakage."""
_FEWEST_SAMPLES = 1024
"""Of a record in whose spectrum pyFRF can tell two hits from one."""

Array = NDArray[np.float64]


class Complaint(NamedTuple):
    """One thing that is wrong with one impact.

    Parameters
    ----------
    impact : int
        From 1.
    is_bad : bool
        The impact had better be left out: overload or a second hit.
    text : str
    """

    impact: int
    is_bad: bool
    text: str


def complaints(force: Array, response: Array, rate: float, full_scale: tuple[float, float] | None) -> list[Complaint]:
    """Return what is wrong with each impact.

    Second hits are looked for by pyFRF; one counts if there also is a second pulse in the record, since the spectrum of
    a long pulse looks to pyFRF like that of two.

    Parameters
    ----------
    force, response : (n_impacts, n_samples) arrays
    rate : float
        Samples per second.
    full_scale : (float, float) or None
        Range of the two channels, where it is known.
    """
    found = []
    for number, (pulse, signal) in enumerate(zip(force, response, strict=True), start=1):
        for name, channel, limit in zip(
            ("force", "response"), (pulse, signal), full_scale or (None, None), strict=True
        ):
            if _is_overloaded(channel, limit):
                found.append(Complaint(number, True, f"impact {number}: the {name} is overloaded."))
        second = _second_hit(pulse, rate)
        if second is not None and _spectrum_of_two(pulse):
            share, time = second
            text = f"impact {number}: a second hit of {100 * share:.0f} % at {time:.4g} s."
            found.append(Complaint(number, True, text))
        left = np.sqrt(2.0 * np.mean(signal[-max(signal.size // 20, 1) :] ** 2)) / np.abs(signal).max()
        if left > _RINGING:
            text = f"impact {number}: the response still has {100 * left:.0f} % of its highest value at the end."
            found.append(Complaint(number, False, text))
    return found


def _is_overloaded(channel: Array, limit: float | None) -> bool:
    if limit is not None and np.abs(channel).max() >= limit:
        return True
    highest = np.abs(channel).max()
    return int(np.sum(np.abs(channel) == highest)) >= _CLIPPED_SAMPLES


def _spectrum_of_two(pulse: Array) -> bool:
    """Whether the spectrum has the ripple of two pulses; taken for granted in a short record."""
    return pulse.size < _FEWEST_SAMPLES or not _checker(pulse.size).is_data_ok(
        pulse, pulse, overflow_samples=pulse.size + 1
    )


def _checker(samples: int):  # type: ignore[no-untyped-def]  # pyFRF has no types
    from pyFRF import FRF

    return FRF(1, fft_len=samples)


def _second_hit(pulse: Array, rate: float) -> tuple[float, float] | None:
    """Return the height of the highest second pulse, over that of the first, and its time; None without one."""
    magnitude = np.abs(pulse)
    first = int(magnitude.argmax())
    threshold = _SECOND_HIT * magnitude[first]
    low = magnitude < threshold
    after = np.flatnonzero(low[first:])
    before = np.flatnonzero(low[: first + 1])
    rest = magnitude.copy()
    rest[before[-1] + 1 if before.size else 0 : first + (after[0] if after.size else low.size)] = 0.0
    second = int(rest.argmax())
    if rest[second] < max(threshold, 8.0 * np.median(magnitude)):
        return None
    return float(rest[second] / magnitude[first]), second / rate
