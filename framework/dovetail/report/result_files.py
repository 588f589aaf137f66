"""The files of an identification in the user's output folder."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dovetail.documents.result_folder import MANIFEST, RESULT_FILE, listed_hashes
from dovetail.plain_text import csv_cell, csv_comment

if TYPE_CHECKING:
    from dovetail.assembly import Assembly
    from dovetail.identification import AtPoint, Identification
    from dovetail.identification.truth import TrueValues

_MODE_COLUMNS = ("natural_frequency", "damping_ratio", "measured_frequency", "measured_damping")
_LINES_PER_PIECE = 10_000
"""Lines of an FRF of which the text is in memory at once."""
_FILES = ("report.html", RESULT_FILE, "parameters.csv")
FRF_FILES = (*_FILES, "frf.csv", "frf.png")
"""Files of an identification from FRFs."""
MODAL_FILES = (*_FILES, "modes.csv")
"""Files of an identification from a table of modal parameters."""


def prepare_folder(folder: Path | None, files: Sequence[str] = FRF_FILES, mark: str = RESULT_FILE) -> None:
    """Check, before any work, that results can be written to a folder.

    Parameters
    ----------
    folder : Path or None
        Nothing is written without one.
    files : sequence of str
        Names of the files to write.
    mark : str
        The file that identifies existing files as results of an earlier run, which may be replaced.

    Raises
    ------
    DovetailError
        The folder is a file, cannot be written, or contains files of these names, or a manifest, that are not of an
        earlier run of the same command: what their manifest lists would be removed.
    """
    from dovetail.atomic_files import check_room
    from dovetail.errors import DovetailError, Fault, listing

    if folder is None:
        return
    remedy = "Choose another folder."
    if folder.exists() and not folder.is_dir():
        raise DovetailError(Fault(str(folder), "this is a file, not a folder for results.", remedy=remedy))
    taken = [name for name in (*files, MANIFEST) if (folder / name).exists()]
    if taken and mark not in taken:
        problem = f"{listing(taken)} would be replaced, and {'is' if len(taken) == 1 else 'are'} not of an earlier run."
        raise DovetailError(Fault(str(folder), problem, remedy=remedy))
    check_room(folder.resolve() if folder.exists() else folder.resolve().parent)


def write_folder(folder: Path, write: Callable[[Path], None], mark: str, kept: Collection[str] = ()) -> list[str]:
    """Write the files of a run to a folder, and return their names.

    Parameters
    ----------
    folder : Path
        The files appear there all at once, with a manifest. Unchanged files of an earlier run are removed; all other
        files in `folder` are kept.
    write : callable
        Writes the files to the folder that is its argument.
    mark : str
        As in `prepare_folder`.
    kept : collection of str
        Files that this run has written to `folder` before, and which stay.

    Raises
    ------
    FileError
        They cannot be written; the folder is then as it was.
    """
    from dovetail.atomic_files import new_folder
    from dovetail.provenance import file_hash

    hashes = {name: digest for name, digest in listed_hashes(folder).items() if name in kept}
    with new_folder(folder, _unchanged(folder) - hashes.keys(), mark, MANIFEST) as fresh:
        write(fresh)
        hashes |= {file.name: file_hash(file) for file in fresh.iterdir()}
        write_texts(fresh, {MANIFEST: "".join(f"{hashes[name]}  {name}\n" for name in sorted(hashes))})
    return sorted(hashes)


def _unchanged(folder: Path) -> set[str]:
    """Return the names of files from an earlier run that have not been changed since."""
    from dovetail.provenance import file_hash

    listed = listed_hashes(folder)
    with suppress(OSError, ValueError):
        return {file.name for file in folder.iterdir() if file.is_file() and file_hash(file) == listed.get(file.name)}
    return set()


def write_results(
    result: Identification, folder: Path, truth: TrueValues | None, assembly: Assembly | None = None, command: str = ""
) -> None:
    """Write a report, the result as JSON, parameters as CSV, and tables and figures of the FRFs or a table of modes.

    Parameters
    ----------
    result : Identification
    folder : Path
    truth : TrueValues or None
        Shown next to the identified values.
    assembly : Assembly, optional
        Drawn in the report.
    command : str
        The command line that computed it, shown in the report.
    """
    from dovetail.atomic_files import write_whole
    from dovetail.meanwhile import meanwhile
    from dovetail.report.html_report import write_report

    texts: dict[str, str | Iterable[str]] = {
        RESULT_FILE: _json_pieces(result.to_dict()),
        "parameters.csv": _parameters(result, truth),
    }
    names = [_frf_files(number) for number in range(1, len(result.responses) + 1)]
    texts |= {table: _frfs(response) for (table, _), response in zip(names, result.responses, strict=True)}
    if not result.responses:
        modes = [asdict(mode) for mode in result.modes]
        rows = [[mode[name] for name in _MODE_COLUMNS] for mode in modes]
        texts["modes.csv"] = warning_comment(result.warning) + csv_text(_MODE_COLUMNS, rows)
    with meanwhile(partial(_pictures, result)) as pictures:
        write_texts(folder, texts)
        write_report(result, folder / "report.html", truth=truth, assembly=assembly, command=command)
        for (_, figure), picture in zip(names, pictures(), strict=True):
            write_whole(folder / figure, picture, overwrite=True)


def _pictures(result: Identification) -> list[bytes]:
    """Return the figure of each response as PNG."""
    from dovetail.report.figures import png_bytes
    from dovetail.report.plots import plot_frf

    figures = (plot_frf(result, index) for index in range(len(result.responses)))
    return [png_bytes(figure, figure.get_suptitle()) for figure in figures]


def write_texts(folder: Path, texts: Mapping[str, str | Iterable[str]]) -> None:
    """Write files, given by name and content, to a folder, with the same line ends on every system.

    Long contents are given in pieces, so that no more than one is in memory.
    """
    for name, text in texts.items():
        with (folder / name).open("w", encoding="utf-8", errors="replace", newline="\n") as stream:
            stream.writelines([text] if isinstance(text, str) else text)


def _parameters(result: Identification, truth: TrueValues | None) -> str:
    rows = [asdict(row) for row in result.table]
    if truth is not None:
        true = truth.with_tied(result.parameters.values())
        rows = [{**row, "truth": true.get(row["name"])} for row in rows]
    return csv_text(list(rows[0]), [row.values() for row in rows])


def _frf_files(number: int) -> tuple[str, str]:
    """Return the names of the table and the figure of a response, counted from 1."""
    stem = "frf" if number == 1 else f"frf_{number}"
    return f"{stem}.csv", f"{stem}.png"


def _frfs(at_point: AtPoint) -> Iterator[str]:
    """Yield the table of a response in pieces."""
    measured, frf = at_point.measured, at_point.frf
    columns = {"frequency_Hz": frf.frequency}
    if measured.has_phase:
        columns |= {"measured_real": measured.values.real, "measured_imag": measured.values.imag}
    else:
        columns["measured_amplitude"] = measured.amplitude
    columns |= {"reconstructed_real": frf.values.real, "reconstructed_imag": frf.values.imag}
    columns["coherence"] = at_point.coherence
    yield f"# quantity: {frf.quantity}\n{warning_comment(frf.note)}"
    for first in range(0, len(frf.frequency), _LINES_PER_PIECE):
        piece = (column[first : first + _LINES_PER_PIECE].tolist() for column in columns.values())
        text = csv_text(list(columns), zip(*piece, strict=True))
        yield text.partition("\n")[2] if first else text


def json_text(value: Any) -> str:
    """Return plain values as the text of a JSON file."""
    return "".join(_json_pieces(value))


def _json_pieces(value: Any) -> Iterator[str]:
    """Yield the text of a JSON file in pieces."""
    yield from json.JSONEncoder(indent=1, ensure_ascii=False, allow_nan=False).iterencode(value)
    yield "\n"


def warning_comment(warning: str) -> str:
    """Return a warning as a comment line of a CSV file of FRF lines, as `write_frf` writes it; empty without one."""
    return f"# note: {csv_comment(warning)}\n" if warning else ""


def csv_text(header: Sequence[str], rows: Iterable[Iterable[Any]]) -> str:
    """Return comma-separated text with a header line."""
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    for row in (header, *rows):
        writer.writerow([_cell(cell) for cell in row])
    return stream.getvalue()


def _cell(value: Any) -> Any:
    """Return a value as a cell of a CSV file: a list as JSON."""
    if isinstance(value, (list, tuple)):
        return json.dumps(value, ensure_ascii=False)
    return csv_cell(value) if isinstance(value, str) else value
