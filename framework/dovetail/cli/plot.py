"""``dovetail plot``: a look at measured FRFs."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from dovetail.cli.completion import complete_files
from dovetail.cli.options import Overwrite, check_new_files
from dovetail.cli.reading import (
    Columns,
    ForceDofs,
    Indices,
    Names,
    QuantityOfFile,
    ResponseDofs,
    UnitOfFile,
    read_measured,
    read_selected,
)
from dovetail.cli.terminal import note, table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from dovetail.frf import Frf

__all__ = ["plot", "write_figure", "write_figures"]

_PEAKS = 6
"""Resonances of an FRF that are listed."""


def plot(
    measured: Annotated[
        list[Path],
        typer.Argument(metavar="FILE...", help="Measured FRFs, drawn over each other.", autocompletion=complete_files),
    ],
    output: Annotated[
        list[Path] | None,
        typer.Option("--output", "-o", metavar="FILE", help="Figure: .png, .svg or .html. May be repeated."),
    ] = None,
    quantity: QuantityOfFile = None,
    unit: UnitOfFile = None,
    index: Indices = None,
    response: ResponseDofs = None,
    force: ForceDofs = None,
    names: Names = None,
    columns: Columns = None,
    overwrite: Overwrite = False,
) -> None:
    """Look at measured FRFs: what files hold, resonances, figures.

    A figure draws amplitude, phase and coherence of all files over each other.
    """
    from dovetail.report.svg import FIGURE_SUFFIXES

    files = output or []
    check_new_files(files, FIGURE_SUFFIXES, overwrite)
    read = partial(read_measured, names=names, columns=columns, quantity=quantity, unit=unit)
    frfs = read_selected(read, measured, index, response, force)
    headers = ["measurement", "quantity", "lines", "band [Hz]", "coherence", "averages", "resonances [Hz]"]
    table(headers, [_row(frf) for frf in frfs], numbers=["lines"], split=True)
    write_figures(frfs, files, overwrite=overwrite)
    for file in files:
        note(f"Written: {file}")


def _row(frf: Frf) -> list[str]:
    from dovetail.identification.resonance_peaks import resonance_peaks

    peaks = resonance_peaks(frf)
    listed = ", ".join(f"{peak:.1f}" for peak in peaks[:_PEAKS]) + (", ..." if len(peaks) > _PEAKS else "")
    return [
        frf.label,
        frf.quantity + ("" if frf.has_phase else ", amplitude alone"),
        str(frf.frequency.size),
        f"{frf.frequency[0]:g} to {frf.frequency[-1]:g}",
        "" if frf.coherence is None else f"{frf.coherence.mean():.3f}",
        "" if frf.averages is None else str(frf.averages),
        listed,
    ]


def write_figures(frfs: list[Frf], files: list[Path], *, overwrite: bool) -> None:
    """Draw FRFs over each other, and write the figure in the format that each file's suffix names."""
    if files:
        from dovetail.report.figures import measured_figure

        write_figure(measured_figure(frfs), files, overwrite=overwrite)


def write_figure(figure: Figure, files: list[Path], title: str = "", *, overwrite: bool) -> None:
    """Write a figure in the format that each file's suffix names; a screen reader reads its title."""
    from dovetail.atomic_files import write_whole
    from dovetail.report.svg import figure_bytes

    for file in files:
        file.parent.mkdir(parents=True, exist_ok=True)
        write_whole(file, figure_bytes(figure, file.suffix.lower(), title), overwrite=overwrite)
