"""Statements in what a reader does not use otherwise: lines of text, comments, texts and numbers under other names.

A line, or a text under a name, is a statement if it is one as a whole: a key with a unit, a quantity or a number, or a
label. In running text a unit or a quantity is only mentioned: it counts if nothing else states it. A number that may
act on the values, such as a gain or a delay, is refused with its place, since whether it was applied is not known.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field

from dovetail.errors import Fault, MeasurementError
from dovetail.interfaces import About, Statement
from dovetail.measurement.acting_numbers import find_acting_number
from dovetail.measurement.frf_units import frequency_factor, read_unit
from dovetail.measurement.quantity_words import inverse_quantity, read_label, word_set, words_of

_UNIT_WORDS = word_set(
    "unit units einheit einheiten unite unites unité unités unidad unidades unità unita eenheid enhet jednostka eu uom"
    " dimension dimensions engineering"
)
_AXIS_WORDS = word_set("frequency frequencies freq frequenz fréquence f x abscissa xaxis xlabel abszisse hz")
_LOAD_WORDS = word_set("force load excitation denominator input hammer kraft moment reference ref exc")
_MOTION_WORDS = word_set("motion numerator response resp output acceleration velocity displacement")
_VALUE_WORDS = word_set(
    "y h hv hxy frf frfs amplitude amplitudes magnitude mag real imag re im value values ordinate ylabel yaxis data"
    " transfer function response complex db axis z zaxis si label of the ampl wert system quantity frd responsedata"
)
_LABEL_WORDS = word_set("label labels xlabel ylabel title name")
_PHASE_WORDS = word_set("phase angle time coherence coh variance tip temperature stiffness")
"""Words of what has a unit of its own, which is not that of the values."""
_QUANTITY_WORDS = word_set("quantity function type format measurement kind grösse größe ordinate y ylabel")
_REMARKS = word_set("note notes comment comments remark remarks description title name file filename path")
_GENERIC = word_set(
    "frf frequency response function functions h of the a real imag part magnitude amplitude per over transfer"
    " dynamic mechanical apparent effective mass point drive complex spectrum measured measurement"
)
_KEY = re.compile(r"(?=[^:=\t]{0,60}?[^\W\d_])([^:=\t]{1,60}?)\s*(?::=|[:=\t])\s*(\S.*)")
_KEY_AND_NUMBER = re.compile(r"([^\d,]{1,60}?)\s*,\s*([-+]?\d.*)")
_MULTIPLE = re.compile(
    r"\d[\d.]*(?:[eE][-+]?\d+)?\s*[*\u00b7\u00d7x]\s*[^\s,;]+/[^\s,;]+|\bin\s+\d\S*\s+[^\s,;\d]+/[^\s,;]+",
    re.IGNORECASE,
)
"""A unit with a factor, as in ``1e-6*m/N`` and ``in 1e-6 m/N``."""
_CELL = re.compile(r"[\t;]|,(?!\d)")
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
    """

    statements: list[Statement] = field(default_factory=list)
    mentions: list[Statement] = field(default_factory=list)


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
        for key, value in _pairs(name, text[:_LONGEST]):
            _read_pair(free_text, key, value, where)
    return free_text


def read_statements(statements: Sequence[Statement], skip: Sequence[str] = ()) -> FreeText:
    """Return statements with those that are found in the texts among them.

    Raises
    ------
    MeasurementError
        As in `read_texts`.
    """
    found = read_texts(((one.key, one.text, one.where) for one in statements if one.about == "text"), skip)
    return FreeText([*(one for one in statements if one.about != "text"), *found.statements], found.mentions)


def _pairs(name: str, text: str) -> Iterator[tuple[str, str]]:
    """Yield keys and values in a text: that of its name, that in front of a colon, or the first cell of a row."""
    line = text.strip() if name else text.strip().lstrip("#%!*;/ \t")
    line = line.strip().strip('"').strip()
    if not line:
        return
    if name:
        yield name, line
        if not _KEY.fullmatch(line):
            return
    if match := _KEY.fullmatch(line) or _KEY_AND_NUMBER.fullmatch(line):
        key, value = (part.strip().strip("\"'").strip() for part in match.groups())
        values = [cell.strip().strip("\"'").strip() for cell in _CELL.split(value)]
        if len(values) > 1 and all(read_unit(cell) for cell in values):
            yield from ((key, cell) for cell in values)
        else:
            yield key, value
        return
    cells = [cell for cell in (part.strip().strip("\"'").strip() for part in _CELL.split(line)) if cell]
    if len(cells) > 1 and all(map(read_unit, cells)) and cells[0].lower() not in _UNIT_WORDS:
        yield from (("unit", cell) for cell in cells)
    elif len(cells) > 1 and _UNIT_WORDS & set(words_of(cells[0])):
        yield from ((cells[0], cell) for cell in cells[1:])
    elif len(cells) == 2:
        yield cells[0], cells[1]
    else:
        yield "", line


def _read_pair(free_text: FreeText, key: str, value: str, where: str) -> None:
    words = words_of(key)
    is_label = bool(set(words) & _LABEL_WORDS and set(words) & (_AXIS_WORDS | _VALUE_WORDS))
    if set(words) & _REMARKS and not set(words) & _UNIT_WORDS and not is_label:
        _read_prose(free_text, value, where)
        return
    if (statement := _unit_statement(words, value, where)) is not None:
        (free_text.mentions if statement.about == "unclear unit" else free_text.statements).append(statement)
        return
    if (statement := _label_statement(words, value, where)) is not None:
        free_text.statements.append(statement)
        return
    if problem := find_acting_number(key, value):
        raise _not_understood(problem, where, key or value)
    _read_prose(free_text, f"{key}: {value}" if key else value, where)


def _unit_statement(words: Sequence[str], value: str, where: str) -> Statement | None:
    """Return the statement of a key with a unit, or None if the value is no unit and need not be one."""
    named = set(words)
    text = re.sub(r"^[\[(]([^()\[\]]*)[\])]$", r"\1", value)
    reading = None if text[:2].lower() == "db" else read_unit(text)
    about = _subject(named, text)
    if named & _UNIT_WORDS and not named & _PHASE_WORDS:
        known = _UNIT_WORDS | _AXIS_WORDS | _LOAD_WORDS | _MOTION_WORDS | _VALUE_WORDS | _LABEL_WORDS
        if reading is not None or frequency_factor(text) is not None:
            return Statement(about, text, where)
        return Statement("unclear unit", text, where) if named <= known else None
    if reading is None or named & _PHASE_WORDS:
        return None
    is_compound = re.search(r"[/·*^²]", text) is not None
    if reading.kind in ("ratio", "inverse") or (is_compound and reading.kind == "motion" and named <= _VALUE_WORDS):
        return Statement(about, text, where)
    fields = _AXIS_WORDS | _LOAD_WORDS | _MOTION_WORDS | _VALUE_WORDS
    if reading.kind in ("motion", "load", "frequency") and named and named <= fields:
        return Statement(about, text, where)
    return None


def _subject(named: set[str], text: str) -> About:
    """Return what the unit under a key is of, according to the words of the key, or else to the unit."""
    if named & _AXIS_WORDS and not named & (_VALUE_WORDS - {"axis", "label", "response", "function"}):
        return "axis unit"
    reading = read_unit(text)
    if named & _LOAD_WORDS and (reading is None or reading.kind != "ratio"):
        return "load unit"
    is_frequency = reading is None or reading.kind in ("frequency", "time")
    return "axis unit" if is_frequency and frequency_factor(text) is not None else "unit"


def _label_statement(words: Sequence[str], value: str, where: str) -> Statement | None:
    """Return the statement of a label, or of a text that consists of the name of a quantity."""
    named, label = set(words), read_label(value)
    if named & _LABEL_WORDS and named & (_AXIS_WORDS | _VALUE_WORDS):
        return Statement("axis label" if named & _AXIS_WORDS else "label", value, where)
    rest = set(words_of(value)) - _GENERIC
    bare = [word for word in rest if not (read_label(word).quantities or inverse_quantity(value))]
    if (label.quantities or inverse_quantity(value)) and not bare and not label.units:
        return Statement("quantity", value, where)
    if label.motions and named & (_QUANTITY_WORDS | _MOTION_WORDS) and len(words_of(value)) <= 2 and not label.unclear:
        return Statement("motion quantity", value, where)
    if any((reading := read_unit(unit)) and reading.kind == "ratio" for unit in label.units):
        return Statement("label", value, where)
    return None


def _read_prose(free_text: FreeText, text: str, where: str) -> None:
    """Collect what running text mentions."""
    if problem := find_acting_number("", text):
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


def _not_understood(problem: str, where: str, name: str) -> MeasurementError:
    shown = name[:_SHOWN].partition(",")[0].strip()
    return MeasurementError(Fault(where, problem, remedy=SKIP.replace("NAME", shown)))
