"""The meaning of an FRF's unit: the quantity, and the factor that converts the values to SI."""

from __future__ import annotations

import re
from typing import NamedTuple

from dovetail.errors import Fault, MeasurementError, UnitError
from dovetail.frf import QUANTITIES, Quantity, unit_of
from dovetail.units import to_si

__all__ = ["UnitMeaning", "conversion_factor", "is_angular", "meaning_of_unit", "motion_unit", "pint_spelling"]

_SQUARE = re.compile(r"(?<=[a-z])2(?![\d.])|²")
_GRAVITY = re.compile(r"^\(?[gG]\)?(?=\s*/|$)")
_NO_LABEL = ("", "none")
_ANGLE = re.compile(r"rad|deg|°", re.IGNORECASE)
_DECIBEL = re.compile(r"\bdb", re.IGNORECASE)
_SHOWN = 60
_MOTION: dict[tuple[Quantity, bool], str] = {
    ("receptance", False): "m",
    ("mobility", False): "m/s",
    ("accelerance", False): "m/s^2",
    ("receptance", True): "rad",
    ("mobility", True): "rad/s",
    ("accelerance", True): "rad/s^2",
}


class UnitMeaning(NamedTuple):
    """The meaning of an FRF's unit.

    Parameters
    ----------
    quantity : Quantity
    factor : float
        Converts the values to SI.
    rotation, moment : bool
        Whether the response is a rotation instead of a displacement, and the excitation a moment instead of a force.
    """

    quantity: Quantity
    factor: float
    rotation: bool
    moment: bool

    @property
    def kind(self) -> tuple[bool, bool]:
        """Whether the response is a rotation, and whether the excitation is a moment."""
        return self.rotation, self.moment


def meaning_of_unit(label: str, where: str) -> UnitMeaning:
    """Return the meaning of a unit such as ``"um/N"``, ``"g/lbf"``, ``"mm/s^2/N"`` or ``"rad/(N m)"``.

    `g` is the standard gravity of 9.80665 m/s^2.

    Raises
    ------
    MeasurementError
        Not a unit of an FRF; the fault is reported at `where`.
    """
    if _DECIBEL.search(label[:_SHOWN]):
        problem = f"the unit '{label[:_SHOWN]}' is in decibels."
        raise MeasurementError(Fault(where, problem, remedy="Give the unit of the amplitude, and call its column db."))
    text = pint_spelling(label)
    turns = is_angular(text)  # an angle has no dimension, by which rad/N and m/(N m) would be alike
    kinds = [(q, *pair) for pair in ((False, False), (True, True), (turns, not turns)) for q in QUANTITIES]
    spelled_so = [(q, r, m) for q, r, m in kinds if unit_of(q, rotation=r, moment=m) == text]
    for quantity, rotation, moment in spelled_so or kinds:  # the spelling of Dovetail's own files needs no pint
        factor = conversion_factor(text, unit_of(quantity, rotation=rotation, moment=moment))
        if factor is not None:
            return UnitMeaning(quantity, factor, rotation, moment)
    accepted = "a motion per force or moment, such as um/N, mm/s/N, m/s^2/N, g/N, in/lbf, rad/(N m)"
    raise MeasurementError(Fault(where, f"the unit '{label[:_SHOWN]}' is not understood.", accepted))


def is_angular(label: str) -> bool:
    """Return whether a unit is that of a rotation, judged by its spelling."""
    return _ANGLE.search(label) is not None


def motion_unit(quantity: Quantity, *, rotation: bool) -> str:
    """Return the SI unit of the motion alone, without the force or the moment."""
    return _MOTION[quantity, rotation]


def pint_spelling(label: str) -> str:
    """Return a unit label in pint's spelling, or an empty text if there is none."""
    text = label.strip()
    if text.lower() in _NO_LABEL:
        return ""
    return _GRAVITY.sub("standard_gravity", _SQUARE.sub("^2", text.replace("**", "^")))


def conversion_factor(label: str, unit: str) -> float | None:
    """Return the factor from a label in pint's spelling to a unit, or None if its dimension differs."""
    if label == unit:
        return 1.0
    try:
        return to_si(f"1 {label}", unit) if label else None
    except UnitError:
        return None
