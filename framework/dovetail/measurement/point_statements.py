"""The points of an FRF in texts: ``Reference DOF: 1+x``, ``measured at tool``, ``node 5``, ``H(tool/nut)``."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Literal, NamedTuple, TypeAlias

from dovetail.measurement.frf_units import read_unit
from dovetail.measurement.quantity_words import read_label, word_set, words_of

End: TypeAlias = Literal["response", "force", "point", ""]

_RESPONSE = word_set(
    "response responses resp rsp output outputs outputname antwort messpunkt messort messstelle antwortpunkt"
)
_FORCE = word_set(
    "force forces reference references ref excitation exc input inputs inputname kraft anregung erregung anregungspunkt"
)
_MEASURED = _RESPONSE | word_set(
    "measured measuring measurement acc sensor accelerometer vibrometer receiver motion moving"
)
_DRIVEN = _FORCE | word_set("excited driven driver impact impacted hammer shaker source load roving hit")
_ALONE = word_set("sensor accelerometer vibrometer hammer shaker")
"""Words that may have the name of a point as their value, but usually that of an instrument."""
_PLACES = word_set(
    "point points pt node nodes dof dofs location position place at on punkt knoten ort messpunkt messort"
    " messstelle antwortpunkt"
    " anregungspunkt part body component substructure entity ent direction dir channel inputname outputname"
)
_MORE = word_set("drive driving test fixed name id number no nr of the frf was were is")
_TITLES = word_set("title name comment comments note notes remark remarks description caption")
LISTS = word_set("names labels channels dofs nodes points")
"""Names of lists with a point for each channel."""
_AXIS_CODES = {"1": "x", "2": "y", "3": "z", "4": "rx", "5": "ry", "6": "rz"}
_CLAUSE = re.compile(r"[;\n]|,\s+(?=[^\W\d_])|\sand\s(?!\S+$)")
_BETWEEN = re.compile(r"(?:frf\s+)?(?:between|from)\s+(\S+)\s+(?:and|to)\s+(\S+)", re.IGNORECASE)
_PAIR = re.compile(
    r"(?:(?:frf|tf|fr|h\d?|g|x|a|v|transfer function|frequency response(?: function)?)\b)?\s*(?P<open>\()?\s*"
    r"(?P<response>[^\s/,()\[\]][^/,()\[\]]{0,30}?)\s*[/,]\s*(?P<force>[^\s/,()\[\]][^/,()\[\]]{0,30}?)\s*\)?",
    re.IGNORECASE,
)
_NO_POINTS = word_set(
    "real imag mag amplitude phase on off and or yes no input output pre post auto cross min max left right"
)
"""Words with a slash between them that are not points."""
_INDICES = re.compile(r"(?:frf\s+)?[hg]_?(\d)_?(\d)", re.IGNORECASE)
_JOINED = re.compile(r"(?:h|frf|tf|g|x|a|v)[_ ](?P<response>[^\W_]+)[_ ](?P<force>[^\W_]+)", re.IGNORECASE)
"""The name of an FRF with two points, as in ``H_lower_lower``; but ``H_tool_tip`` may be one of a point."""
_OF_POINT = (
    re.compile(r"(?:\w+\s+){0,3}?(?:tests?|measurements?|frfs?|runs?)\s+(?:of|on|at)\s+(\S.{0,40})", re.IGNORECASE),
    re.compile(r"(\S.{0,40}?)\s+(?:alone|only|by\s+itself|separately)", re.IGNORECASE),
)
"""Titles of the measurement of a part: ``test of lower``, ``lower mass alone``."""
GENERAL_NOUNS = word_set("mass block bar beam rod plate shaft structure specimen assembly")
"""Words next to the name of a part in a title."""
_MOST_WORDS, _MOST_OF_TITLE = 4, 3
_LONGEST = 80
_NO_PLACE = re.compile(r"(?:unknown|none|n/?a|-+|true|false|yes|no|\?+)?", re.IGNORECASE)


class PointStatement(NamedTuple):
    """What a text says of the point of an FRF.

    Parameters
    ----------
    end : {"response", "force", "point"}
        ``"point"`` if it leaves open whether the motion or the force is there.
    text : str
    key : str
        Under which the file has it.
    """

    end: End
    text: str
    key: str = ""

    @property
    def clause(self) -> str:
        """The statement as a part of a note."""
        return self.text if self.key == "title" else f"{self.key or self.end}: {self.text}"


def point_statements(key: str, value: str) -> Iterator[PointStatement]:
    """Yield what a text under a key, or a line of text without one, says of points.

    Parameters
    ----------
    key : str
        Empty for a line of text.
    value : str
    """
    if end := end_of_key(key):
        text = value.strip()
        if set(words_of(key)) & {"dir", "direction"} and text.lstrip("+") in _AXIS_CODES:
            text = _AXIS_CODES[text.lstrip("+")]
        if _may_be_place(key, text):
            yield PointStatement(end, text, key.strip())
    elif found := tuple(_in_sentence(f"{key}; {value[:1000]}")):
        yield from found
    elif key and set(words_of(key)) <= _TITLES:
        yield from title_points(value)


def title_points(text: str) -> tuple[PointStatement, ...]:
    """Return what a title, or a line of a few words, says of points."""
    if re.search(r"[:=;\t]|,(?=\S)", _bare(text)):
        return ()
    if found := tuple(_in_sentence(text)):
        return found
    bare = _bare(text)
    if match := _JOINED.fullmatch(bare):
        return tuple(PointStatement(end, match[end], "title") for end in ("response", "force"))
    point_name = next((match[1] for pattern in _OF_POINT if (match := pattern.fullmatch(bare))), None)
    is_short = 0 < len(words_of(text)) <= _MOST_OF_TITLE
    return (PointStatement("point", point_name or bare, "title"),) if point_name or is_short else ()


def _bare(text: str) -> str:
    return text.strip().lstrip("#%!*;/ \t").strip(" .")


def _in_sentence(text: str) -> Iterator[PointStatement]:
    for clause in map(_bare, _CLAUSE.split(text)):
        if pair := points_of_label(clause):
            yield from pair
            continue
        words = clause.split()
        heads = [n for n in range(len(words) - 1, 0, -1) if len(words) - n <= _MOST_WORDS]
        for head in heads:
            key, value = " ".join(words[:head]), " ".join(words[head:])
            if len(value) <= _LONGEST and (end := end_of_key(key)) and _may_be_place(key, value):
                yield PointStatement(end, value)
                break


def points_of_label(text: str) -> tuple[PointStatement, ...]:
    """Return response and force in the name of an FRF, as in ``H(tool/nut)``, ``2+x/1+x`` and ``H21``."""
    if match := _INDICES.fullmatch(text):
        return PointStatement("response", match[1]), PointStatement("force", match[2])
    if match := _BETWEEN.fullmatch(text):
        return PointStatement("force", match[1]), PointStatement("response", match[2])
    match = _PAIR.fullmatch(text)
    if match is None or ("," in text and not match["open"]):
        return ()
    ends = match["response"], match["force"]
    reading = None if ends[0] == ends[1] else read_unit(f"{ends[0]}/{ends[1]}")
    if reading is not None and reading.kind != "none":
        return ()
    if any(map(_is_amount, ends)):
        return ()
    return PointStatement("response", ends[0]), PointStatement("force", ends[1])


def _is_amount(text: str) -> bool:
    """Return whether a text is a quantity, a number or a unit, alone or behind a number."""
    label, unit = read_label(text), read_unit(text.split()[-1])
    is_word = set(words_of(text)) <= _NO_POINTS
    return bool(is_word or label.motions or label.moments or unit or re.match(r"[\d.]+(?:\s|$)", text))


def points_of_column(signal: str) -> tuple[PointStatement, ...]:
    """Return what the name of a column says of points, apart from its part of the values."""
    return points_of_label(signal) or ((PointStatement("point", signal, "column"),) if signal else ())


def points_of_note(note: str) -> Iterator[PointStatement]:
    """Yield the points that a note gives as clauses with keys."""
    for clause in note.split("; "):
        key, colon, value = clause.partition(": ")
        if colon and key == "column":
            yield from points_of_column(value)
        elif colon:
            yield from point_statements(key, value)
        else:
            yield from title_points(clause)


def end_of_key(key: str) -> End:
    """Return what a key gives the point of, or an empty text if it gives none."""
    words = set(words_of(key))
    if not words or not words <= _MEASURED | _DRIVEN | _PLACES | _MORE:
        return ""
    has_place = bool(words & _PLACES)
    is_response = bool(words & (_MEASURED if has_place else _RESPONSE | _ALONE & _MEASURED))
    is_force = bool(words & (_DRIVEN if has_place else _FORCE | _ALONE & _DRIVEN))
    if is_response == is_force:
        return "" if is_response or not words & (_PLACES - {"at", "on"}) else "point"
    return "response" if is_response else "force"


def _may_be_place(key: str, text: str) -> bool:
    """Return whether a value may name a point, and not a unit, a quantity or a norm."""
    if not text or len(text) > _LONGEST or _NO_PLACE.fullmatch(text):
        return False
    words = set(words_of(key))
    if words & (_PLACES - {"channel"}):
        return True
    label = read_label(text)
    is_other = read_unit(text) is not None or label.motions or label.quantities or label.moments
    return not is_other and len(text) > 1 and not text.lstrip("+-").isdigit()


def without_points(note: str) -> str:
    """Return a note without the clauses that give points."""
    return "; ".join(clause for clause in note.split("; ") if all(p.key == "title" for p in points_of_note(clause)))
