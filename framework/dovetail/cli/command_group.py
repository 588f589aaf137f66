"""The commands of the program, and those that packages and plugin files add to it; each is imported when it is run."""

from __future__ import annotations

import errno
import shlex
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NoReturn, cast

import typer
from typer.core import TyperCommand, TyperGroup

from dovetail.cli.commands import INTERRUPTED, TYPED
from dovetail.cli.option_names import message_of, with_options
from dovetail.cli.plain_words import plain_arguments, refused_value
from dovetail.cli.terminal import say_on_stderr, waiting
from dovetail.cli.warning_notes import suspicious_values_as_notes, warnings_as_notes
from dovetail.errors import DovetailError, Fault, PluginError, contained, did_you_mean, limit_exceeded
from dovetail.plain_text import terminal_text
from dovetail.registry import Command, CommandOffer, CommandTable
from dovetail.version import __version__

_PANELS = {
    "Describe an assembly": {
        "examples:examples": "List the examples, or copy one of them, or all.",
        "new_assembly:new_assembly": "Write a description of two parts and a joint, with comments.",
        "check:check": "Check a description and show its DOFs, nodes and modes.",
        "components:describe": "Describe a model: options, parameters, ports.",
        "simulate:simulate": "Compute the FRF for chosen parameters.",
        "explore:explore": "Change parameters in a web page and watch the FRF.",
        "schema:schema": "Write the JSON Schema of descriptions, for completion in an editor.",
    },
    "Measure": {
        "plot:plot": "Show what measured FRFs contain: band, resonances, figures.",
        "convert:convert": "Convert a measured FRF to another format, quantity or unit.",
        "frf:frf": "Estimate an FRF with its coherence from hammer signals.",
        "plan:plan": "Rank measurement points by how much they would reveal.",
    },
    "Identify a joint": {
        "identify:identify": "Identify a joint from a measured FRF.",
        "series:identify_series": "Identify a joint from several tests together.",
        "compare_models:compare_models": "Compare models of the same measurements by their marginal likelihoods.",
        "train:train": "Train a network and print its test errors.",
        "generate:generate": "Generate a dataset for training.",
        "merge:merge": "Join the shards of a dataset that were generated on several machines.",
    },
    "Use the result": {
        "predict:predict": "Predict the FRF of another assembly.",
        "watch:watch": "Watch a folder: identify each new measurement, and report changes.",
        "predict_series:predict_series": "Predict the FRF of a test that a series does not contain.",
    },
    "Extend": {
        "components:plugins": "List the available models.",
        "new_plugin:new_plugin": "Create a package for a new model: code, entry point, tests and an example.",
        "check_plugin:check_plugin": "Check a model against its contract (the conformance kit).",
        "cite:cite": "Print what to cite in a publication that uses Dovetail.",
    },
}
OWN = tuple(
    CommandOffer(Command(f"dovetail.cli.{place}", summary, panel), f"dovetail-frf {__version__}")
    for panel, commands in _PANELS.items()
    for place, summary in commands.items()
)
"""The commands of the program itself."""
_OWN = {offer.command.called: offer for offer in OWN}

loaded_commands: dict[str, CommandOffer] = {}
"""The commands that this process has loaded, by the modules of their functions."""


class _SingleCommand(TyperCommand):
    """A command whose options are given once, unless they may be repeated: of two values one would be ignored."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Refuse an option that is given twice."""
        if not ctx.resilient_parsing:
            given: list[Any] = [
                p for p in self.make_parser(ctx).parse_args(args=list(args))[2] if p.param_type_name == "option"
            ]
            single = [p for p in given if not (p.multiple or p.count or (p.is_flag and not p.secondary_opts))]
            if twice := next((p for p in single if single.count(p) > 1), None):
                ctx.fail(f"{'/'.join([*twice.opts, *twice.secondary_opts])} is given twice; give it once.")
        return super().parse_args(ctx, args)


class Commands(TyperGroup):
    """The group of all commands, which prints faults as one block of text, without a traceback."""

    def make_context(self, info_name: str | None, args: list[str], parent: Any = None, **extra: Any) -> Any:
        """Parse the options before the command."""
        typed = shlex.join(["dovetail", *args])
        with _explained_faults(None), _escaped_usage_errors():
            context = super().make_context(info_name, args, parent, **extra)
        context.meta[TYPED] = typed
        return context

    def list_commands(self, ctx: Any) -> list[str]:
        """Return the names of all commands."""
        return list(_table(ctx).offers)

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """Return a command, which also accepts -q and -v; of a broken one, a command that explains the failure."""
        offer = _OWN.get(cmd_name) or _table(ctx).offers.get(cmd_name)
        if offer is None:
            return None
        try:
            command = _loaded(offer)
        except PluginError as error:
            return _broken(cmd_name, error)
        names = {option.name for option in command.params}
        command.params += [o for o in self.params if o.name in ("_quiet", "_verbose") and o.name not in names]
        return command

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """Return the command that the first word names; of an unknown one, say what was meant and what failed."""
        name = str(args[0])
        if not name.startswith("-") and self.get_command(ctx, name) is None:
            table = _table(ctx)
            hints = [did_you_mean(name, table.offers)]
            hints += [f"(Not loaded: {failure.source}: {failure.reason})" for failure in table.failures]
            if "--plugin" in args:
                hints.append("A command of a plugin file needs '--plugin FILE.py' before it.")
            ctx.fail(" ".join([f"No such command '{name}'.", *filter(None, hints)]))
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """List the commands by purpose, each with its summary; those that could not be loaded on stderr."""
        table = _table(ctx)
        for panel, offers in table.panels().items():
            with formatter.section(terminal_text(panel)):
                formatter.write_dl([(offer.command.called, terminal_text(offer.command.summary)) for offer in offers])
        for failure in table.failures:
            say_on_stderr(f"Not loaded: {failure.source}: {failure.reason}")

    def invoke(self, ctx: Any) -> Any:
        """Run a command, and convert exceptions to a message and an exit code."""
        faults, usage = _explained_faults(ctx), _escaped_usage_errors()
        with faults, usage, warnings_as_notes(), suspicious_values_as_notes(), waiting():
            return super().invoke(ctx)


def _table(ctx: Any) -> CommandTable:
    """Return all commands, with those of the plugin files that are named before the command; made once a run."""
    if ctx is None:
        return CommandTable(OWN)
    if __name__ not in ctx.meta:
        ctx.meta[__name__] = CommandTable(OWN, ctx.params.get("plugin") or ())
    return cast("CommandTable", ctx.meta[__name__])


def _loaded(offer: CommandOffer) -> Any:
    """Return a command as typer makes it.

    Raises
    ------
    PluginError
        Its module cannot be imported or has no such function, or typer cannot make a command of it.
    """
    with contained(f"{offer.source}: command '{offer.command.called}'", f"{offer.command.place} cannot be loaded: "):
        function = offer.command.load()
        command = _made(offer.command.called, function)
    loaded_commands[str(getattr(function, "__module__", ""))] = offer
    return command


def _made(name: str, function: Callable[..., object], **settings: Any) -> Any:
    app = typer.Typer(rich_markup_mode=None, pretty_exceptions_enable=False, add_completion=False)
    app.command(name, cls=_SingleCommand, **settings)(cast("Callable[..., None]", function))
    command = typer.main.get_command(app)
    plain_arguments(command)
    return command


def _broken(name: str, error: PluginError) -> Any:
    """Return a command that raises an error, whatever its options."""

    def fail() -> NoReturn:
        raise error

    any_words = {"ignore_unknown_options": True, "allow_extra_args": True}
    return _made(name, fail, add_help_option=False, context_settings=any_words, help=error.faults[0].problem)


@contextmanager
def _explained_faults(ctx: Any) -> Iterator[None]:
    """Print an error that has an explanation, in the words of the command that is run, and end with its exit code."""
    try:
        yield
        return
    except DovetailError as error:
        _explain(error, ctx)
    except OSError as error:
        if error.errno == errno.EPIPE:
            raise
        reason = error.strerror or str(error)
        remedy = "Check the permissions and the free space there, or choose another place."
        _explain(Fault(str(error.filename or ""), f"the system refuses: {reason}.", remedy=remedy), ctx)
    except KeyboardInterrupt:
        typer.echo("\nInterrupted.", err=True)
        raise typer.Exit(INTERRUPTED) from None
    except Exception as error:
        if (limit := limit_exceeded(error, _files_named())) is None:
            raise
        _explain(limit, ctx)
    raise typer.Exit(1)


def _explain(error: DovetailError | Fault, ctx: Any) -> None:
    name = None if ctx is None else ctx.invoked_subcommand
    command = None if name is None else ctx.command.get_command(ctx, name)
    typer.echo(message_of(error, command), err=True)


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
        wrong.message = refused_value(error) or getattr(error, "message", None)
        if isinstance(getattr(wrong, "message", None), str):
            wrong.message = terminal_text(with_options(wrong.message))
        raise
