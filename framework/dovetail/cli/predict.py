"""``dovetail predict``: an identified joint in another assembly."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from dovetail.cli.commands import exit_unless_trustworthy, measurement_names, say_warning
from dovetail.cli.natural_frequencies import say_natural_frequencies
from dovetail.cli.options import AsJson, AssemblyFile, Overwrite, PluginFiles, PointNumber, at_point
from dovetail.cli.output_files import FrfFiles, check_frf_files, check_new_files
from dovetail.cli.terminal import heading, note, print_json, quantity_text, table, title


def predict(
    assembly: AssemblyFile,
    result: Annotated[Path, typer.Argument(metavar="RESULT", help="Folder that 'identify' wrote, or its result.json.")],
    point: PointNumber = 1,
    output: FrfFiles = None,
    band: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.csv",
            help="CSV file for the amplitude's prediction band, if the joint was identified by 'posterior'.",
        ),
    ] = None,
    overwrite: Overwrite = False,
    plugin: PluginFiles = None,
    as_json: AsJson = False,
) -> None:
    """Predict the FRF of another assembly.

    The other assembly contains the identified joint: another tool in the same holder, for example. The exit code is 3
    if the result is not trustworthy; the FRF is written nevertheless, with a warning in its files.
    """
    import dovetail
    from dovetail.assembly.summary import natural_frequencies
    from dovetail.identification.prediction import determined_signs, joint_values, predicted_band, predicted_frf
    from dovetail.identification.result_file import load_result
    from dovetail.report.frf_files import band_text, write_frf_files

    files = output or []
    check_frf_files(files, overwrite, plugin)
    if band is not None:
        check_new_files([band], [".csv"], overwrite, option="--band")
    loaded = at_point(dovetail.load(assembly, plugins=plugin or ()), point)
    identified = load_result(result)
    values = joint_values(loaded, identified)
    signs = {f"{name}.sign": sign for name, sign in determined_signs(loaded, identified).items()}
    frf = predicted_frf(loaded, identified)
    natural, damping, reason = natural_frequencies(loaded, values)
    amplitudes = None if band is None else predicted_band(loaded, identified)
    bands = {} if band is None or amplitudes is None else {band: band_text(amplitudes, frf)}
    write_frf_files(frf, files, natural, bands, overwrite=overwrite, plugins=plugin or ())
    if as_json:
        warning = {"is_trustworthy": identified.is_trustworthy, "warning": identified.warning}
        modes = {"natural_frequencies": natural, "damping_ratios": damping}
        print_json({"name": loaded.name, **warning, "parameters": values | signs, **modes})
    else:
        from dovetail.inference.posterior import NOT_TRUSTWORTHY

        title(f"{loaded.name}: predicted with the joint identified from {measurement_names(identified)}")
        say_warning(identified)
        remark = "" if identified.is_trustworthy else NOT_TRUSTWORTHY
        rows = [(p.name, quantity_text(values[p.name], p), remark) for p in loaded.parameters]
        rows += [(name, f"{sign:g}", remark) for name, sign in signs.items()]
        if rows:
            table(["parameter", "value", "note"], rows)
        heading(f"Natural frequencies, {remark}" if remark else "Natural frequencies")
        say_natural_frequencies(natural, damping, reason)
    for file in (*files, *bands):
        note(f"Written: {file}")
    exit_unless_trustworthy(identified)
