"""The ``dovetail`` command: every command is a few calls of the API.

Exit codes: 0; 1 for a fault, explained in one block of text; 2 for a wrong command line; 3 for a result that is not
trustworthy; 130 after Ctrl-C.
"""

from __future__ import annotations

import io
import os
import sys
from collections.abc import Callable
from typing import Annotated, cast

import typer

from dovetail.cli.calibrate import calibrate
from dovetail.cli.check import check
from dovetail.cli.check_plugin import check_plugin
from dovetail.cli.commands import Commands, report_bug
from dovetail.cli.compare import compare
from dovetail.cli.components import describe, plugins
from dovetail.cli.convert import convert
from dovetail.cli.explore import explore
from dovetail.cli.frf import frf
from dovetail.cli.generate import generate
from dovetail.cli.identify import identify
from dovetail.cli.merge import merge
from dovetail.cli.new_assembly import new_assembly
from dovetail.cli.new_plugin import new_plugin
from dovetail.cli.options import PluginFiles
from dovetail.cli.plan import plan
from dovetail.cli.plot import plot
from dovetail.cli.predict import predict
from dovetail.cli.robustness import robustness
from dovetail.cli.schema import schema
from dovetail.cli.simulate import simulate
from dovetail.cli.spindle import spindle
from dovetail.cli.study import study
from dovetail.cli.terminal import choose
from dovetail.cli.train import train
from dovetail.cli.validate import validate

__all__ = ["app", "main"]

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
    plugin: PluginFiles = None,
    _version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version.")
    ] = False,
    _quiet: Annotated[
        bool,
        typer.Option("--quiet", "-q", expose_value=False, callback=choose, help="Leave out notes and progress."),
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
            help="Print what is done, and how long it takes; -vv prints more.",
        ),
    ] = 0,
) -> None:
    """Identify the parameters of a mechanical joint from one measured frequency response function."""
    context.obj = plugin


COMMANDS = {
    "Describe an assembly": (new_assembly, check, describe, simulate, explore, schema),
    "Measure": (plot, convert, frf, spindle),
    "Identify a joint": (identify, train, generate, merge),
    "Use the result": (predict, validate),
    "Study what can be known": (plan, calibrate, compare, robustness, study),
    "Extend": (plugins, new_plugin, check_plugin),
}
for group, commands in COMMANDS.items():
    for command in commands:
        app.command(rich_help_panel=group)(cast("Callable[..., None]", command))


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
        report_bug(error)
        sys.exit(1)
