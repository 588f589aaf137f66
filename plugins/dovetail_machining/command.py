"""``dovetail spindle``: the receptance of a spindle's flange from three impact tests."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from dovetail.commands import (
    NOTHING_SET,
    Overwrite,
    Reading,
    check_new_files,
    note,
    one_of,
    quantity_in,
    say,
    title,
    warnings_as_notes,
    with_reading,
)

_length = quantity_in("m")


@with_reading("none")
def spindle(
    holder: Annotated[
        Path, typer.Argument(metavar="HOLDER", help="Description of the calibration holder beyond its flange.")
    ],
    drive_a: Annotated[
        Path, typer.Argument(metavar="AA", help="Test with accelerometer and hammer at a, near the tip.")
    ],
    transfer: Annotated[
        Path, typer.Argument(metavar="AB", help="Test with the accelerometer at a and the hammer at b.")
    ],
    drive_b: Annotated[Path, typer.Argument(metavar="BB", help="Test with accelerometer and hammer at b.")],
    at: Annotated[float, typer.Option(metavar="LENGTH", parser=_length, help="Position of b on the holder.")],
    flange: Annotated[float, typer.Option(metavar="LENGTH", parser=_length, help="Position of the holder's end.")],
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="FILE.npz", help="File for a 'measured' substructure.")
    ],
    tip: Annotated[
        float,
        typer.Option(metavar="LENGTH", parser=_length, help="Position of a; 0 mm by default.", show_default=False),
    ] = 0.0,
    rotations: Annotated[
        str, typer.Option(metavar="HOW", help="model, or difference (first-order finite differences).")
    ] = "model",
    reading: Reading = NOTHING_SET,
    overwrite: Overwrite = False,
) -> None:
    """Determine the receptance of a spindle's flange from impact tests.

    Three impact tests on a calibration holder in the spindle, and the holder's model, give the receptance of the
    spindle with its flange alone (inverse RCSA): a 'measured' substructure for any holder and tool.
    """
    import numpy as np

    import dovetail
    import dovetail_machining
    from dovetail.evaluation import on_grid
    from dovetail_machining.spindle import ROTATIONS, error_gain

    how = one_of(ROTATIONS, rotations, "--rotations")
    check_new_files([output], [".npz"], overwrite)
    loaded = dovetail.load(holder, plugins=reading.plugins)
    tests = [reading.read(file, accelerometer_mass=0.0) for file in (drive_a, transfer, drive_b)]
    aa, ab, bb = (on_grid(frf, loaded.frequency) for frf in tests)
    arguments = loaded, (aa, ab, bb), (tip, at), flange
    options: dict[str, Any] = {"accelerometer_mass": reading.accelerometer_mass, "rotations": how}
    with warnings_as_notes():
        receptance = dovetail_machining.spindle_flange(*arguments, **options)
        gain = np.median(error_gain(receptance, *arguments, **options), axis=0)
    output.parent.mkdir(parents=True, exist_ok=True)
    dovetail.write_receptance(receptance, output)
    title(f"The spindle's flange, from {drive_a.name}, {transfer.name} and {drive_b.name}")
    lines = receptance.frequency
    say(f"{lines.size} lines from {lines[0]:g} to {lines[-1]:g} Hz, rotations by {how}.")
    say(
        f"An error of 1 % in each test is one of {gain[0]:.3g} % in x and {gain[1]:.3g} % in rz here (median of the "
        "lines). It is smaller with the two points further apart, and cancels in an assembly like the holder's."
    )
    note(f"Written: {output}")
