"""How a command reports an error: the message and the exit code."""

from __future__ import annotations

import errno
import traceback
from types import FrameType
from typing import Any

import typer
from typer.core import TyperGroup

from dovetail.errors import DovetailError, Fault

__all__ = ["INTERRUPTED", "Commands", "report_bug"]

INTERRUPTED = 130
"""Exit code after Ctrl-C, as in the shell."""


class Commands(TyperGroup):
    """The group of all commands: a fault is printed in one block, without a traceback."""

    def invoke(self, ctx: Any) -> Any:
        """Run a command and turn what it raises into a message and an exit code."""
        try:
            return super().invoke(ctx)
        except DovetailError as error:
            typer.echo(str(error), err=True)
        except OSError as error:
            if error.errno == errno.EPIPE:
                raise
            reason = error.strerror or str(error)
            typer.echo(str(Fault(str(error.filename or ""), f"the system refuses: {reason}.")), err=True)
        except KeyboardInterrupt:
            typer.echo("\nInterrupted.", err=True)
            raise typer.Exit(INTERRUPTED) from None
        raise typer.Exit(1)


def report_bug(error: Exception) -> None:
    """Print where an unexpected exception was raised, and that it is a bug."""
    from dovetail.version import __version__

    trace = error.__traceback__
    while trace and trace.tb_next and not _is_command(trace.tb_frame):
        trace = trace.tb_next
    typer.echo("".join(traceback.format_exception(type(error), error, trace)), err=True)
    typer.echo(
        f"This is a bug in dovetail {__version__} or in a plugin that it uses, not a fault of yours: "
        "please report it with the lines above.",
        err=True,
    )


def _is_command(frame: FrameType) -> bool:
    module = str(frame.f_globals.get("__name__", ""))
    return module.startswith("dovetail.cli.") and module != __name__
