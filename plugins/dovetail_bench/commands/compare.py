"""``dovetail compare``: methods of identification side by side."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from dovetail.commands import (
    NOTHING_SET,
    AsJson,
    Reading,
    exit_if_failed,
    exit_unless_trustworthy,
    heading,
    print_json,
    print_table,
    progress_bars,
    say_warning,
    title,
    with_reading,
)

if TYPE_CHECKING:
    from dovetail_bench.evaluation.comparison import Comparison

_FILES = ("comparison.html", "parameters.csv", "coherence.csv", "frequencies.csv", "times.csv")
_HEADINGS = {
    "coherence": "Mean coherence",
    "frequencies": "Resonances: errors in per cent",
    "times": "Time [s]",
}


@with_reading("none", mass=False)
def compare(
    cases: Annotated[Path, typer.Argument(metavar="SERIES", help="Series of measurements of one joint (YAML).")],
    methods: Annotated[
        str | None,
        typer.Option(
            metavar="NAMES",
            help="Methods, separated by commas: refined, posterior, multistart, rigid, umap, pca+robust, ...",
        ),
    ] = None,
    samples: Annotated[
        int | None, typer.Option(metavar="N", min=1, help="FRFs to train networks on.", show_default=False)
    ] = None,
    data: Annotated[
        Path | None, typer.Option("--data", metavar="FOLDER", help="A dataset to train networks on.")
    ] = None,
    truth: Annotated[
        Path | None, typer.Option(metavar="FILE", help="True values of synthetic measurements (JSON).")
    ] = None,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="FOLDER", help="Folder for the report and the tables.")
    ] = None,
    reading: Reading = NOTHING_SET,
    as_json: AsJson = False,
) -> None:
    """Compare methods of identification.

    Each method identifies the joint from each measurement. The result lists the agreement of the reconstructed FRFs
    with the measured ones, resonances, parameters and times. Files of an earlier run in the output folder are
    replaced. A case that fails does not end the others; the exit code is then 1. It is 3 if a result is not
    trustworthy.
    """
    import dovetail_bench
    from dovetail.commands import prepare_folder, writing

    read = dovetail_bench.read_cases(cases, **reading.options)
    known = None if truth is None else dovetail_bench.read_truths(truth)
    chosen = () if methods is None else tuple(name.strip() for name in methods.split(","))
    prepare_folder(output, _FILES, _FILES[0])
    with progress_bars() as progress:
        done = dovetail_bench.compare(
            read, chosen, samples=samples, data=data, truth=known, plugins=reading.plugins, progress=progress
        )
    with writing(output, lambda folder: _write(done, folder), _FILES[0]):
        if as_json:
            print_json(_plain(done))
        else:
            _print(done)
    exit_if_failed(done.failures)
    exit_unless_trustworthy(done)


def _plain(done: Comparison) -> dict[str, object]:
    from dovetail_bench.pages.comparison import comparison_tables

    tables = {name: table.records() for name, table in comparison_tables(done).items()}
    return {"is_trustworthy": done.is_trustworthy, "warning": done.warning, "failures": dict(done.failures), **tables}


def _print(done: Comparison) -> None:
    from dovetail_bench.pages.comparison import comparison_tables

    title(done.title)
    say_warning(done)
    tables = comparison_tables(done)
    for name, words in _HEADINGS.items():
        heading(words)
        print_table(tables[name])


def _write(done: Comparison, folder: Path) -> None:
    from dovetail.commands import write_texts
    from dovetail_bench.pages.comparison import comparison_tables, write_comparison

    write_comparison(done, folder / _FILES[0])
    write_texts(folder, {f"{name}.csv": table.csv() for name, table in comparison_tables(done).items()})
