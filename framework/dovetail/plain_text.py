"""Text of files, and their names, escaped for terminals, pages, tables and spreadsheets, which might interpret it."""

from __future__ import annotations

import html
import re
from collections.abc import Iterable, Sequence

__all__ = ["csv_cell", "csv_comment", "html_table", "html_text", "markdown_cell", "markdown_table", "terminal_text"]

_OBEYED = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff]")
"""Control characters, marks that turn the direction of writing, and halves of characters, which no file can hold."""


def terminal_text(text: str) -> str:
    r"""Return a text in which each character that a terminal obeys is written as ``\u001b``; lines and tabs stay."""
    return _OBEYED.sub(lambda match: f"\\u{ord(match[0]):04x}", text)


def html_text(text: str) -> str:
    """Return a text for the inside of an element or of an attribute in quotes."""
    return html.escape(terminal_text(text))


def html_table(title: str, rows: Iterable[Sequence[str]]) -> str:
    """Return a line and a table of texts, for a notebook; the first row heads the columns."""
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
        return not text.strip("+- ")  # a dash alone stands for nothing
    return True
