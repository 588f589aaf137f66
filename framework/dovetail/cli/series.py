"""``dovetail identify-series``: a joint from several tests."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from dovetail.cli.commands import exit_unless_trustworthy, say_warning
from dovetail.cli.options import AsJson, PluginFiles
from dovetail.cli.output_files import writing
from dovetail.cli.terminal import heading, print_json, progress_bars, say, table, title

if TYPE_CHECKING:
    from dovetail.series import SeriesIdentification
    from dovetail.series.result import SeriesRow

SeriesFile = Annotated[Path, typer.Argument(metavar="SERIES", help="The description of a series of tests (YAML).")]
Samples = Annotated[int, typer.Option(metavar="N", min=20, help="Number of posterior samples.")]
Seed = Annotated[int | None, typer.Option(metavar="N", min=0, help="Seed; that of the description by default.")]
ModelErrorOfTests = Annotated[
    float | None,
    typer.Option(
        "--model-error",
        metavar="FRACTION",
        min=0.0,
        help="Relative error of natural frequencies that the models are allowed; what each test shows by default.",
    ),
]
_FILES = ("result.json", "unknowns.csv", "tests.csv", "parameters.png")


def identify_series(
    series: SeriesFile,
    method: Annotated[
        str, typer.Option("--method", metavar="METHOD", help="posterior, or refined (least squares alone).")
    ] = "posterior",
    samples: Samples = 400,
    model_error: ModelErrorOfTests = None,
    seed: Seed = None,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="FOLDER", help="Folder for tables and figures.")
    ] = None,
    plugin: PluginFiles = None,
    as_json: AsJson = False,
) -> None:
    """Identify a joint from several tests together.

    The description of a series lists tests, each with an assembly, measured files and covariates such as a torque, and
    says of each parameter whether the tests share it, whether it follows a law over a covariate, scatters from test to
    test, or is free. Files of an earlier run in the output folder are replaced.

    The exit code is 3 if the model does not fit a test, or if the tests contradict the relations between them.
    """
    import dovetail
    from dovetail.cli.options import one_of
    from dovetail.report.result_files import prepare_folder
    from dovetail.series.identification import METHODS

    chosen = one_of(METHODS, method, "--method")
    prepare_folder(output, _FILES, _FILES[0])
    with progress_bars() as progress:
        result = dovetail.identify_series(
            series, chosen, samples=samples, model_error=model_error, seed=seed, plugins=plugin or (), progress=progress
        )
    with writing(output, lambda folder: _write(result, folder), _FILES[0]):
        if as_json:
            print_json(result.to_dict())
        else:
            _print(result)
    exit_unless_trustworthy(result)


def _print(result: SeriesIdentification) -> None:
    title(f"{result.series.name}: {len(result.tests)} tests, by {result.method}")
    say_warning(result)
    rows = result.rows
    if rows:
        heading("The series")
        table(*_columns(rows))
    varying = [name for name in _names(result) if result.series.role_of(name).name != "shared"]
    for name in varying:
        parameter_rows = [row for k in range(len(result.tests)) for row in result.rows_of(k) if row.name == name]
        heading(f"{name} ({parameter_rows[0].role})")
        table(*_columns(parameter_rows, first="test"))
    heading("Agreement of the tests")
    table(
        ["test", "model fits", "chi-squared alone", "together"],
        [
            (one.test.name, one.judged.adequacy.word, f"{alone / freedom:.3f}", f"{joint / freedom:.3f}")
            for one, alone, joint, freedom in zip(
                result.tests,
                result.fit.squares_alone.tolist(),
                result.fit.squares.tolist(),
                (one.judged.fit.degrees_of_freedom for one in result.tests),
                strict=True,
            )
        ],
        numbers=["chi-squared alone", "together"],
    )
    say()
    say(
        "If the relations between the tests are right, chance raises the sum of squares by at least this much with "
        f"probability {result.fit.contradiction:.2g}."
    )
    for warning in result.warnings:
        say(f"Note: {warning}")


def _names(result: SeriesIdentification) -> list[str]:
    return list(dict.fromkeys(p.name for one in result.tests for p in one.test.assembly.parameters))


def _columns(rows: Sequence[SeriesRow], first: str = "unknown") -> tuple[list[str], list[list[str]]]:
    """Return the header and the cells of a table."""
    from dovetail.units import format_quantity

    cells = []
    for row in rows:
        line = [row.test if first == "test" else row.name]
        if first != "test":
            line.append(row.role)
        line.append(format_quantity(row.fit, row.unit))
        if row.estimate is None or row.low is None or row.high is None:
            line.append(f"± {format_quantity(row.deviation, row.unit, 2)}")
        else:
            ends = f"{format_quantity(row.low, row.unit, 4)} to {format_quantity(row.high, row.unit, 4)}"
            line += [format_quantity(row.estimate, row.unit), ends, row.precision, row.verdict]
        cells.append(line)
    with_posterior = bool(rows) and rows[0].estimate is not None
    head = [first, *(["role"] if first != "test" else []), "best fit"]
    head += ["estimate", "90 % interval", "precision", "verdict"] if with_posterior else ["standard deviation"]
    return head, cells


def _write(result: SeriesIdentification, folder: Path) -> None:
    from dovetail.report.figures import save_png
    from dovetail.report.result_files import json_text, write_texts
    from dovetail.report.series import covariate_figure, parameter_table, unknown_table

    tables = {_FILES[1]: unknown_table(result), _FILES[2]: parameter_table(result)}
    content = {_FILES[0]: json_text(result.to_dict()), **tables}
    write_texts(folder, content)
    save_png(covariate_figure(result), folder / _FILES[3], dpi=120)
