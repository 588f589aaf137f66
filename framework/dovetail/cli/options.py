"""Options that several commands share, and how their values are read."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from dovetail.cli.completion import complete_files
from dovetail.cli.terminal import note

if TYPE_CHECKING:
    from dovetail.assembly import Assembly

__all__ = [
    "AsJson",
    "AssemblyFile",
    "Overwrite",
    "PluginFiles",
    "PointNumber",
    "at_point",
    "check_method",
    "check_new_files",
    "note_doubts",
    "part",
    "quantity_in",
]


def _with_global(context: typer.Context, value: list[Path] | None) -> list[Path]:
    """Put the plugin files that stand before the command in front of those behind it."""
    return [*(context.obj or ()), *(value or ())]


PluginFiles = Annotated[
    list[Path] | None,
    typer.Option(
        "--plugin",
        metavar="FILE.py",
        callback=_with_global,
        help="Take in a plugin file; it runs with your rights. May be repeated.",
    ),
]

AssemblyFile = Annotated[
    Path,
    typer.Argument(metavar="ASSEMBLY", help="The assembly's description (YAML).", autocompletion=complete_files),
]

AsJson = Annotated[bool, typer.Option("--json", help="Print JSON, for a program.")]

Overwrite = Annotated[bool, typer.Option("--overwrite", help="Replace files that are there already.")]

PointNumber = Annotated[
    int, typer.Option("--point", metavar="N", min=1, help="Which response, from 1, if the description has several.")
]


def at_point(assembly: Assembly, number: int) -> Assembly:
    """Return the assembly with one of its responses alone.

    Raises
    ------
    typer.BadParameter
        There are fewer.
    """
    labels = assembly.description.response_labels
    if number > len(labels):
        listed = "; ".join(f"{place}. {label}" for place, label in enumerate(labels, start=1))
        raise typer.BadParameter(f"there is no response {number}: {listed}.", param_hint="--point")
    return assembly if len(labels) == 1 else assembly.at(number - 1)


def quantity_in(unit: str) -> Callable[[str], float]:
    """Return a parser of quantities with a unit, such as ``"1.2 g"``, that gives SI values."""

    def parse(text: str) -> float:
        from dovetail.errors import UnitError
        from dovetail.units import to_si

        try:
            return to_si(text, unit)
        except UnitError as error:
            raise typer.BadParameter(error.faults[0].problem) from None

    return parse


def note_doubts(assembly: Assembly) -> None:
    """Say on stderr, before long work, what looks wrong in a description."""
    from dovetail.assembly import find_doubts

    for doubt in find_doubts(assembly):
        note(f"This looks wrong: {doubt}")


def part(text: str) -> float:
    """Parse a part of one, from 0: ``"0.01"`` or ``"1%"``."""
    number = str(text).strip()
    try:
        value = float(number.removesuffix("%")) / (100.0 if number.endswith("%") else 1.0)
    except ValueError:
        raise typer.BadParameter(f"'{text}' is no number, such as 0.01 or 1%.") from None
    if not 0.0 <= value < math.inf:
        raise typer.BadParameter(f"'{text}' is not 0 or more.")
    return value


def check_method(method: str, options: Iterable[str] = ()) -> None:
    """Make sure that a method of identification exists and has these options.

    Raises
    ------
    typer.BadParameter
    """
    from dovetail.errors import did_you_mean
    from dovetail.identification.identify import method_options
    from dovetail.identification.methods import METHODS

    if method not in METHODS:
        hint = did_you_mean(method, METHODS)
        raise typer.BadParameter(
            f"'{method}' is not a method. {hint} Accepted: {', '.join(METHODS)}", param_hint="--method"
        )
    for name in options:
        if name not in method_options(method):
            others = ", ".join(other for other in METHODS if name in method_options(other))
            problem = f"the method '{method}' has no such option; it is of {others}."
            raise typer.BadParameter(problem, param_hint=f"--{name.replace('_', '-')}")


def check_new_files(files: Iterable[Path], suffixes: Iterable[str], overwrite: bool) -> None:
    """Make sure, before any work, that files can be written.

    Parameters
    ----------
    files : iterable of Path
    suffixes : iterable of str
        Those that are accepted.
    overwrite : bool

    Raises
    ------
    typer.BadParameter
        A suffix is not accepted.
    DovetailError
        A file is there already, or its folder cannot be written.
    """
    from dovetail.atomic_files import check_room
    from dovetail.errors import DovetailError, Fault, listing

    accepted = list(suffixes)
    for file in files:
        if file.suffix.lower() not in accepted:
            raise typer.BadParameter(
                f"'{file}': the suffix says what is written. Accepted: {listing(accepted)}", param_hint="--output"
            )
        if file.exists() and not overwrite:
            raise DovetailError(
                Fault(str(file), "there is such a file already.", remedy="Choose another name, or add --overwrite.")
            )
        check_room(file.resolve().parent)
