"""``dovetail convert``: a measured FRF from one file format to another."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from dovetail.cli.options import Overwrite
from dovetail.cli.output_files import check_frf_files
from dovetail.cli.reading import NOTHING_SET, Reading, warnings_as_notes, with_reading
from dovetail.cli.terminal import note, say, title

if TYPE_CHECKING:
    from dovetail.frf import Frf


@with_reading("one")
def convert(
    source: Annotated[
        Path, typer.Argument(metavar="IN", help="Measured FRF: .uff, .csv, .txt, .npz, .mat, .h5, .frf, .lvm, ...")
    ],
    target: Annotated[
        Path, typer.Argument(metavar="OUT", help="New file: .uff, .csv, .npz or the format of a plugin; or a figure.")
    ],
    reading: Reading = NOTHING_SET,
    dofs: Annotated[
        str | None,
        typer.Option(
            metavar="RESPONSE,FORCE",
            help="DOFs of response and force, such as 3+x,1-x, if the file does not say.",
        ),
    ] = None,
    to: Annotated[
        str | None,
        typer.Option(
            "--to", metavar="QUANTITY_OR_UNIT", help="Quantity or unit of the new file, such as mobility or um/N."
        ),
    ] = None,
    drive_point: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Of a transfer FRF: the drive-point FRF at the accelerometer.")
    ] = None,
    to_response: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="The FRF from an accelerometer at a third point to the response."),
    ] = None,
    from_force: Annotated[
        Path | None, typer.Option(metavar="FILE", help="The FRF from the force to an accelerometer at a third point.")
    ] = None,
    overwrite: Overwrite = False,
) -> None:
    """Convert a measured FRF to another format, quantity or unit.

    Coherence, averages, variance and the names of the DOFs are kept. Without --to the quantity is kept and the unit is
    SI. The effect of the accelerometer's mass can be removed: for a drive-point FRF from the FRF itself; for a transfer
    FRF, --drive-point is the drive-point FRF at the accelerometer. If the accelerometer is at a third point,
    --to-response and --from-force are the FRFs from it to the response and from the force to it.
    """
    import dovetail
    from dovetail.frf import QUANTITIES
    from dovetail.measurement.frf_units import meaning_of_unit
    from dovetail.report.frf_files import describe_frf, write_figures
    from dovetail.report.svg import FIGURE_SUFFIXES

    check_frf_files([target], overwrite, reading.plugins, figures=FIGURE_SUFFIXES, option="OUT")
    if to is not None and to not in QUANTITIES and target.suffix.lower() in FIGURE_SUFFIXES:
        raise typer.BadParameter(f"a figure is in SI units: {', '.join(QUANTITIES)}.", param_hint="--to")
    others = {"drive": drive_point, "to_response": to_response, "from_force": from_force}
    frf = _read(source, reading, {name: file for name, file in others.items() if file is not None}, _dofs_of(dofs))
    wanted = next((known for known in QUANTITIES if known == to), None)
    if to is not None:
        frf = frf.to(wanted or meaning_of_unit(to, "--to").quantity)
    target.parent.mkdir(parents=True, exist_ok=True)
    if target.suffix.lower() in FIGURE_SUFFIXES:
        write_figures([frf], [target], overwrite=overwrite)
    else:
        unit = None if wanted else to
        dovetail.write_frf(frf, target, overwrite=overwrite, unit=unit, plugins=reading.plugins)
    title(f"{source.name} to {target.name}")
    say(describe_frf(frf))
    note(f"Written: {target}")


def _read(source: Path, reading: Reading, others: dict[str, Path], dofs: tuple[str, str] | None) -> Frf:
    """Read an FRF, from which the accelerometer's mass is removed with the other FRFs of the same test, if any."""
    import dovetail

    if not others:
        return reading.read(source, **reading.selection, dofs=dofs)
    if not reading.accelerometer_mass:
        raise typer.BadParameter("the mass is missing, such as '1.2 g'.", param_hint="--accelerometer-mass")
    other_frfs = {name: reading.read(file, accelerometer_mass=0.0) for name, file in others.items()}
    frf = reading.read(source, **reading.selection, dofs=dofs, accelerometer_mass=0.0)
    with warnings_as_notes():
        return dovetail.remove_accelerometer_mass(frf, reading.accelerometer_mass, **other_frfs)


def _dofs_of(text: str | None) -> tuple[str, str] | None:
    if text is None:
        return None
    response, comma, force = (name.strip() for name in text.partition(","))
    if not (response and comma and force):
        raise typer.BadParameter(f"'{text}' is not RESPONSE,FORCE, such as 3+x,1-x.", param_hint="--dofs")
    return response, force
