"""The files of an identification, all in the folder that the user names."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dovetail.plain_text import csv_cell, csv_comment

if TYPE_CHECKING:
    from dovetail.identification import AtPoint, Identification
    from dovetail.report.truth import Truth

__all__ = ["caveat_comment", "csv_text", "prepare_folder", "write_results"]

_RESULT = "result.json"
_FILES = ("report.html", _RESULT, "parameters.csv", "frf.csv", "frf.png")


def prepare_folder(folder: Path, files: Sequence[str] = _FILES, mark: str = _RESULT) -> None:
    """Make sure, before any work, that results can be written to a folder, and make it.

    Parameters
    ----------
    folder : Path
    files : sequence of str
        Names of what will be written.
    mark : str
        Which of them shows that those that are there are results of an earlier run, which may be replaced.

    Raises
    ------
    DovetailError
        The folder is a file, or holds files of these names that are no results.
    """
    from dovetail.errors import DovetailError, Fault, listing

    remedy = "Choose another folder."
    if folder.exists() and not folder.is_dir():
        raise DovetailError(Fault(str(folder), "this is a file, not a folder for results.", remedy=remedy))
    taken = [name for name in files if (folder / name).exists()]
    if taken and mark not in taken:
        problem = f"{listing(taken)} would be replaced, and {'is' if len(taken) == 1 else 'are'} not of an earlier run."
        raise DovetailError(Fault(str(folder), problem, remedy=remedy))
    folder.mkdir(parents=True, exist_ok=True)


def write_results(result: Identification, folder: Path, truth: Truth | None) -> tuple[Path, ...]:
    """Write a report, the result as JSON, parameters and FRFs as CSV, and a figure of each FRF.

    Parameters
    ----------
    result : Identification
    folder : Path
        Files of an earlier run are replaced, each whole or not at all.
    truth : Truth or None
        Shown beside what was identified.

    Returns
    -------
    tuple of Path
    """
    from dovetail.atomic_files import write_whole
    from dovetail.report.figures import save_png
    from dovetail.report.plots import plot_frf
    from dovetail.report.report import write_report

    paths = {name: folder / name for name in _FILES}
    texts = {
        _RESULT: json.dumps(result.to_dict(), indent=1, ensure_ascii=False, allow_nan=False) + "\n",
        "parameters.csv": _parameters(result, truth),
    }
    for name, text in texts.items():
        write_whole(paths[name], text.encode("utf-8", "replace"), overwrite=True)
    for index, response in enumerate(result.responses):
        table, figure = (folder / name for name in _frf_files(index + 1))
        paths |= {table.name: table, figure.name: figure}
        write_whole(table, _frfs(response).encode("utf-8", "replace"), overwrite=True)
        save_png(plot_frf(result, index), figure)
    write_report(result, paths["report.html"], truth=truth)
    return tuple(paths.values())


def _parameters(result: Identification, truth: Truth | None) -> str:
    header = ["name", "joint", "value", "unit", "lower", "upper", "scale", "in_range", "description"]
    rows = [
        [*(getattr(parameter, key) for key in header), result.believable] for parameter in result.parameters.values()
    ]
    header.append("believable")
    if truth is None:
        return csv_text(header, rows)
    return csv_text(
        [*header, "truth"],
        [[*row, truth.parameters.get(name, "")] for row, name in zip(rows, result.parameters, strict=True)],
    )


def _frf_files(number: int) -> tuple[str, str]:
    """Return the names of the table and the figure of a response, counted from 1."""
    stem = "frf" if number == 1 else f"frf_{number}"
    return f"{stem}.csv", f"{stem}.png"


def _frfs(at_point: AtPoint) -> str:
    measured, frf = at_point.measured, at_point.frf
    columns = {"frequency_Hz": frf.frequency}
    if measured.has_phase:
        columns |= {"measured_real": measured.values.real, "measured_imag": measured.values.imag}
    else:
        columns["measured_amplitude"] = measured.amplitude
    columns |= {"reconstructed_real": frf.values.real, "reconstructed_imag": frf.values.imag}
    columns["coherence"] = at_point.coherence
    rows = zip(*(column.tolist() for column in columns.values()), strict=True)
    return f"# quantity: {frf.quantity}\n{caveat_comment(frf.note)}" + csv_text(list(columns), rows)


def caveat_comment(caveat: str) -> str:
    """Return the comment line of a table of lines of an FRF, as `write_frf` writes it; nothing without a caveat."""
    return f"# note: {csv_comment(caveat)}\n" if caveat else ""


def csv_text(header: Sequence[str], rows: Iterable[Iterable[Any]]) -> str:
    """Return comma-separated text with a header line."""
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    for row in (header, *rows):
        writer.writerow([csv_cell(cell) if isinstance(cell, str) else cell for cell in row])
    return stream.getvalue()
