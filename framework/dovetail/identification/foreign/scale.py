"""A measurement in another unit or of another quantity than it says."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from dovetail.assembly import Assembly
from dovetail.frf import QUANTITIES, Frf
from dovetail.identification.foreign.altered import AlteredAssembly, factor
from dovetail.identification.foreign.coarse import samples

__all__ = ["rescaled"]

_UNITS: Mapping[float, tuple[str, str]] = {
    1.0: ("", ""),
    9.80665: ("m/s^2 read as g", "g read as m/s^2"),
    4.44822: ("per lbf read as per N", "per N read as per lbf"),
    25.4: ("mm read as inches", "inches read as mm"),
    39.3701: ("inches read as m", "m read as inches"),
    1e3: ("mm read as m", "m read as mm"),
    1e6: ("micrometres read as m", "m read as micrometres"),
    2.0 * np.pi: ("rad/s read as Hz", "Hz read as rad/s"),
    2.0: ("a factor of two", "a factor of two"),
    np.sqrt(2.0): ("peak read as RMS", "RMS read as peak"),
}
"""What makes all values so many times too large, and so many times too small."""
_NEAR = 0.25
"""Difference of logarithms up to which a factor is taken for one of these."""
_LEAST = 0.15


def rescaled(assembly: Assembly, measured: Frf, target: Frf) -> tuple[tuple[Assembly, str], ...]:
    """Return the assembly as it would be measured in another unit or quantity, and in words what that is.

    Parameters
    ----------
    assembly : Assembly
    measured : Frf
        As it came.
    target : Frf
        The same in the quantity of the assembly's response.
    """
    middle = np.median(np.log(samples(assembly)), axis=0)
    difference = np.log(np.maximum(target.amplitude, np.finfo(float).tiny)) - middle
    power = _power(target.frequency, difference)
    turned = np.asarray((2j * np.pi * target.frequency) ** power, dtype=np.complex128)
    offset = float(np.median(difference - np.log(np.abs(turned))))
    found = []
    for sign in (1.0, -1.0):
        for by, unit in _factors(offset):
            if power or sign < 0 or abs(np.log(by)) > _LEAST:
                words = " and ".join(_words(measured, power, by, unit, sign))
                found.append((AlteredAssembly(assembly, factor(sign * by * turned)), words))
    return tuple(found)


def _power(frequency: NDArray[np.float64], difference: NDArray[np.float64]) -> int:
    """Return the whole power of the frequency that a ratio follows."""
    logarithm = np.log(frequency)
    half = len(logarithm) // 2
    order = np.argsort(logarithm)
    low, high = order[:half], order[half:]
    slope = (np.median(difference[high]) - np.median(difference[low])) / (
        np.median(logarithm[high]) - np.median(logarithm[low])
    )
    return int(np.clip(np.round(slope), -4, 4))


def _factors(offset: float) -> list[tuple[float, str]]:
    """Return what a factor may be, the nearest first; nothing where no usual one is near."""
    usual = [(by**sign, words[sign < 0]) for by, words in _UNITS.items() for sign in (1, -1)]
    near = sorted(usual, key=lambda one: abs(np.log(one[0]) - offset))
    return [one for one in dict(near).items() if abs(np.log(one[0]) - offset) <= _NEAR][:2]


def _words(measured: Frf, power: int, by: float, unit: str, sign: float) -> list[str]:
    words = []
    if power:
        actual = QUANTITIES.index(measured.quantity) + power
        words.append(
            f"it were a {QUANTITIES[actual]}, not {_article(measured.quantity)} {measured.quantity}"
            if 0 <= actual < len(QUANTITIES)
            else f"it were multiplied by the frequency to the power {power}"
        )
    if by != 1.0:
        ratio, which = (by, "large") if by > 1.0 else (1.0 / by, "small")
        words.append(f"all values were {ratio:.4g} times too {which} ({unit}?)")
    if sign < 0.0:
        words.append("it had the wrong sign")
    return words


def _article(word: str) -> str:
    return "an" if word[0] in "aeiou" else "a"
