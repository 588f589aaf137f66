"""The words of measured quantities in labels: names of columns, arrays, channels and axes."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import NamedTuple

from dovetail.frf import Quantity
from dovetail.measurement.frf_units import frequency_factor, read_unit

_RATIOS: dict[str, Quantity] = {
    **dict.fromkeys(("receptance", "compliance", "flexibility", "nachgiebigkeit"), "receptance"),
    **dict.fromkeys(("mobility", "beweglichkeit"), "mobility"),
    **dict.fromkeys(("accelerance", "inertance", "akzeleranz"), "accelerance"),
}
"""Motions per load."""
_MOTIONS: dict[str, Quantity] = {
    **dict.fromkeys(("displacement", "displ", "disp", "verschiebung", "weg", "auslenkung"), "receptance"),
    **dict.fromkeys(("velocity", "vel", "geschwindigkeit", "schnelle"), "mobility"),
    **dict.fromkeys(("acceleration", "accel", "acc", "beschleunigung"), "accelerance"),
}
_LOADS = {
    **dict.fromkeys(("force", "excitation", "hammer", "kraft"), False),
    **dict.fromkeys(("moment", "torque", "drehmoment"), True),
}
"""Loads, and whether each is a moment."""
_INVERSE = re.compile(
    r"\b(impedances?(?! heads?\b)|impedanz|(?:dynamic |static |apparent )?(?:stiffness|steifigkeit)"
    r"|(?:apparent|dynamic|effective) mass)\b"
)
"""Loads per motion."""
_UPSIDE_DOWN = re.compile(
    rf"\b(?:{'|'.join(_LOADS)}|load)s?\s*(?:/|\bper\b|\bover\b|\bpro\b)\s*(?:{'|'.join(_MOTIONS)}|motion|response)\b"
    r"|(?<![\w/])F\s*/\s*[AVXaxv](?![\w/])",
    re.IGNORECASE,
)
"""A load per motion, as in ``Force/Acceleration`` and ``F/X``."""
_OTHER = re.compile(
    r"\b((?:micro)?strains?|dehnung|stress(?:es)?|sound|spl|transmissibility|transmissibilities|intensity"
    r"|psd|asd|autospectrum|autopower|crosspower|cross ?spectrum|charge|coherence|temperature|jerk"
    r"|pressure|voltage|volts?|current|power|energy|momentum|viscosity|resistance|capacitance)\b"
)
"""Quantities that are neither a motion per load nor its inverse."""
_CHANGED = re.compile(
    r"\b(minus|neg|negative|negated|inverse|inverted|reciprocal|conj|conjugate|conjugated|scaled|normali[sz]ed"
    r"|log|log10|ln|squared|std|sigma|error|uncertainty|integrated|differentiated|derivative)\b"
)
"""Words for values that were computed from an FRF and differ from it."""
_MINUS = re.compile(r"(?:^|[(\[:,])\s*[-\u2212]\s*(?=[a-z])|(?<=\s)[-\u2212](?=[a-z])", re.IGNORECASE)
"""A minus sign; a dash between words has a blank behind it, or a word right before it."""
_MULTIPLIED = re.compile(
    r"[*\u00d7·^|]|(?<![\w.])\d+\.\d|\d[eE][+-]?\d|(?<![a-zA-Z])[xX]\s?\d{2,}|\b1/(?=[a-zA-Z(])|\d{4,}(?!\w)"
)
"""What multiplies or raises a value, in a label without its units."""
ANGULAR = frozenset(("omega", "angular", "circular", "kreisfrequenz", "w"))
"""Words of frequencies in radians per second."""
_BRACKET = re.compile(r"[\[(]([^\[\]()]*(?:\([^()]*\)[^\[\]()]*)*)[\])]")


class Label(NamedTuple):
    """What the name of a column, an array or an axis states.

    Parameters
    ----------
    quantities : tuple of Quantity
        Quantities that are a motion per load.
    motions : tuple of Quantity
        Quantities whose motion is named.
    moments : tuple of bool
        For each load that is named, whether it is a moment.
    units : tuple of str
        Texts in brackets, or behind a slash as in ``Frequency / Hz``, that are units.
    unclear : str
        A word for something other than an FRF, or for values that were changed; empty without one.
    """

    quantities: tuple[Quantity, ...]
    motions: tuple[Quantity, ...]
    moments: tuple[bool, ...]
    units: tuple[str, ...]
    unclear: str


def words_of(text: str) -> list[str]:
    """Return the words of a name in lower case: ``AmplitudeUnit``, ``H_unit`` and ``y-label`` have two each."""
    separated = re.sub(r"(?<=[a-zäöü])(?=[A-Z])", " ", text)
    return re.findall(r"[^\W\d_]+", separated.lower())


def word_set(text: str) -> frozenset[str]:
    """Return the set of the words in a text that are separated by blanks."""
    return frozenset(text.split())


def read_label(text: str) -> Label:
    """Return what a label such as ``FRF (g/N)`` or ``Acceleration/Force`` states."""
    units = tuple(unit for unit in _units_of(text) if _is_written_as_unit(unit))
    rest = text
    for unit in units:
        rest = rest.replace(unit, " ", 1)
    words = words_of(rest)
    plain = " ".join(words)
    unclear = _INVERSE.search(plain) or _UPSIDE_DOWN.search(text) or _OTHER.search(plain) or _CHANGED.search(plain)
    unclear = unclear or _MINUS.search(rest) or _MULTIPLIED.search(re.sub(r"\|([^|]*)\|(?!\^)", r"\1", rest))
    return Label(
        quantities=tuple(dict.fromkeys(_RATIOS[word] for word in words if word in _RATIOS)),
        motions=tuple(dict.fromkeys(_MOTIONS[word] for word in words if word in _MOTIONS)),
        moments=tuple(dict.fromkeys(_LOADS[word] for word in words if word in _LOADS)),
        units=units,
        unclear=unclear[0].strip() if unclear else "",
    )


def unit_in_name(name: str) -> str:
    """Return the unit of a motion per load at the end of a name, as in ``H_g_per_N``; empty without one."""
    for unit in _endings(name):
        reading = read_unit(unit) if "/" in unit else None
        if reading is not None and reading.kind == "ratio":
            return unit
    return ""


def axis_unit_in_name(name: str) -> str:
    """Return the unit of a frequency that a name states, as ``f_kHz`` or ``omega`` does; empty without one."""
    for unit in _endings(name):
        if frequency_factor(unit) is not None:
            return unit
    return "rad/s" if ANGULAR & set(words_of(name)) else ""


def _endings(name: str) -> Iterator[str]:
    """Yield the last words of a name as a unit, the longest first: of ``f_rad_s`` ``rad/s``, then ``s``."""
    words = [word for word in re.split(r"[\s_.]+", name) if word.lower() != "per"]
    for first in range(1, len(words)):
        yield "/".join(words[first:])


def inverse_quantity(text: str) -> str:
    """Return the words of a text that name a load per motion, such as an impedance; empty without any."""
    plain = " ".join(words_of(text))
    match = _INVERSE.search(plain) or _UPSIDE_DOWN.search(text)
    return match[0] if match else ""


def _units_of(text: str) -> list[str]:
    """Return what stands where a unit does: in brackets, behind a blank and a slash, or as a word, ``g/N``."""
    behind = re.search(r"\S\s+/\s+(\S+)\s*$", text)
    bare = (word for word in _BRACKET.sub(" ", text).split() if re.search(r"\w/\w", word))
    words = [word for word in bare if (reading := read_unit(word)) and reading.kind in ("ratio", "inverse")]
    return [*(match[1].strip() for match in _BRACKET.finditer(text)), *([behind[1]] if behind else []), *words]


def _is_written_as_unit(text: str) -> bool:
    """Return whether a text in brackets is a unit; letters that only happen to be one, as in ``H(f)``, are not."""
    reading = read_unit(text)
    return (
        reading is not None
        and reading.kind != "none"
        and not re.fullmatch(r"[fthHxyz]|[xyz]{2}|in|re|[dD][bB].*", text)
    )
