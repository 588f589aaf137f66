"""Messages and exit codes of commands."""

from __future__ import annotations

import errno
import shlex
import sys
import traceback
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Any, Protocol

import typer
from typer.core import TyperGroup

from dovetail.cli.option_names import with_options
from dovetail.cli.terminal import say, say_on_stderr, waiting
from dovetail.cli.warning_notes import warnings_as_notes
from dovetail.errors import DovetailError, Fault, limit_exceeded
from dovetail.plain_text import terminal_text

if TYPE_CHECKING:
    from dovetail.identification.result_file import AnyIdentification

_HELP_LENGTH = 90
"""Largest number of characters of the sentence that describes a command."""

_TYPED = "dovetail typed"
"""Key of the command line in a context."""

INTERRUPTED = 130
"""Exit code after Ctrl-C, as in the shell."""

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


class Commands(TyperGroup):
    """The group of all commands, which prints faults as one block of text, without a traceback."""

    def make_context(self, info_name: str | None, args: list[str], parent: Any = None, **extra: Any) -> Any:
        """Parse the options before the command."""
        typed = shlex.join(["dovetail", *args])
        with _escaped_usage_errors():
            context = super().make_context(info_name, args, parent, **extra)
        context.meta[_TYPED] = typed
        return context

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """Return a command, which also accepts -q and -v."""
        command = super().get_command(ctx, cmd_name)
        if command is not None:
            names = {option.name for option in command.params}
            command.params += [o for o in self.params if o.name in ("_quiet", "_verbose") and o.name not in names]
        return command

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """List the commands by purpose, each with the first sentence of its help."""
        groups: dict[str, list[tuple[str, str]]] = {}
        for name in self.list_commands(ctx):
            command: Any = self.get_command(ctx, name)
            group = getattr(command, "rich_help_panel", None) or "Commands"
            groups.setdefault(group, []).append((name, command.get_short_help_str(_HELP_LENGTH)))
        for group, rows in groups.items():
            with formatter.section(group):
                formatter.write_dl(rows)

    def invoke(self, ctx: Any) -> Any:
        """Run a command, and convert exceptions to a message and an exit code."""
        try:
            with _escaped_usage_errors(), warnings_as_notes(), waiting():
                return super().invoke(ctx)
        except DovetailError as error:
            _explain(error)
        except OSError as error:
            if error.errno == errno.EPIPE:
                raise
            reason = error.strerror or str(error)
            _explain(Fault(str(error.filename or ""), f"the system refuses: {reason}."))
        except KeyboardInterrupt:
            typer.echo("\nInterrupted.", err=True)
            raise typer.Exit(INTERRUPTED) from None
        except Exception as error:
            if (limit := limit_exceeded(error, _files_named())) is None:
                raise
            _explain(limit)
        raise typer.Exit(1)


def _explain(error: DovetailError | Fault) -> None:
    typer.echo(with_options(str(error)), err=True)


def _files_named() -> str:
    """Return the files of the command line, whose values are to blame for what cannot be computed."""
    return ", ".join(word for word in sys.argv[1:] if Path(word).is_file())


@contextmanager
def _escaped_usage_errors() -> Iterator[None]:
    """Escape control characters in messages about a wrong command line, which may contain names of files."""
    try:
        yield
    except Exception as error:
        wrong: Any = error
        if isinstance(getattr(wrong, "message", None), str):
            wrong.message = terminal_text(with_options(wrong.message))
        raise


def typed(context: typer.Context) -> str:
    """Return the command line as it was typed."""
    return str(context.meta[_TYPED])


def say_warning(result: JudgedResult) -> None:
    """Print the warning of a result, if it has one, before its numbers."""
    if result.warning:
        say(f"Warning: {result.warning}")


def measurement_names(result: AnyIdentification) -> str:
    """Return the names of the measurements from which a joint was identified, each once, with commas."""
    further = [response.measured.label for response in getattr(result, "further", ())]
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


def report_bug(error: Exception) -> None:
    """Report an unexpected exception as a bug, and where it was raised."""
    from dovetail.version import __version__

    trace = error.__traceback__
    while trace and trace.tb_next and not _is_command(trace.tb_frame):
        trace = trace.tb_next
    typer.echo(terminal_text("".join(traceback.format_exception(type(error), error, trace))), err=True)
    typer.echo(
        f"This is a bug in dovetail {__version__} or in a plugin that it uses, not a fault of yours: "
        "please report it with the lines above.",
        err=True,
    )


def _is_command(frame: FrameType) -> bool:
    module = str(frame.f_globals.get("__name__", ""))
    return module.startswith("dovetail.cli.") and module != __name__
