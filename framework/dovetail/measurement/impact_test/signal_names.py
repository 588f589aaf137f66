"""Names of signals in tables, channels and arrays: what a name is for, and what else it states."""

from __future__ import annotations

import re
from typing import Literal, NamedTuple

from dovetail.measurement.frf_units import frequency_factor, read_unit
from dovetail.measurement.quantity_words import read_label, word_set, words_of

Role = Literal["force", "response", "times", "rate", "step", "start", ""]

_FORCES = frozenset(("force", "forces", "excitation", "hammer", "exc"))
_RESPONSES = frozenset(("response", "responses", "resp", "accelerometer", "vibrometer"))
_OTHER_SENSORS = word_set("vibrometer ldv laser lvdt proximity eddy geophone microphone mic strain gauge gage encoder")
"""Words of sensors whose signal is not an acceleration."""
_AXIS: dict[str, Role] = {
    **dict.fromkeys(("time", "times", "t", "zeit"), "times"),
    **dict.fromkeys(
        ("rate", "sampling", "sampling rate", "sample rate", "samplerate", "samplingrate", "fs", "f s"), "rate"
    ),
    **dict.fromkeys(("sampling", "samp rate", "fsamp", "f sample", "abtastrate", "abtastfrequenz"), "rate"),
    **dict.fromkeys(("sampling frequency", "sample frequency", "samplingfrequency", "samplefrequency"), "rate"),
    **dict.fromkeys(("dt", "ts", "delta t", "delta x", "time step", "timestep", "increment", "x increment"), "step"),
    **dict.fromkeys(("time increment", "wf increment", "xincrement", "sampling interval", "sample interval"), "step"),
    **dict.fromkeys(("sampling period", "sample period"), "step"),
    **dict.fromkeys(
        ("start", "start time", "time start", "t start", "wf start offset", "time offset", "x start"), "start"
    ),
    **dict.fromkeys(("xstart", "x offset", "t zero", "pretrigger time"), "start"),
}
_NO_SIGNAL = word_set(
    "unit units label labels sensitivity gain scale factor calibration offset range window sign"
    " direction channel channels id number spectrum spectra psd frf fft freq frequency frequencies coherence name"
    " serial type quantity dimension coupling filter scaling title description comment"
)
"""Words that describe a signal."""
_POINTS = word_set("node point position location pt dof p n x y z xx yy zz rx ry rz")
"""Words in front of the number of a point, and of its axis; other numbers are those of impacts."""
_RAW = word_set("raw counts count adc lsb digit digits bits rms mean average peak envelope abs absolute")
"""Words of numbers that are not samples in a unit."""
_AXIS_SIGN = re.compile(r"(?<=[\s_(\d])-\s?(?=(?:[xyz]|r[xyz])\b)", re.IGNORECASE)
_LENGTH = r"(?P<length>[nuµμmckd]?m|inch(?:es)?|in|ft|mils?|thou)"
_PER_TIME = r"(?P<time>[/_ ]?s(?:ec)?(?P<power>(?:\^|\*\*|_|-|_-)?[23²])?)?"
_OTHERS = (
    r"(?P<other>[muµ]?g|gn|gs|mps2?|ips|[kmMud]?a?N|lbf?|kgf|ozf|dyn|[kmuµ]?V|volts?|[pn]C|%|ppm|[muµ]?strain"
    r"|[kMm]?Pa|psi|bar|kg|rad(?:[/_]s(?:[_^]{0,2}2)?)?|deg|dB|Hz|kHz|Nm|N[_ ]m)"
)
_ENDING = re.compile(rf"(?<=[\s_\-])(?:{_LENGTH}{_PER_TIME}|{_OTHERS})(?P<below>[/_]k?N)?$")
"""A unit at the end of a name. Only units of laboratories count: points, hands and chains are lengths to pint."""
_NOT_A_WORD = re.compile(r"[%^*]|\d[.,]\d|.*(?=/).*\b(?:s|N|g|m|sec)\d?$")
_LAST_BRACKET = re.compile(r"\s*[\[(][^\[\]()]*[\])]\s*$")
_SPELLINGS = {"gs": "g", "gn": "g", "mps2": "m/s^2", "mps": "m/s", "ips": "in/s", "N_m": "N m"}


class SignalName(NamedTuple):
    """What a name states.

    Parameters
    ----------
    role : str
        force, response, times, rate, step or start; empty for anything else.
    unit : str
        A unit of a time or a rate at the end of the name, as in ``time_ms``.
    impact : str
        Number of the impact; empty without one.
    point : str
        Words and numbers that name a point, without a sign.
    sign : float
        -1 along a negative axis, such as ``-z``.
    others : str
        Words that name something else, such as a sensor.
    unclear : str
        A word that shows that the samples are not in a unit.
    label : str
        The name without its unit and its sign.
    units : tuple of str
        Units of the samples, in brackets or at the end of the name, as in ``response_g``.
    is_acceleration : bool
        Whether the response of a sensor of this name is an acceleration if nothing states what it is.
    """

    role: Role
    unit: str = ""
    impact: str = ""
    point: str = ""
    sign: float = 1.0
    others: str = ""
    unclear: str = ""
    label: str = ""
    units: tuple[str, ...] = ()
    is_acceleration: bool = True


def read_name(text: str, chosen: Role = "") -> SignalName:
    """Return what the name of a column, a channel or an array states, such as ``Response 2 (g)`` or ``fs_kHz``.

    Parameters
    ----------
    text : str
    chosen : str
        The role that the caller gives it; empty if its words decide.
    """
    contents = read_label(text)
    plain = text
    for unit in contents.units:
        plain = plain.replace(unit, " ", 1)
    words = words_of(plain)
    if (axis := _axis_name(plain)) is not None and chosen in ("", axis.role):
        return axis
    forces, responses = _FORCES & set(words) or contents.moments, _RESPONSES & set(words) or contents.motions
    other_sensor = bool(_OTHER_SENSORS & set(words))
    if not chosen and (_NO_SIGNAL & set(words) or not (forces or responses)):
        return SignalName("", is_acceleration=not other_sensor)
    role: Role = chosen or ("" if forces and responses else "force" if forces else "response")
    label, unit = _without_unit(_AXIS_SIGN.sub("", plain).strip(" ()[]"))
    if not unit:
        before, unit = _without_unit(_AXIS_SIGN.sub("", _LAST_BRACKET.sub("", plain)).strip(" ()[]"))
        label = before if unit else label
    raw = "dB" if re.search(r"\bdB", text) else "".join(sorted(_RAW & set(words))[:1])
    if unit == "in" and "receptance" not in read_label(label).motions:  # an input, or inches
        unit, raw = "", raw or ("in" if role == "response" else "")
    rest = _tokens(re.sub(r"\s+in$", "", label))
    raw = raw or next((token for token in rest if _NOT_A_WORD.search(token) or _ENDING.search(f" {token}")), "")
    impact, point = _impact_and_point(rest)
    others = " ".join(word for word in words_of(" ".join(rest)) if word not in _POINTS)
    sign = -1.0 if _AXIS_SIGN.search(plain) else 1.0
    units = (*contents.units, *([unit] if unit else []))
    return SignalName(role, "", impact, point, sign, others, raw, label, units, not other_sensor)


def _axis_name(text: str) -> SignalName | None:
    """Return the meaning of a name such as ``time_ms``, ``fs_kHz`` or ``dt``, or None."""
    parts = [part for part in re.split(r"[\s_\-()\[\]/.:]+", text.strip()) if part not in ("", "in")]
    for count in range(min(len(parts), 2)):
        unit = parts[-1] if count else ""
        name = " ".join(words_of(" ".join(parts[: len(parts) - count])))
        if name in _AXIS and len(parts) > count:
            reading = read_unit(unit)
            known = not unit or (reading is not None and reading.kind == "time") or frequency_factor(unit) is not None
            if known:
                return SignalName(_AXIS[name], unit)
    return SignalName("start") if re.fullmatch(r"[tx]_?0", text.strip(), re.IGNORECASE) else None


def _tokens(text: str) -> list[str]:
    """Return the words, numbers and marks of a name that do not name its quantity."""
    found = []
    for part in re.split(r"[\s_()\[\],;:]+", text.strip()):
        known = set(words_of(part))
        rest = re.sub(r"^[A-Za-zäöü]+", "", part) if _is_known(known) else part
        found += [rest] if rest else []
    return found


def _is_known(words: set[str]) -> bool:
    joined = " ".join(words)
    return bool(words) and (
        words <= _FORCES | _RESPONSES or bool(read_label(joined).motions or read_label(joined).moments)
    )


def _without_unit(text: str) -> tuple[str, str]:
    """Return a name without the unit at its end, and the unit as it is spelled elsewhere."""
    match = _ENDING.search(text)
    if match is None:
        return text, ""
    unit = match["other"] or match["length"]
    if match["time"]:
        power = re.sub(r"[^23²-]", "", match["power"] or "").replace("²", "2").lstrip("-")
        glued = not re.match(r"[/_ ]", match["time"])
        unit = "ms" if glued and unit == "m" and not power else f"{unit}/s{'^' if power else ''}{power}"
    unit = _SPELLINGS.get(unit, unit) + (match["below"] or "").replace("_", "/")
    return text[: match.start()].rstrip(" _-"), unit


def _impact_and_point(tokens: list[str]) -> tuple[str, str]:
    pieces = [piece for token in tokens for piece in re.findall(r"[A-Za-z]+|\d+", token)]
    words = [piece.lower() for piece in pieces if piece.isalpha()]
    numbers = [piece for piece in pieces if piece.isdigit()]
    if not set(words) & _POINTS:
        return " ".join(numbers), ""
    is_node = set(words) & (_POINTS - {"x", "y", "z", "xx", "yy", "zz", "rx", "ry", "rz"})
    if is_node or len(numbers) != 1:
        return "", " ".join(piece.lower() for piece in pieces if piece.lower() in _POINTS or not piece.isalpha())
    return numbers[0], " ".join(word for word in words if word in _POINTS)
