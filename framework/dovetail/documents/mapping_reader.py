"""A dict as a tree of values, read within the limits of a file."""

from __future__ import annotations

import math
from collections.abc import Mapping
from numbers import Integral, Real

from dovetail.documents.fault_list import FaultList
from dovetail.documents.tree import Entry, Item, Mark, Path, Scalar, format_value
from dovetail.documents.yaml_reader import LARGEST_TREE, LARGEST_WHOLE, MOST_LEVELS, UNPRINTABLE

DICT = "<dict>"
"""Name of a dict in messages, instead of a file's name."""


def read_mapping(source: Mapping[str, object], faults: FaultList) -> Item:
    """Read a dict of dicts, lists, texts, numbers and truth values.

    Raises
    ------
    DescriptionError
        It exceeds the limits of a description's size or depth.
    """
    return _Reader(faults).item(source, ())


class _Reader:
    def __init__(self, faults: FaultList) -> None:
        self._faults = faults
        self._count = 0

    def item(self, value: object, path: Path) -> Item:
        self._count += 1
        mark = Mark(0, 0, self._count, DICT)
        if self._count > LARGEST_TREE or len(path) >= MOST_LEVELS:
            bound = f"{LARGEST_TREE} values" if self._count > LARGEST_TREE else f"{MOST_LEVELS} levels"
            self._faults.add_at(mark, path[:3], f"the description has more than {bound}.")
            raise self._faults.error()
        if isinstance(value, Mapping):
            return Item(mark, self._entries(value, path))
        if isinstance(value, (list, tuple)):
            return Item(mark, tuple(self.item(element, (*path, index)) for index, element in enumerate(value)))
        return Item(mark, self._scalar(value, mark, path))

    def _entries(self, value: Mapping[object, object], path: Path) -> dict[str, Entry]:
        entries: dict[str, Entry] = {}
        for key, element in value.items():
            mark = Mark(0, 0, self._count + 1, DICT)
            if not isinstance(key, str):
                self._faults.add_at(mark, path, f"the key is {format_value(key)}.", "a text")
            elif match := UNPRINTABLE.search(key):
                self._faults.add_at(mark, path, f"a key contains the character U+{ord(match.group()):04X}.")
            else:
                entries[key] = Entry(mark, self.item(element, (*path, key)))
        return entries

    def _scalar(self, value: object, mark: Mark, path: Path) -> Scalar:
        if value is None or isinstance(value, bool):
            return value
        if isinstance(value, str):
            if match := UNPRINTABLE.search(value):
                problem = f"the character U+{ord(match.group()):04X} is not allowed in a description."
                self._faults.add_garbled(mark, path, problem)
            return str(value)
        if isinstance(value, Integral):
            if abs(int(value)) > LARGEST_WHOLE:
                self._faults.add_garbled(mark, path, "this is too large a whole number.")
                return 0
            return int(value)
        if isinstance(value, Real):
            if not math.isfinite(value):
                self._faults.add_garbled(mark, path, f"{float(value)!r} is not a finite number.")
            return float(value)
        problem = f"an object of the type '{type(value).__name__}' is not allowed in a description."
        self._faults.add_garbled(mark, path, problem, "a dict, a list, a text, a number, true or false")
        return None
