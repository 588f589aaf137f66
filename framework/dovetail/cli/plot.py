"""``dovetail plot``: a look at measured FRFs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from dovetail.cli import reading
from dovetail.cli.completion import complete_files
from dovetail.cli.options import AsJson, Overwrite, PluginFiles, check_new_files
from dovetail.cli.terminal import note, print_json, table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from dovetail.frf import Frf

_PEAKS = 6
"""Largest number of resonances of an FRF that are listed."""


def plot(
    measured: Annotated[
        list[Path],
        typer.Argument(metavar="FILE...", help="Measured FRFs, drawn over each other.", autocompletion=complete_files),
    ],
    output: Annotated[
        list[Path] | None,
        typer.Option("--output", "-o", metavar="FILE", help="Figure: .png, .svg or .html. May be repeated."),
    ] = None,
    quantity: reading.QuantityOfFile = None,
    unit: reading.UnitOfFile = None,
    index: reading.Indices = None,
    response: reading.ResponseDofs = None,
    force: reading.ForceDofs = None,
    names: reading.Names = None,
    columns: reading.Columns = None,
    reader: reading.Reader = None,
    plugin: PluginFiles = None,
    overwrite: Overwrite = False,
    as_json: AsJson = False,
) -> None:
    """Look at measured FRFs: what files hold, resonances, figures.

    A figure draws amplitude, phase and coherence of all files over each other.
    """
    from dovetail.report.svg import FIGURE_SUFFIXES

    files = output or []
    check_new_files(files, FIGURE_SUFFIXES, overwrite)
    contents = reading.reading_options(quantity, unit, names, columns, reader, plugin)
    frfs = reading.read_selected(measured, index, response, force, **contents)
    summaries = [_summary(frf) for frf in frfs]
    if as_json:
        print_json(summaries)
    else:
        headers = ["measurement", "quantity", "lines", "band [Hz]", "coherence", "averages", "resonances [Hz]"]
        table(headers, [_row(summary) for summary in summaries], numbers=["lines"], split=True)
    write_figures(frfs, files, overwrite=overwrite)
    for file in files:
        note(f"Written: {file}")


def _summary(frf: Frf) -> dict[str, Any]:
    """Return the properties of an FRF as plain values."""
    from dovetail.frf.resonance_peaks import resonance_peaks

    return {
        "measurement": frf.label,
        "quantity": frf.quantity,
        "has_phase": frf.has_phase,
        "lines": frf.frequency.size,
        "band_Hz": [float(frf.frequency[0]), float(frf.frequency[-1])],
        "mean_coherence": None if frf.coherence is None else float(frf.coherence.mean()),
        "averages": frf.averages,
        "resonances_Hz": [float(peak) for peak in resonance_peaks(frf)],
    }


def _row(summary: dict[str, Any]) -> list[str]:
    from dovetail.plain_text import hertz

    low, high = summary["band_Hz"]
    coherence, peaks = summary["mean_coherence"], summary["resonances_Hz"]
    return [
        summary["measurement"],
        summary["quantity"] + ("" if summary["has_phase"] else ", amplitude alone"),
        str(summary["lines"]),
        f"{low:g} to {high:g}",
        "" if coherence is None else f"{coherence:.3f}",
        str(summary["averages"] or ""),
        ", ".join(hertz(peak) for peak in peaks[:_PEAKS]) + (", ..." if len(peaks) > _PEAKS else ""),
    ]


def write_figures(frfs: list[Frf], files: list[Path], *, overwrite: bool) -> None:
    """Draw FRFs in one figure, and write it in the format given by each file's suffix."""
    if files:
        from dovetail.report.figures import measured_figure

        write_figure(measured_figure(frfs), files, overwrite=overwrite)


def write_figure(figure: Figure, files: list[Path], title: str = "", *, overwrite: bool) -> None:
    """Write a figure in the format given by each file's suffix, with a title for screen readers."""
    from dovetail.atomic_files import write_whole
    from dovetail.report.svg import figure_bytes

    for file in files:
        file.parent.mkdir(parents=True, exist_ok=True)
        write_whole(file, figure_bytes(figure, file.suffix.lower(), title), overwrite=overwrite)
