"""``dovetail schema``: the description as JSON Schema."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from dovetail.cli.options import Overwrite, PluginFiles
from dovetail.cli.output_files import check_new_files
from dovetail.cli.terminal import note, print_json


def schema(
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="FILE.json", help="File for the schema; standard output by default."),
    ] = None,
    overwrite: Overwrite = False,
    plugin: PluginFiles = None,
) -> None:
    """Write the JSON Schema of descriptions, for completion in an editor.

    It includes the options of every available model. Editors use it if the first line of a description is
    "# yaml-language-server: $schema=dovetail.schema.json".
    """
    from dovetail.atomic_files import write_whole
    from dovetail.description import description_schema
    from dovetail.registry import components
    from dovetail.report.result_files import json_text

    if output is not None:
        check_new_files([output], [".json"], overwrite)
    made = description_schema(components(plugin or ()))
    if output is None:
        print_json(made)
        return
    output.parent.mkdir(parents=True, exist_ok=True)
    write_whole(output, json_text(made).encode("utf-8"), overwrite=True)
    note(f"Written: {output}")
