"""``dovetail robustness``: how the accuracy of networks with different reducers falls with noise."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from dovetail.commands import (
    AsJson,
    AssemblyFile,
    PluginFiles,
    load_assembly,
    part,
    print_json,
    progress_bars,
    table,
    title,
)

if TYPE_CHECKING:
    from dovetail_bench.evaluation.robustness import RobustnessRow

_FILES = ("robustness.json", "robustness.csv", "robustness.png")


def _levels(text: str) -> tuple[float, ...]:
    """Parse fractions with commas."""
    return tuple(part(level) for level in text.split(","))


def robustness(
    assembly: AssemblyFile,
    models: Annotated[
        str | None, typer.Option(metavar="NAMES", help="Reducers, with commas; 'pca+robust' is trained with noise.")
    ] = None,
    levels: Annotated[
        Any,
        typer.Option(
            "--levels",
            metavar="LEVELS",
            parser=_levels,
            help="Noise over the data's standard deviation, with commas, such as 0,1%.",
        ),
    ] = "0,0.01,0.02,0.05,0.1,0.15,0.2",
    seed: Annotated[int, typer.Option(metavar="N", min=0, help="Seed of the noise.")] = 0,
    data: Annotated[
        Path | None,
        typer.Option("--data", metavar="FOLDER", help="A dataset; by default one is generated and discarded."),
    ] = None,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="FOLDER", help="Folder for the table and the figure.")
    ] = None,
    plugin: PluginFiles = None,
    as_json: AsJson = False,
) -> None:
    """Show how accuracy falls with noise.

    One network for each model is trained, on clean FRFs or ('+robust') on noisy ones, and evaluated on noisy ones.
    R2 is the mean over the parameters, RMSE a part of their ranges. Files of an earlier run in the output folder are
    replaced.
    """
    import dovetail
    import dovetail_bench
    from dovetail.commands import prepare_folder, writing
    from dovetail.evaluation import components
    from dovetail_bench.evaluation.robustness import variant

    chosen = [name.strip() for name in models.split(",")] if models else []
    loaded, registry = load_assembly(assembly, plugin), components(plugin or ())
    for name in chosen:
        variant(loaded, name, registry)
    prepare_folder(output, _FILES, _FILES[0])
    dataset = None if data is None else dovetail.Dataset(data)
    with progress_bars() as progress:
        rows = dovetail_bench.robustness(
            loaded, dataset, models=chosen, levels=levels, seed=seed, plugins=plugin or (), progress=progress
        )
    with writing(output, lambda folder: _write(rows, folder), _FILES[0]):
        if as_json:
            print_json([_finite(row.flat()) for row in rows])
        else:
            title(f"{loaded.name}: accuracy with noise")
            printed = [(row.model, f"{row.level:g}", f"{row.r2:.3f}", f"{row.rmse:.3f}") for row in rows]
            table(["model", "noise", "R2", "RMSE"], printed, numbers=["noise", "R2", "RMSE"])


def _finite(row: dict[str, Any]) -> dict[str, Any]:
    """Return a row with None for NaN and infinite values."""
    return {key: None if isinstance(value, float) and not math.isfinite(value) else value for key, value in row.items()}


def _write(rows: Sequence[RobustnessRow], folder: Path) -> None:
    from dovetail.commands import csv_text, json_text, write_texts
    from dovetail.pages import save_png
    from dovetail_bench.pages.robustness_figure import robustness_figure

    flat = [_finite(row.flat()) for row in rows]
    content = {
        _FILES[0]: json_text(flat),
        _FILES[1]: csv_text(list(flat[0]), [row.values() for row in flat]),
    }
    write_texts(folder, content)
    save_png(robustness_figure(flat), folder / _FILES[2])
