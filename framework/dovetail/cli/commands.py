"""Messages and exit codes of commands."""

from __future__ import annotations

import traceback
from collections.abc import Mapping
from types import FrameType
from typing import TYPE_CHECKING, Protocol

import typer

from dovetail.cli.terminal import say, say_on_stderr
from dovetail.plain_text import terminal_text

if TYPE_CHECKING:
    from dovetail.identification import Identification

INTERRUPTED = 130
"""Exit code after Ctrl-C, as in the shell."""

TYPED = "dovetail typed"
"""Key of the command line in a context."""

_NOT_TRUSTWORTHY = 3
"""Exit code after work that was done, with a result that is not trustworthy."""


class JudgedResult(Protocol):
    """A result, or several."""

    @property
    def is_trustworthy(self) -> bool:
        """Whether all of it can be trusted."""

    @property
    def warning(self) -> str:
        """Warning that must accompany the result; empty if there is none."""


def typed(context: typer.Context) -> str:
    """Return the command line as it was typed."""
    return str(context.meta[TYPED])


def say_warning(result: JudgedResult) -> None:
    """Print the warning of a result, if it has one, before its numbers."""
    if result.warning:
        say(f"Warning: {result.warning}")


def measurement_names(result: Identification) -> str:
    """Return the names of the measurements from which a joint was identified, each once, with commas."""
    further = [response.measured.label for response in result.further]
    return ", ".join(dict.fromkeys([result.measured.label, *further]))


def exit_if_failed(failures: Mapping[str, str]) -> None:
    """Print why some of several measurements or cases have no result, and exit with code 1 if there are any."""
    for failure in failures.values():
        say_on_stderr(failure)
    if failures:
        raise typer.Exit(1)


def exit_unless_trustworthy(result: JudgedResult) -> None:
    """Print the warning of a result on stderr, and exit with code 3, if it is not trustworthy."""
    if result.warning:
        say_on_stderr(f"Warning: {result.warning}")
    if not result.is_trustworthy:
        raise typer.Exit(_NOT_TRUSTWORTHY)


def report_bug(error: Exception, command_modules: Mapping[str, str]) -> None:
    """Report an unexpected exception as a bug, and where it was raised.

    Parameters
    ----------
    error : Exception
    command_modules : mapping of str to str
        Modules of the commands that were run, with the packages that they belong to.
    """
    from dovetail.version import __version__

    trace = error.__traceback__
    while trace and trace.tb_next and _module(trace.tb_frame) not in command_modules:
        trace = trace.tb_next
    package = command_modules.get(_module(trace.tb_frame), "") if trace else ""
    typer.echo(terminal_text("".join(traceback.format_exception(type(error), error, trace))), err=True)
    other = package if package and not package.startswith("dovetail-frf ") else "a plugin that it uses"
    typer.echo(
        f"This is a bug in dovetail {__version__} or in {other}, not a fault of yours: "
        "please report it with the lines above.",
        err=True,
    )


def _module(frame: FrameType) -> str:
    return str(frame.f_globals.get("__name__", ""))
