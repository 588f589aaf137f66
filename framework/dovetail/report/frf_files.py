"""FRFs in files that the user names, and in words: the suffix determines the format."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dovetail.atomic_files import new_files, write_whole
from dovetail.frf import Frf
from dovetail.frf.resonance_peaks import resonance_peaks
from dovetail.measurement import write_frf
from dovetail.registry import PluginPaths
from dovetail.report.result_files import csv_text, warning_comment

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from dovetail.identification import PredictedBand


def write_frf_files(
    frf: Frf,
    files: Sequence[Path],
    natural: Sequence[float],
    texts: Mapping[Path, str],
    *,
    overwrite: bool,
    plugins: PluginPaths = (),
) -> None:
    """Write an FRF to each of `files`, together with other files; missing folders are created.

    Parameters
    ----------
    frf : Frf
    files : sequence of Path
    natural : sequence of float
        Natural frequencies [Hz] to mark in figures.
    texts : mapping of Path to str
        The other files; all files appear together.
    overwrite : bool
    plugins : path or iterable of paths
        Plugin files that may write further formats.
    """
    for file in (*files, *texts):
        file.parent.mkdir(parents=True, exist_ok=True)
    with new_files((*files, *texts), overwrite=overwrite) as staged:
        for file in staged[: len(files)]:
            if file.suffix.lower() == ".png":
                from dovetail.report.figures import save_png, simulated_figure

                save_png(simulated_figure(frf, natural), file)
            else:
                write_frf(frf, file, plugins=plugins)
        for file, text in zip(staged[len(files) :], texts.values(), strict=True):
            file.write_bytes(text.encode("utf-8", "replace"))


def write_figures(frfs: list[Frf], files: list[Path], *, overwrite: bool) -> None:
    """Draw FRFs in one figure, and write it in the format given by each file's suffix."""
    if files:
        from dovetail.report.figures import measured_figure

        write_figure(measured_figure(frfs), files, overwrite=overwrite)


def write_figure(figure: Figure, files: list[Path], title: str = "", *, overwrite: bool) -> None:
    """Write a figure in the format given by each file's suffix, with a title for screen readers."""
    from dovetail.report.svg import figure_bytes

    for file in files:
        file.parent.mkdir(parents=True, exist_ok=True)
        write_whole(file, figure_bytes(figure, file.suffix.lower(), title), overwrite=overwrite)


def describe_frf(frf: Frf) -> str:
    """Return one sentence with the lines, the quantity and other properties of an FRF."""
    known = [f"{frf.frequency.size} lines from {frf.frequency[0]:g} to {frf.frequency[-1]:g} Hz", frf.quantity]
    if frf.rotation or frf.by_moment:
        known.append(frf.kind)
    if not frf.has_phase:
        known.append("amplitude alone")
    if frf.coherence is not None:
        known.append("coherence")
    if frf.averages is not None:
        known.append(f"{frf.averages} averages")
    if frf.response and frf.force:
        known.append(f"from {frf.force} to {frf.response}")
    return ", ".join(known) + "."


def frf_summary(frf: Frf) -> dict[str, Any]:
    """Return the properties of an FRF as plain values."""
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


def band_text(band: PredictedBand, frf: Frf) -> str:
    """Return a band of amplitudes as CSV, with the amplitude of the FRF that it belongs to."""
    columns = (band.frequency, frf.amplitude, band.lower, band.upper)
    rows = zip(*(column.tolist() for column in columns), strict=True)
    text = f"# quantity: {frf.quantity}; {band.level:.0%} of each line\n{warning_comment(band.warning)}"
    return text + csv_text(["frequency_Hz", "amplitude", "lower", "upper"], rows)
