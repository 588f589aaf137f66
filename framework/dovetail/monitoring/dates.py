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
    r"(?:[T_ -]?(?!(?:19|20)\d\d[-_.]?\d\d)(?P<hour>\d\d)[:h.-]?(?P<minute>\d\d)(?:[:m.-]?(?P<second>\d\d))?)?(?!\d)"
)
_PARTS = ("year", "year"), ("month", "mm"), ("day", "dd")
_NUMBERS = re.compile(r"(?<!\d)(\d\d?)[-_./](\d\d?)[-_./]((?:19|20)\d\d)(?!\d)")
"""Day and month, in either order, and year."""
_YEAR_FIRST = re.compile(r"(?<!\d)(\d{4})/(\d\d?)/(\d\d?)(?!\d)")
_MONTHS = "jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec"
_WITH_NAME = re.compile(
    rf"(?<!\d)(\d\d?)[-_. ]*({'|'.join(_MONTHS)})[a-z]*[-_., ]*((?:19|20)?\d\d)(?!\d)", re.IGNORECASE
)
_NO_SUCH_DATE = re.compile(r"(?<!\d)(?:19|20)\d\d[-_.]\d\d?[-_.]\d\d?(?!\d)")
_KEY = re.compile(
    r"(?:(?:test|measurement|measuring|acquisition|recording|start)_)?(?:date|day|datum|time|timestamp)(?:_(?:and_)?time)?"
    r"|(?:measured|recorded|acquired)(?:_(?:on|at))?|date_of_(?:the_)?(?:test|measurement)"
)
"""Keys under which files give the day of a measurement."""
_BARE = re.compile(r"\d[\d\s:.,/-]*|\d{1,2}[-. ][a-z]{3,9}[-. ,]+\d{2,4}[\d\s:.-]*", re.IGNORECASE)
"""A line that is a date and perhaps a time, as the third id line of a universal file often is."""
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
    if others := [day for day in _days_in(name) if abs(day - named.date()) > _SAME]:
        yield f"Its name has two dates, {named.date().isoformat()} and {others[0].isoformat()}; the first counts."
    for key, text, where in named_values(file, content):
        line = f"{key.replace('_', '-')}:{text}" if key[:1].isdigit() else text  # a colon is that of a time
        is_bare = (not key or line != text) and _BARE.fullmatch(line) is not None
        days = _days(line) if is_bare or _KEY.fullmatch(key) else []
        if days and all(abs(day - named.date()) > _SAME for day in days):
            shown = line if is_bare else f"{key}: {text}"
            yield f"Its name says {named.date().isoformat()}, and '{shown[:40]}' is at {where}; the name counts."


def _days_in(name: str) -> list[date]:
    """Return the days in a file's name, in their order, without numbers behind a letter, such as those of a sensor."""
    found = (named_date(match[0]) for match in _DATE.finditer(name) if not name[: match.start()][-1:].isalpha())
    return [moment.date() for moment in found if moment is not None]


def _days(text: str) -> list[date]:
    """Return the days that a text may mean; none if it is not a date."""
    if (found := named_date(_YEAR_FIRST.sub(r"\1-\2-\3", text))) is not None:
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
