"""Values that a measured file gives under a name, such as ``# torque: 40 N m``."""

from __future__ import annotations

import re
from collections.abc import Iterator
from itertools import chain
from pathlib import Path

from dovetail.interfaces import Recorded, RecordedArrays, RecordedChannels, RecordedFrf, RecordedSet, Statement
from dovetail.measurement.text_pairs import pairs_of
from dovetail.units import is_unit

_MOST_LINES = 1000
"""Lines at the start and at the end of a text that are read."""
_LONGEST = 1000
"""Characters of a text that is read."""
_BRACKETS = re.compile(r"(.*?)\s*[\[(]([^\[\]()]*)[\])]")
_AMOUNT = re.compile(r"([^\W\d_][^\d:=,;]{0,40}?)\s+([-+]?\d[\d.]*(?:[eE][-+]?\d+)?\s*\D{1,10})")
_ROW = re.compile(r"[\s\d.,;:eE+-]*")


def named_values(path: Path, recorded: Recorded) -> Iterator[tuple[str, str, str]]:
    """Yield names in lower case, their values as texts, and their places in a file.

    Parameters
    ----------
    path : Path
    recorded : Recorded
        What its reader returned.
    """
    for key, text, where in _texts(path, recorded):
        for pair in chain.from_iterable(pairs_of(key, clause) for clause in _clauses(text)):
            name, text = (pair.key, pair.value) if pair.key else _name_and_amount(pair.value)
            if match := _BRACKETS.fullmatch(name):
                name, text = match[1], _with_unit(text, match[2])
            yield _plain(name), text.strip(), where
            rest, _, unit = name.rpartition("_")
            if rest and is_unit(unit) and (text := _with_unit(text, unit)) != pair.value:
                yield _plain(rest), text, where


def _name_and_amount(text: str) -> tuple[str, str]:
    """Return the name and the quantity in a line such as ``torque 20 N m``; an empty name for another line."""
    match = _AMOUNT.fullmatch(text)
    return (match[1], match[2]) if match else ("", text)


def _with_unit(text: str, unit: str) -> str:
    return f"{text} {unit}" if re.fullmatch(r"[-+\d.eE]+", text) else text


def _plain(name: str) -> str:
    return re.sub(r"[\W_]+", "_", name.lower()).strip("_")


def _clauses(text: str) -> list[str]:
    """Return the parts of a text, such as those of the note of a converted file; none of a very long one."""
    return text.split("; ") if len(text) < _LONGEST else []


def _texts(path: Path, recorded: Recorded) -> Iterator[tuple[str, str, str]]:
    if isinstance(recorded, str):
        lines = recorded.split("\n")
        numbers = dict.fromkeys(chain(range(len(lines))[:_MOST_LINES], range(len(lines))[-_MOST_LINES:]))
        yield from (("", lines[n], f"{path}:{n + 1}") for n in numbers if not _ROW.fullmatch(lines[n]))
    elif isinstance(recorded, RecordedArrays):
        attributes = (recorded.attributes, *recorded.group_attributes.values())
        yield from ((key, text, f"{path}  {key}") for group in attributes for key, text in group.items())
        for name, entry in recorded.entries.items():
            yield from ((key, text, f"{path}  {name}, attribute {key}") for key, text in entry.attributes.items())
            if entry.is_small and (value := entry.load()).size == 1 and value.dtype.kind in "USiuf":
                yield re.split(r"[/.]", name)[-1], str(value.reshape(-1)[0]), f"{path}  {name}"
    elif isinstance(recorded, (list, tuple)) and len(recorded) == 1:
        yield from ((one.key, one.text, one.where) for one in _statements(recorded[0]) if one.about == "text")


def _statements(part: object) -> tuple[Statement, ...]:
    if isinstance(part, RecordedSet):
        return _statements(part.load())
    if isinstance(part, RecordedFrf):
        return (*part.statements, Statement("text", part.note, part.where))
    return tuple(part.statements) if isinstance(part, RecordedChannels) else ()
