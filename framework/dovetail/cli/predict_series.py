"""``dovetail predict-series``: an FRF between or beyond the tests of a series, and tests left out."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from dovetail.cli.commands import exit_unless_trustworthy, say_warning
from dovetail.cli.options import AsJson, Overwrite, PluginFiles
from dovetail.cli.output_files import FrfFiles, check_frf_files, check_new_files
from dovetail.cli.series import ModelErrorOfTests, Samples, Seed, SeriesFile
from dovetail.cli.terminal import heading, note, print_json, progress_bars, say, table, title
from dovetail.errors import Fault, ParameterError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dovetail.series.left_out import LeftOutTest
    from dovetail.series.prediction import PredictedTest
    from dovetail.series.result import SeriesIdentification


def predict_series(
    series: SeriesFile,
    at: Annotated[
        list[str] | None,
        typer.Option("--at", metavar="COVARIATE=VALUE", help="Where to predict: torque=70Nm. May be repeated."),
    ] = None,
    assembly: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Another assembly with the joint; by default that of the first test."),
    ] = None,
    leave_one_out: Annotated[
        bool, typer.Option("--leave-one-out", help="Predict each test of the series from all others instead.")
    ] = False,
    model_error: ModelErrorOfTests = None,
    samples: Samples = 400,
    seed: Seed = None,
    output: FrfFiles = None,
    band: Annotated[
        Path | None,
        typer.Option(metavar="FILE.csv", help="CSV file for the amplitude's prediction band."),
    ] = None,
    overwrite: Overwrite = False,
    plugin: PluginFiles = None,
    as_json: AsJson = False,
) -> None:
    """Predict the FRF of a test that a series does not contain.

    The series is identified first. The prediction is for another value of a covariate, such as a torque between the
    tests or beyond them, or for another assembly with the same joint. With --leave-one-out each test is predicted from
    all others, and compared with its measurement.

    The exit code is 3 if the result is not trustworthy; the FRF is written nevertheless, with a warning in its files.
    """
    import dovetail
    from dovetail.report.frf_files import band_text, write_frf_files
    from dovetail.series.left_out import leave_one_out as predict_each

    files = output or []
    if leave_one_out and (at or assembly or files or band):
        problem = "the tests that are left out say where to predict."
        raise ParameterError(
            Fault("--leave-one-out", problem, remedy="Leave out --at, --assembly, --output and --band.")
        )
    check_frf_files(files, overwrite, plugin)
    if band is not None:
        check_new_files([band], [".csv"], overwrite, option="--band")
    loaded = None if assembly is None else dovetail.load(assembly, plugins=plugin or ())
    where = _covariates(at or [])
    with progress_bars() as progress:
        result = dovetail.identify_series(
            series, samples=samples, model_error=model_error, seed=seed, plugins=plugin or (), progress=progress
        )
        left_out = predict_each(result, samples=samples, seed=seed, progress=progress) if leave_one_out else ()
    if leave_one_out:
        _print_left_out(result, left_out, as_json=as_json)
    else:
        predicted = dovetail.predict_test(result, where, loaded)
        texts = {} if band is None else {band: band_text(predicted.band, predicted.frf)}
        write_frf_files(predicted.frf, files, [], texts, overwrite=overwrite, plugins=plugin or ())
        _print(result, predicted, where, as_json=as_json)
        for file in (*files, *texts):
            note(f"Written: {file}")
    exit_unless_trustworthy(result)


def _covariates(given: Sequence[str]) -> dict[str, str]:
    values = {}
    for text in given:
        name, equals, value = text.partition("=")
        if not equals or not name.strip() or not value.strip():
            raise ParameterError(Fault("--at", f"'{text}' gives no value.", "COVARIATE=VALUE, such as torque=70Nm"))
        values[name.strip()] = value.strip()
    return values


def _print(result: SeriesIdentification, predicted: PredictedTest, at: dict[str, str], *, as_json: bool) -> None:
    from dovetail.units import format_quantity

    if as_json:
        warning = {"is_trustworthy": result.is_trustworthy, "warning": result.warning}
        print_json({"series": result.series.name, "at": at, **warning, **predicted.to_dict()})
        return
    title(
        f"{result.series.name}: predicted at {', '.join(f'{name} = {value}' for name, value in at.items()) or 'a test'}"
    )
    say_warning(result)
    units = {p.name: p.unit for test in result.tests for p in test.test.assembly.parameters}
    rows = []
    for name, (middle, low, high) in predicted.intervals.items():
        ends = f"{format_quantity(low, units.get(name, ''), 4)} to {format_quantity(high, units.get(name, ''), 4)}"
        rows.append((name, format_quantity(middle, units.get(name, "")), ends))
    heading("Parameters of the predicted test")
    table(["parameter", "median", "90 % interval"], rows)
    for text in predicted.warnings:
        if text != result.warning:
            note(text)


def _print_left_out(result: SeriesIdentification, left_out: Sequence[LeftOutTest], *, as_json: bool) -> None:
    if as_json:
        warning = {"is_trustworthy": result.is_trustworthy, "warning": result.warning}
        tests = {one.test: one.to_dict() for one in left_out}
        print_json({"series": result.series.name, **warning, "left_out": tests})
        return
    title(f"{result.series.name}: each test predicted from the others")
    say_warning(result)
    rows = []
    for test in left_out:
        density = "not known" if test.evidence is None else f"{test.evidence.log:.1f} ± {test.evidence.error:.1f}"
        where = "beyond the others" if test.extrapolated else "between the others"
        rows.append((test.test, where, f"{test.coverage:.1%}", f"{test.frequency_error:.3%}", density))
    headers = ["test", "where", "lines within the 90 % band", "natural frequencies", "log predictive density"]
    table(headers, rows, numbers=headers[2:])
    say()
    say("'Natural frequencies' is the largest difference from the fit to the test alone.")
