"""A YAML file as a tree of values and positions, read with bounds that a hostile file meets quickly."""

from __future__ import annotations

import math
import os
import re
import stat
from collections.abc import Iterator
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.error import MarkedYAMLError

from dovetail.documents.fault_list import Findings
from dovetail.documents.tree import Entry, Item, Mark, Path, Scalar, shown
from dovetail.errors import DescriptionError

__all__ = ["LARGEST_FILE", "LARGEST_TREE", "LARGEST_WHOLE", "MOST_LEVELS", "UNPRINTABLE", "read_yaml"]

LARGEST_FILE = 256 * 1024
"""Bytes."""
LARGEST_TREE = 50_000
"""Values, those that aliases repeat counted each time."""
MOST_LEVELS = 32
LARGEST_WHOLE = 2**63 - 1

UNPRINTABLE = re.compile("[^\t\n\r\x20-\x7e\x85\xa0-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
_WHOLE = re.compile(r"[-+]?[0-9]+")
_BASED = re.compile(r"0o[0-7]+|0x[0-9a-fA-F]+")
_REAL = re.compile(r"[-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?")
_NOT_FINITE = re.compile(r"[-+]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN)")
_NULL = ("", "~", "null", "Null", "NULL")
_TRUTH = {"true": True, "True": True, "TRUE": True, "false": False, "False": False, "FALSE": False}
_CORE = "tag:yaml.org,2002:"
_SCALAR_TAGS = {f"{_CORE}{name}": name for name in ("int", "float", "bool", "null")}
_CORE_TAGS = "!!str, !!int, !!float, !!bool, !!null, !!map, !!seq"
_IN_OTHER_WORDS = (
    (r"found character '\\t' that cannot start any token", "a tab stands where YAML wants spaces"),
    (r"mapping values are not allowed here", "a ':' is not allowed here; an indentation or a quote is wrong"),
    (r"found character '(.)' that cannot start any token", r"a text that begins with '\1' must be in quotes"),
    (r"could not find expected ':'", "a ':' with a space behind it is missing"),
    (r"(.*)'<stream end>'", r"\1the end of the file"),
)


def read_yaml(file: str, rank: int, findings: Findings) -> Item:
    """Read one YAML file.

    Parameters
    ----------
    file : str
        Path, also used in messages.
    rank : int
        Number of the file in a chain of `extends`.
    findings : Findings
        Takes in what is wrong with single keys and values.

    Returns
    -------
    Item
        A mapping.

    Raises
    ------
    DescriptionError
        It is no YAML mapping at all, or larger than a description may be.
    """
    text = _read_text(file, rank, findings)
    return _Composer(file, rank, findings).compose(text)


def _read_text(file: str, rank: int, findings: Findings) -> str:
    start = Mark(rank, 0, 0, file)
    try:
        status = os.stat(file)
        if not stat.S_ISREG(status.st_mode):
            findings.add_at(start, (), "this is not a file.")
            raise findings.error()
        with open(file, "rb") as stream:
            data = stream.read(LARGEST_FILE + 1)
    except FileNotFoundError:
        findings.add_at(start, (), "there is no such file.")
        raise findings.error() from None
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        findings.add_at(start, (), f"the file cannot be read: {reason}.")
        raise findings.error() from None
    if len(data) > LARGEST_FILE:
        size = f"the file has {status.st_size} bytes; a description has {LARGEST_FILE} at most."
        findings.add_at(start, (), size)
        raise findings.error()
    return _decode(data, file, rank, findings)


def _decode(data: bytes, file: str, rank: int, findings: Findings) -> str:
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        before = data[: error.start].decode("utf-8-sig")
        problem = f"the byte 0x{data[error.start]:02x} is not UTF-8."
        findings.add_at(_mark_after(before, file, rank), (), problem, remedy="Save the file as UTF-8.")
        raise findings.error() from None
    if match := UNPRINTABLE.search(text):
        mark = _mark_after(text[: match.start()], file, rank)
        findings.add_at(mark, (), f"the character U+{ord(match.group()):04X} cannot stand in a description.")
        raise findings.error()
    return text


def _mark_after(text: str, file: str, rank: int) -> Mark:
    return Mark(rank, text.count("\n") + 1, len(text) - text.rfind("\n"), file)


class _Composer:
    """Builds the tree of one file from the events of its parser."""

    def __init__(self, file: str, rank: int, findings: Findings) -> None:
        self._file = file
        self._rank = rank
        self._findings = findings
        self._count = 0
        self._last = Mark(rank, 1, 1, file)
        self._anchors: dict[str, tuple[Item, int, int] | None] = {}
        self._events: Iterator[Any] = iter(())

    def compose(self, text: str) -> Item:
        self._events = self._parse(text)
        next(self._events)
        event = next(self._events)
        if type(event).__name__ == "StreamEndEvent":
            raise self._fatal(self._last, "the file is empty.", "a description, which begins with 'dovetail: 1'")
        if event.version not in (None, (1, 2)):
            asked = ".".join(str(number) for number in event.version)
            raise self._fatal(self._last, f"the file asks for YAML {asked}.", "YAML 1.2")
        root, _ = self._node(next(self._events), (), 1)
        if not root.is_mapping:
            raise self._fatal(root.mark, f"the file holds {shown(root.value)}.", "a section of keys and values")
        next(self._events)
        if type(event := next(self._events)).__name__ != "StreamEndEvent":
            raise self._fatal(self._last, "a second document begins here.", "one document in a file")
        return root

    def _parse(self, text: str) -> Iterator[Any]:
        """Yield the parser's events; whatever it raises becomes a fault."""
        try:
            for event in YAML(typ="safe", pure=True).parse(text):
                self._last = self._mark(event.start_mark)
                yield event
        except MarkedYAMLError as error:
            mark = self._mark(error.problem_mark) if error.problem_mark else self._last
            problem = (error.problem or "it cannot be parsed").strip()
            if problem == "found unexpected end of stream" and error.context_mark:
                mark, problem = self._mark(error.context_mark), "the quote that opens here is not closed"
            for pattern, words in _IN_OTHER_WORDS:
                problem = re.sub(f"^{pattern}$", words, problem)
            raise self._fatal(mark, f"this is not YAML: {problem}.") from None
        except (ValueError, OverflowError, ArithmeticError, LookupError, AssertionError, NotImplementedError):
            raise self._fatal(self._last, "this is not YAML: an escape or a directive cannot be read.") from None

    def _mark(self, mark: Any) -> Mark:
        return Mark(self._rank, mark.line + 1, mark.column + 1, self._file)

    def _fatal(self, mark: Mark, found: str, accepted: str = "", path: Path = ()) -> DescriptionError:
        self._findings.add_at(mark, path, found, accepted)
        return self._findings.error()

    def _node(self, event: Any, path: Path, level: int) -> tuple[Item, int]:
        """Return an item and the number of levels that it has."""
        mark = self._mark(event.start_mark)
        if type(event).__name__ == "AliasEvent":
            return self._alias(event.anchor, mark, path, level)
        if level > MOST_LEVELS:
            raise self._fatal(mark, f"this is nested more than {MOST_LEVELS} levels deep.")
        before = self._count
        self._grow(1, mark)
        if event.anchor is not None:
            self._anchors[event.anchor] = None
        match type(event).__name__:
            case "MappingStartEvent":
                item, height = self._mapping(event, mark, path, level)
            case "SequenceStartEvent":
                item, height = self._sequence(event, mark, path, level)
            case _:
                item, height = Item(mark, self._scalar(event, mark, path)), 1
        if event.anchor is not None:
            self._anchors[event.anchor] = item, height, self._count - before
        return item, height

    def _grow(self, count: int, mark: Mark) -> None:
        self._count += count
        if self._count > LARGEST_TREE:
            raise self._fatal(mark, f"the description has more than {LARGEST_TREE} values, aliases followed.")

    def _alias(self, anchor: str, mark: Mark, path: Path, level: int) -> tuple[Item, int]:
        if anchor not in self._anchors:
            raise self._fatal(mark, f"the alias '*{anchor}' has no anchor '&{anchor}' before it.", path=path)
        target = self._anchors[anchor]
        if target is None:
            raise self._fatal(mark, f"the alias '*{anchor}' stands inside what it names.", path=path)
        item, height, size = target
        self._grow(size, mark)
        if level + height - 1 > MOST_LEVELS:
            raise self._fatal(mark, f"this is nested more than {MOST_LEVELS} levels deep.")
        return item, height

    def _mapping(self, event: Any, mark: Mark, path: Path, level: int) -> tuple[Item, int]:
        self._check_tag(event, mark, path, "map")
        entries: dict[str, Entry] = {}
        height = 0
        while type(event := next(self._events)).__name__ != "MappingEndEvent":
            key_mark = self._mark(event.start_mark)
            key, _ = self._node(event, path, level + 1)
            name = key.value if isinstance(key.value, str) else None
            if name is None:
                remedy = "Put it in quotes." if isinstance(key.value, (int, float)) else ""
                self._findings.add_at(key_mark, path, f"the key is {shown(key.value)}.", "a text", remedy)
            item, below = self._node(next(self._events), (*path, str(name)), level + 1)
            height = max(height, below)
            if name in entries:
                line = entries[name].key.line
                problem = f"the key '{name}' stands here a second time; the first is in line {line}."
                self._findings.add_at(key_mark, (*path, name), problem, remedy="Remove one of them.")
            elif name is not None:
                entries[name] = Entry(key_mark, item)
        return Item(mark, entries), height + 1

    def _sequence(self, event: Any, mark: Mark, path: Path, level: int) -> tuple[Item, int]:
        self._check_tag(event, mark, path, "seq")
        items: list[Item] = []
        height = 0
        while type(event := next(self._events)).__name__ != "SequenceEndEvent":
            item, below = self._node(event, (*path, len(items)), level + 1)
            items.append(item)
            height = max(height, below)
        return Item(mark, tuple(items)), height + 1

    def _check_tag(self, event: Any, mark: Mark, path: Path, wanted: str) -> None:
        if event.ctag is not None and str(event.ctag) not in ("!", _CORE + wanted):
            self._refuse_tag(str(event.ctag), mark, path)

    def _refuse_tag(self, tag: str, mark: Mark, path: Path) -> None:
        short = f"!!{tag.removeprefix(_CORE)}" if tag.startswith(_CORE) else tag
        problem = f"the tag {shown(short)} is not allowed here; a description holds plain values."
        self._findings.add_garbled(mark, path, problem, _CORE_TAGS, "Remove it.")

    def _scalar(self, event: Any, mark: Mark, path: Path) -> Scalar:
        tag = None if event.ctag is None else str(event.ctag)
        text = str(event.value)
        if match := UNPRINTABLE.search(text):
            problem = f"the character U+{ord(match.group()):04X} cannot stand in a description."
            self._findings.add_garbled(mark, path, problem)
            return UNPRINTABLE.sub("?", text)
        if tag in ("!", f"{_CORE}str") or (tag is None and event.style):
            return text
        value, reason = _resolve(text)
        if reason:
            self._findings.add_garbled(mark, path, reason)
        if tag is not None and tag != _CORE + _tag_of(value) and not (tag == f"{_CORE}float" and _is_number(value)):
            if tag in _SCALAR_TAGS:
                self._findings.add_garbled(
                    mark, path, f"{shown(text)} is not what its tag '!!{_SCALAR_TAGS[tag]}' says."
                )
            else:
                self._refuse_tag(tag, mark, path)
        return value


def _resolve(text: str) -> tuple[Scalar, str]:
    """Return the value of a plain scalar by the core schema of YAML 1.2, and what is wrong with it."""
    if text in _NULL:
        return None, ""
    if text in _TRUTH:
        return _TRUTH[text], ""
    if _WHOLE.fullmatch(text) or _BASED.fullmatch(text):
        number = int(text, 0 if _BASED.fullmatch(text) else 10) if len(text) <= 64 else LARGEST_WHOLE + 1
        return (number, "") if abs(number) <= LARGEST_WHOLE else (text, f"{shown(text)} is too large a whole number.")
    if _NOT_FINITE.fullmatch(text) or (_REAL.fullmatch(text) and not math.isfinite(float(text))):
        return text, f"{shown(text)} is not a finite number."
    return (float(text), "") if _REAL.fullmatch(text) else (text, "")


def _is_number(value: Scalar) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def _tag_of(value: Scalar) -> str:
    if value is None:
        return "null"
    return {bool: "bool", int: "int", float: "float"}.get(type(value), "str")
