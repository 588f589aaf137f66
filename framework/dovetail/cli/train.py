"""``dovetail train``: a network from a dataset."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from dovetail.cli.options import AsJson, AssemblyFile, PluginFiles, load_assembly
from dovetail.cli.terminal import note, print_json, progress_bars, say, table, title

if TYPE_CHECKING:
    from dovetail.identification import Evaluation, Identifier


def train(
    assembly: AssemblyFile,
    output: Annotated[Path, typer.Option("--output", "-o", metavar="FOLDER", help="Folder for the model.")],
    data: Annotated[
        Path | None,
        typer.Option("--data", metavar="FOLDER", help="A dataset; by default one is generated and discarded."),
    ] = None,
    robust: Annotated[
        bool,
        typer.Option("--robust", help="Train on noisy FRFs, with the description's 'augmentation' or its defaults."),
    ] = False,
    fresh: Annotated[bool, typer.Option("--fresh", help="Train on noisy FRFs that are new in every epoch.")] = False,
    minutes: Annotated[
        float | None, typer.Option(metavar="M", help="Longest time for the regressor, in minutes.", show_default=False)
    ] = None,
    plugin: PluginFiles = None,
    as_json: AsJson = False,
) -> None:
    """Train a network and print its test errors.

    They are computed on the test part of the dataset, which is not used in training.
    """
    import dovetail
    from dovetail.atomic_files import check_target
    from dovetail.network.bundle import check_replaceable

    check_replaceable(output)
    check_target(output)
    loaded = load_assembly(assembly, plugin)
    dataset = None if data is None else dovetail.Dataset(data)
    with progress_bars() as progress:
        model = dovetail.train(loaded, dataset, robust=robust, fresh=fresh, minutes=minutes, progress=progress)
    try:
        _save(model, output)
    finally:
        if as_json:
            print_json(evaluation_as_dict(model.evaluation))
        else:
            print_evaluation(model)
    note(f"Written: {output}")


def _save(model: Identifier, folder: Path) -> None:
    """Save a model; if that fails, save it among the system's temporary files, and say so."""
    import tempfile

    from dovetail.errors import BundleError

    try:
        model.save(folder)
    except BundleError:
        with suppress(BundleError, OSError):
            kept = model.save(Path(tempfile.mkdtemp(prefix="dovetail-")) / folder.resolve().name)
            note(f"The model is kept in {kept} for now.")
        raise


def evaluation_as_dict(evaluation: Evaluation) -> dict[str, object]:
    """Return an evaluation with its mean R2 as plain values for JSON."""
    mean = evaluation.mean_r2
    return {**evaluation.to_dict(), "mean_r2": mean if mean == mean else None}


def print_evaluation(model: Identifier) -> None:
    """Print how well each parameter is predicted on the test part."""
    from dovetail.plain_text import display_unit, number

    evaluation = model.evaluation
    title(f"{model.assembly.name}: errors on {evaluation.test_samples} test samples")
    rows = []
    for parameter in model.assembly.parameters:
        metrics = evaluation.parameters[parameter.name]
        unit = display_unit(parameter.unit, parameter.lower, parameter.upper)
        r2 = "-" if metrics.r2 is None else f"{metrics.r2:.3f}"
        errors = (f"{100 * metrics.mae:.1f}", f"{100 * metrics.rmse:.1f}")
        rows.append((parameter.name, r2, *errors, f"{number(metrics.mae_si * unit.factor, 3)} {unit.text}".strip()))
    table(
        ["parameter", "R2", "MAE [% of range]", "RMSE [% of range]", "MAE"],
        rows,
        numbers=["R2", "MAE [% of range]", "RMSE [% of range]"],
    )
    if any(parameter.prior == "normal" for parameter in model.assembly.parameters):
        say("Of a parameter with a normal prior the range is that of its probability, from 0 to 100 %.")
    say()
    say(f"Mean R2 {evaluation.mean_r2:.3f}; trained on {evaluation.training_samples} samples, seed {evaluation.seed}.")
    say("Time: " + ", ".join(f"{stage} {seconds:.1f} s" for stage, seconds in evaluation.seconds.items()))
