"""``dovetail identify``: joint parameters from one measured FRF."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from dovetail.cli.options import AsJson, PluginFiles, check_method, quantity_in
from dovetail.cli.reading import ForceDof, Index, Names, QuantityOfFile, ResponseDof, UnitOfFile, names_of
from dovetail.cli.terminal import heading, note, print_json, say, table, title

if TYPE_CHECKING:
    from dovetail.assembly import Assembly
    from dovetail.frf import Frf
    from dovetail.identification import Identification, Identifier
    from dovetail.report import Truth

__all__ = ["identify"]


def identify(
    source: Annotated[
        Path, typer.Argument(metavar="MODEL_OR_ASSEMBLY", help="A folder that 'train' wrote, or a description (YAML).")
    ],
    measured: Annotated[Path, typer.Argument(metavar="MEASURED", help="The measured FRF; docs, measured files.")],
    method: Annotated[str, typer.Option(metavar="METHOD", help="How to identify.")] = "network",
    quantity: QuantityOfFile = None,
    unit: UnitOfFile = None,
    index: Index = None,
    response: ResponseDof = None,
    force: ForceDof = None,
    names: Names = None,
    accelerometer_mass: Annotated[
        float,
        typer.Option(
            metavar="MASS",
            parser=quantity_in("kg"),
            show_default=False,
            help="At the drive point, such as '1.2 g'; it is removed from the FRF.",
        ),
    ] = 0.0,
    truth: Annotated[
        Path | None, typer.Option(metavar="FILE", help="JSON with the true values of a synthetic measurement.")
    ] = None,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="FOLDER", help="Folder for the report and all files.")
    ] = None,
    retrain: Annotated[bool, typer.Option("--retrain", help="Train even if there is a model already.")] = False,
    plugin: PluginFiles = None,
    as_json: AsJson = False,
) -> None:
    """Identify a joint from a measured FRF.

    Given a description, a network is trained first; it is kept in the user's cache folder (or where DOVETAIL_CACHE_DIR
    says) and taken from there the next time. Files of an earlier run in the output folder are replaced.
    """
    import dovetail
    from dovetail.report import read_truth

    check_method(method)
    frf = dovetail.read_frf(
        measured,
        quantity=quantity,
        unit=unit,
        accelerometer_mass=accelerometer_mass,
        index=index,
        response=response,
        force=force,
        names=names_of(names or []),
    )
    model = _model(source, frf, truth, output, plugin or [], retrain, accelerometer_mass)
    known = None if truth is None else read_truth(truth, model.assembly.parameters)
    result = model.identify(frf, method=method)
    if output is not None:
        from dovetail.cli.result_files import write_results

        files = write_results(result, output, known)
    if as_json:
        print_json(result.to_dict())
    else:
        _print(result, known)
    if output is not None:
        note(f"Written to {output}: {', '.join(file.name for file in files)}")


def _model(
    source: Path,
    measured: Frf,
    truth: Path | None,
    output: Path | None,
    plugins: list[Path],
    retrain: bool,
    accelerometer_mass: float,
) -> Identifier:
    """Load the model, or train it once everything else that could be wrong has been looked at."""
    import dovetail
    from dovetail.cli.model_cache import trained_model
    from dovetail.cli.result_files import prepare_folder
    from dovetail.measurement import on_grid
    from dovetail.report import read_truth

    model = dovetail.load_model(source, plugins=plugins) if source.is_dir() else None
    assembly = dovetail.load(source, plugins=plugins) if model is None else model.assembly
    _check_accelerometer(assembly, accelerometer_mass)
    on_grid(measured, assembly.frequency)
    if truth is not None:
        read_truth(truth, assembly.parameters)
    if output is not None:
        prepare_folder(output)
    return model if model is not None else trained_model(assembly, plugins, retrain=retrain)


def _check_accelerometer(assembly: Assembly, mass: float) -> None:
    from dovetail.errors import Fault, MeasurementError

    if mass and assembly.description.response.rotation:
        found = f"the response of '{assembly.name}' is a rotation per moment, from which no mass can be removed."
        raise MeasurementError(Fault("--accelerometer-mass", found, remedy="Leave it out."))


def _print(result: Identification, truth: Truth | None) -> None:
    from dovetail.report.content import mode_rows, parameter_rows, warnings_of

    title(f"{result.provenance['assembly']}: joint identified from {result.measured.label} ({result.method})")
    rows = []
    for row in parameter_rows(result, truth):
        outside = "" if row.in_range else "outside"
        true = (row.true_value, row.error) if truth is not None else ("", "")
        rows.append((row.name, row.value, *true, row.unit, f"{row.lower} to {row.upper}", outside))
    headers = ["parameter", "identified", "truth", "error [%]", "unit", "range", "note"]
    table(headers, rows, numbers=headers[1:4])
    heading("Natural frequencies [Hz]")
    modes = [
        (
            row.natural,
            *((row.true_natural, row.error) if truth is not None else ("", "")),
            row.reconstructed_peak,
            row.measured_peak,
            row.difference,
        )
        for row in mode_rows(result, truth)
    ]
    headers = ["identified", "truth", "error [%]", "FRF peak", "measured peak", "difference [%]"]
    if modes:
        table(headers, modes, numbers=headers)
    else:
        say("none within the frequencies")
    say()
    say(f"Mean coherence of measured and reconstructed FRF: {result.mean_coherence:.3f}")
    for warning in warnings_of(result, truth):
        say(f"Note: {warning}")
