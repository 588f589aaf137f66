"""The prior predictive check: measurements compared with FRFs of joints from all over the ranges.

It is rough and quick. It tells which other assembly comes near a measurement, which unit error brings the measurement
near the assembly, and which resonance that nearly every joint has is missing.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d
from scipy.signal import find_peaks
from scipy.stats import qmc

from dovetail.assembly import Assembly
from dovetail.frf import QUANTITIES, Frf
from dovetail.identification.fitting.random_error import random_error_variance
from dovetail.identification.misspecification.perturbations import PerturbedAssembly, scale_by

__all__ = ["find_missing_resonance", "list_unit_errors", "prior_distance", "prior_width"]


@dataclass(frozen=True)
class Settings:
    """How measurements are compared with the prior predictive FRFs."""

    samples: int = 64
    """Joints: few, since each assembly that is tried needs its own FRFs."""
    above_noise: float = 4.0
    """Standard deviations of the noise above which an amplitude is compared, and a resonance counts."""
    most_difference: float = 1.0
    """Difference of logarithms at which it is cut off: a resonance that is elsewhere makes larger ones."""
    unit_tolerance: float = 0.25
    """Difference of logarithms up to which a factor is taken for that of a usual unit error."""
    least_factor: float = 0.15
    """Logarithm of the smallest factor that is tried; a smaller one is the perturbation "gain"."""
    smoothed_lines: int = 9
    """Lines over which a measured amplitude is averaged, so that noise makes no resonance."""
    joint_prominence: float = 1.0
    """Prominence [dB] of a joint's resonance: low, since the joint is free of noise."""
    measured_prominence: float = 3.0
    """Prominence [dB] of a resonance of the measurement."""
    quantiles: tuple[float, float] = (0.05, 0.95)
    """Of the joints, between which a resonance lies."""
    margin: float = 0.05
    """Part of its frequency by which a resonance may lie beside that."""


_SETTINGS = Settings()


def _sample_amplitudes(assembly: Assembly) -> NDArray[np.float64]:
    """Return amplitudes (n, n_freq) of FRFs of joints from all over the ranges."""
    points = qmc.LatinHypercube(len(assembly.parameters), rng=np.random.default_rng(0)).random(_SETTINGS.samples)
    return np.asarray(np.abs(assembly.frf(assembly.from_unit(points))))


def prior_distance(assembly: Assembly, target: Frf) -> float:
    """Return the mean difference of log amplitudes to the nearest sample, on the lines that are clear of noise."""
    clear = target.amplitude > _SETTINGS.above_noise * np.sqrt(random_error_variance(target))
    if not clear.any():
        return _SETTINGS.most_difference
    logarithms = np.log(_sample_amplitudes(assembly)[:, clear])
    return float(_differences(logarithms, np.log(target.amplitude[clear])).min())


def prior_width(assembly: Assembly) -> float:
    """Return the width of the prior predictive: the largest distance of a sample from its nearest neighbour."""
    logarithms = np.log(_sample_amplitudes(assembly))
    nearest = [np.sort(_differences(logarithms, sample))[1] for sample in logarithms]  # the first is the sample itself
    return float(max(nearest))


def _differences(samples: NDArray[np.float64], logarithm: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the mean differences (n,) of log amplitudes (n, f) from one (f,)."""
    return np.asarray(np.minimum(np.abs(samples - logarithm), _SETTINGS.most_difference).mean(axis=1))


_UNIT_ERRORS: Mapping[float, tuple[str, str]] = {
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


def list_unit_errors(assembly: Assembly, measured: Frf, target: Frf) -> tuple[tuple[Assembly, str], ...]:
    """Return the assembly as measured in another unit or quantity, and in words which.

    Parameters
    ----------
    assembly : Assembly
    measured : Frf
        As it was read.
    target : Frf
        The same in the quantity of the assembly's response.
    """
    median = np.median(np.log(_sample_amplitudes(assembly)), axis=0)
    difference = np.log(np.maximum(target.amplitude, np.finfo(float).tiny)) - median
    power = _power_of_frequency(target.frequency, difference)
    by_frequency = np.asarray((2j * np.pi * target.frequency) ** power, dtype=np.complex128)
    offset = float(np.median(difference - np.log(np.abs(by_frequency))))
    errors = []
    for sign in (1.0, -1.0):
        for factor, unit in _usual_factors(offset):
            if power or sign < 0 or abs(np.log(factor)) > _SETTINGS.least_factor:
                words = " and ".join(_describe(measured, power, factor, unit, sign))
                errors.append((PerturbedAssembly(assembly, scale_by(sign * factor * by_frequency)), words))
    return tuple(errors)


def _power_of_frequency(frequency: NDArray[np.float64], difference: NDArray[np.float64]) -> int:
    """Return the whole power of the frequency that a ratio with these logarithms follows."""
    logarithm = np.log(frequency)
    low, high = np.split(np.argsort(logarithm), [len(logarithm) // 2])
    slope = (np.median(difference[high]) - np.median(difference[low])) / (
        np.median(logarithm[high]) - np.median(logarithm[low])
    )
    return int(np.clip(np.round(slope), -4, 4))


def _usual_factors(offset: float) -> list[tuple[float, str]]:
    """Return the two usual factors nearest to a logarithm, with their words; none if no usual one is near."""
    usual = {factor**sign: words[sign < 0] for factor, words in _UNIT_ERRORS.items() for sign in (1, -1)}
    near = sorted(usual.items(), key=lambda item: abs(np.log(item[0]) - offset))
    return [item for item in near if abs(np.log(item[0]) - offset) <= _SETTINGS.unit_tolerance][:2]


def _describe(measured: Frf, power: int, factor: float, unit: str, sign: float) -> list[str]:
    words = []
    if power:
        actual = QUANTITIES.index(measured.quantity) + power
        article = "an" if measured.quantity[0] in "aeiou" else "a"
        words.append(
            f"it were a {QUANTITIES[actual]}, not {article} {measured.quantity}"
            if 0 <= actual < len(QUANTITIES)
            else f"it were multiplied by the frequency to the power {power}"
        )
    if factor != 1.0:
        ratio, size = (factor, "large") if factor > 1.0 else (1.0 / factor, "small")
        words.append(f"all values were {ratio:.4g} times too {size} ({unit}?)")
    if sign < 0.0:
        words.append("it had the wrong sign")
    return words


def find_missing_resonance(assembly: Assembly, target: Frf) -> tuple[float, float] | None:
    """Return the frequencies [Hz] between which the one resonance lies that a measurement lacks.

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
    measured = _measured_resonances(target)
    samples = 20.0 * np.log10(_sample_amplitudes(assembly))
    ranges = _resonance_ranges([target.frequency[_peaks(sample, _SETTINGS.joint_prominence)] for sample in samples])
    missing = [(low, high) for low, high in ranges if not np.any((measured > low) & (measured < high))]
    return missing[0] if len(missing) == 1 < len(ranges) else None


def _measured_resonances(target: Frf) -> NDArray[np.float64]:
    """Return the frequencies of the resonances that are clear in a measurement."""
    noise = float(np.sqrt(np.median(random_error_variance(target))))
    smooth = uniform_filter1d(target.amplitude, _SETTINGS.smoothed_lines, mode="nearest")
    floor = max(_SETTINGS.above_noise * noise, np.finfo(float).tiny)
    return target.frequency[_peaks(20.0 * np.log10(np.maximum(smooth, floor)), _SETTINGS.measured_prominence)]


def _peaks(decibels: NDArray[np.float64], prominence: float) -> NDArray[np.intp]:
    return np.asarray(find_peaks(decibels, prominence=prominence)[0])


def _resonance_ranges(of_joints: list[NDArray[np.float64]]) -> list[tuple[float, float]]:
    """Return the frequencies between which the first, second, ... resonance lies, as far as all joints have it."""
    common = min(len(frequencies) for frequencies in of_joints)
    ordered = np.array([frequencies[:common] for frequencies in of_joints]).reshape(len(of_joints), common)
    lowest, highest = np.quantile(ordered, _SETTINGS.quantiles, axis=0)
    low, high = lowest * (1.0 - _SETTINGS.margin), highest * (1.0 + _SETTINGS.margin)
    return list(zip(low.tolist(), high.tolist(), strict=True))
