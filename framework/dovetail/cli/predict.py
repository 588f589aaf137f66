"""``dovetail predict``: an identified joint in another assembly."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from dovetail.cli.frf_files import FrfFiles, check_frf_files, write_frf_files
from dovetail.cli.natural_frequencies import natural_frequencies, say_natural_frequencies
from dovetail.cli.options import AsJson, AssemblyFile, Overwrite, PluginFiles, PointNumber, at_point, check_new_files
from dovetail.cli.terminal import heading, note, print_json, quantity_text, table, title

if TYPE_CHECKING:
    from dovetail.frf import Frf
    from dovetail.identification import Band

__all__ = ["predict"]


def predict(
    assembly: AssemblyFile,
    result: Annotated[
        Path, typer.Argument(metavar="RESULT", help="The folder that 'identify' wrote, or its result.json.")
    ],
    point: PointNumber = 1,
    output: FrfFiles = None,
    band: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.csv",
            help="Between which amplitudes the FRF lies, if the joint was identified by 'posterior'.",
        ),
    ] = None,
    overwrite: Overwrite = False,
    plugin: PluginFiles = None,
    as_json: AsJson = False,
) -> None:
    """Predict the FRF of another assembly.

    It has the joint that was identified: another tool in the same holder, say.
    """
    import dovetail
    from dovetail.identification.prediction import joint_values
    from dovetail.identification.result_file import read_identification

    files = output or []
    check_frf_files(files, overwrite)
    if band is not None:
        check_new_files([band], [".csv"], overwrite)
    loaded = at_point(dovetail.load(assembly, plugins=plugin or ()), point)
    identified = read_identification(result)
    values = joint_values(loaded, identified)
    frf = dovetail.predict(loaded, identified)
    natural, reason = natural_frequencies(loaded, values)
    predicted_band = None if band is None else dovetail.predict_band(loaded, identified)
    write_frf_files(frf, files, natural, overwrite)
    if band is not None and predicted_band is not None:
        _write_band(predicted_band, frf, band)
    if as_json:
        print_json({"name": loaded.name, "parameters": values, "natural_frequencies": natural})
    else:
        title(f"{loaded.name}: predicted with the joint identified from {identified.measured.label}")
        rows = [(parameter.name, quantity_text(values[parameter.name], parameter)) for parameter in loaded.parameters]
        if rows:
            table(["parameter", "value"], rows)
        heading("Natural frequencies")
        say_natural_frequencies(natural, reason)
    for file in (*files, *([] if band is None else [band])):
        note(f"Written: {file}")


def _write_band(band: Band, frf: Frf, file: Path) -> None:
    from dovetail.atomic_files import write_whole
    from dovetail.cli.result_files import csv_text

    columns = (band.frequency, frf.amplitude, band.lower, band.upper)
    rows = zip(*(column.tolist() for column in columns), strict=True)
    text = f"# quantity: {frf.quantity}; {band.level:.0%} of each line\n"
    text += csv_text(["frequency_Hz", "amplitude", "lower", "upper"], rows)
    write_whole(file, text.encode("utf-8"), overwrite=True)
