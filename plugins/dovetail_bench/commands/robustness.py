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
    print_table,
    progress_bars,
    title,
)

if TYPE_CHECKING:
    from dovetail.pages import Table
    from dovetail_bench.evaluation.robustness import RobustnessRow

_FILES = ("robustness.json", "robustness.csv", "robustness.png")


def _levels(text: str) -> tuple[float, ...]:
    """Parse fractions with commas."""
    return tuple(part(level) for level in text.split(","))


def robustness(
    assembly: AssemblyFile,
    models: Annotated[
        str | None,
        typer.Option(metavar="NAMES", help="Reducers, separated by commas; 'pca+robust' is trained with noise."),
    ] = None,
    levels: Annotated[
        Any,
        typer.Option(
            "--levels",
            metavar="LEVELS",
            parser=_levels,
            help="Noise relative to the standard deviation of the data, separated by commas, such as 0,1%.",
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
    """Show how the accuracy of networks falls with noise.

    One network per reducer is trained, on clean FRFs or ("+robust") on noisy ones, and evaluated on noisy FRFs. R2 is
    the mean over the parameters, RMSE is relative to their ranges. Files of an earlier run in the output folder are
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
            print_json(_table(rows).records())
        else:
            title(f"{loaded.name}: accuracy with noise")
            print_table(_table(rows))


def _table(rows: Sequence[RobustnessRow]) -> Table:
    """Return R2 and RMSE by model and level of noise, for programs also by parameter; None for what is not finite."""
    from dovetail.pages import Column, Table

    shown = {
        "model": Column("model", "model", is_number=False),
        "level": Column("noise", "level", "{:g}".format),
        "r2": Column("R2", "r2", _three_decimals),
        "rmse": Column("RMSE", "rmse", _three_decimals),
    }
    columns = [shown.get(key) or Column("", key) for key in rows[0].flat()] if rows else []
    return Table(columns, [[_finite(value) for value in row.flat().values()] for row in rows])


def _three_decimals(value: float | None) -> str:
    return "nan" if value is None else f"{value:.3f}"


def _finite(value: float | str) -> float | str | None:
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _write(rows: Sequence[RobustnessRow], folder: Path) -> None:
    from dovetail.commands import json_text, write_texts
    from dovetail.pages import save_png
    from dovetail_bench.pages.robustness_figure import robustness_figure

    table = _table(rows)
    write_texts(folder, {_FILES[0]: json_text(table.records()), _FILES[1]: table.csv()})
    save_png(robustness_figure(table.records()), folder / _FILES[2])
