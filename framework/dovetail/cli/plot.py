"""``dovetail plot``: a look at measured FRFs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from dovetail.cli.completion import complete_files
from dovetail.cli.options import AsJson, Overwrite
from dovetail.cli.output_files import check_new_files
from dovetail.cli.reading import NOTHING_SET, Reading, with_reading
from dovetail.cli.terminal import note, print_json, table

if TYPE_CHECKING:
    pass

_PEAKS = 6
"""Largest number of resonances of an FRF that are listed."""


@with_reading()
def plot(
    measured: Annotated[
        list[Path],
        typer.Argument(metavar="FILE...", help="Measured FRFs, drawn over each other.", autocompletion=complete_files),
    ],
    output: Annotated[
        list[Path] | None,
        typer.Option("--output", "-o", metavar="FILE", help="Figure: .png, .svg or .html. May be repeated."),
    ] = None,
    reading: Reading = NOTHING_SET,
    overwrite: Overwrite = False,
    as_json: AsJson = False,
) -> None:
    """Show what measured FRFs contain: band, resonances, figures.

    A figure shows amplitude, phase and coherence of all files in the same axes.
    """
    from dovetail.report.frf_files import frf_summary, write_figures
    from dovetail.report.svg import FIGURE_SUFFIXES

    files = output or []
    check_new_files(files, FIGURE_SUFFIXES, overwrite)
    frfs = reading.read_selected(measured)
    summaries = [frf_summary(frf) for frf in frfs]
    if as_json:
        print_json(summaries)
    else:
        headers = ["measurement", "quantity", "lines", "band [Hz]", "coherence", "averages", "resonances [Hz]"]
        table(headers, [_row(summary) for summary in summaries], numbers=["lines"], split=True)
    write_figures(frfs, files, overwrite=overwrite)
    for file in files:
        note(f"Written: {file}")


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
