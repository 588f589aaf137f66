"""What a description says and where it says it: a tree of plain values with the position of each."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, TypeAlias

__all__ = ["Entry", "Item", "Mark", "Path", "Scalar", "dotted", "plain", "replaced", "shown"]

Scalar: TypeAlias = str | int | float | bool | None
Path: TypeAlias = tuple[str | int, ...]
"""Keys and list indices from the root of the description."""

_LONGEST_SHOWN = 60


@dataclass(frozen=True, order=True)
class Mark:
    """A place in a source.

    Parameters
    ----------
    rank : int
        Number of the file in a chain of `extends`, the first read being 0.
    line, column : int
        Counted from 1; line 0 is a source without lines, whose `column` is the order in which things stand.
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
    """What stands behind a key of a mapping."""

    key: Mark
    item: Item


@dataclass(frozen=True)
class Item:
    """A value and its place: a scalar, a tuple of items, or a mapping of texts to entries."""

    mark: Mark
    value: Scalar | tuple[Item, ...] | Mapping[str, Entry]

    @property
    def entries(self) -> Mapping[str, Entry]:
        """The entries of a mapping; none for anything else."""
        return self.value if isinstance(self.value, Mapping) else {}

    @property
    def is_mapping(self) -> bool:
        """Whether it is a mapping."""
        return isinstance(self.value, Mapping)

    def steps(self, path: Path) -> Iterator[tuple[Mark, Item]]:
        """Walk along `path` as far as it exists, giving the place of each key or list element and what is there."""
        item = self
        for step in path:
            if isinstance(item.value, Mapping) and isinstance(step, str) and step in item.value:
                entry = item.value[step]
                place, item = entry.key, entry.item
            elif isinstance(item.value, tuple) and isinstance(step, int) and step < len(item.value):
                item = item.value[step]
                place = item.mark
            else:
                return
            yield place, item

    def at(self, path: Path) -> Item | None:
        """Return what stands at `path`, or None."""
        found = [item for _, item in self.steps(path)]
        if len(found) < len(path):
            return None
        return found[-1] if found else self


def replaced(item: Item, path: Path, value: Scalar) -> Item:
    """Return the tree with another value at a path of keys that is there."""
    if not path:
        return Item(item.mark, value)
    key, entry = str(path[0]), item.entries[str(path[0])]
    changed = Entry(entry.key, replaced(entry.item, path[1:], value))
    return Item(item.mark, {**item.entries, key: changed})


def plain(item: Item) -> Any:
    """Return the values alone, as dicts, lists and scalars."""
    if isinstance(item.value, Mapping):
        return {key: plain(entry.item) for key, entry in item.value.items()}
    if isinstance(item.value, tuple):
        return [plain(element) for element in item.value]
    return item.value


def dotted(path: Path) -> str:
    """Write a path for a reader: ``joints.collet.connect.tool.at[1]``."""
    text = ""
    for step in path:
        if isinstance(step, int):
            text += f"[{step}]"
        else:
            text += f"{'.' if text else ''}{step if step.isidentifier() else repr(_cut(step))}"
    return text


def shown(value: object) -> str:
    """Write a value of a description for a reader, shortened where it is long."""
    if value is None:
        return "an empty value"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, Mapping):
        return "a section of keys and values"
    if isinstance(value, (list, tuple)):
        return "a list"
    return repr(_cut(value)) if isinstance(value, str) else repr(value)


def _cut(text: str) -> str:
    return text if len(text) <= _LONGEST_SHOWN else f"{text[:_LONGEST_SHOWN]}..."
