"""The sets of a universal file.

`scan_sets` locates each set and reads its header, `select_set` returns the one that the caller wants, and `meaning_of`
determines quantity, unit and sign of its values.
"""

from __future__ import annotations

import os
import re
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from dovetail.errors import Fault, MeasurementError
from dovetail.frf import QUANTITIES, Quantity, unit_of
from dovetail.measurement.frf_units import conversion_factor, is_angular, motion_unit, pint_spelling
from dovetail.measurement.recording import ReadOptions

GENERAL, TIME, FRF, COHERENCE = 0, 1, 4, 6
_FUNCTIONS = {
    GENERAL: "general function",
    TIME: "time response",
    2: "auto spectrum",
    3: "cross spectrum",
    FRF: "FRF",
    5: "transmissibility",
    COHERENCE: "coherence",
    9: "power spectral density",
    12: "spectrum",
}
_DIRECTIONS = {0: "scalar", 1: "x", 2: "y", 3: "z", 4: "rotation x", 5: "rotation y", 6: "rotation z"}
DIRECTIONS = {0: "", 1: "x", 2: "y", 3: "z", 4: "rx", 5: "ry", 6: "rz"}
"""Directions in the names of DOFs."""
_MOST_SETS = 10_000
_SETS_SHOWN = 20
_TAG = re.compile(rb" {4}-1(?=[\r\n]| {74}|\Z)")
"""Start and end of every set; the same rule as pyuff's."""
_HEADER = re.compile(rb"(?:[^\r\n]{0,200}(?:\r\n|\r|\n)){13}")
_NOT_PRINTED = dict.fromkeys((*range(10), 11, 12, *range(14, 32), 0x7F, 0x85, 0x2028, 0x2029), " ")
"""Characters that end a line in Python but not in a universal file, and other control characters."""
END = b"    -1\n"
ORDINATE: dict[Quantity, tuple[int, str, str]] = {
    "receptance": (8, "Displacement", "m"),
    "mobility": (11, "Velocity", "m/s"),
    "accelerance": (12, "Acceleration", "m/s^2"),
}
"""Data type of the ordinate's numerator, its name and its SI unit."""
FORCE = 13
ABSCISSA_TYPES = (0, 1, 18)
"""Unknown, general, frequency."""
_UNKNOWN = (0, 1)
_QUANTITY_OF: dict[int, Quantity] = {number: quantity for quantity, (number, _, _) in ORDINATE.items()}
_NO_LABEL = ("", "none")


@dataclass(frozen=True)
class UffSet:
    """One set of a universal file.

    Parameters
    ----------
    where : str
        File and number of the set.
    number : int
        From 1.
    kind : int
        Type of the set, 58 for functions; 0 if it cannot be read.
    start, end : int
        First byte of the start tag and of the end tag.
    header_end : int
        First byte after the thirteen header lines of a set 58.
    fields : dict
        Header of a set 58, with pyuff's names; empty if it cannot be read.
    """

    where: str
    number: int
    kind: int
    start: int
    end: int
    header_end: int
    fields: dict[str, Any]

    @property
    def function(self) -> int | None:
        """Function type of a set 58: 4 for an FRF, 6 for a coherence."""
        return self.fields.get("func_type")

    @property
    def points(self) -> tuple[int, int, int, int]:
        """Response node and direction, reference node and direction."""
        fields = self.fields
        return fields["rsp_node"], fields["rsp_dir"], fields["ref_node"], fields["ref_dir"]

    @property
    def response(self) -> str:
        """Name of the response DOF, such as ``5+x``; empty for node 0 without a direction."""
        return self._dof("rsp")

    @property
    def force(self) -> str:
        """Name of the reference DOF."""
        return self._dof("ref")

    def _dof(self, end: str) -> str:
        entity = str(self.fields.get(f"{end}_ent_name", "")).strip()
        prefix = "" if entity.upper() in ("", "NONE") else f"{entity}:"
        code = self.fields[f"{end}_dir"]
        if not code and not self.fields[f"{end}_node"]:
            return prefix.rstrip(":")
        return f"{prefix}{self.fields[f'{end}_node']}{_sign(code)}{DIRECTIONS.get(abs(code), code)}"

    @property
    def rotation(self) -> bool:
        """Whether the response is a rotation, according to its direction or else to its unit or a moment."""
        direction, unit = int(self.fields["rsp_dir"]), str(self.fields["ordinate_axis_units_lab"]).strip().lower()
        by_unit = is_angular(unit) if unit not in _NO_LABEL else self.moment
        return abs(direction) > 3 if direction else by_unit

    @property
    def moment(self) -> bool:
        """Whether the excitation is a moment, according to its direction or else to its name."""
        direction, word = int(self.fields["ref_dir"]), str(self.fields["orddenom_axis_lab"]).strip().lower()
        return abs(direction) > 3 if direction else word == "moment"

    def __str__(self) -> str:
        if self.kind != 58:
            return f"set {self.number}: type {self.kind}"
        if self.function is None:
            return f"set {self.number}: type 58 with a damaged header"
        function = _FUNCTIONS.get(self.function, f"function type {self.function}")
        response, towards, reference, along = self.points
        return (
            f"set {self.number}: {function}, response {response} {_direction(towards)}, "
            f"reference {reference} {_direction(along)}, '{self.fields['id1']}'"
        )


def _sign(code: int) -> str:
    return "-" if code < 0 else "+" if code else ""


def _direction(code: int) -> str:
    return f"{_sign(code)}{_DIRECTIONS.get(abs(code), code)}"


def scan_sets(path: Path, content: bytes) -> list[UffSet]:
    """Return the sets of a file, in order, without reading their data.

    Raises
    ------
    MeasurementError
        No set, a last set without an end, or too many sets.
    """
    tags: list[int] = []
    for match in _TAG.finditer(content):
        tags.append(match.start())
        if len(tags) > 2 * _MOST_SETS:
            raise MeasurementError(Fault(str(path), "the file has too many sets.", f"at most {_MOST_SETS:,} sets"))
    if not tags:
        raise MeasurementError(Fault(str(path), "this is no universal file: no line '    -1' starts a set."))
    if len(tags) % 2:
        raise MeasurementError(
            Fault(f"{path}: set {len(tags) // 2 + 1}", "the set has no end line '    -1': the file is truncated.")
        )
    spans = zip(tags[::2], tags[1::2], strict=True)
    return [_scan_set(path, content, number, *span) for number, span in enumerate(spans, start=1)]


def _scan_set(path: Path, content: bytes, number: int, start: int, end: int) -> UffSet:
    kind = re.compile(rb"[^\r\n]{0,200}(?:\r\n|\r|\n) *(\d{1,6})").match(content, start, end)
    header = _HEADER.match(content, start, end)
    code = int(kind[1]) if kind else 0
    fields = parse_set(clean_header(header[0]) + END, header_only=True) if header and code == 58 else {}
    return UffSet(f"{path}: set {number}", number, code, start, end, header.end() if header else end, fields)


def clean_header(header: bytes) -> bytes:
    """Return header lines, in UTF-8 or in Latin-1 from older programs, as UTF-8 with plain line ends."""
    try:
        text = header.decode("utf-8")
    except UnicodeDecodeError:
        text = header.decode("latin-1")
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    return "\n".join(line.translate(_NOT_PRINTED) for line in lines).encode()


def parse_set(content: bytes, *, header_only: bool = False) -> dict[str, Any]:
    """Return the contents of one set as pyuff reads them; empty if it cannot."""
    import pyuff

    number, file = tempfile.mkstemp(".uff")  # a folder for each of ten thousand sets would take half a minute
    try:
        with os.fdopen(number, "wb") as stream:
            stream.write(content)
        with np.errstate(all="ignore"):
            parsed = pyuff.UFF(file).read_sets(header_only=header_only)
    except Exception:  # pyuff raises bare exceptions that do not say what is wrong
        return {}
    finally:
        os.unlink(file)
    return parsed if isinstance(parsed, dict) else {}  # one set comes back bare, none as an empty list


def _inventory(sets: list[UffSet]) -> str:
    hidden = len(sets) - _SETS_SHOWN
    rows = "".join(f"\n    {shown}" for shown in sets[:_SETS_SHOWN])
    return f"{rows}\n    and {hidden} more" if hidden > 0 else rows


def select_set(path: Path, sets: list[UffSet], options: ReadOptions) -> UffSet:
    """Return the FRF that the options choose by its number or by the names of its DOFs, or the only one.

    Raises
    ------
    MeasurementError
        No such set, no FRF, or several that match; the fault lists the sets.
    """
    inventory = _inventory(sets)
    if options.index is not None:
        numbered = [uff_set for uff_set in sets if uff_set.number == options.index]
        if not numbered or numbered[0].function != FRF:
            what = "is no FRF" if numbered else "is not in the file"
            raise MeasurementError(Fault(str(path), f"set {options.index} {what}; it holds:{inventory}"))
        return numbered[0]
    functions = [uff_set for uff_set in sets if uff_set.function == FRF]
    if not functions:
        raise MeasurementError(Fault(str(path), f"the file holds no FRF; it holds:{inventory}"))
    fitting = [
        uff_set
        for uff_set in functions
        if is_dof(uff_set.response, options.response) and is_dof(uff_set.force, options.force)
    ]
    if len(fitting) == 1:
        return fitting[0]
    if not fitting:
        wanted = f"from {options.force or 'any force'} to {options.response or 'any response'}"
        raise MeasurementError(Fault(str(path), f"no FRF {wanted} is in the file; it holds:{inventory}"))
    which = " that fit" if options.chooses else ""
    problem = f"the file holds {len(fitting)} FRFs{which}, and one is wanted:{inventory}"
    remedy = f"Choose one by its DOFs (response, force) or its number, for example index={fitting[0].number}."
    raise MeasurementError(Fault(str(path), problem, remedy=remedy))


def is_dof(name: str, wanted: str | None) -> bool:
    """Return whether the caller's name is that of this DOF; component, sign and direction may be left out."""
    if wanted is None:
        return True
    entity, _, rest = name.lower().rpartition(":")
    node = re.match(r"\d*", rest)
    number = node[0] if node else rest
    forms = {rest, rest.replace("+", "").replace("-", ""), number}
    spellings = {re.sub(r"[\s:]", "", start + form) for form in forms for start in ("", entity)}
    return re.sub(r"[\s:]", "", wanted.lower()) in spellings


class Meaning(NamedTuple):
    """The meaning of the values of a set.

    Parameters
    ----------
    quantity : Quantity or None
        From the data types or the unit labels.
    over_force : bool
        Whether the header states that the motion is per force.
    factor : float
        Converts the values to SI; negative if response and reference point in opposite directions.
    unit : str
        Label of the unit; empty if there is none.
    """

    quantity: Quantity | None
    over_force: bool
    factor: float
    unit: str = ""


def meaning_of(uff_set: UffSet) -> Meaning:
    """Return the meaning of a set's values according to its header.

    Raises
    ------
    MeasurementError
        Not a motion over a force or a moment, or a unit label that is not understood.
    """
    _check_types(uff_set)
    fields = uff_set.fields
    sign = -1.0 if fields["rsp_dir"] * fields["ref_dir"] < 0 else 1.0
    stated = _QUANTITY_OF.get(fields["ordinate_spec_data_type"])
    above, below = _unit_label(uff_set, "ordinate_axis_units_lab"), _unit_label(uff_set, "orddenom_axis_units_lab")
    over_force = fields["orddenom_spec_data_type"] == FORCE or bool(below)
    if not above:
        return Meaning(stated, over_force, sign / _force(uff_set, below))
    candidates = QUANTITIES if stated is None else (stated,)
    rotation, moment = uff_set.rotation, uff_set.moment
    units = [(q, unit_of(q, rotation=rotation, moment=moment), motion_unit(q, rotation=rotation)) for q in candidates]
    for quantity, frf, motion in units:
        if (whole := conversion_factor(above, frf)) is not None:
            return Meaning(quantity, True, sign * whole, above)
        if (alone := conversion_factor(above, motion)) is not None:
            return Meaning(quantity, over_force, sign * alone / _force(uff_set, below), f"{above} over {below or 'N'}")
    accepted = " or ".join(f"{motion}, {frf}" for _, frf, motion in units)
    raise _unknown_unit(uff_set, above, accepted)


def _check_types(uff_set: UffSet) -> None:
    fields = uff_set.fields
    numerator, denominator = fields["ordinate_spec_data_type"], fields["orddenom_spec_data_type"]
    if numerator not in (*_UNKNOWN, *_QUANTITY_OF) or denominator not in (*_UNKNOWN, FORCE):
        raise MeasurementError(
            Fault(
                uff_set.where,
                f"the data are of type {numerator} over type {denominator}.",
                "displacement (8), velocity (11) or acceleration (12) over excitation force (13)",
            )
        )
    directions, word = (abs(fields["rsp_dir"]), abs(fields["ref_dir"])), fields["orddenom_axis_lab"].strip().lower()
    if max(directions) > 3 and min(directions) == 0 and word not in ("force", "moment"):
        accepted = "directions of both, 1 to 3 or 4 to 6; or 'Force' or 'Moment' on the axis of the denominator"
        raise MeasurementError(Fault(uff_set.where, "either the response or the reference is a rotation.", accepted))
    label = fields["abscissa_axis_units_lab"].strip().lower()
    if label not in (*_NO_LABEL, "hz"):
        raise MeasurementError(Fault(uff_set.where, f"the frequencies are in {label!r}.", "Hz"))


def _force(uff_set: UffSet, label: str) -> float:
    """Return the factor from the denominator's labelled unit to newtons or newton metres; 1 without a label."""
    unit = "N m" if uff_set.moment else "N"
    si = conversion_factor(label, unit) if label else 1.0
    if si is None:
        raise _unknown_unit(uff_set, label, unit)
    return si


def _unit_label(uff_set: UffSet, field: str) -> str:
    return pint_spelling(uff_set.fields[field])


def _unknown_unit(uff_set: UffSet, label: str, accepted: str) -> MeasurementError:
    return MeasurementError(
        Fault(
            uff_set.where,
            f"the unit label '{label}' is not understood.",
            f"a unit of {accepted}",
            "Export it in SI units.",
        )
    )
