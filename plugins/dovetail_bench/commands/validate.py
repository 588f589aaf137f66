"""``dovetail validate``: comparison of measured and predicted resonances."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from dovetail.commands import (
    NOTHING_SET,
    AsJson,
    Reading,
    chosen_method,
    exit_if_failed,
    exit_unless_trustworthy,
    print_json,
    print_table,
    progress_bars,
    say,
    say_warning,
    title,
    with_reading,
)
from dovetail.pages import markdown_cell

if TYPE_CHECKING:
    from dovetail import Assembly, Frf, Identification, IdentificationMethod
    from dovetail_bench.evaluation.validation import Identify, Validation

_FILES = ("validation.json", "validation.csv", "table.md", "frfs.png", "validation.html")
_SERIES = "series.png"


@with_reading("none", mass=False)
def validate(
    cases: Annotated[
        Path, typer.Argument(metavar="SERIES", help="Series of measurements, with the models that predict them (YAML).")
    ],
    method: Annotated[
        str, typer.Option("--method", metavar="METHOD", help="Method by which joints are identified.")
    ] = "refined",
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="FOLDER", help="Folder for the report, the table and the figures."),
    ] = None,
    reading: Reading = NOTHING_SET,
    as_json: AsJson = False,
) -> None:
    """Compare predictions of models with measurements.

    For each test: the measured resonances, corrected for the accelerometer, and those that the model predicts with a
    joint that was identified elsewhere. Files of an earlier run in the output folder are replaced. A case that fails
    does not end the others; the exit code is then 1. It is 3 if a joint is not trustworthy.
    """
    import dovetail_bench
    from dovetail.commands import prepare_folder, writing

    chosen = chosen_method(method, reading.plugins)
    read = dovetail_bench.read_cases(cases, **reading.options)
    files = (*_FILES, _SERIES) if read.series else _FILES
    prepare_folder(output, files, _FILES[0])
    with progress_bars() as progress:
        done = dovetail_bench.validate(
            read, _method(chosen, reading.plugins), plugins=reading.plugins, progress=progress
        )
    with writing(output, lambda folder: _write(done, folder), _FILES[0]):
        if as_json:
            print_json(done.to_dict())
        else:
            _print(done)
    exit_if_failed(done.failures)
    exit_unless_trustworthy(done)


def _method(method: IdentificationMethod, plugins: list[Path]) -> IdentificationMethod | Identify:
    """Return a method that identifies joints; one that needs a network uses the model of each assembly."""

    def by_network(assembly: Assembly, measured: Frf) -> Identification:
        from dovetail.commands import trained_model

        return trained_model(assembly, plugins, retrain=False).identify(measured, method)

    return method if method.fits_lines else by_network


def _print(done: Validation) -> None:
    from dovetail.evaluation import NOT_TRUSTWORTHY
    from dovetail_bench.pages.validation import validation_table

    title(done.title)
    say_warning(done)
    print_table(validation_table(done.cases))
    if untrusted := [result.case.name for result in done.cases if not result.is_trustworthy]:
        say(f"Joints {NOT_TRUSTWORTHY}: {', '.join(untrusted)}.")  # a narrow terminal cuts the last column off


def _markdown(done: Validation) -> str:
    from dovetail_bench.pages.validation import validation_table

    text = validation_table(done.cases).markdown()
    return f"{text}\n{markdown_cell(done.warning)}\n" if done.warning else text


def _write(done: Validation, folder: Path) -> None:
    from dovetail.commands import json_text, write_texts
    from dovetail.pages import save_png
    from dovetail_bench.pages.validation import validation_table, write_validation
    from dovetail_bench.pages.validation_figures import series_figure, validation_figure

    content = {
        _FILES[0]: json_text(done.to_dict()),
        _FILES[1]: validation_table(done.cases).csv(),
        _FILES[2]: _markdown(done),
    }
    write_texts(folder, content)
    save_png(validation_figure(done), folder / _FILES[3], dpi=120)
    write_validation(done, folder / _FILES[4])
    if done.series:
        save_png(series_figure(done), folder / _SERIES, dpi=120)
