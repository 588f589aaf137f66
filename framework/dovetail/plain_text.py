"""Text for terminals, pages, tables and spreadsheets.

Text of files, and their names, is escaped where it might be interpreted; numbers and units are formatted for readers.
"""

from __future__ import annotations

import html
import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

_CONTROL = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff]")
"""Control characters, marks that change the writing direction, and surrogates, which no file can contain."""


def terminal_text(text: str) -> str:
    r"""Return a text in which each control character is written as ``\u001b``; lines and tabs stay."""
    return _CONTROL.sub(lambda match: f"\\u{ord(match[0]):04x}", text)


def html_text(text: str) -> str:
    """Return a text for the inside of an element or of an attribute in quotes."""
    return html.escape(terminal_text(text))


def html_table(title: str, rows: Iterable[Sequence[str]]) -> str:
    """Return a title and a table as HTML, for a notebook; the first row is the header."""
    head, *body = ([html_text(cell) for cell in row] for row in rows)
    lines = [f"<tr><th>{'</th><th>'.join(head)}</th></tr>"]
    lines += [f"<tr><td>{'</td><td>'.join(row)}</td></tr>" for row in body]
    return f"<p>{html_text(title)}</p><table>{''.join(lines)}</table>"


def markdown_cell(text: str) -> str:
    """Return a text for a cell of a table in Markdown: no elements, no links, one line."""
    return " ".join(html_text(text).split()).replace("|", "/").replace("[", "&#91;").replace("`", "&#96;")


def markdown_table(header: Sequence[str], rows: Iterable[Sequence[str]], rule: Sequence[str] = ()) -> str:
    """Return a table in Markdown; `rule` aligns the columns, all of them to the left by default."""
    cells = [map(markdown_cell, header), rule or ["---"] * len(header), *(map(markdown_cell, row) for row in rows)]
    return "".join(f"| {' | '.join(line)} |\n" for line in cells)


def csv_cell(text: str) -> str:
    """Return a text that no spreadsheet takes for a formula."""
    shown = terminal_text(text)
    return shown if shown.lstrip()[:1] not in ("=", "+", "-", "@") or _is_number(shown) else f"'{shown}"


def csv_comment(text: str) -> str:
    """Return a text for a comment in a table: one line, none of its cells a formula."""
    return re.sub(r"[^,;]+", lambda match: csv_cell(match[0]), " ".join(text.split()))


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return not text.strip("+- ")  # a single dash marks a missing value
    return True


ABSENT = "\N{EN DASH}"
"""Text for a missing number."""

_MINUS, _TIMES = "\N{MINUS SIGN}", "\N{MULTIPLICATION SIGN}"

_PREFIXES = ((1e9, "G"), (1e6, "M"), (1e3, "k"))
_PREFIXED = re.compile(r"(N|Pa|W|J|Hz)(?![\w^*])")
"""Units that take a prefix: the first symbol of the text, not raised to a power."""

_SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


@dataclass(frozen=True)
class DisplayUnit:
    """A unit for display: an SI value times `factor` is in the unit `text`."""

    factor: float
    text: str


def unit_text(unit: str) -> str:
    """Format a unit in pint's spelling: ``"m/(N s^2)"`` becomes ``"m/(N·s²)"``; a pure number has no unit."""
    if unit == "1":
        return ""
    raised = re.sub(r"(?:\^|\*\*)(-?\d+)", lambda power: power[1].translate(_SUPERSCRIPT), unit)
    return re.sub(r"\s*\*\s*|\s+", "·", raised.strip())


_SHORT = 1e-2
"""Time [s] below which microseconds are used."""


def display_unit(unit: str, lower: float, upper: float) -> DisplayUnit:
    """Choose the unit in which values of a range are easiest to read.

    Parameters
    ----------
    unit : str
        SI unit in pint's spelling.
    lower, upper : float
        Range of the values, in `unit`.

    Returns
    -------
    DisplayUnit
        Millimetres for lengths, grams for small masses, microseconds for short times, prefixes from kilo to giga for
        forces and units that begin with a force, pressure, energy, power or frequency; otherwise the SI unit.
    """
    size = math.sqrt(lower * upper) if lower > 0 and upper > 0 else max(abs(lower), abs(upper))
    if unit == "m":
        return DisplayUnit(1e3, "mm")
    if unit == "kg" and size < 1.0:
        return DisplayUnit(1e3, "g")
    if unit == "s" and size < _SHORT:
        return DisplayUnit(1e6, "µs")
    if _PREFIXED.match(unit):
        for factor, prefix in _PREFIXES:
            if size >= factor:
                return DisplayUnit(1.0 / factor, prefix + unit_text(unit))
    return DisplayUnit(1.0, unit_text(unit))


def number(value: float | None, digits: int = 4, *, padded: bool = True) -> str:
    """Write a number with significant digits: ``"35.18"``, ``"1.2 x 10⁻⁷"`` with a cross; a dash for None and NaN.

    Parameters
    ----------
    value : float or None
    digits : int
        Significant digits.
    padded : bool
        Keep trailing zeros, so that the numbers in a column line up.

    Returns
    -------
    str
    """
    if value is None or not math.isfinite(value):
        return ABSENT
    text = f"{value:{'#' if padded else ''}.{digits}g}"
    if "e" in text and 1.0 <= abs(value) < 1e7:
        text = f"{value:.0f}"
    mantissa, _, power = text.partition("e")
    return mantissa.rstrip(".").replace("-", _MINUS) + (_power_of_ten(power) if power else "")


def fixed(value: float | None, decimals: int, *, signed: bool = False) -> str:
    """Write a number with a given number of decimals, if `signed` with its sign; a dash for None and NaN."""
    if value is None or not math.isfinite(value):
        return ABSENT
    return f"{value:{'+' if signed else ''}.{decimals}f}".replace("-", _MINUS)


def hertz(frequency: float | None) -> str:
    """Write a frequency [Hz] with one decimal, or more below 100 Hz; a dash for None and NaN."""
    return fixed(frequency, 1 if frequency is None or frequency >= 100.0 else 2 if frequency >= 10.0 else 3)


def readable(text: str) -> str:
    """Format the powers of ten in a sentence: ``"1.5e+08 N/m"`` becomes ``"1.5 x 10⁸ N/m"``, with a real cross."""
    return re.sub(r"(?<=\d)e([+-]\d\d+)\b", lambda match: _power_of_ten(match[1]), text)


def _power_of_ten(power: str) -> str:
    return f" {_TIMES} 10{str(int(power)).translate(_SUPERSCRIPT)}"
