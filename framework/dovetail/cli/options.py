"""Options that several commands share, and the parsing of their values."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypeVar

import typer

from dovetail.cli.completion import complete_files, complete_models

if TYPE_CHECKING:
    from dovetail.assembly import Assembly
    from dovetail.identification import Identifier
    from dovetail.interfaces import IdentificationMethod
    from dovetail.registry import Registry

_Choice = TypeVar("_Choice", bound=str)


def _with_global(context: typer.Context, value: list[Path] | None) -> list[Path]:
    """Prepend the plugin files given before the command to those after it."""
    return [*(context.obj or ()), *(value or ())]


PluginFiles = Annotated[
    list[Path] | None,
    typer.Option(
        "--plugin",
        metavar="FILE.py",
        callback=_with_global,
        help="Load a plugin file; its code runs with your rights. May be repeated.",
    ),
]

AssemblyFile = Annotated[
    Path, typer.Argument(metavar="ASSEMBLY", help="The assembly's description (YAML).", autocompletion=complete_files)
]

ModelName = Annotated[
    str,
    typer.Argument(
        metavar="MODEL", help="Name of the model, as after 'model:' in a description.", autocompletion=complete_models
    ),
]

AsJson = Annotated[bool, typer.Option("--json", help="Print JSON for other programs.")]

Overwrite = Annotated[bool, typer.Option("--overwrite", help="Replace existing files.")]

PointNumber = Annotated[
    int,
    typer.Option("--point", metavar="N", min=1, help="Number of the response, from 1, if the description has several."),
]

Scheduler = Annotated[
    str | None,
    typer.Option(
        metavar="ADDRESS",
        help="Run on the workers of a Dask scheduler, such as tcp://host:8786.",
        show_default=False,
    ),
]


def at_point(assembly: Assembly, number: int) -> Assembly:
    """Return the assembly with only one of its responses.

    Raises
    ------
    typer.BadParameter
        There are fewer responses.
    """
    labels = assembly.description.response_labels
    if number > len(labels):
        listed = "; ".join(f"{place}. {label}" for place, label in enumerate(labels, start=1))
        raise typer.BadParameter(f"there is no response {number}: {listed}.", param_hint="--point")
    return assembly if len(labels) == 1 else assembly.at(number - 1)


def quantity_in(unit: str) -> Callable[[str], float]:
    """Return a parser that converts quantities with a unit, such as ``"1.2 g"``, to SI values."""

    def parse(text: str) -> float:
        from dovetail.errors import UnitError
        from dovetail.units import to_si

        try:
            return to_si(text, unit)
        except UnitError as error:
            raise typer.BadParameter(error.faults[0].problem) from None

    return parse


def load_assembly(file: Path, plugins: Sequence[Path] | None) -> Assembly:
    """Read a description."""
    import dovetail

    return dovetail.load(file, plugins=plugins or ())


def assembly_or_model(source: Path, plugins: Sequence[Path] | None) -> tuple[Assembly, Identifier | None]:
    """Read a trained model (a folder) or a description."""
    import dovetail

    if not source.is_dir():
        return load_assembly(source, plugins), None
    model = dovetail.load_model(source, plugins=plugins or ())
    return model.assembly, model


def one_of(choices: Iterable[_Choice], text: str, option: str) -> _Choice:
    """Return the choice that an option names.

    Raises
    ------
    typer.BadParameter
        There is no such choice.
    """
    known = {choice: choice for choice in choices}
    if text not in known:
        raise typer.BadParameter(f"'{text}' is not one of {', '.join(known)}.", param_hint=option)
    return known[text]


def part(text: str) -> float:
    """Parse a fraction of 0 or more: ``"0.01"`` or ``"1%"``; above a half it needs the percent sign."""
    from dovetail.errors import UnitError
    from dovetail.units import to_fraction

    try:
        return to_fraction(text)
    except UnitError as error:
        raise typer.BadParameter(error.faults[0].problem) from None


def _options_of(name: str, registry: Registry) -> tuple[str, ...]:
    """Return the options of a method; none of one that cannot be made without its description."""
    from dovetail.errors import DovetailError
    from dovetail.identification.one_measurement import find_method, method_options

    try:
        return method_options(find_method(name, None, registry))
    except DovetailError:
        return ()


def chosen_method(
    method: str | None, plugins: Sequence[Path] | None, assembly: Assembly | None = None, options: Iterable[str] = ()
) -> IdentificationMethod:
    """Return the chosen method of identification, which must have these options.

    Raises
    ------
    typer.BadParameter
    """
    from dovetail.identification.one_measurement import find_method, method_options
    from dovetail.registry import components

    try:
        registry = components(plugins or ())
        chosen = find_method(method, assembly, registry)
    except ValueError as error:
        raise typer.BadParameter(str(error), param_hint="--method") from None
    for name in options:
        if name not in method_options(chosen):
            owners = [other for other in registry.names("method") if name in _options_of(other, registry)]
            problem = f"the method '{chosen.name}' has no such option; it is of {', '.join(owners)}."
            raise typer.BadParameter(problem, param_hint=f"--{name.replace('_', '-')}")
    return chosen
