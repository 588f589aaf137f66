"""``dovetail generate``: a dataset of samples and their FRFs."""

from __future__ import annotations

import re
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from dovetail.cli.commands import INTERRUPTED, typed
from dovetail.cli.options import AssemblyFile, PluginFiles, Scheduler, load_assembly
from dovetail.cli.terminal import progress_bars, say, say_on_stderr
from dovetail.errors import counted

if TYPE_CHECKING:
    from dovetail.dataset import Storage


class StorageChoice(StrEnum):
    """What is stored of each FRF."""

    amplitude = "amplitude"
    complex = "complex"


def generate(
    context: typer.Context,
    assembly: AssemblyFile,
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="FOLDER", help="Folder of the dataset, such as data.zarr.")
    ],
    samples: Annotated[
        int | None, typer.Option(metavar="N", min=1, help="Number of samples; that of the description by default.")
    ] = None,
    seed: Annotated[
        int | None, typer.Option(metavar="N", min=0, help="Seed; that of the description by default.")
    ] = None,
    storage: Annotated[
        StorageChoice,
        typer.Option(help="Store the amplitude of each FRF, or complex values, which take twice the space."),
    ] = StorageChoice.amplitude,
    interpolation: Annotated[
        float | None,
        typer.Option(
            metavar="TOLERANCE",
            help="Compute some lines of each FRF and interpolate the others within this estimated relative error.",
        ),
    ] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Continue an interrupted dataset.")] = False,
    shard: Annotated[
        str, typer.Option(metavar="I/N", help="Compute only part I of N on this machine; 'merge' joins the parts.")
    ] = "1/1",
    scheduler: Scheduler = None,
    plugin: PluginFiles = None,
) -> None:
    """Generate a dataset for training.

    Parameters are drawn by Latin hypercube sampling, and their FRFs are written to a Zarr folder. After Ctrl-C (exit
    code 130) the finished part is kept, and --resume continues; the result is bit for bit that of an uninterrupted run.
    """
    import dovetail

    part, shards = _shard(shard)
    loaded = load_assembly(assembly, plugin)
    kept: Storage = storage.value
    try:
        with progress_bars() as progress:
            dataset = dovetail.generate(
                loaded,
                output,
                samples=samples,
                seed=seed,
                storage=kept,
                interpolation=interpolation,
                resume=resume,
                shard=(part, shards),
                scheduler=scheduler,
                progress=progress,
            )
    except KeyboardInterrupt:
        _advise(output, typed(context))
        raise typer.Exit(INTERRUPTED) from None
    of = f"shard {shard} of " if shards > 1 else ""
    say(
        f"{output}: {of}{counted(len(dataset), 'sample')} of {counted(len(loaded.parameters), 'parameter')}, "
        f"{counted(len(dataset.frequency), 'line')} each, seed {dataset.seed}"
    )


def _shard(text: str) -> tuple[int, int]:
    """Parse part and number of shards: ``"2/7"``."""
    match = re.fullmatch(r"([1-9]\d{0,5})/([1-9]\d{0,5})", text)
    if match is None:
        raise typer.BadParameter(f"'{text}' is not I/N, such as 2/7.", param_hint="--shard")
    return int(match[1]), int(match[2])


def _advise(output: Path, command: str) -> None:
    """Print what exists after an interruption, and how to continue."""
    if not output.exists():
        say_on_stderr("\nInterrupted before the first sample; nothing was written.")
        return
    again = command if " --resume" in command else f"{command} --resume"
    say_on_stderr(f"\nInterrupted. What is done stays in {output}; go on with:\n  {again}")
