"""A YAML file as a tree of values and positions, read within limits that stop a hostile file early.

PyYAML gives the events of the file with their positions. Scalars are resolved here, by the core schema of YAML 1.2.
"""

from __future__ import annotations

import math
import os
import re
import stat
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import yaml

from dovetail.atomic_files import missing_file
from dovetail.documents.fault_list import FaultList
from dovetail.documents.tree import Entry, Item, Mark, Path, Scalar, format_value
from dovetail.errors import DescriptionError

LARGEST_FILE = 256 * 1024
"""Bytes."""
DESCRIPTION = "a description (YAML); measured files come after it"
"""What is accepted in place of another kind of file."""
LARGEST_TREE = 50_000
"""Number of values; those behind an alias are counted each time."""
MOST_LEVELS = 32
"""Of nesting, since reading is recursive."""
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
_REWORDED = (
    (r"found character '\\t' that cannot start any token", "a tab is not an indentation; use spaces"),
    (r"mapping values are not allowed here", "a ':' is not allowed here; an indentation or a quote is wrong"),
    (r"found character '(.)' that cannot start any token", r"a text that begins with '\1' must be in quotes"),
    (r"could not find expected ':'", "a ':' with a space after it is missing"),
    (r"(.*)'<stream end>'", r"\1the end of the file"),
)
_AFTER_ANCHOR = "\0 \t\r\n\x85\u2028\u2029,[]{}"


def read_yaml(file: str, rank: int, faults: FaultList) -> Item:
    """Read one YAML file.

    Parameters
    ----------
    file : str
        Path, also used in messages.
    rank : int
        Number of the file in a chain of `extends`.
    faults : FaultList
        Collects the faults of single keys and values.

    Returns
    -------
    Item
        A mapping.

    Raises
    ------
    DescriptionError
        The file is not a YAML mapping, or exceeds the limits.
    """
    text = _read_text(file, rank, faults)
    return _Composer(file, rank, faults).compose(text)


def _read_text(file: str, rank: int, faults: FaultList) -> str:
    start = Mark(rank, 0, 0, file)
    try:
        status = os.stat(file)
        if not stat.S_ISREG(status.st_mode):
            kind = "a folder" if stat.S_ISDIR(status.st_mode) else "not a file"
            faults.add_at(start, (), f"this is {kind}.", DESCRIPTION)
            raise faults.error()
        with open(file, "rb") as stream:
            data = stream.read(LARGEST_FILE + 1)
    except FileNotFoundError:
        faults.add_at(start, (), "there is no such file.", remedy=missing_file(file).remedy)
        raise faults.error() from None
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        faults.add_at(start, (), f"the file cannot be read: {reason}.")
        raise faults.error() from None
    if len(data) > LARGEST_FILE:
        size = f"the file has {status.st_size} bytes; a description has {LARGEST_FILE} at most."
        faults.add_at(start, (), size, DESCRIPTION)
        raise faults.error()
    return _decode(data, file, rank, faults)


def _decode(data: bytes, file: str, rank: int, faults: FaultList) -> str:
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        before = data[: error.start].decode("utf-8-sig")
        is_yaml = os.path.splitext(file)[1].lower() in (".yaml", ".yml")
        problem = f"the byte 0x{data[error.start]:02x} is not UTF-8."
        mark = _mark_after(before, file, rank)
        if is_yaml:
            faults.add_at(mark, (), problem, remedy="Save the file as UTF-8.")
        else:
            faults.add_at(mark, (), f"this is not a text file: {problem}", DESCRIPTION)
        raise faults.error() from None
    if match := UNPRINTABLE.search(text):
        mark = _mark_after(text[: match.start()], file, rank)
        faults.add_at(mark, (), f"the character U+{ord(match.group()):04X} is not allowed in a description.")
        raise faults.error()
    return text


def _mark_after(text: str, file: str, rank: int) -> Mark:
    return Mark(rank, text.count("\n") + 1, len(text) - text.rfind("\n"), file)


class _Loader(yaml.SafeLoader):  # type: ignore[misc]
    """PyYAML's loader, with three rules of YAML 1.2 instead of those of YAML 1.1."""

    def scan_to_next_token(self) -> None:
        """Skip blanks and comments; in a flow collection tabs are blanks too."""
        super().scan_to_next_token()
        while self.flow_level and self.peek() == "\t":
            self.forward()
            super().scan_to_next_token()

    def scan_anchor(self, token: type[yaml.Token]) -> yaml.Token:
        """Read the name of an anchor or an alias: any characters except blanks and brackets."""
        length = 1
        while self.peek(length) not in _AFTER_ANCHOR:
            length += 1
        if length == 1:
            return super().scan_anchor(token)  # raises the parser's error
        start, name = self.get_mark(), self.prefix(length)[1:]
        self.forward(length)
        return token(name, start, self.get_mark())

    def parse_block_mapping_key(self) -> yaml.Event:
        """Return the key of an entry; an empty one if there is only a ':'."""
        if self.check_token(yaml.ValueToken):
            self.state = self.parse_block_mapping_value
            return self.process_empty_scalar(self.peek_token().start_mark)
        return super().parse_block_mapping_key()


class _Composer:
    """Builds the tree of one file from the events of its parser."""

    def __init__(self, file: str, rank: int, faults: FaultList) -> None:
        self._file = file
        self._rank = rank
        self._faults = faults
        self._count = 0
        self._last = Mark(rank, 1, 1, file)
        self._anchors: dict[str, tuple[Item, int, int] | None] = {}
        self._events: Iterator[Any] = iter(())

    def compose(self, text: str) -> Item:
        self._events = self._parse(text)
        next(self._events)
        event = next(self._events)
        if isinstance(event, yaml.StreamEndEvent):
            raise self._fatal(self._last, "the file is empty.", "a description, which begins with 'dovetail: 1'")
        if event.version not in (None, (1, 2)):
            version = ".".join(str(number) for number in event.version)
            mark = replace(self._last, line=event.end_mark.line + 1)  # of the '---' after the directive
            raise self._fatal(mark, f"the file requires YAML {version}.", "YAML 1.2")
        root, _ = self._node(next(self._events), (), 1)
        if not root.is_mapping:
            content = "no description" if self._rank else format_value(root.value)  # do not show an extended file
            raise self._fatal(root.mark, f"the file contains {content}.", DESCRIPTION)
        next(self._events)
        if not isinstance(next(self._events), yaml.StreamEndEvent):
            raise self._fatal(self._last, "a second document begins here.", "one document in a file")
        return root

    def _parse(self, text: str) -> Iterator[Any]:
        """Yield the parser's events; an error of the parser becomes a fault."""
        try:
            for event in yaml.parse(text, Loader=_Loader):
                self._last = self._mark(event.start_mark)
                yield event
        except yaml.MarkedYAMLError as error:
            mark = self._mark(error.problem_mark) if error.problem_mark else self._last
            problem = (error.problem or "it cannot be parsed").strip()
            if problem == "found unexpected end of stream" and error.context_mark:
                mark, problem = self._mark(error.context_mark), "the quote that opens here is not closed"
            for pattern, words in _REWORDED:
                problem = re.sub(f"^{pattern}$", words, problem)
            raise self._fatal(mark, f"this is not YAML: {problem}.") from None
        except (ValueError, ArithmeticError, LookupError):
            raise self._fatal(self._last, "this is not YAML: an escape or a directive cannot be read.") from None

    def _mark(self, mark: yaml.Mark) -> Mark:
        return Mark(self._rank, mark.line + 1, mark.column + 1, self._file)

    def _fatal(self, mark: Mark, problem: str, accepted: str = "", path: Path = ()) -> DescriptionError:
        self._faults.add_at(mark, path, problem, accepted)
        return self._faults.error()

    def _node(self, event: Any, path: Path, level: int) -> tuple[Item, int]:
        """Return an item and its number of levels."""
        mark = self._mark(event.start_mark)
        if isinstance(event, yaml.AliasEvent):
            return self._alias(event.anchor, mark, path, level)
        if level > MOST_LEVELS:
            raise self._fatal(mark, f"this is nested more than {MOST_LEVELS} levels deep.")
        before = self._count
        self._grow(1, mark)
        if event.anchor is not None:
            self._anchors[event.anchor] = None
        if isinstance(event, yaml.MappingStartEvent):
            item, height = self._mapping(event, mark, path, level)
        elif isinstance(event, yaml.SequenceStartEvent):
            item, height = self._sequence(event, mark, path, level)
        else:
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
            raise self._fatal(mark, f"the alias '*{anchor}' is inside its own anchor.", path=path)
        item, height, size = target
        self._grow(size, mark)
        if level + height - 1 > MOST_LEVELS:
            raise self._fatal(mark, f"this is nested more than {MOST_LEVELS} levels deep.")
        return item, height

    def _mapping(self, event: Any, mark: Mark, path: Path, level: int) -> tuple[Item, int]:
        self._check_tag(event, mark, path, "map")
        entries: dict[str, Entry] = {}
        height = 0
        while not isinstance(event := next(self._events), yaml.MappingEndEvent):
            key_mark = self._mark(event.start_mark)
            key, _ = self._node(event, path, level + 1)
            name = key.value if isinstance(key.value, str) else None
            if name is None:
                remedy = "Put it in quotes." if isinstance(key.value, (int, float)) else ""
                self._faults.add_at(key_mark, path, f"the key is {format_value(key.value)}.", "a text", remedy)
            item, below = self._node(next(self._events), (*path, str(name)), level + 1)
            height = max(height, below)
            if name in entries:
                line = entries[name].key.line
                problem = f"the key '{name}' is repeated; it is first used in line {line}."
                self._faults.add_at(key_mark, (*path, name), problem, remedy="Remove one of them.")
            elif name is not None:
                entries[name] = Entry(key_mark, item)
        return Item(mark, entries), height + 1

    def _sequence(self, event: Any, mark: Mark, path: Path, level: int) -> tuple[Item, int]:
        self._check_tag(event, mark, path, "seq")
        items: list[Item] = []
        height = 0
        while not isinstance(event := next(self._events), yaml.SequenceEndEvent):
            item, below = self._node(event, (*path, len(items)), level + 1)
            items.append(item)
            height = max(height, below)
        return Item(mark, tuple(items)), height + 1

    def _check_tag(self, event: Any, mark: Mark, path: Path, wanted: str) -> None:
        if event.tag not in (None, "!", _CORE + wanted):
            self._refuse_tag(event.tag, mark, path)

    def _refuse_tag(self, tag: str, mark: Mark, path: Path) -> None:
        short = f"!!{tag.removeprefix(_CORE)}" if tag.startswith(_CORE) else tag
        problem = f"the tag {format_value(short)} is not allowed here; a description has only plain values."
        self._faults.add_garbled(mark, path, problem, _CORE_TAGS, "Remove it.")

    def _scalar(self, event: Any, mark: Mark, path: Path) -> Scalar:
        tag, text = event.tag, event.value
        if match := UNPRINTABLE.search(text):
            problem = f"the character U+{ord(match.group()):04X} is not allowed in a description."
            self._faults.add_garbled(mark, path, problem)
            return UNPRINTABLE.sub("?", text)
        if tag in ("!", f"{_CORE}str") or (tag is None and event.style):
            return str(text)
        value, problem = _resolve(text)
        if problem:
            self._faults.add_garbled(mark, path, problem)
        if tag is not None and tag != _CORE + _tag_of(value) and not (tag == f"{_CORE}float" and _is_number(value)):
            if tag in _SCALAR_TAGS:
                problem = f"{format_value(text)} is not what its tag '!!{_SCALAR_TAGS[tag]}' says."
                self._faults.add_garbled(mark, path, problem)
            else:
                self._refuse_tag(tag, mark, path)
        return value


def _resolve(text: str) -> tuple[Scalar, str]:
    """Return the value of a plain scalar by the core schema of YAML 1.2, and its problem or an empty text."""
    if text in _NULL:
        return None, ""
    if text in _TRUTH:
        return _TRUTH[text], ""
    if _WHOLE.fullmatch(text) or _BASED.fullmatch(text):
        number = int(text, 0 if _BASED.fullmatch(text) else 10) if len(text) <= 64 else LARGEST_WHOLE + 1
        if abs(number) <= LARGEST_WHOLE:
            return number, ""
        return text, f"{format_value(text)} is too large a whole number."
    if _NOT_FINITE.fullmatch(text) or (_REAL.fullmatch(text) and not math.isfinite(float(text))):
        return text, f"{format_value(text)} is not a finite number."
    return (float(text), "") if _REAL.fullmatch(text) else (text, "")


def _is_number(value: Scalar) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def _tag_of(value: Scalar) -> str:
    if value is None:
        return "null"
    return {bool: "bool", int: "int", float: "float"}.get(type(value), "str")
