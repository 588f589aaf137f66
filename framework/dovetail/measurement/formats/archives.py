"""Files of named arrays: their entries, which are loaded when they are needed, and their attributes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

LARGEST_ARRAY = 40_000_000
"""Largest size of an unpacked array in bytes."""
SMALL_ARRAY = 16_000
"""Largest size in bytes of an array that is loaded to see what it states."""


@dataclass(frozen=True)
class Entry:
    """One array or text of a file, not loaded yet.

    Parameters
    ----------
    what : str
        Shape and type in words.
    load : callable
        Returns the array; a text is an array of one string.
    attributes : mapping of str to str
        Texts and numbers that the file attaches to the entry, such as its unit.
    is_small : bool
        Whether it may be loaded to see what it states.
    """

    what: str
    load: Callable[[], NDArray[Any]] = field(repr=False)
    attributes: Mapping[str, str] = field(default_factory=dict)
    is_small: bool = True


@dataclass(frozen=True)
class Archive:
    """A file of named arrays.

    Parameters
    ----------
    path : Path
    entries : mapping of str to Entry
    attributes : mapping of str to str
        Texts and numbers that the file attaches to itself.
    group_attributes : mapping of str to mapping of str to str
        Those that it attaches to its groups, by the group's name with a slash at its end.
    made_from : frozenset of str
        Entries from which other entries were computed.
    """

    path: Path
    entries: Mapping[str, Entry]
    attributes: Mapping[str, str] = field(default_factory=dict)
    group_attributes: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    made_from: frozenset[str] = frozenset()
