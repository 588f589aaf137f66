"""Statements in what a reader does not use otherwise: lines of text, comments, texts and numbers under other names.

A line, or a text under a name, is a statement if it is one as a whole: a key with a unit, a quantity or a number, or a
label. In running text a unit or a quantity is only mentioned: it counts if nothing else states it. A number that may
act on the values, such as a gain or a delay, is refused with its place, since whether it was applied is not known.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

from dovetail.errors import Fault, MeasurementError
from dovetail.interfaces import About, Statement
from dovetail.measurement.acting_numbers import find_acting_number
from dovetail.measurement.changed_values import find_scale, parts_in, reference_of_decibels
from dovetail.measurement.frf_units import frequency_factor, read_unit
from dovetail.measurement.other_quantities import find_other_quantity, names_rotation, warn_of_exponential_window
from dovetail.measurement.point_statements import PointStatement, point_statements, points_of_label
from dovetail.measurement.quantity_words import inverse_quantity, read_label, word_set, words_of
from dovetail.measurement.text_pairs import (
    ANGLES,
    AXIS_WORDS,
    LOAD_WORDS,
    MOTION_WORDS,
    OTHER_FIELDS,
    UNIT_WORDS,
    VALUE_WORDS,
    Pair,
    axis_setting,
    pairs_of,
)

_ROLES = {
    "above": word_set("output out numerator response resp outputname outputs"),
    "below": word_set("input in denominator excitation force reference inputname inputs"),
}
_MOMENTS = frozenset(("moment", "torque", "drehmoment"))
_LETTERS = {
    "F": "force",
    "X": "displacement",
    "x": "displacement",
    "V": "velocity",
    "v": "velocity",
    "A": "acceleration",
}
"""Letters of signals."""
_SENSOR = word_set("channel channels sensor signal dof quantity type measurand")
_LABEL_WORDS = word_set("label labels xlabel ylabel title name")
_AXES = word_set("axis xaxis yaxis abscissa abszisse ordinate")
_PHASE_WORDS = word_set("phase angle time coherence coh variance tip temperature stiffness")
"""Words of what has a unit of its own, which is not that of the values."""
_QUANTITY_WORDS = word_set("quantity function type format measurement kind grösse größe ordinate y ylabel")
_AVERAGES = word_set("averages average avg avgs navg nave averagings mittelungen")
_COUNTED = _AVERAGES | word_set("number of no num n nr count anzahl der linear spectral frf fft")
_FORMS = word_set("format form data values representation columns complex")
_WHOLE_VALUES = word_set("values value data real imag imaginary complex frf frfs werte")
"""Words of the values themselves."""
_SHOWN_ON = word_set("axis axes scale scaling plot display shown ordinate")
"""Words of how values are shown."""
_ESTIMATOR = re.compile(r"\bestimat(?:or|ion)\W+(H[12v])\b", re.IGNORECASE)
_REMARKS = word_set("note notes comment comments remark remarks description title name file filename path")
_GENERIC = word_set(
    "frf frequency response function functions h of the a real imag part magnitude amplitude per over transfer"
    " dynamic mechanical apparent effective mass point drive complex spectrum measured measurement"
)
_MULTIPLE = re.compile(
    r"\d[\d.]*(?:[eE][-+]?\d+)?\s*[*\u00b7\u00d7x]\s*[^\s,;]+/[^\s,;]+|\bin\s+\d\S*\s+[^\s,;\d]+/[^\s,;]+",
    re.IGNORECASE,
)
"""A unit with a factor, as in ``1e-6*m/N`` and ``in 1e-6 m/N``."""
_TOKEN = re.compile(r"[^\s,;:=\"'\[\]{}]+")
_PER = re.compile(r"([^\s,;:=\"'()\[\]]+)\s+(?:per|pro|over)\s+([^\s,;:=\"'()\[\]]+)", re.IGNORECASE)
_IN_UNIT = re.compile(r"\b(?:in|unit)\s+([^\s,;:=\"'()\[\]]+)")
_NUMBER_BEFORE = re.compile(r"[\d.)]\s*$")
_LONGEST = 2000
SKIP = (
    "If the values already take it into account, or it does not concern them: `names={'skip': 'NAME'}`. "
    "Otherwise apply it, and remove it from the file."
)
"""What to do about a number that may act on the values."""
_SHOWN = 60


class FieldClaim(NamedTuple):
    """What a text says of a part of the FRF that has a unit of its own.

    Parameters
    ----------
    part : str
        ``phase``, ``coherence``, ``variance``, ``amplitude`` or ``values`` (their scale), ``db`` (what it is over),
        ``rotation``, ``averages`` (their number), ``estimator`` (H1, H2 or Hv), ``parts`` (of the values, as in
        ``amplitude phase``), or a setting of the frequencies with its numbers in Hz: ``step``, ``start``, ``end``,
        ``range``, ``rate``, ``lines``.
    text, where : str
    key : str
        Under which a setting of the frequencies stands.
    """

    part: str
    text: str
    where: str
    key: str = ""


@dataclass(frozen=True)
class FreeText:
    """What texts state.

    Parameters
    ----------
    statements : list of Statement
        What counts like any other statement of the file.
    mentions : list of Statement
        Units and quantities in running text, which count only if nothing else gives one, and units that are not
        understood.
    sentences : list of Statement
        Units in sentences such as "values are in g/N", which must not contradict what is given elsewhere; without
        such a statement they are mentions.
    claims : list of FieldClaim
        Units of the phase, the coherence and the variance, and scales of the amplitude.
    points : list of PointStatement
        Where the motion was measured and where the force acted.
    """

    statements: list[Statement] = field(default_factory=list)
    mentions: list[Statement] = field(default_factory=list)
    sentences: list[Statement] = field(default_factory=list)
    claims: list[FieldClaim] = field(default_factory=list)
    points: list[PointStatement] = field(default_factory=list)


def read_texts(texts: Iterable[tuple[str, str, str]], skip: Sequence[str] = ()) -> FreeText:
    """Return what texts state, each given by its key, which may be empty, its words and its place.

    Parameters
    ----------
    texts : iterable of (str, str, str)
    skip : sequence of str
        Keys, or parts of texts, that the caller says do not concern the values.

    Raises
    ------
    MeasurementError
        A unit that is not understood, or a number that may act on the values.
    """
    free_text = FreeText()
    skipped = [name.strip().lower() for name in skip if name.strip()]
    for name, text, where in texts:
        if any(words in f"{name}: {text}".lower() for words in skipped):
            continue
        free_text.points.extend(points_of_label(text.strip("#%!* \t")))
        for pair in pairs_of(name, text[:_LONGEST]):
            _read_pair(free_text, pair, where)
            free_text.points.extend(point_statements(pair.key.removeprefix(f"{name} "), pair.value))
        warn_of_exponential_window(name, text[:_LONGEST], where)
    return free_text


def read_statements(statements: Sequence[Statement], skip: Sequence[str] = ()) -> FreeText:
    """Return statements with those that are found in the texts among them.

    Raises
    ------
    MeasurementError
        As in `read_texts`.
    """
    found = read_texts(((one.key, one.text, one.where) for one in statements if one.about == "text"), skip)
    joined = [*(one for one in statements if one.about != "text"), *found.statements]
    return replace(found, statements=joined)


def _read_pair(free_text: FreeText, pair: Pair, where: str) -> None:
    """Collect what a key and its value, or running text, state."""
    key, value, is_sentence = pair
    words = words_of(key)
    is_label = bool(set(words) & _LABEL_WORDS and set(words) & (AXIS_WORDS | VALUE_WORDS))
    if match := _ESTIMATOR.search(f"{key}: {value}"):
        free_text.claims.append(FieldClaim("estimator", match[1].capitalize(), where))
    if claim := _field_claim(words, key, value, where):
        free_text.claims.append(claim)
        return
    if _is_upside_down(set(words), value):
        raise _not_understood(f"'{key}: {value[:_SHOWN]}' is not a motion per load.", where, key)
    is_role = bool(set(words) & (_ROLES["above"] | _ROLES["below"]))
    if set(words) & _REMARKS and not set(words) & UNIT_WORDS and not is_label and not is_role:
        if (named := _whole_quantity(value, where, strict=True)) is not None:
            free_text.statements.append(named)
        _read_prose(free_text, value, where)
        return
    if (statement := _unit_statement(words, value, where)) is not None:
        unclear = statement.about == "unclear unit"
        (free_text.mentions if unclear else free_text.sentences if is_sentence else free_text.statements).append(
            statement
        )
        return
    if (statement := _label_statement(words, value, where)) is not None:
        free_text.statements.append(statement)
        return
    if problem := find_acting_number(key, value) or find_other_quantity(key, value):
        raise _not_understood(problem, where, key or value)
    if names_rotation(key, value):
        free_text.claims.append(FieldClaim("rotation", value, where))
    _read_prose(free_text, f"{key}: {value}" if key else value, where)


def _field_claim(words: Sequence[str], key: str, value: str, where: str) -> FieldClaim | None:
    """Return what a text says of the phase, the coherence, the variance or the scale of the amplitude."""
    named, text = set(words), value.strip(" .[]()").lower()
    has_unit = bool(named & UNIT_WORDS)
    for part, spellings in OTHER_FIELDS.items():
        if named & spellings and named <= spellings | UNIT_WORDS | _LABEL_WORDS | {"deg", "rad"}:
            is_unit = text in ANGLES if part == "phase" else text in ("%", "percent", "db")
            if has_unit or is_unit or (part == "variance" and read_unit(text) is not None):
                return FieldClaim(part, text, where)
    if named & _AVERAGES and named <= _COUNTED and text.isdecimal():
        return FieldClaim("averages", text, where)
    if (reference := reference_of_decibels(key, value)) != 1.0:
        return FieldClaim("db", f"{reference:g}", where)
    if scale := find_scale(key, value):
        about = set(words_of(f"{key} {value}"))
        is_whole = about & _WHOLE_VALUES and not about & _SHOWN_ON
        return FieldClaim("values" if is_whole else "amplitude", scale, where)
    if (setting := axis_setting(key, value)) is not None:
        return FieldClaim(setting[0], " ".join(f"{number:.10g}" for number in setting[1]), where, key or value)
    if named & _FORMS and len(parts := parts_in(value)) > 1:
        return FieldClaim("parts", " ".join(parts), where)
    return None


def _is_upside_down(named: set[str], value: str) -> bool:
    """Return whether a load is called the response, or a motion the excitation."""
    label, rest = read_label(_LETTERS.get(value.strip(), value)), set(words_of(value)) - _GENERIC - _SENSOR
    alone = value.strip() in _LETTERS or (
        bool(rest) and all((one := read_label(word)).motions or one.moments for word in rest)
    )
    if not alone or not named <= _ROLES["above"] | _ROLES["below"] | _SENSOR | _QUANTITY_WORDS | {"name"}:
        return False
    above, below = named & _ROLES["above"], named & _ROLES["below"]
    return bool(above and not below and label.moments and not label.motions) or bool(
        below and not above and label.motions and not label.moments
    )


def _unit_statement(words: Sequence[str], value: str, where: str) -> Statement | None:
    """Return the statement of a key with a unit, or None if the value is not a unit and need not be one."""
    named = set(words)
    text = re.sub(r"^[\[(]([^()\[\]]*)[\])]$", r"\1", value)
    reading = None if text[:2].lower() == "db" else read_unit(text)
    about = _subject(named, text)
    if named & UNIT_WORDS and not named & _PHASE_WORDS:
        known = UNIT_WORDS | AXIS_WORDS | LOAD_WORDS | MOTION_WORDS | VALUE_WORDS | _LABEL_WORDS
        if reading is not None or frequency_factor(text) is not None:
            return Statement(about, text, where)
        return Statement("unclear unit", text, where) if named <= known else None
    if reading is None or named & _PHASE_WORDS:
        return None
    if named and named <= AXIS_WORDS and reading.kind in ("frequency", "time", "other") and text.isalpha():
        return Statement("axis unit", text, where)
    is_compound = re.search(r"[/·*^²]", text) is not None
    if reading.kind in ("ratio", "inverse") or (is_compound and reading.kind == "motion" and named <= VALUE_WORDS):
        return Statement(about, text, where)
    fields = AXIS_WORDS | LOAD_WORDS | MOTION_WORDS | VALUE_WORDS
    if reading.kind in ("motion", "load", "frequency") and named and named <= fields:
        return Statement(about, text, where)
    return None


def _subject(named: set[str], text: str) -> About:
    """Return what the unit under a key is of, according to the words of the key, or else to the unit."""
    if named & AXIS_WORDS and not named & (VALUE_WORDS - {"axis", "label", "response", "function"}):
        return "axis unit"
    reading = read_unit(text)
    if named & LOAD_WORDS and (reading is None or reading.kind != "ratio"):
        return "load unit"
    is_frequency = reading is None or reading.kind in ("frequency", "time")
    return "axis unit" if is_frequency and frequency_factor(text) is not None else "unit"


def _label_statement(words: Sequence[str], value: str, where: str) -> Statement | None:
    """Return the statement of a label, or of a text that consists of the name of a quantity."""
    named, label = set(words), read_label(value)
    is_named = named & _LABEL_WORDS or (named & _AXES and re.match(r"[^\W\d_]{2}", value))
    if is_named and named & (AXIS_WORDS | VALUE_WORDS):
        return Statement("axis label" if named & AXIS_WORDS else "label", value, where)
    if named and named <= AXIS_WORDS - {"f", "x", "hz"} and not re.search(r"\d", value):
        return Statement("axis label", value, where)
    if (whole := _whole_quantity(value, where)) is not None:
        return whole
    loads = set(words_of(value))
    if loads & _MOMENTS and loads <= _MOMENTS | _ROLES["below"] and not named & _ROLES["above"]:
        moment = min(loads & _MOMENTS)
        if loads - _MOMENTS or (named and named <= _ROLES["below"] | _SENSOR | _QUANTITY_WORDS):
            return Statement("load label", moment, where)
    if label.motions and named & (_QUANTITY_WORDS | MOTION_WORDS) and len(words_of(value)) <= 2 and not label.unclear:
        return Statement("motion quantity", value, where)
    marked = [unit for unit in label.units if f"[{unit}]" in value or f"({unit})" in value or f" / {unit}" in value]
    if any((reading := read_unit(unit)) and reading.kind == "ratio" for unit in marked):
        return Statement("label", value, where)
    return None


def _whole_quantity(value: str, where: str, *, strict: bool = False) -> Statement | None:
    """Return the statement of a text that consists of the name of a quantity, or else contains that of an inverse."""
    label, inverse = read_label(value), inverse_quantity(value)
    rest = set(words_of(value)) - _GENERIC - set(words_of(inverse) if strict else ())
    bare = [word for word in rest if not (read_label(word).quantities or (inverse and not strict))]
    is_named = (label.quantities or inverse) and not bare and not label.units
    return Statement("quantity", value, where) if is_named else None


def _read_prose(free_text: FreeText, text: str, where: str) -> None:
    """Collect what running text mentions."""
    if problem := find_acting_number("", text) or find_other_quantity("", text):
        raise _not_understood(problem, where, text)
    candidates = [match[0].strip(".!?").strip() for match in _TOKEN.finditer(text) if "/" in match[0]]
    candidates += [candidate[1:-1] for candidate in candidates if candidate[0] + candidate[-1] == "()"]
    candidates += [f"{match[1]}/{match[2]}".strip(".") for match in _PER.finditer(text)]
    if match := _MULTIPLE.search(text):
        free_text.mentions.append(Statement("unclear unit", match[0], where))
    for candidate in candidates:
        reading = read_unit(candidate)
        if reading is not None and reading.kind in ("ratio", "inverse"):
            free_text.mentions.append(Statement("unit", candidate, where))
        elif _is_per_load(candidate):
            free_text.mentions.append(Statement("unclear unit", candidate, where))
        elif candidate.lower() in ("rad/s", "radians/second", "radians/s"):
            free_text.mentions.append(Statement("axis unit", "rad/s", where))
    for match in _IN_UNIT.finditer(text):
        reading = read_unit(match[1].strip("."))
        if reading is not None and reading.kind in ("motion", "load") and reading.factor != 1.0:
            free_text.mentions.append(Statement("unit", match[1], where))
    for match in _TOKEN.finditer(text):
        if frequency_factor(match[0]) not in (None, 1.0) and not _NUMBER_BEFORE.search(text[: match.start()]):
            free_text.mentions.append(Statement("axis unit", match[0], where))
    label = read_label(text)
    if label.quantities or inverse_quantity(text):
        free_text.mentions.append(Statement("quantity", text[:_SHOWN], where))


def _is_per_load(text: str) -> bool:
    """Return whether a text is something per unit of a load, as ``Pa/N`` is."""
    above, _, below = text.rpartition("/")
    reading = read_unit(below)
    is_quotient = len(above) > 1 or above == "V"  # and not S/N, the ratio of signal and noise
    return is_quotient and reading is not None and reading.kind == "load"


def _not_understood(problem: str, where: str, name: str) -> MeasurementError:
    shown = name[:_SHOWN].partition(",")[0].strip()
    return MeasurementError(Fault(where, problem, remedy=SKIP.replace("NAME", shown)))
