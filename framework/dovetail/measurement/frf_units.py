"""The meaning of an FRF's unit: the quantity, and the factor that converts the values to SI."""

from __future__ import annotations

import math
import re
from functools import cache
from typing import Literal, NamedTuple

from dovetail.errors import Fault, MeasurementError, UnitError
from dovetail.frf import QUANTITIES, Quantity, unit_of
from dovetail.units import find_homonym, is_unit, to_si

_SQUARE = re.compile(r"(?<=[a-z])2(?![\d.])|²")
_GRAVITY = re.compile(r"^\(?[gG]\)?(?=\s*/|$)")
_NO_LABEL = ("", "none")
_ANGLE = re.compile(r"rad|deg|°", re.IGNORECASE)
_GLUED = re.compile(r"\b[munkc]?ms\s?\^?\s?-\s?[12]\b|\b[munkc]?ms[⁻][¹²]")
"""Metres per second or its square, written without a sign between the two, which pint reads as milliseconds."""
_DECIBEL = re.compile(r"\bdb", re.IGNORECASE)
_NO_MOTION = re.compile(r"strain|%|ppm|percent|permille|count|^1\s*/\s*[^*·\s]+$")
"""Numerators without a dimension, which with a force look like a displacement per moment."""
_SHOWN = 60
_MOTION: dict[tuple[Quantity, bool], str] = {
    ("receptance", False): "m",
    ("mobility", False): "m/s",
    ("accelerance", False): "m/s^2",
    ("receptance", True): "rad",
    ("mobility", True): "rad/s",
    ("accelerance", True): "rad/s^2",
}


UnitKind = Literal["ratio", "motion", "load", "frequency", "time", "inverse", "none", "other"]
"""What a unit measures: a motion per load, a motion, a load, a frequency, a time, a load per motion, nothing (``-``,
``NONE``), or something else."""
_LOADS = (("N", False), ("N m", True))
_FREQUENCIES = {"rad/s": 1.0 / (2.0 * math.pi), "rad/sec": 1.0 / (2.0 * math.pi)}
_FREQUENCY_NAMES = ("hz", "hertz", "cps", "rps")
_SPELLINGS = {
    **dict.fromkeys(("hertz", "cycles/s", "cycles/sec", "cycles/second"), "Hz"),
    **dict.fromkeys(("newton", "newtons"), "N"),
    **dict.fromkeys(("meters/second^2", "meters/sec^2", "metres/second^2"), "m/s^2"),
}
"""Spellings of analysers that pint does not know, in lower case."""
_PURE = ("", "-", "--", "1", "none", "n/a", "dimensionless", "ratio", "linear", "lin", "si", "mks")


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
    turns = is_angular(text)  # an angle has no dimension, so rad/N and m/(N m) would be equal
    pairs = ((True, True), (True, False)) if turns else ((False, False), (False, True))
    kinds = [(q, *pair) for pair in pairs for q in QUANTITIES]
    spelled_so = [(q, r, m) for q, r, m in kinds if unit_of(q, rotation=r, moment=m) == text]
    for quantity, rotation, moment in spelled_so or kinds:  # the spelling of Dovetail's own files needs no pint
        factor = conversion_factor(text, unit_of(quantity, rotation=rotation, moment=moment))
        if factor is not None and not _NO_MOTION.search(text) and not _GLUED.search(text):
            return UnitMeaning(quantity, factor, rotation, moment)
    accepted = "a motion per force or moment, such as um/N, mm/s/N, m/s^2/N, g/N, in/lbf, rad/(N m)"
    problem = f"the unit '{label[:_SHOWN]}' is not understood."
    raise MeasurementError(Fault(where, problem, accepted, find_homonym(text)))


class UnitReading(NamedTuple):
    """What a text means as a unit.

    Parameters
    ----------
    kind : UnitKind
    factor : float
        Converts to SI: a motion per load, a motion, a load, Hz or s; 1 for other kinds.
    quantity : Quantity or None
        Of a motion, or of a motion per load.
    rotation, moment : bool
        Whether the motion is a rotation, and the load a moment.
    """

    kind: UnitKind
    factor: float = 1.0
    quantity: Quantity | None = None
    rotation: bool = False
    moment: bool = False


@cache
def read_unit(label: str) -> UnitReading | None:
    """Return what a text means as a unit, or None if it is not the unit of anything.

    ``rad/s`` is a motion here; as the unit of an axis it is a frequency, which `frequency_factor` converts.
    """
    text = label.strip().strip("'\"").strip()
    if text.lower() in _PURE:
        return UnitReading("none")
    text = pint_spelling(_SPELLINGS.get(text.lower(), text))
    if not _has_unit_characters(text):
        return None
    return _PLAIN.get(text) or _reading_by_pint(text)


_PLAIN = {
    **{unit: UnitReading("motion", 1.0, quantity, rotation) for (quantity, rotation), unit in _MOTION.items()},
    **{unit: UnitReading("load", moment=moment) for unit, moment in _LOADS},
    "standard_gravity": UnitReading("motion", 9.80665, "accelerance"),
    "Hz": UnitReading("frequency"),
    "s": UnitReading("time"),
}
"""Readings of the labels of most files, as pint gives them: a file is read sooner without pint."""


def _reading_by_pint(text: str) -> UnitReading | None:
    try:
        meaning = meaning_of_unit(text, "")
        return UnitReading("ratio", meaning.factor, meaning.quantity, meaning.rotation, meaning.moment)
    except MeasurementError:
        pass
    rotation = is_angular(text)
    for quantity in QUANTITIES:
        if (factor := conversion_factor(text, motion_unit(quantity, rotation=rotation))) is not None:
            return UnitReading("motion", factor, quantity, rotation)
    if (factor := frequency_factor(text)) is not None:
        return UnitReading("frequency", factor)
    for unit, moment in _LOADS:
        if (factor := conversion_factor(text, unit)) is not None:
            return UnitReading("load", factor, moment=moment)
    if (factor := conversion_factor(text, "s")) is not None:
        return UnitReading("time", factor)
    if any(conversion_factor(text, f"N m^{a}/m s^{b}") for a, b in ((0, 0), (0, 1), (0, 2), (2, 0), (2, 1), (2, 2))):
        return UnitReading("inverse")
    return UnitReading("other") if is_unit(text) else None


def is_si(label: str) -> bool:
    """Return whether a unit is that of a motion per load in SI."""
    reading = read_unit(label)
    return reading is not None and reading.kind == "ratio" and reading.factor == 1.0


def frequency_factor(label: str) -> float | None:
    """Return the factor from the unit of a frequency to Hz, or None if it is none; a speed in rpm is none."""
    text = label.strip()
    if "min" in text or "rpm" in text or not any(map(str.isalpha, text)):
        return None
    if text.isalpha() and not text.lower().endswith(_FREQUENCY_NAMES):  # most words of a text: no need to ask pint
        return None
    text = _SPELLINGS.get(text.lower(), text)
    if text.lower() in _FREQUENCIES:
        return _FREQUENCIES[text.lower()]
    spelled = {"hz": "Hz", "khz": "kHz", "mhz": "mHz" if text.startswith("m") else "MHz"}.get(text.lower(), text)
    return conversion_factor(spelled, "Hz")


def _has_unit_characters(text: str) -> bool:
    return 0 < len(text) <= _SHOWN and any(map(str.isalpha, text)) and not text[0].isdigit()


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
