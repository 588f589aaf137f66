"""The sets of a universal file.

`scan_sets` locates each set and reads its header with pyuff.
"""

from __future__ import annotations

import os
import re
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from dovetail import Fault, MeasurementError

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
_TAG = re.compile(rb" {4}-1(?=[\r\n]| {74}|\Z)")
"""Start and end of every set; the same rule as pyuff's."""
_HEADER = re.compile(rb"(?:[^\r\n]{0,200}(?:\r\n|\r|\n)){13}")
_NOT_PRINTED = dict.fromkeys((*range(10), 11, 12, *range(14, 32), 0x7F, 0x85, 0x2028, 0x2029), " ")
"""Characters that end a line in Python but not in a universal file, and other control characters."""
END = b"    -1\n"
ORDINATE = {
    "receptance": (8, "Displacement", "m"),
    "mobility": (11, "Velocity", "m/s"),
    "accelerance": (12, "Acceleration", "m/s^2"),
}
"""Data type of the ordinate's numerator, its name and its SI unit."""
FORCE = 13
UNKNOWN = (0, 1)
ABSCISSA_TYPES = (0, 1, 18)
"""Unknown, general, frequency."""


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

    def label(self, field: str) -> str:
        """Return a text of the header; empty for NONE."""
        text = str(self.fields[field]).strip()
        return "" if text.lower() == "none" else text

    @property
    def rotation(self) -> bool | None:
        """Whether the response is a rotation, according to its direction; None if a unit has to say it."""
        direction = int(self.fields["rsp_dir"])
        if direction:
            return abs(direction) > 3
        return None if self.label("ordinate_axis_units_lab") else self.moment

    @property
    def moment(self) -> bool | None:
        """Whether the excitation is a moment, according to its direction or else to its name; None if neither says."""
        direction, word = int(self.fields["ref_dir"]), self.label("orddenom_axis_lab").lower()
        return abs(direction) > 3 if direction else {"force": False, "moment": True}.get(word)

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
        raise MeasurementError(Fault(str(path), "this is not a universal file: no line '    -1' starts a set."))
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
