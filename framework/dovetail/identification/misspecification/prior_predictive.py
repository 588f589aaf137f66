"""How near an assembly comes to a measurement with any joint at all: rough, and quick."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d
from scipy.signal import find_peaks
from scipy.stats import qmc

from dovetail.assembly import Assembly
from dovetail.frf import QUANTITIES, Frf
from dovetail.identification.fitting.random_error import estimated_variance, known_variance
from dovetail.identification.misspecification.perturbations import AlteredAssembly, factor

__all__ = ["distance", "furthest", "missing_resonance", "rescaled", "samples"]

_SAMPLES = 64
_CLEAR = 4.0
"""Standard deviations of noise above which an amplitude is compared."""
_MOST = 1.0
"""Difference of logarithms that counts as much as any larger one, as beside a resonance that is elsewhere."""


def samples(assembly: Assembly) -> NDArray[np.float64]:
    """Return FRFs (n, n_freq) of joints from all over the ranges."""
    points = qmc.LatinHypercube(len(assembly.parameters), rng=np.random.default_rng(0)).random(_SAMPLES)
    return np.asarray(np.abs(assembly.frf(assembly.from_unit(points))))


def distance(assembly: Assembly, target: Frf) -> float:
    """Return the mean difference of logarithms of the amplitudes, where they are clear, for the nearest joint tried."""
    known = known_variance(target)
    variance = estimated_variance(target) if known is None else known
    clear = target.amplitude > _CLEAR * np.sqrt(variance)
    if not clear.any():
        return _MOST
    apart = np.minimum(np.abs(np.log(samples(assembly)[:, clear]) - np.log(target.amplitude[clear])), _MOST)
    return float(apart.mean(axis=1).min())


def furthest(assembly: Assembly) -> float:
    """Return the distance of the joint, of those tried, that is the furthest from all others."""
    logarithms = np.log(samples(assembly))
    apart = [
        np.sort(np.minimum(np.abs(logarithms - one), _MOST).mean(axis=1))[1]  # the nearest is the joint itself
        for one in logarithms
    ]
    return float(max(apart))


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


_SMOOTHED = 9
"""Lines over which a measured amplitude is averaged, so that noise makes no resonance."""
_FAINT, _CLEAR = 1.0, 3.0
"""Decibels by which a resonance of a joint stands out at least, and one of the measurement."""
_ABOVE_NOISE = 4.0
"""Standard deviations of the noise that a measured resonance is at least high."""
_MIDDLE = (0.05, 0.95)
"""Quantiles of the joints between which a resonance lies."""
_BESIDE = 0.05
"""Part of a frequency by which it may lie beside that."""


def missing_resonance(assembly: Assembly, target: Frf) -> tuple[float, float] | None:
    """Return between which frequencies [Hz] the one resonance lies that a measurement lacks.

    Parameters
    ----------
    assembly : Assembly
    target : Frf
        In the quantity of the assembly's response, on its frequencies.

    Returns
    -------
    (float, float) or None
        None if it lacks none or several, or if the joints have no more than one in common.
    """
    found = _measured(target)
    ranges = _ranges([target.frequency[_peaks(one, _FAINT)] for one in 20.0 * np.log10(samples(assembly))])
    absent = [(low, high) for low, high in ranges if not np.any((found > low) & (found < high))]
    return absent[0] if len(absent) == 1 < len(ranges) else None


def _measured(target: Frf) -> NDArray[np.float64]:
    """Return the frequencies of the resonances that are clear in a measurement."""
    known = known_variance(target)
    noise = float(np.sqrt(np.median(estimated_variance(target) if known is None else known)))
    smooth = uniform_filter1d(target.amplitude, _SMOOTHED, mode="nearest")
    floor = np.maximum(smooth, max(_ABOVE_NOISE * noise, np.finfo(float).tiny))
    return target.frequency[_peaks(20.0 * np.log10(floor), _CLEAR)]


def _peaks(decibels: NDArray[np.float64], prominence: float) -> NDArray[np.intp]:
    return np.asarray(find_peaks(decibels, prominence=prominence)[0])


def _ranges(of_joints: list[NDArray[np.float64]]) -> list[tuple[float, float]]:
    """Return between which frequencies the first, second, ... resonance of the joints lies, as far as all have one."""
    common = min(len(one) for one in of_joints)
    ordered = np.array([one[:common] for one in of_joints]).reshape(len(of_joints), common)
    lowest, highest = np.quantile(ordered, _MIDDLE, axis=0)
    return list(zip((lowest * (1.0 - _BESIDE)).tolist(), (highest * (1.0 + _BESIDE)).tolist(), strict=True))
