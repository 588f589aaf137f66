"""Whether the coherence, the variance, the phase and the amplitude are in the unit in which they are read."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

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


def check_parts(
    fields: Mapping[str, str], claims: Sequence[FieldClaim], unit: str, where: str, averages: int | None = None
) -> None:
    """Refuse parts of an FRF that the file says to be in another unit, on another scale, or computed from others.

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

    Raises
    ------
    MeasurementError
    """
    for field in ("coherence", "variance"):
        if match := _COMPUTED.search(fields.get(field, "")):
            problem = f"'{fields[field][:60]}' is not a {field}: '{match[0].strip()}' is not understood."
            raise MeasurementError(Fault(where, problem, f"a column called {field}"))
    for claim in claims:
        if claim.part == "averages":
            if averages is not None and int(claim.text) != averages:
                problem = f"there are {claim.text[:20]} averages here, and {averages} elsewhere in the file."
                raise MeasurementError(Fault(claim.where, problem, remedy="Keep one of the two."))
        elif problem := _problem(fields, claim, unit):
            raise MeasurementError(Fault(claim.where, problem, remedy=SKIP.replace("NAME", claim.text)))


def _problem(fields: Mapping[str, str], claim: FieldClaim, unit: str) -> str:
    part, text, _ = claim
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
    return f"the amplitude is on the scale '{text}' here, and is read as another." if is_wrong else ""


def _is_square(text: str, unit: str) -> bool:
    """Return whether a text is the square of a unit."""
    match = _SQUARE.fullmatch(text.strip())
    if match is None or not unit:
        return text.lower() in _RATIO
    return read_unit(match[1]) == read_unit(unit) is not None
