"""``dovetail calibrate``: coverage and ranks of the posterior for simulated measurements with known truth."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from dovetail.commands import (
    INTERRUPTED,
    AsJson,
    PluginFiles,
    Scheduler,
    assembly_or_model,
    chosen_method,
    note,
    one_of,
    part,
    print_json,
    print_table,
    progress_bars,
    say,
    say_on_stderr,
    title,
)

if TYPE_CHECKING:
    from dovetail_bench.evaluation.calibration import Calibration

_FILES = (
    "calibration.json",
    "calibration.md",
    "parameters.csv",
    "cases.csv",
    "ranks.png",
    "coverage.png",
    "calibration.html",
)


_Subject = Annotated[
    Path, typer.Argument(metavar="MODEL_OR_ASSEMBLY", help="A description (YAML), or a model for --method network.")
]
_Cases = Annotated[int, typer.Option(metavar="N", min=1, help="Number of random joints.")]
_Noise = Annotated[
    float,
    typer.Option(
        metavar="FRACTION", parser=part, show_default=False, help="Noise level, such as 2%; see --noise-kind."
    ),
]
_Samples = Annotated[int, typer.Option(metavar="N", min=1, help="Samples of each posterior.")]
_ModelError = Annotated[
    float,
    typer.Option(
        metavar="FRACTION",
        parser=part,
        show_default=False,
        help="Relative error of natural frequencies allowed to the model.",
    ),
]
_FinerMesh = Annotated[
    int, typer.Option(metavar="N", min=1, help="Simulate the measurements with a mesh N times finer.")
]
_Seed = Annotated[int, typer.Option(metavar="N", min=0, help="Seed of joints and noise.")]
_Method = Annotated[
    str,
    typer.Option("--method", metavar="METHOD", help="posterior, network (with intervals), or a method of a plugin."),
]
_NoiseKind = Annotated[str, typer.Option(metavar="KIND", help="uniform over all lines, or proportional to each line.")]
_Workers = Annotated[
    int | None,
    typer.Option(
        metavar="N", min=1, help="Cases to run at the same time; one per processor by default.", show_default=False
    ),
]
_Output = Annotated[
    Path | None, typer.Option("--output", "-o", metavar="FOLDER", help="Folder for tables and figures.")
]


def calibrate(
    assembly: _Subject,
    cases: _Cases = 100,
    noise: _Noise = 0.01,
    samples: _Samples = 400,
    model_error: _ModelError = 0.0,
    finer_mesh: _FinerMesh = 1,
    seed: _Seed = 0,
    method: _Method = "posterior",
    noise_kind: _NoiseKind = "uniform",
    workers: _Workers = None,
    scheduler: Scheduler = None,
    output: _Output = None,
    plugin: PluginFiles = None,
    as_json: AsJson = False,
) -> None:
    """Check intervals against simulated joints whose parameters are known.

    Joints are drawn from the ranges; each is measured with noise and identified. For a correct posterior, 90 % of the
    90 % intervals contain the true value, and the rank of the true value among the samples is uniform. After Ctrl-C
    the finished cases are reported. A case that fails does not end the others; the exit code is then 1. Files of an
    earlier run in the output folder are replaced.
    """
    import dovetail_bench
    from dovetail.commands import prepare_folder, trained_model, writing
    from dovetail.evaluation import NOISE_KINDS

    kind = one_of(NOISE_KINDS, noise_kind, "--noise-kind")
    loaded, model = assembly_or_model(assembly, plugin)
    chosen = chosen_method(method, plugin, loaded)
    if not chosen.fits_lines and model is None:
        model = trained_model(loaded, plugin or [], retrain=False)
    prepare_folder(output, _FILES, _FILES[0])
    with progress_bars() as progress:
        done = dovetail_bench.calibrate(
            loaded,
            cases=cases,
            noise=noise,
            samples=samples,
            model_error=model_error,
            finer_mesh=finer_mesh,
            seed=seed,
            method=chosen,
            model=model,
            noise_kind=kind,
            workers=workers,
            scheduler=scheduler,
            progress=progress,
        )
    with writing(output, lambda folder: _write(loaded.name, done, folder), _FILES[0]):
        if as_json:
            print_json(done.to_dict())
        else:
            _print(loaded.name, done)
    _exit_unless_complete(done, cases)


def _exit_unless_complete(done: Calibration, cases: int) -> None:
    """Print why cases are missing, and exit with the code of an interruption or of failures if there are any."""
    for failure in done.failures.values():
        say_on_stderr(failure)
    ended = len(done.case) + len(done.failures)
    if ended < cases:
        note(f"Interrupted after {ended} of {cases} cases.")
        raise typer.Exit(INTERRUPTED)
    if done.failures:
        note(f"{len(done.failures)} of {cases} cases failed, and are not in the coverage.")
        raise typer.Exit(1)


def _print(name: str, done: Calibration) -> None:
    from dovetail_bench.pages.calibration import calibration_table, calibration_times

    title(_title(name, done))
    print_table(calibration_table(done))
    say()
    say(calibration_times(done))


def _title(name: str, done: Calibration) -> str:
    return f"{name}: truth in the posterior, noise {done.setting.noise:g}"


def _write(name: str, done: Calibration, folder: Path) -> None:
    from dovetail.commands import json_text, write_texts
    from dovetail.pages import save_png
    from dovetail_bench.pages.calibration import calibration_table, calibration_times, write_calibration
    from dovetail_bench.pages.calibration_figures import coverage_figure, rank_figure

    table = calibration_table(done)
    content = {
        _FILES[0]: json_text(done.to_dict()),
        _FILES[1]: f"{table.markdown()}\n{calibration_times(done)}\n",
        _FILES[2]: table.csv(),
        _FILES[3]: _cases(done),
    }
    write_texts(folder, content)
    save_png(rank_figure(done), folder / _FILES[4])
    save_png(coverage_figure(done), folder / _FILES[5])
    write_calibration(done, folder / _FILES[6], _title(name, done))


def _cases(done: Calibration) -> str:
    from dovetail.commands import csv_text

    header = ["case", "seconds", "effective", "reached", "is_trustworthy"]
    header += [f"{what} {name}" for what in ("truth", "estimate", "rank") for name in done.names]
    columns = zip(
        done.case.tolist(),
        done.seconds.tolist(),
        done.effective.tolist(),
        done.reached.tolist(),
        done.is_trustworthy.tolist(),
        *(column.tolist() for array in (done.truth, done.estimate, done.rank) for column in array.T),
        strict=True,
    )
    return "# truth and estimate in fractions of the ranges\n" + csv_text(header, columns)
