"""Faults in the records of an impact test: an overload, a second hit, a response that has not decayed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Settings:
    """Limits for faults of a record.

    Parameters
    ----------
    clipped_samples : int
        Smallest number of samples at the highest level in a clipped record; two may be equal by chance.
    second_hit : float
        Smallest peak of a second hit that counts, relative to that of the pulse.
    above_noise : float
        Smallest peak of a second pulse, relative to the median magnitude of the record.
    ringing : float
        Amplitude in the last twentieth of the record, relative to the highest response, above which there is leakage.
    fewest_samples : int
        Smallest number of samples of a record in whose spectrum pyFRF can distinguish two hits from one.
    """

    clipped_samples: int = 3
    second_hit: float = 0.02
    above_noise: float = 8.0
    ringing: float = 0.01
    fewest_samples: int = 1024


_SETTINGS = Settings()


class SignalFault(NamedTuple):
    """A fault of one impact.

    Parameters
    ----------
    impact : int
        From 1.
    is_bad : bool
        Whether the impact should be left out, because of an overload or a second hit.
    problem : str
        A sentence that describes the fault.
    """

    impact: int
    is_bad: bool
    problem: str


def check_signals(
    force: Array, response: Array, rate: float, full_scale: tuple[float, float] | None
) -> list[SignalFault]:
    """Return the faults of each impact.

    pyFRF looks for second hits in the spectrum. A second hit counts only if there is also a second pulse in the record,
    since pyFRF takes the spectrum of a long pulse for that of two.

    Parameters
    ----------
    force, response : (n_impacts, n_samples) arrays
    rate : float
        Samples per second.
    full_scale : (float, float) or None
        Range of the two channels, if known.
    """
    faults = []
    for number, (pulse, signal) in enumerate(zip(force, response, strict=True), start=1):
        for name, channel, limit in zip(
            ("force", "response"), (pulse, signal), full_scale or (None, None), strict=True
        ):
            if _is_overloaded(channel, limit):
                faults.append(SignalFault(number, True, f"impact {number}: the {name} is overloaded."))
        second = _second_hit(pulse, rate)
        if second is not None and _spectrum_of_two(pulse):
            share, time = second
            problem = f"impact {number}: a second hit of {100 * share:.0f} % at {time:.4g} s."
            faults.append(SignalFault(number, True, problem))
        remaining = np.sqrt(2.0 * np.mean(signal[-max(signal.size // 20, 1) :] ** 2)) / np.abs(signal).max()
        if remaining > _SETTINGS.ringing:
            problem = (
                f"impact {number}: the response still has {100 * remaining:.0f} % of its highest value at the end."
            )
            faults.append(SignalFault(number, False, problem))
    return faults


def _is_overloaded(channel: Array, limit: float | None) -> bool:
    if limit is not None and np.abs(channel).max() >= limit:
        return True
    highest = np.abs(channel).max()
    return int(np.sum(np.abs(channel) == highest)) >= _SETTINGS.clipped_samples


def _spectrum_of_two(pulse: Array) -> bool:
    """Return whether the spectrum has the ripple of two pulses; always True for a short record."""
    return pulse.size < _SETTINGS.fewest_samples or not _pyfrf_checker(pulse.size).is_data_ok(
        pulse, pulse, overflow_samples=pulse.size + 1
    )


def _pyfrf_checker(samples: int):  # type: ignore[no-untyped-def]  # pyFRF has no types
    from pyFRF import FRF

    return FRF(1, fft_len=samples)


def _second_hit(pulse: Array, rate: float) -> tuple[float, float] | None:
    """Return the height of the highest second pulse, relative to the first, and its time [s]; None without one."""
    magnitude = np.abs(pulse)
    first = int(magnitude.argmax())
    threshold = _SETTINGS.second_hit * magnitude[first]
    low = magnitude < threshold
    after = np.flatnonzero(low[first:])
    before = np.flatnonzero(low[: first + 1])
    rest = magnitude.copy()
    rest[before[-1] + 1 if before.size else 0 : first + (after[0] if after.size else low.size)] = 0.0
    second = int(rest.argmax())
    if rest[second] < max(threshold, _SETTINGS.above_noise * np.median(magnitude)):
        return None
    return float(rest[second] / magnitude[first]), second / rate
