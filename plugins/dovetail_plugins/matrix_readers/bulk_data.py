"""Entries of NASTRAN's bulk data: fixed fields of 8 or 16 characters, or free ones with commas."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass

_EXPONENT = re.compile(r"^([-+]?(?:\d+\.?\d*|\.\d+))([-+]\d+)$")
"""A number such as 1.5-3, which is 1.5e-3."""


@dataclass(frozen=True)
class Card:
    """An entry: its name, the fields after it with those of its continuations, and the number of its first line."""

    name: str
    fields: list[str]
    line: int

    def __getitem__(self, field: int) -> str:
        """Return a field, from 0; an empty text beyond the last one."""
        return self.fields[field] if field < len(self.fields) else ""


def cards(text: str) -> Iterator[Card]:
    """Yield the entries of a file, from its BEGIN BULK or, without one, from its first line, to ENDDATA."""
    lines = text.splitlines()
    begin = next((at for at, line in enumerate(lines) if line.strip().upper().startswith("BEGIN BULK")), -1)
    name, fields, number = "", list[str](), 0
    for at in range(begin + 1, len(lines)):
        line = lines[at].partition("$")[0].expandtabs(8).rstrip()
        if not line or line.upper().startswith(("BEGIN ", "ENDDATA")):
            continue
        first, values = _split(line)
        if first == "" or first[0] in "+*":
            fields += values
            continue
        if name:
            yield Card(name, fields, number)
        name, fields, number = first.rstrip("*").upper(), values, at + 1
    if name:
        yield Card(name, fields, number)


def _split(line: str) -> tuple[str, list[str]]:
    """Return the first field of a line, and the fields that it has room for: 8, or 4 wide ones."""
    if "," in line:
        first, *values = (field.strip() for field in line.split(","))
        room = 4 if "*" in first else 8
        return first, [*values, *[""] * room][:room]
    first = line[:8].strip()
    width, room = (16, 4) if "*" in first else (8, 8)
    return first, [line[start : start + width].strip() for start in range(8, 8 + room * width, width)]


def real(field: str, card: Card) -> float:
    """Return a number; zero for an empty field.

    Raises
    ------
    ValueError
        It is none.
    """
    text = field.upper().replace("D", "E")
    try:
        return float(_EXPONENT.sub(r"\1E\2", text)) if text else 0.0
    except ValueError:
        raise ValueError(f"line {card.line}: '{field}' of {card.name} is not a number.") from None


def whole(field: str, card: Card, default: int | None = None) -> int:
    """Return a whole number.

    Raises
    ------
    ValueError
        It is none, or the field is empty and there is no default.
    """
    if not field and default is not None:
        return default
    try:
        return int(field)
    except ValueError:
        raise ValueError(f"line {card.line}: '{field}' of {card.name} is not a whole number.") from None
