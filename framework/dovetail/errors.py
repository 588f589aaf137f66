"""Messages for users: errors with a remedy, and the notes of a result by importance."""

from __future__ import annotations

import difflib
import importlib.util
import re
import sys
import traceback
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from enum import IntEnum
from typing import Any, Self

from dovetail.plain_text import terminal_text

_LEAST_SIMILAR = 0.4
"""Ratio of common letters above which a spelling is suggested."""
_LONGEST_WORD = 100
"""Characters of a word for which a spelling is looked for: comparing takes their square."""
_MISSING_ARGUMENTS = re.compile(
    r"(?P<name>\w+)\.__init__\(\) missing \d+ required (?:positional|keyword-only) arguments?: (?P<arguments>.+)"
)
"""Python's message on an object made without an argument that it needs, such as ``JointPort("a")``."""


@dataclass(frozen=True)
class Fault:
    """One fault in the user's input.

    Parameters
    ----------
    where : str
        Its position, most often ``file:line:column  path.in.the.file``.
    problem : str
        One sentence: the value at this position, and why it cannot be used.
    accepted : str, optional
        The values that can be used instead.
    remedy : str, optional
        What to do, as a separate sentence.
    """

    where: str
    problem: str
    accepted: str = ""
    remedy: str = ""

    def __str__(self) -> str:
        lines = [self.where] if self.where else []
        lines.append(f"  {self.problem}")
        advice = [self.remedy] if self.remedy else []
        if self.accepted:
            advice.append(f"Accepted: {self.accepted}")
        if advice:
            lines.append("  " + "  ".join(advice))
        return terminal_text("\n".join(lines))


class DovetailError(Exception):
    """Base of all errors that Dovetail explains; the command line prints them without a traceback.

    Parameters
    ----------
    *faults : Fault or str
        All faults, in the order of the input. A string is a fault without a position.
    """

    def __init__(self, *faults: Fault | str) -> None:
        self.faults = tuple(Fault("", fault) if isinstance(fault, str) else fault for fault in faults)
        super().__init__("\n".join(str(fault) for fault in self.faults))


class DescriptionError(DovetailError):
    """An assembly description that cannot be used."""


class PluginError(DovetailError):
    """A component that is missing, broken, or offered twice."""


class ParameterError(DovetailError):
    """Parameter values that the assembly cannot take."""


class FileError(DovetailError):
    """A file that is missing, empty, too large, a folder, or cannot be read or written."""


class MeasurementError(DovetailError):
    """A measurement that cannot be read, or that does not fit the assembly."""


class DatasetError(DovetailError):
    """A dataset that cannot be read, or that does not belong to the assembly."""


class BundleError(DovetailError):
    """A model bundle that is damaged, of another format, or lacks its components."""


class UnitError(DovetailError, ValueError):
    """A quantity without a unit of the required dimension."""


_SYNONYMS = {"inertance": "accelerance", "compliance": "receptance", "flexibility": "receptance"}
"""Synonyms of the field, whose spelling resembles another accepted word."""


def argument(name: str, value: object = None) -> str:
    """Return an argument of the API as messages name it, with a value or without.

    ``argument("columns", ["force", "time"])`` is ``"`columns=['force', 'time']`"``. The command line prints
    the option that sets this argument in its place; so the library knows no options.
    """
    text = "" if value is None else repr(value).replace("`", "\\x60")
    return f"`{name}={text}`"


def did_you_mean(word: str, accepted: Iterable[str]) -> str:
    """Return ``"Did you mean 'x'?"`` with the accepted spelling nearest to `word`, or an empty text."""
    meant = nearest(word, accepted)
    return f"Did you mean '{meant}'?" if meant else ""


def nearest(word: str, accepted: Iterable[str]) -> str:
    """Return the accepted spelling nearest to `word`, or an empty text if none is similar."""
    word = word[:_LONGEST_WORD].lower()
    word = _SYNONYMS.get(word, word)
    similar, highest = "", (_LEAST_SIMILAR, 0)
    for candidate in accepted:
        ratio = difflib.SequenceMatcher(None, word, candidate.lower()).ratio()
        score = ratio, len(set(word) & set(candidate.lower()))
        if score > highest:
            similar, highest = candidate, score
    return similar


def counted(count: int, noun: str) -> str:
    """Return a count with its noun: ``"1 line"``, ``"2 lines"``."""
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


def listing(names: Iterable[str], limit: int = 12) -> str:
    """Join `names` with commas; those beyond `limit` are counted."""
    items = list(names)
    text = ", ".join(items[:limit])
    return f"{text}, and {len(items) - limit} more" if len(items) > limit else text


def as_dovetail_error(error: Exception, where: str) -> DovetailError:
    """Return any exception as a DovetailError with its cause, so that the remaining tasks of a batch continue.

    Parameters
    ----------
    error : Exception
        A DovetailError is returned unchanged.
    where : str
        The task, such as the name of a measurement.
    """
    if isinstance(error, DovetailError):
        return error
    if isinstance(error, OSError):
        return DovetailError(Fault(where, f"the system refuses: {error.strerror or error}."))
    if (limit := limit_exceeded(error, where)) is not None:
        return limit
    calls = traceback.extract_tb(error.__traceback__)
    place = f" ({calls[-1].filename}:{calls[-1].lineno})" if calls else ""
    problem = f"unexpected error: {type(error).__name__}: {error}{place}."
    remedy = "This is a bug in dovetail or in a plugin that it uses: please report it with this message and the file."
    return DovetailError(Fault(where, problem, remedy=remedy))


def limit_exceeded(error: Exception, where: str) -> DovetailError | None:
    """Return an error for input that exceeds the memory or the range of numbers, or None if the exception is a bug."""
    if isinstance(error, MemoryError) or "can't allocate memory" in str(error):  # torch raises a RuntimeError
        return DovetailError(Fault(where, "there is not enough memory for it.", remedy="Free some memory."))
    if isinstance(error, ArithmeticError) or type(error).__name__ == "LinAlgError":
        return DovetailError(Fault(where, f"its values are beyond what can be computed with: {error}."))
    return None


def require_package(name: str, extra: str, where: str, *, load: bool = True) -> Any:
    """Return an optional package, or raise a DovetailError at `where` that says what to install.

    With ``load=False`` the package is only looked for, for work that another process does.
    """
    reason = "is not installed"
    try:
        if importlib.util.find_spec(name) is not None:
            return __import__(name) if load else None
    except ValueError:  # a module without a specification stands in its place
        if sys.modules.get(name) is not None:
            return sys.modules[name]
    except ImportError as error:
        if getattr(error, "name", None) not in (None, name):
            reason = f"is installed but cannot be loaded ({error})"
    problem = f"this needs the package {name}, which {reason}."
    raise DovetailError(Fault(where, problem, remedy=f'Install it by: pip install "dovetail-frf[{extra}]"'))


@contextmanager
def damage_reported(
    where: str, problem: str, accepted: str = "", kind: type[DovetailError] = MeasurementError
) -> Iterator[None]:
    """Convert any exception about a damaged file to one error of this class, with the reason."""
    try:
        yield
    except kind as error:
        if all(fault.where for fault in error.faults):
            raise
        raise type(error)(*(replace(fault, where=fault.where or where) for fault in error.faults)) from None
    except Exception as error:
        reason = " ".join(str(error).split())[:100] or type(error).__name__
        raise kind(Fault(where, f"{problem}: {reason.rstrip('.')}.", accepted)) from error


class Importance(IntEnum):
    """Importance of a note."""

    DECISIVE = 0
    """The numbers may be wrong: parts of the band were not measured, a value lies outside its range."""
    LIMITING = 1
    """The numbers have a limited meaning: a parameter at an end of its range, rough intervals."""
    DETAIL = 2
    """Details: lines that were omitted, the number of repeated searches."""


class Note(str):
    """A sentence with its importance.

    Parameters
    ----------
    text : str
    importance : Importance
    """

    importance: Importance

    def __new__(cls, text: str, importance: Importance = Importance.LIMITING) -> Self:
        """Return the sentence."""
        made = super().__new__(cls, text)
        made.importance = importance
        return made


def by_importance(notes: Iterable[str]) -> tuple[str, ...]:
    """Sort notes by importance, keeping their order otherwise; a plain text counts as limiting."""
    return tuple(sorted(notes, key=_importance))


def is_decisive(note: str) -> bool:
    """Return whether a note warns that the numbers may be wrong."""
    return _importance(note) == Importance.DECISIVE


def reworded(note: str, text: str) -> Note:
    """Return another text with the importance of a note."""
    return Note(text, _importance(note))


def _importance(note: str) -> Importance:
    return note.importance if isinstance(note, Note) else Importance.LIMITING


@contextmanager
def contained(source: str, problem: str = "", *passing: type[Exception]) -> Iterator[None]:
    """Turn any exception of a plugin's code into a PluginError; Ctrl-C and the types in `passing` pass."""
    try:
        yield
    except BaseException as error:
        if isinstance(error, (KeyboardInterrupt, *passing)):
            raise
        raise PluginError(Fault(source, f"{problem}{reason_of(error)}")) from error


def reason_of(error: BaseException) -> str:
    """Return an error as one sentence."""
    if isinstance(error, TypeError) and (match := _MISSING_ARGUMENTS.fullmatch(str(error))):
        return f"{match['name']}(...) is called without {match['arguments']}."
    if not isinstance(error, DovetailError):
        return f"{type(error).__name__}: {error}".removesuffix(": ")
    fault = error.faults[0]
    accepted = f" Accepted: {fault.accepted}." if fault.accepted else ""
    return f"{fault.where}: {fault.problem}{accepted}".removeprefix(": ")
