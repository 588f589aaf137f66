"""The date of a measurement, as the name of its file gives it, and as its content does."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import suppress
from datetime import UTC, date, datetime, time, timedelta
from pathlib import Path

from dovetail.interfaces import Recorded
from dovetail.measurement.named_values import named_values

_DATE = re.compile(
    r"(?<!\d)(?P<year>\d{4})(?:(?P<mark>[-_.])(?P<month>\d\d?)(?P=mark)(?P<day>\d\d?)|(?P<mm>\d\d)(?P<dd>\d\d))"
    r"(?:[T_ -]?(?P<hour>\d\d)[:h.-]?(?P<minute>\d\d)(?:[:m.-]?(?P<second>\d\d))?)?(?!\d)"
)
_PARTS = ("year", "year"), ("month", "mm"), ("day", "dd")
_NUMBERS = re.compile(r"(?<!\d)(\d\d?)[-_./](\d\d?)[-_./]((?:19|20)\d\d)(?!\d)")
"""Day and month, in either order, and year."""
_MONTHS = "jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec"
_WITH_NAME = re.compile(
    rf"(?<!\d)(\d\d?)[-_. ]*({'|'.join(_MONTHS)})[a-z]*[-_., ]*((?:19|20)?\d\d)(?!\d)", re.IGNORECASE
)
_NO_SUCH_DATE = re.compile(r"(?<!\d)(?:19|20)\d\d[-_.]\d\d?[-_.]\d\d?(?!\d)")
_KEY = re.compile(
    r"(?:(?:test|measurement|measuring|acquisition|recording)_)?(?:date|day)|(?:measured|recorded)(?:_on)?"
)
"""Keys under which files give the day of a measurement."""
_SAME = timedelta(days=1)
"""Difference of two dates that may be that of time zones, or a night."""


def named_date(name: str) -> datetime | None:
    """Return the date in a file's name, such as ``2026-03-01`` or ``20260301T0800``; None if it has none."""
    for match in _DATE.finditer(name):
        year, month, day = (int(match[part] or match[short]) for part, short in _PARTS)
        clock = [int(match[part] or 0) for part in ("hour", "minute", "second")]
        for hour, minute, second in (clock, (0, 0, 0)):
            with suppress(ValueError):  # not a time, or not a date
                return datetime.combine(date(year, month, day), time(hour, minute, second))
    return None


def date_of(name: str, changed: int) -> str:
    """Return the date in a file's name, or that of its last change [ns] (UTC); ISO 8601."""
    named = named_date(name)
    if named is not None:
        return named.isoformat(timespec="seconds")
    return datetime.fromtimestamp(changed / 1e9, UTC).replace(tzinfo=None).isoformat(timespec="microseconds")


def date_remarks(name: str, file: Path, content: Recorded) -> Iterator[str]:
    """Yield what is doubtful about the date of a measured file, as sentences."""
    named = named_date(name)
    if named is None:
        if any(pattern.search(name) for pattern in (_NUMBERS, _WITH_NAME, _NO_SUCH_DATE)):
            yield "Its name has no date such as 2026-03-01; that of its last change counts."
        return
    for key, text, where in named_values(file, content):
        days = _days(text) if _KEY.fullmatch(key) else []
        if days and all(abs(day - named.date()) > _SAME for day in days):
            yield f"Its name says {named.date().isoformat()}, and '{key}: {text[:40]}' is at {where}; the name counts."


def _days(text: str) -> list[date]:
    """Return the days that a text may mean; none if it is not a date."""
    if (found := named_date(text)) is not None:
        return [found.date()]
    if match := _WITH_NAME.search(text):
        year, month = int(match[3]), 1 + _MONTHS.index(match[2].lower())
        candidates = [(year if year > 99 else 2000 + year, month, int(match[1]))]
    elif match := _NUMBERS.search(text):
        first, second, year = (int(part) for part in match.groups())
        candidates = [(year, second, first), (year, first, second)]
    else:
        return []
    days = []
    for year, month, day in candidates:
        with suppress(ValueError):
            days.append(date(year, month, day))
    return days
