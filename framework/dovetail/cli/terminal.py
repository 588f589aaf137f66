"""Output: results on stdout, notes and progress on stderr, control characters on a terminal only."""

from __future__ import annotations

import json
import logging
import os
import shutil
import sys
import textwrap
import threading
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from typing import TYPE_CHECKING, Any, Protocol

import typer

from dovetail.cli.option_names import with_options
from dovetail.plain_text import terminal_text

if TYPE_CHECKING:
    from rich.console import RenderableType

    from dovetail.interfaces import Progress
    from dovetail.report.tables import Table

_UNLIMITED = 10_000
"""Width in a pipe, where each row of a table stays on one line, for grep."""
_GAP = 3
"""Blanks between the columns of a table."""
_PATIENCE = 0.5
"""Seconds without output after which a command shows that it is running."""


class Ranged(Protocol):
    """A parameter with its unit and its range."""

    @property
    def unit(self) -> str:
        """SI unit."""

    @property
    def lower(self) -> float:
        """Lower end of the range, in `unit`."""

    @property
    def upper(self) -> float:
        """Upper end of the range, in `unit`."""


class _Records(logging.Handler):
    """Prints what is logged under the name "dovetail"."""

    def emit(self, record: logging.LogRecord) -> None:
        """Print one record."""
        say_on_stderr(f"{record.name}: {record.getMessage()}")


_RECORDS = _Records()
_chosen = {"_quiet": 0, "_verbose": 0}
"""How often -q and -v were given to this command."""


def choose(context: typer.Context, option: typer.CallbackParam, value: int) -> None:
    """Count how often -q or -v was given, before and after the name of the command."""
    name = str(option.name)
    _chosen[name] = value + (_chosen[name] if context.parent is not None else 0)
    if any(_chosen.values()):
        _WAITING.end()
    logger, verbose = logging.getLogger("dovetail"), min(_chosen["_verbose"], 2)
    logger.setLevel((logging.NOTSET, logging.INFO, logging.DEBUG)[verbose])
    (logger.addHandler if verbose else logger.removeHandler)(_RECORDS)


class _Waiting:
    """A moving bar that is shown while a command prints nothing for a while, as when libraries are loaded."""

    def __init__(self) -> None:
        self._lock = threading.RLock()
        self._timer: threading.Timer | None = None
        self._shown = ExitStack()

    def begin(self) -> None:
        """Show the bar after a while, unless `end` is called before."""
        self.end()
        self._timer = threading.Timer(_PATIENCE, self._show)
        self._timer.daemon = True
        self._timer.start()

    def _show(self) -> None:
        with self._lock:
            if threading.current_thread() is self._timer:  # nobody has ended it meanwhile
                from dovetail.progress_bars import StageBars

                self._shown.enter_context(StageBars(transient=True))("running", 0, 1)

    def end(self) -> bool:
        """Remove the bar; return whether it was shown or about to be shown."""
        with self._lock:
            timer, self._timer = self._timer, None
            self._shown.close()
        if timer is not None:
            timer.cancel()
        return timer is not None


_WAITING = _Waiting()


@contextmanager
def waiting() -> Iterator[None]:
    """Show on a terminal that a command is running, whenever it has printed nothing for a while."""
    if _shows_progress():
        _WAITING.begin()
    try:
        yield
    finally:
        _WAITING.end()


@contextmanager
def room() -> Iterator[None]:
    """Remove the bar of `waiting` while something else is printed or asked."""
    waited = _WAITING.end()
    try:
        yield
    finally:
        if waited:
            _WAITING.begin()


def _shows_progress() -> bool:
    return sys.stderr.isatty() and not any(_chosen.values())


def note(text: str) -> None:
    """Print a note on stderr, unless -q was given."""
    if not _chosen["_quiet"]:
        say_on_stderr(text)


def note_from_handler(text: str) -> None:
    """Print a note on stderr from a signal handler, which may interrupt the code that fills the buffer of stderr."""
    if not _chosen["_quiet"]:
        with suppress(OSError, ValueError):  # stderr is closed, or not a file
            os.write(sys.stderr.fileno(), text.encode())


@room()
def say_on_stderr(text: str) -> None:
    """Print a text on stderr; on a terminal, lines that are not indented are wrapped."""
    text = terminal_text(with_options(text))
    if sys.stderr.isatty():
        width = shutil.get_terminal_size().columns
        text = "\n".join(
            line if line.startswith(" ") else textwrap.fill(line, width, break_on_hyphens=False)
            for line in text.split("\n")
        )
    typer.echo(text, err=True)


@room()
def print_json(value: Any) -> None:
    """Print plain values as JSON."""
    text = json.dumps(value, indent=2, ensure_ascii=False, allow_nan=False)
    typer.echo(terminal_text(text.encode("utf-8", "replace").decode("utf-8")))


@room()
def say(text: str = "") -> None:
    """Print a paragraph, wrapped on a terminal."""
    from rich.text import Text

    _show(Text(terminal_text(with_options(text))))


@room()
def title(text: str) -> None:
    """Print a line that stands out on a terminal."""
    from rich.text import Text

    _show(Text(terminal_text(text), style="bold"))


def heading(text: str) -> None:
    """Print an empty line and a title."""
    say()
    title(text)


def quantity_text(value: float, parameter: Ranged) -> str:
    """Write a parameter's SI value in the unit in which its range is easiest to read."""
    from dovetail.plain_text import display_unit, number

    unit = display_unit(parameter.unit, parameter.lower, parameter.upper)
    return f"{number(value * unit.factor)} {unit.text}".rstrip()


def range_text(parameter: Ranged) -> str:
    """Write a parameter's range: ``"26 to 40 mm"``."""
    from dovetail.plain_text import display_unit, number

    unit = display_unit(parameter.unit, parameter.lower, parameter.upper)
    low, high = (number(end * unit.factor, padded=False) for end in (parameter.lower, parameter.upper))
    return f"{low} to {high} {unit.text}".rstrip()


@room()
def table(
    headers: Sequence[str], rows: Iterable[Sequence[str]], *, numbers: Sequence[str] = (), split: bool = False
) -> None:
    """Print a table; columns without any entry are left out.

    Parameters
    ----------
    headers : sequence of str
    rows : iterable of sequences of str
    numbers : sequence of str
        Headers of the columns that are set flush right and never wrapped.
    split : bool
        Whether columns that do not fit into the terminal follow below, after a repetition of the first column, in place
        of cells that are wrapped.
    """
    cells = [[terminal_text(cell) for cell in row] for row in rows]
    kept = [column for column in range(len(headers)) if any(row[column] for row in cells)]
    widths = {column: max(len(row[column]) for row in (headers, *cells)) for column in kept}
    for number, columns in enumerate(_blocks(kept, widths) if split else [kept]):
        if number:
            say()
        _print_columns(headers, cells, columns, numbers)


def print_table(made: Table) -> None:
    """Print a table of `dovetail.report.tables`."""
    table(made.headings, made.texts, numbers=made.numbers)


def _blocks(columns: Sequence[int], widths: Mapping[int, int]) -> Iterator[list[int]]:
    """Yield groups of columns that fit side by side into the terminal; each begins with the first of all columns."""
    first, *others = columns
    block, taken = [first], widths[first]
    for column in others:
        if len(block) > 1 and taken + _GAP + widths[column] > _width():
            yield block
            block, taken = [first], widths[first]
        block.append(column)
        taken += _GAP + widths[column]
    yield block


def _print_columns(
    headers: Sequence[str], cells: Sequence[Sequence[str]], kept: Sequence[int], numbers: Sequence[str]
) -> None:
    from rich import box
    from rich.table import Table
    from rich.text import Text

    grid = Table(box=box.SIMPLE_HEAD, show_edge=False, pad_edge=False, header_style="bold")
    for column in kept:
        name = terminal_text(headers[column])
        narrow = column == 0 or name in numbers
        grid.add_column(Text(name), justify="right" if name in numbers else "left", no_wrap=narrow, overflow="fold")
    for row in cells:
        grid.add_row(*(Text(row[column]) for column in kept))
    _show(grid)


def _width() -> int:
    """Return the width of the output in characters."""
    return shutil.get_terminal_size().columns if sys.stdout.isatty() or "COLUMNS" in os.environ else _UNLIMITED


def _show(renderable: RenderableType) -> None:
    from rich.console import Console

    if sys.stdout.isatty():
        Console(highlight=False).print(renderable)
        return
    plain = Console(highlight=False, color_system=None, force_terminal=False, width=_width())
    with plain.capture() as captured:
        plain.print(renderable)
    typer.echo("\n".join(line.rstrip() for line in captured.get().rstrip("\n").split("\n")))


@contextmanager
def progress_bars() -> Iterator[Progress]:
    """Show the progress of each stage as a bar with the time left.

    Nothing is shown if stderr is not a terminal, with -q, or with -v, which prints records instead.
    """
    from dovetail.interfaces import progress_reporter

    shown = _shows_progress()
    with progress_reporter(shown) as bars:

        def progress(stage: str, done: int, total: int, note: str = "") -> None:
            _WAITING.end()
            bars(stage, done, total, note)

        yield progress
    if shown:
        say_on_stderr("")
        _WAITING.begin()
