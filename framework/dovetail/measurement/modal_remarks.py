"""What the lines around a table of modal parameters state: it must agree with the header, which alone is used."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping

from dovetail.errors import Fault, MeasurementError
from dovetail.measurement.acting_numbers import find_acting_number
from dovetail.measurement.content.text_tables import TextTable
from dovetail.measurement.frf_units import frequency_factor
from dovetail.measurement.quantity_words import word_set, words_of
from dovetail.measurement.text_pairs import pairs_of

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
_SPREAD = re.compile(
    r"(?:[2-9]|two|three)[ -]*(?:sigma|\u03c3|sd|standard dev)|\b9\d(?:\.\d+)?\s*%|\bconfidence\b|k\s*=\s*[2-9]", re.I
)
_PERCENT = ("%", "percent", "per cent", "percent of critical", "% of critical")
_REMEDY = "If it does not concern the numbers, remove the line; otherwise correct the header."


def check_lines(table: TextTable, path: str, factors: Mapping[str, float], damping: float) -> None:
    """Refuse a table whose lines of text contradict its header, or say what acts on its numbers.

    Parameters
    ----------
    table : TextTable
    path : str
    factors : mapping of str to float
        What converts each parameter to Hz or ratios, as the header states it.
    damping : float
        The largest damping ratio; 0 without any.

    Raises
    ------
    MeasurementError
    """
    for number, line in (*table.around, *table.between):
        for key, value, _ in pairs_of("", line):
            problem = _problem(set(words_of(key)), key, value.strip(" ."), factors) or find_acting_number(key, value)
            if damping > _LARGEST_RATIO and _DAMPED.search(line):
                problem = "frequencies are read as magnitudes of poles: divide damped ones by sqrt(1 - zeta^2)."
            if problem:
                raise MeasurementError(Fault(f"{path}:{number}", problem, remedy=_REMEDY))


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
