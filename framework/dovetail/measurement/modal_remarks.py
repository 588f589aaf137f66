"""What the lines around a table of modal parameters state: it must agree with the header, which alone is used."""

from __future__ import annotations

import math
import re
import warnings
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from dovetail.errors import Fault, MeasurementError
from dovetail.measurement.acting_numbers import find_acting_number
from dovetail.measurement.content.text_tables import TextTable
from dovetail.measurement.frf_units import frequency_factor
from dovetail.measurement.quantity_words import word_set, words_of
from dovetail.measurement.text_pairs import axis_setting, pairs_of

_FREQUENCY = word_set(
    "frequency frequencies freq f fn natural eigenfrequency eigenfrequencies axis unit units eigenfrequenz"
)
_DAMPING = word_set("damping zeta dämpfung")
_OTHER_DAMPING = re.compile(
    r"\bloss factors?\b|\beta\b|\bdecrements?\b|\bbandwidth\b|\bquality factors?\b|\bq[- ]factors?\b"
    r"|verlustfaktor|\b2\s*\*?\s*zeta\b",
    re.IGNORECASE,
)
_DAMPED = re.compile(r"(?<!un)\bdamped (?:natural )?freq|(?<!un)\bgedämpfte Eigenfreq", re.IGNORECASE)
_LARGEST_RATIO = 0.03
"""Damping ratio up to which damped and undamped natural frequencies differ by less than 0.05 %."""
_LARGEST_USUAL, _LEAST_USUAL = 0.2, 1e-4
"""Damping ratios between which those of structures with joints are."""
_MOST_UNCERTAIN = 0.2, 3.0
"""Standard deviations over natural frequencies and over damping ratios above which a unit is hardly right."""
_COUNTED = word_set("number of modes n no nr count anzahl identified found")
_ROUNDED = 1.01
_SPREAD = re.compile(
    r"(?:[2-9]|two|three)[ -]*(?:sigma|\u03c3|sd|standard dev)|\b9\d(?:\.\d+)?\s*%|\bconfidence\b|k\s*=\s*[2-9]", re.I
)
_PERCENT = ("%", "percent", "per cent", "percent of critical", "% of critical")
_REMEDY = "If it does not concern the numbers, remove the line; otherwise correct the header."


def check_lines(
    table: TextTable, path: str, factors: Mapping[str, float], values: Mapping[str, NDArray[np.float64]]
) -> None:
    """Refuse a table whose lines of text contradict its header, or say what acts on its numbers.

    Parameters
    ----------
    table : TextTable
    path : str
    factors : mapping of str to float
        What converts each parameter to Hz or ratios, as the header states it.
    values : mapping of str to array
        The numbers of each parameter, in Hz or as ratios.

    Raises
    ------
    MeasurementError
    """
    damping = float(np.max(values.get("damping_ratio", 0.0)))
    for number, line in (*table.around, *table.between):
        for key, value, _ in pairs_of("", line):
            problem = _problem(set(words_of(key)), key, value.strip(" ."), factors) or find_acting_number(key, value)
            problem = problem or _other_modes(key, value.strip(" ."), values["frequency"])
            if damping > _LARGEST_RATIO and _DAMPED.search(line):
                problem = "frequencies are read as magnitudes of poles: divide damped ones by sqrt(1 - zeta^2)."
            if problem:
                raise MeasurementError(Fault(f"{path}:{number}", problem, remedy=_REMEDY))


def number_fault(path: str, numbers: NDArray[np.float64]) -> Fault | None:
    """Return the fault of a table whose numbers of modes (n_modes,) do not increase, if they do not."""
    falling = np.flatnonzero(np.diff(numbers) <= 0)
    if not falling.size:
        return None
    row = int(falling[0])
    problem = f"mode {numbers[row + 1]:g} follows mode {numbers[row]:g}: modes are in the order of their frequencies."
    return Fault(path, problem, "numbers that increase", "Correct the numbers, or leave them out.")


def warn_of_sizes(path: str, values: Mapping[str, NDArray[np.float64]], factors: Mapping[str, float]) -> None:
    """Warn of damping ratios and standard deviations whose unit is hardly right.

    Parameters
    ----------
    path : str
    values : mapping of str to array
        The numbers of each parameter, in Hz or as ratios.
    factors : mapping of str to float
        What converts each parameter to Hz or ratios, as the header states it.
    """
    frequency, damping = values["frequency"], values.get("damping_ratio", np.zeros(0))
    said = list[str]()
    if damping.size and damping.max() > _LARGEST_USUAL:
        largest = damping.max()
        said.append(f"a damping ratio of {largest:.3g} is {100 * largest:.3g} %. Is the column in per cent?")
    elif damping.size and factors["damping_ratio"] != 1.0 and 0 < damping.max() < _LEAST_USUAL:
        said.append(f"no damping exceeds {100 * damping.max():.2g} %. Is the column a ratio?")
    for name, of, most, unit in (
        ("frequency_sd", frequency, _MOST_UNCERTAIN[0], "Hz"),
        ("damping_sd", damping, _MOST_UNCERTAIN[1], "as a ratio"),
    ):
        if name in values and of.size and np.any(large := values[name] > most * of):
            row = int(np.argmax(large))
            text = f"the standard deviation in row {row + 1} is {values[name][row]:.3g}, of {of[row]:.3g} ({unit})"
            said.append(f"{text}. Is its unit right?")
    for text in said:
        warnings.warn(f"{path}: {text}", stacklevel=3)


def _other_modes(key: str, value: str, frequency: NDArray[np.float64]) -> str:
    """Return how a number of modes or a band contradicts the natural frequencies [Hz]; empty if it does not."""
    words = set(words_of(key))
    if "modes" in words and words <= _COUNTED and value.isdecimal() and int(value) != frequency.size:
        return f"there are {value} modes here, and {frequency.size} in the table."
    kind, ends = axis_setting(key, value) or ("", ())
    if kind in ("end", "range") and frequency[-1] > ends[-1] * _ROUNDED:
        return f"the band ends at {ends[-1]:g} Hz here, and a mode is at {frequency[-1]:g} Hz."
    if kind in ("start", "range") and frequency[0] * _ROUNDED < ends[0]:
        return f"the band begins at {ends[0]:g} Hz here, and a mode is at {frequency[0]:g} Hz."
    return ""


def _problem(words: set[str], key: str, value: str, factors: Mapping[str, float]) -> str:
    """Return how a line contradicts the header; empty if it does not."""
    text = f"{key}: {value}" if key else value
    factor = frequency_factor(value) if words and words <= _FREQUENCY else None
    if factor is not None and not math.isclose(factor, factors["frequency"], rel_tol=1e-6):
        return f"the frequencies are in '{value}' here, and in another unit by the header."
    if "angular" in words_of(text) and "frequenc" in text.lower() and math.isclose(factors["frequency"], 1.0):
        return f"'{text[:60]}' contradicts the unit of the frequencies."
    spread = {"frequency_sd", "damping_sd"} & set(factors)
    if spread and _SPREAD.search(text):
        return f"'{text[:60]}': one standard deviation is needed."
    if "damping_ratio" not in factors:
        return ""
    if _OTHER_DAMPING.search(text):
        return f"'{text[:60]}' is not a damping ratio."
    is_percent = value.lower() in _PERCENT
    if words & _DAMPING and (is_percent or value in ("-", "1")) and is_percent != (factors["damping_ratio"] != 1.0):
        return f"the damping is in '{value}' here, and in another unit by the header."
    return ""
