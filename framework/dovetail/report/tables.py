"""One table for all readers: CSV and JSON with its values, terminal, Markdown and HTML with its texts."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

from dovetail.plain_text import markdown_table
from dovetail.report.result_files import csv_text


@dataclass(frozen=True)
class Column:
    """A column of a table.

    Parameters
    ----------
    heading : str
        For people; a column without one is not shown to them.
    key : str
        In CSV and JSON; a column without one is not in them.
    text : callable
        Writes a value for people; None is shown as an empty cell by default.
    is_number : bool
        Whether it is set flush right.
    once : bool
        Whether people see it only in the first of consecutive rows with the same value in the first column.
    """

    heading: str
    key: str = ""
    text: Callable[[Any], str] = lambda value: "" if value is None else str(value)
    is_number: bool = True
    once: bool = False


@dataclass(frozen=True)
class Table:
    """A table with plain values.

    Parameters
    ----------
    columns : sequence of Column
    rows : sequence of sequences
        A value for each column.
    summary : sequence of str
        Texts of a last row for people; empty: none.
    """

    columns: Sequence[Column]
    rows: Sequence[Sequence[Any]]
    summary: Sequence[str] = ()

    @property
    def headings(self) -> list[str]:
        """The headings of the columns that people see, those with any entry."""
        return [self.columns[index].heading for index in self._shown]

    @property
    def numbers(self) -> list[str]:
        """The headings of those that are set flush right."""
        return [self.columns[index].heading for index in self._shown if self.columns[index].is_number]

    @property
    def texts(self) -> list[list[str]]:
        """The rows for people."""
        return [[row[index] for index in self._shown] for row in self._all_texts()]

    @property
    def _shown(self) -> list[int]:
        texts = self._all_texts()
        columns = enumerate(self.columns)
        return [index for index, column in columns if column.heading and any(row[index] for row in texts)]

    def _all_texts(self) -> list[list[str]]:
        texts = []
        for number, row in enumerate(self.rows):
            is_repeated = number > 0 and self.rows[number - 1][0] == row[0]
            pairs = zip(self.columns, row, strict=True)
            texts.append(["" if column.once and is_repeated else column.text(value) for column, value in pairs])
        return [*texts, list(self.summary)] if self.summary else texts

    def without(self, *headings: str) -> Table:
        """Return the table without some of the columns that people see."""
        columns = [replace(column, heading="") if column.heading in headings else column for column in self.columns]
        return replace(self, columns=columns)

    def records(self) -> list[dict[str, Any]]:
        """Return the rows as dicts, for JSON."""
        return [{c.key: value for c, value in zip(self.columns, row, strict=True) if c.key} for row in self.rows]

    def csv(self) -> str:
        """Return the values as comma-separated text."""
        kept = [index for index, column in enumerate(self.columns) if column.key]
        return csv_text([self.columns[index].key for index in kept], ([row[i] for i in kept] for row in self.rows))

    def markdown(self) -> str:
        """Return the texts as a table in Markdown."""
        rule = ["---:" if heading in self.numbers else "---" for heading in self.headings]
        return markdown_table(self.headings, self.texts, rule)
