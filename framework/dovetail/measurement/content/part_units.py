"""Whether the coherence, the variance, the phase and the amplitude are in the unit in which they are read."""

from __future__ import annotations

import re
import warnings
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from dovetail.errors import Fault, MeasurementError
from dovetail.measurement.free_text import SKIP, FieldClaim
from dovetail.measurement.frf_units import read_unit
from dovetail.measurement.text_pairs import ANGLES

_RATIO = ("", "-", "--", "1", "none", "n/a", "dimensionless", "ratio", "linear", "lin")
"""Units of a coherence."""
_SQUARE = re.compile(r"[\[(]?(.+?)[\])]?\s*(?:\^2|\*\*2|²)")
_COMPUTED = re.compile(
    r"sqrt|root|wurzel|1\s*[-\u2212]|\blog|inverse|incoher|minus|\bstd\b|\bsd\b|[%^²]|\bdb\b", re.IGNORECASE
)
"""Words in the names of columns that hold something computed from a coherence or a variance."""
_SETTINGS = ("step", "start", "end", "range", "rate", "lines")
"""Parts of claims on the frequencies."""
_ESTIMATOR = re.compile(r"(?<![A-Za-z0-9])(H[12v])(?![A-Za-z0-9])", re.IGNORECASE)
PHASES = ("phase_deg", "phase_rad")
_SAME = 0.01
"""Largest relative difference of equal frequencies: programs write few digits."""
_MOST_SKIPPED = 20.5
"""Up to this many steps may lie between exported lines."""
_TOO_SMALL = 500.0
"""The last line is at least this part of the end of the band; a part of a thousand is kHz taken for Hz."""
_FEWEST_LINES = 3


def check_parts(
    fields: Mapping[str, str],
    claims: Sequence[FieldClaim],
    unit: str,
    where: str,
    averages: int | None = None,
    frequency: NDArray[np.float64] | None = None,
) -> None:
    """Refuse parts of an FRF that the file says to be in another unit, on another scale, or computed from others.

    What may be meant, such as lines that were not exported, gives a warning.

    Parameters
    ----------
    fields : mapping of str to str
        From the fields of the FRF that are read to their names in the file.
    claims : sequence of FieldClaim
    unit : str
        The unit of the values, whose square is that of a variance.
    where : str
        Place of the names.
    averages : int, optional
        The number of averages that is read.
    frequency : (n_freq,) array, optional
        Hz.

    Raises
    ------
    MeasurementError
    """
    for field in ("coherence", "variance"):
        if match := _COMPUTED.search(fields.get(field, "")):
            problem = f"'{fields[field][:60]}' is not a {field}: '{match[0].strip()}' is not understood."
            raise MeasurementError(Fault(where, problem, f"a column called {field}"))
    counted = [int(claim.text) for claim in claims if claim.part == "averages"]
    for claim in claims:
        if claim.part == "averages":
            other = next((number for number in (averages, *counted) if number not in (None, int(claim.text))), None)
            if other is not None:
                problem = f"there are {claim.text[:20]} averages here, and {other} elsewhere in the file."
                raise MeasurementError(Fault(claim.where, problem, remedy="Keep one of the two."))
        elif claim.part in _SETTINGS:
            _compare_rates(claim, claims)
            _check_setting(claim, np.zeros(0) if frequency is None else frequency)
        elif claim.part in ("estimator", "parts"):
            _compare_words(fields, claim, claims)
        elif problem := _problem(fields, claim, unit):
            raise MeasurementError(Fault(claim.where, problem, remedy=SKIP.replace("NAME", claim.text)))


def _check_setting(claim: FieldClaim, frequency: NDArray[np.float64]) -> None:
    """Compare what a file says of its frequencies with them: an impossible step is refused, others give a warning.

    Lines may have been left out at the export, so that a step, a band or a number of lines may be that of the test.
    """
    if frequency.size < _FEWEST_LINES or not np.all(np.diff(frequency) > 0) or not np.isfinite(frequency[-1]):
        return  # the latter are refused where frequencies are checked
    steps, last = np.diff(frequency), float(frequency[-1])
    numbers, said = [float(number) for number in claim.text.split()], ""
    if claim.part == "step" and numbers[0] > 0 and np.allclose(steps, steps[0], rtol=_SAME):
        ratio = float(steps[0]) / numbers[0]
        said = (
            "" if abs(ratio - 1.0) <= _SAME else f"a step of {numbers[0]:g} Hz, and the lines are {steps[0]:g} Hz apart"
        )
        if said and not (1.5 < ratio < _MOST_SKIPPED and abs(ratio - round(ratio)) <= _SAME * ratio):
            remedy = f"Correct the file; or, if it does not concern the values: `names={{'skip': '{claim.key[:40]}'}}`."
            raise MeasurementError(Fault(claim.where, f"the file gives {said}.", remedy=remedy))
    elif claim.part == "lines" and abs(numbers[0] - frequency.size) > 1:
        said = f"{numbers[0]:g} lines, and there are {frequency.size}"
    elif claim.part == "rate" and last > 0.5 * numbers[0] * (1.0 + _SAME):
        said = f"a sampling rate of {numbers[0]:g} Hz, and the frequencies reach {last:g} Hz, above half of it"
    elif claim.part in ("start", "range") and frequency[frequency > 0].min() < numbers[0] * (1.0 - _SAME):
        said = f"a start at {numbers[0]:g} Hz, and the frequencies begin at {frequency[0]:g} Hz"
    elif claim.part in ("end", "range") and not 1.0 / _TOO_SMALL < last / max(numbers[-1], 1e-300) <= 1.0 + _SAME:
        said = f"an end at {numbers[-1]:g} Hz, and the frequencies end at {last:g} Hz"
    if said:
        remedy = "Check that the file is whole, and the unit of its frequencies."
        warnings.warn(f"{claim.where}: the file gives {said}. {remedy}", stacklevel=3)


def _compare_rates(claim: FieldClaim, claims: Sequence[FieldClaim]) -> None:
    """Warn of another sampling rate, or of a time between samples that is not one over it."""
    rates = [one for one in claims if one.part == claim.part == "rate"]
    first = rates[0] if rates else claim
    if claim is not first and not np.isclose(float(claim.text), float(first.text), rtol=_SAME):
        said = f"a sampling rate of {float(claim.text):g} Hz, and {first.where} one of {float(first.text):g} Hz"
        remedy = "Check the unit of the frequencies, and which of the two is right."
        warnings.warn(f"{claim.where}: the file gives {said}. {remedy}", stacklevel=3)


def _compare_words(fields: Mapping[str, str], claim: FieldClaim, claims: Sequence[FieldClaim]) -> None:
    """Warn of another estimator, or of other parts of the values, than the names of the columns say."""
    said = ""
    if claim.part == "estimator":
        named = [match[1] for name in fields.values() if (match := _ESTIMATOR.search(name))]
        named += [one.text for one in claims if one.part == "estimator"]
        if other := next((word for word in named if word.lower() != claim.text.lower()), ""):
            said = f"the FRF is estimated as {claim.text} here, and as {other} elsewhere in the file"
    elif not _means(claim.text.split(), fields):
        read = ", ".join(field for field in ("values", "real", "imag", "amplitude", "db", *PHASES) if field in fields)
        said = f"the parts of the values are {' and '.join(claim.text.split())} here, and are read as {read}"
    if said:
        warnings.warn(f"{claim.where}: {said}. Check which of the two is right.", stacklevel=3)


def _means(parts: Sequence[str], fields: Mapping[str, str]) -> bool:
    """Return whether parts of the values, as a text names them, may be those that are read."""
    polar = bool({"amplitude", "db", *PHASES} & set(fields))
    return ("amplitude" in parts) == polar and ("real" in parts) != polar


def _problem(fields: Mapping[str, str], claim: FieldClaim, unit: str) -> str:
    part, text = claim.part, claim.text
    if part == "phase":
        read_as = next((angle for angle in ("deg", "rad") if f"phase_{angle}" in fields), "")
        said = ANGLES.get(text)
        return f"the phase is read in {read_as}, and is in '{text[:40]}' here." if read_as and said != read_as else ""
    if part == "coherence":
        return f"the coherence is in '{text[:40]}'." if part in fields and text not in _RATIO else ""
    if part == "variance":
        return f"the variance is in '{text[:40]}'." if part in fields and not _is_square(text, unit) else ""
    if part == "rotation":
        is_rotation = bool(unit) and (reading := read_unit(unit)) is not None and reading.rotation
        return "" if is_rotation else f"the motion is '{text[:40]}' here, and is read as a displacement."
    if part == "db":
        return f"decibels are over {text} of the unit, and are read as over 1." if "db" in fields else ""
    is_wrong = "amplitude" in fields if text != "power" else {"amplitude", "db"} & set(fields)
    if part == "values" and {"values", "real", "imag"} & set(fields):
        return f"the values are on the scale '{text}' here, and are read as complex numbers."
    return f"the amplitude is on the scale '{text}' here, and is read as another." if is_wrong else ""


def _is_square(text: str, unit: str) -> bool:
    """Return whether a text is the square of a unit."""
    match = _SQUARE.fullmatch(text.strip())
    if match is None or not unit:
        return text.lower() in _RATIO
    return read_unit(match[1]) == read_unit(unit) is not None
