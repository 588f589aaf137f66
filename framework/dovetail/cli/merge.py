"""``dovetail merge``: one dataset from its shards."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from dovetail.cli.terminal import say
from dovetail.errors import counted


def merge(
    shards: Annotated[list[Path], typer.Argument(metavar="SHARD...", help="Folders that 'generate --shard' wrote.")],
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="FOLDER", help="Folder of the dataset, such as data.zarr.")
    ],
) -> None:
    """Join the shards of a dataset that were generated on several machines.

    The result is bit for bit the dataset of a single run. Within one file system nothing is copied.
    """
    import dovetail

    dataset = dovetail.merge_datasets(shards, output)
    say(
        f"{output}: {counted(len(dataset), 'sample')} of {counted(dataset.parameters.shape[1], 'parameter')}, "
        f"from {counted(len(shards), 'shard')}"
    )
