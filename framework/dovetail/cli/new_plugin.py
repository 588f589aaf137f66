"""``dovetail new-plugin``: a package to begin with."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from dovetail.cli.options import one_of
from dovetail.cli.terminal import say


def new_plugin(
    kind: Annotated[
        str,
        typer.Argument(
            metavar="KIND",
            help="substructure, joint, reducer, regressor, reader, matrix_reader, method or law.",
        ),
    ],
    name: Annotated[str, typer.Argument(metavar="NAME", help="Name of the model, as after 'model:' in a description.")],
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="FOLDER", help="Folder to create; dovetail-NAME by default."),
    ] = None,
    into: Annotated[
        Path | None,
        typer.Option("--into", metavar="PACKAGE", help="Add it to the package in this folder instead."),
    ] = None,
) -> None:
    """Create a package for a new model: code, entry point, tests and an example.

    It can be installed and passes its own tests as it is; edit it from there.
    """
    from dovetail.interfaces import KINDS
    from dovetail.registry.new_plugin import add_to_package, write_plugin_package

    if into is not None and output is not None:
        raise typer.BadParameter("--into names an existing package, and --output a new one.", param_hint="--into")
    chosen = one_of(KINDS, kind, "KIND")
    made = write_plugin_package(chosen, name, output) if into is None else add_to_package(chosen, name, into)
    say(f"{made.folder}: {', '.join(made.files)}")
    again = "" if into is None else " again, since it has one more entry point,"
    install = f"Install it{again} with 'pip install -e {made.folder}'"
    say(f"{install}, and check it with 'dovetail check-plugin {made.name}'.")
