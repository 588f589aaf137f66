"""``dovetail simulate``: the FRF of an assembly with chosen parameters."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from dovetail.cli.frf_files import FrfFiles, check_frf_files, write_frf_files
from dovetail.cli.natural_frequencies import natural_frequencies, say_natural_frequencies
from dovetail.cli.options import AsJson, AssemblyFile, Overwrite, PluginFiles, PointNumber, at_point
from dovetail.cli.terminal import heading, note, print_json, quantity_text, range_text, table, title

if TYPE_CHECKING:
    from dovetail.assembly import Assembly

__all__ = ["simulate"]


def simulate(
    assembly: AssemblyFile,
    settings: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="NAME=VALUE", help="Value of a parameter, such as Dc=30mm. May be repeated."),
    ] = None,
    point: PointNumber = 1,
    output: FrfFiles = None,
    overwrite: Overwrite = False,
    plugin: PluginFiles = None,
    as_json: AsJson = False,
) -> None:
    """Compute the FRF for chosen parameters.

    A parameter that is not set stands in the middle of its range. The suffix of a file names its format.
    """
    import dovetail

    files = output or []
    check_frf_files(files, overwrite)
    chosen = _settings(settings or [])
    loaded = at_point(dovetail.load(assembly, plugins=plugin or ()), point)
    theta = _theta(loaded, chosen)
    response, label = loaded.description.response, f"{loaded.name}, simulated"
    values = loaded.frf(theta)
    frf = dovetail.Frf(loaded.frequency, values, response.quantity, label=label, rotation=response.rotation)
    natural, reason = natural_frequencies(loaded, theta)
    write_frf_files(frf, files, natural, {}, overwrite=overwrite)
    if as_json:
        print_json({"name": loaded.name, "parameters": theta, "natural_frequencies": natural})
    else:
        _print(loaded, theta, natural, reason)
    for file in files:
        note(f"Written: {file}")


def _settings(texts: list[str]) -> dict[str, str]:
    chosen: dict[str, str] = {}
    for text in texts:
        name, equals, value = (part.strip() for part in text.partition("="))
        if not (name and equals and value):
            raise typer.BadParameter(f"'{text}' is not NAME=VALUE, such as Dc=30mm.", param_hint="--set")
        if name in chosen:
            raise typer.BadParameter(f"'{name}' is set twice.", param_hint="--set")
        chosen[name] = value
    return chosen


def _theta(assembly: Assembly, chosen: dict[str, str]) -> dict[str, float]:
    """Return SI values of all parameters by name: those chosen, and the middle of the range for the others."""
    import numpy as np

    middle = assembly.from_unit(np.full(len(assembly.parameters), 0.5))
    names = [parameter.name for parameter in assembly.parameters]
    values = assembly.vector({**dict(zip(names, middle.tolist(), strict=True)), **chosen})
    return dict(zip(names, values.tolist(), strict=True))


def _print(assembly: Assembly, theta: dict[str, float], natural: list[float], reason: str) -> None:
    title(assembly.name)
    rows = []
    for parameter in assembly.parameters:
        value = theta[parameter.name]
        outside = "" if parameter.lower <= value <= parameter.upper else "outside the range"
        rows.append((parameter.name, quantity_text(value, parameter), range_text(parameter), outside))
    if rows:
        table(["parameter", "value", "range", "note"], rows)
    heading("Natural frequencies")
    say_natural_frequencies(natural, reason)
