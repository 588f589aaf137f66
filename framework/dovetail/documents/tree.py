"""The content of a document: a tree of plain values, each with its position."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, TypeAlias

Scalar: TypeAlias = str | int | float | bool | None
Path: TypeAlias = tuple[str | int, ...]
"""Keys and list indices from the root of the document."""

_LONGEST_TEXT = 60
"""Characters of a value that a message quotes."""


@dataclass(frozen=True, order=True)
class Mark:
    """A position in a file or a dict.

    Parameters
    ----------
    rank : int
        Number of the file in a chain of `extends`, from 0 for the file that is read first.
    line, column : int
        Counted from 1. A dict has no lines: there `line` is 0 and `column` counts the values in their order.
    file : str
    """

    rank: int
    line: int
    column: int
    file: str

    def __str__(self) -> str:
        return f"{self.file}:{self.line}:{self.column}" if self.line else self.file


@dataclass(frozen=True)
class Entry:
    """The value of a key in a mapping, and the position of the key."""

    key: Mark
    item: Item


@dataclass(frozen=True)
class Item:
    """A value and its position: a scalar, a tuple of items, or a mapping of texts to entries."""

    mark: Mark
    value: Scalar | tuple[Item, ...] | Mapping[str, Entry]

    @property
    def entries(self) -> Mapping[str, Entry]:
        """The entries of a mapping; empty for any other value."""
        return self.value if isinstance(self.value, Mapping) else {}

    @property
    def is_mapping(self) -> bool:
        """Whether it is a mapping."""
        return isinstance(self.value, Mapping)

    def steps(self, path: Path) -> Iterator[tuple[Mark, Item]]:
        """Yield the position and the item of each step along `path`, as far as it exists."""
        item = self
        for step in path:
            if isinstance(item.value, Mapping) and isinstance(step, str) and step in item.value:
                entry = item.value[step]
                mark, item = entry.key, entry.item
            elif isinstance(item.value, tuple) and isinstance(step, int) and step < len(item.value):
                item = item.value[step]
                mark = item.mark
            else:
                return
            yield mark, item

    def at(self, path: Path) -> Item | None:
        """Return the item at `path`, or None."""
        items = [self, *(item for _, item in self.steps(path))]
        return items[-1] if len(items) > len(path) else None


def replace_value(item: Item, path: Path, value: Scalar) -> Item:
    """Return the tree with another value at a path, which must exist."""
    old = item.at(path)
    assert old is not None
    return replace_item(item, path, Item(old.mark, value))


def replace_item(item: Item, path: Path, replacement: Item) -> Item:
    """Return the tree with another item at a path, which must exist."""
    if not path:
        return replacement
    step, *others = path
    if isinstance(item.value, tuple):
        elements = list(item.value)
        elements[int(step)] = replace_item(elements[int(step)], tuple(others), replacement)
        return Item(item.mark, tuple(elements))
    key, entry = str(step), item.entries[str(step)]
    changed = replace_item(entry.item, tuple(others), replacement)
    return Item(item.mark, {**item.entries, key: Entry(entry.key, changed)})


def plain_values(item: Item) -> Any:
    """Return the values without their positions, as dicts, lists and scalars."""
    if isinstance(item.value, Mapping):
        return {key: plain_values(entry.item) for key, entry in item.value.items()}
    if isinstance(item.value, tuple):
        return [plain_values(element) for element in item.value]
    return item.value


def format_path(path: Path) -> str:
    """Write a path for a message: ``joints.collet.connect.tool.at[1]``."""
    text = ""
    for step in path:
        if isinstance(step, int):
            text += f"[{step}]"
        else:
            text += f"{'.' if text else ''}{step if step.isidentifier() else repr(_shortened(step))}"
    return text


def format_value(value: object) -> str:
    """Write a value for a message; a long text is cut."""
    if value is None:
        return "an empty value"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, Mapping):
        return "a section of keys and values"
    if isinstance(value, (list, tuple)):
        return "a list"
    return repr(_shortened(value)) if isinstance(value, str) else repr(value)


def _shortened(text: str) -> str:
    return text if len(text) <= _LONGEST_TEXT else f"{text[:_LONGEST_TEXT]}..."
