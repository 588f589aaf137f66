"""Keys and values in texts: lines such as ``Unit: g/N``, rows of cells, sentences such as "phase in radians", JSON."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from typing import Any, NamedTuple

from dovetail.measurement.frf_units import frequency_factor, read_unit
from dovetail.measurement.quantity_words import read_label, word_set, words_of

UNIT_WORDS = word_set(
    "unit units einheit einheiten unite unites unité unités unidad unidades unità unita eenheid enhet jednostka eu uom"
    " dimension dimensions engineering"
)
AXIS_WORDS = word_set("frequency frequencies freq frequenz fréquence f x abscissa xaxis xlabel abszisse hz omega")
LOAD_WORDS = word_set("force load excitation denominator input hammer kraft moment reference ref exc")
MOTION_WORDS = word_set(
    "motion numerator response resp output acceleration velocity displacement signal measurand transducer messgröße"
    " accelerometer vibrometer"
)
VALUE_WORDS = word_set(
    "y h hv hxy frf frfs amplitude amplitudes magnitude mag real imag re im value values ordinate ylabel yaxis data"
    " transfer function response complex db axis z zaxis si label of the ampl wert system quantity frd responsedata"
)
OTHER_FIELDS = {
    "phase": word_set("phase phases angle angles arg phasen winkel"),
    "coherence": word_set("coherence coh gamma kohärenz"),
    "variance": word_set("variance var variances"),
}
"""Words of parts of an FRF that have a unit of their own."""
ANGLES = {
    **dict.fromkeys(("deg", "degs", "degree", "degrees", "grad", "°"), "deg"),
    **dict.fromkeys(("rad", "rads", "radian", "radians", "radiant"), "rad"),
}
_OTHER_UNITS = word_set("db decibel decibels % percent counts count lsb adc digits bits volt volts v mv")
_SUBJECTS = frozenset().union(
    *(AXIS_WORDS, LOAD_WORDS, MOTION_WORDS, VALUE_WORDS, *OTHER_FIELDS.values()),
    word_set("time times damping samples signal signals channel channels all angular circular natural"),
)
_KEY = re.compile(r"(?=[^:=\t]{0,60}?[^\W\d_])([^:=\t]{1,60}?)\s*(?::=|[:=\t])\s*(\S.*)")
_KEY_AND_NUMBER = re.compile(r"([^\d,]{1,60}?)\s*,\s*([-+]?\d.*)")
_IN = re.compile(
    r"(?P<key>[^\W\d_][^\d:=,;()\[\]]{0,40}?)\s+(?:(?:is|are|was|were|given|measured|stored|expressed|shown|recorded|"
    r"exported|saved|written)\s+)*in\s+(?:units?\s+of\s+)?[\[(]?(?P<unit>[^\s\[\]()](?:.{0,28}[^\s\[\]()])?)[\])]?",
    re.IGNORECASE,
)
_IS = re.compile(
    r"(?P<key>[^\W\d_][^\d:=,;()\[\]]{0,40}?)\s+(?:is|are)\s+(?:an?\s+|the\s+)?(?P<value>\S.{0,30}?)(?:\s+in\s+\S+)?",
    re.IGNORECASE,
)
_BRACKETED = re.compile(r"(?P<key>[^\W\d_][^\d:=,;()\[\]]{0,40}?)\s*[\[(](?P<unit>[^\[\]()]{1,30})[\])]")
_UNIT_IS = re.compile(
    r"(?P<key>[^\W\d_][^\d:=,;()\[\]]{0,40}?\sunits?)\s+(?:is|are)\s+(?P<unit>\S{1,30})", re.IGNORECASE
)
_NEXT_KEY = re.compile(r"[,;]\s+(?=[^\W\d_][^:=,;]{0,40}[:=]\s*\S)")
_CELL = re.compile(r"[\t;]|,(?!\d)")
_OF_AXIS = word_set("frequency frequencies freq f frequenz spectral fft")
_COUNTS = word_set("lines nlines linien nfreq nf")
_AXIS_SETTINGS = {
    "step": word_set("df delta step spacing increment resolution auflösung schritt fstep"),
    "start": word_set("start begin lower min minimum fmin fstart"),
    "end": word_set("stop end upper max maximum highest last nyquist fmax fend fstop"),
    "range": word_set("range band"),
    "rate": word_set("fs samplerate samplingrate abtastrate sampling sample scan"),
}
"""Words of settings that the frequencies of a file must not contradict."""
_WITH_SETTINGS = _OF_AXIS | word_set("of the in line hz k khz number no num n nr anzahl count rate")
_OWN_SETTINGS = word_set("df fmin fmax fstart fstop fend fstep fs samplerate samplingrate abtastrate rate")
"""Settings that need no word for a frequency."""
_FREQUENCIES = re.compile(
    r"(?P<first>\d[\d.]*(?:[eE][-+]?\d+)?)(?:\s*(?P<unit_of_first>[kM]?Hz)?\s*(?:-|\u2013|to|bis|\.{2,3}|\u2026)\s*"
    r"(?P<second>\d[\d.]*(?:[eE][-+]?\d+)?))?\s*[\[(]?(?P<unit>[kM]?Hz)?[\])]?",
    re.IGNORECASE,
)
_INTERVALS = ("dt", "delta t", "deltat", "sampling interval", "sample interval", "sampling time", "time step")
"""Names of the time from one sample to the next."""
_SECONDS = {"": 1.0, "s": 1.0, "sec": 1.0, "ms": 1e-3, "us": 1e-6}
_INTERVAL = re.compile(r"(\d+\.?\d*(?:[eE][-+]?\d+)?)\s*[\[(]?([a-z]*)[\])]?", re.IGNORECASE)
_SMALLEST_RATE = 210.0
"""A sampling rate below this without a unit may be in kHz: analysers sample at up to 204.8 kHz."""
_MOST = 200
"""Entries of a text in JSON that are read."""


class Pair(NamedTuple):
    """A key and its value.

    Parameters
    ----------
    key : str
        Empty for running text.
    value : str
    is_sentence : bool
        Whether they are from a sentence, which counts only against another statement.
    """

    key: str
    value: str
    is_sentence: bool = False


def pairs_of(name: str, text: str) -> Iterator[Pair]:
    """Yield keys and values in a text: that of its name, that in front of a colon, or the first cell of a row.

    Parameters
    ----------
    name : str
        The name under which the text is found; empty for a line.
    text : str
    """
    line = text.strip() if name else text.strip().lstrip("#%!*;/ \t")
    line = line.strip().strip('"').strip()
    if not line:
        return
    if (entries := json_entries(name, line)) is not None:
        yield from (Pair(*entry) for entry in entries)
        return
    clauses = [_UNIT_IS.fullmatch(part.strip(" .")) for part in re.split(r"[,;]\s+|\sand\s", line)]
    if pairs := [Pair(one["key"], one["unit"]) for one in clauses if one is not None and _is_unit(one["unit"])]:
        yield from pairs
        return
    parts = _NEXT_KEY.split(line)
    if len(parts) > 1 and all(map(_KEY.fullmatch, parts)):
        for part in parts:
            yield from pairs_of("", part)
        return
    if name:
        units = [cell.strip() for cell in _CELL.split(line)]
        if len(units) > 1 and UNIT_WORDS & set(words_of(name)) and all(map(read_unit, units)):
            yield from (Pair(name, unit) for unit in units)
            return
        if (pair := sentence(line)) is not None:
            yield pair
            return
        yield Pair(name, line)
        if not _KEY.fullmatch(line):
            return
    if match := _KEY.fullmatch(line) or _KEY_AND_NUMBER.fullmatch(line):
        key, value = (part.strip().strip("\"'").strip() for part in match.groups())
        values = [cell.strip().strip("\"'").strip() for cell in _CELL.split(value)]
        if len(values) > 1 and all(read_unit(cell) for cell in values):
            yield from (Pair(key, cell) for cell in values)
        else:
            yield Pair(key, value)
        return
    if (pair := sentence(line)) is not None:
        yield pair
        return
    cells = [cell for cell in (part.strip().strip("\"'").strip() for part in _CELL.split(line)) if cell]
    if len(cells) > 1 and all(map(read_unit, cells)) and cells[0].lower() not in UNIT_WORDS:
        yield from (Pair("unit", cell) for cell in cells)
    elif len(cells) > 1 and UNIT_WORDS & set(words_of(cells[0])):
        yield from (Pair(cells[0], cell) for cell in cells[1:])
    elif len(cells) == 2:
        yield Pair(cells[0], cells[1])
    else:
        yield Pair("", line)


def sentence(line: str) -> Pair | None:
    """Return the key and the value of ``Force [kN]``, "values are in g/N" or "response is a velocity"."""
    text = line.strip(" .")
    match = _BRACKETED.fullmatch(text)
    if match and _is_subject(match["key"]) and _is_unit(match["unit"].strip()):
        return Pair(f"{match['key']} unit", match["unit"].strip())
    match = _IN.fullmatch(text)
    if match and _is_subject(match["key"]) and _is_unit(match["unit"]):
        return Pair(f"{match['key']} unit", match["unit"], is_sentence=True)
    match = _IS.fullmatch(text)
    if match and _is_subject(match["key"]):
        label = read_label(match["value"])
        if (label.motions or label.quantities or label.moments) and len(words_of(match["value"])) <= 2:
            return Pair(match["key"], match["value"], is_sentence=True)
    return None


def _is_subject(text: str) -> bool:
    words = words_of(text)
    return bool(words) and set(words) <= _SUBJECTS


def _is_unit(text: str) -> bool:
    return text.lower() in ANGLES or text.lower() in _OTHER_UNITS or read_unit(text) is not None


def axis_setting(key: str, text: str) -> tuple[str, tuple[float, ...]] | None:
    """Return what a key and its numbers say of the frequencies, in Hz; None if they say nothing of them.

    Returns
    -------
    (str, tuple of float) or None
        ``step``, ``start``, ``end``, ``range`` (two numbers), ``rate`` (of sampling) or ``lines`` (their number).
    """
    if " ".join(words_of(key)) in _INTERVALS:
        interval = _INTERVAL.fullmatch(text.strip(" ."))
        seconds = float(interval[1].rstrip(".")) * _SECONDS.get(interval[2].lower(), 0.0) if interval else 0.0
        return ("rate", (1.0 / seconds,)) if seconds > 0.0 else None
    words, match = set(words_of(key)), _FREQUENCIES.fullmatch(text.strip(" ."))
    if match is None or any(match[part] and match[part].count(".") > 1 for part in ("first", "second")):
        return None
    numbers = [float(match[part].rstrip(".")) for part in ("first", "second") if match[part]]
    in_key = re.search(r"[kM]?Hz(?![a-z])", key, re.IGNORECASE)
    unit = match["unit"] or (in_key[0] if in_key else None)
    if words == {"n", "freq"} or (words & _COUNTS and words <= _COUNTS | _WITH_SETTINGS):
        is_count = unit is None and len(numbers) == 1 and numbers[0].is_integer()
        return ("lines", (numbers[0],)) if is_count else None
    kind = next((kind for kind, names in _AXIS_SETTINGS.items() if words & names), "")
    if not kind or not words <= _AXIS_SETTINGS[kind] | _WITH_SETTINGS:
        return None
    if unit is None and (not words & (_OF_AXIS | _OWN_SETTINGS) or (kind == "rate" and numbers[0] < _SMALLEST_RATE)):
        return None
    units = [match["unit_of_first"] or unit, unit][-len(numbers) :]
    found = tuple(number * (frequency_factor(one or "Hz") or 1.0) for number, one in zip(numbers, units, strict=True))
    if (kind == "range") != (len(found) == 2):
        return ("end", found) if kind == "range" else None
    return kind, found


def json_entries(name: str, text: str) -> list[tuple[str, str]] | None:
    """Return keys and values of a text in JSON, with keys of groups in front; None for another text."""
    if text[:1] not in "{[" or text[-1:] not in "}]":
        return None
    try:
        content = json.loads(text)
    except (ValueError, RecursionError):
        return None
    return list(_entries(name, content))[:_MOST] if isinstance(content, (dict, list)) else None


def _entries(name: str, content: Any) -> Iterator[tuple[str, str]]:
    if isinstance(content, dict):
        for key, value in content.items():
            yield from _entries(f"{name} {key}".strip(), value)
    elif isinstance(content, list):
        for value in content:
            yield from _entries(name, value)
    elif content is not None:
        yield name, str(content)
