"""The ``dovetail`` command: options before the command, and exit codes.

Exit codes: 0; 1 for a fault, explained in one block of text; 2 for a wrong command line; 3 for a result that is not
trustworthy; 130 after Ctrl-C.
"""

from __future__ import annotations

import io
import os
import sys
from pathlib import Path
from typing import Annotated

import typer

from dovetail.cli.command_group import Commands, loaded_commands
from dovetail.cli.commands import report_bug
from dovetail.cli.terminal import choose

app = typer.Typer(
    name="dovetail",
    cls=Commands,
    no_args_is_help=True,
    rich_markup_mode=None,  # plain help: half the time, and the same in a pipe
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
)


def _print_version(wanted: bool) -> None:
    if wanted:
        from dovetail.version import __version__

        typer.echo(f"dovetail {__version__}")
        raise typer.Exit


@app.callback()
def dovetail(
    context: typer.Context,
    plugin: Annotated[
        list[Path] | None,
        typer.Option(
            "--plugin",
            metavar="FILE.py",
            is_eager=True,  # --help lists the commands of plugin files too
            help="Load a plugin file; its code runs with your rights. May be repeated.",
        ),
    ] = None,
    _version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version.")
    ] = False,
    _quiet: Annotated[
        bool,
        typer.Option("--quiet", "-q", expose_value=False, callback=choose, help="Print no notes and no progress."),
    ] = False,
    _verbose: Annotated[
        int,
        typer.Option(
            "--verbose",
            "-v",
            count=True,
            expose_value=False,
            callback=choose,
            show_default=False,
            help="Print each step and its duration; -vv prints more.",
        ),
    ] = 0,
) -> None:
    """Identify the parameters of a mechanical joint from one measured frequency response function."""
    context.obj = plugin


def main() -> None:
    """Run the command line."""
    # Threads that spin while they wait starve each other on a busy machine; OpenMP reads this when it is loaded.
    os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")  # a terminal that cannot show a sign shows a question mark
    try:
        app()
    except Exception as error:  # whatever the commands explain ends in SystemExit
        report_bug(error, {module: offer.source for module, offer in loaded_commands.items()})
        sys.exit(1)
