"""``dovetail identify`` of many measurements: one table of all results, and the files of each."""

from __future__ import annotations

import re
import shutil
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from itertools import chain, count
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import typer

from dovetail.cli.commands import INTERRUPTED, exit_unless_trustworthy
from dovetail.cli.reading import read_measured
from dovetail.cli.result_files import write_folder, writing
from dovetail.cli.terminal import heading, note, print_json, progress_bars, say, say_on_stderr, table, title
from dovetail.errors import FileError

if TYPE_CHECKING:
    from dovetail.assembly import Assembly
    from dovetail.frf import Frf
    from dovetail.identification import Batch, Identification, Identifier
    from dovetail.interfaces import IdentificationMethod
    from dovetail.report.content import ParameterRow

_SUMMARY = "summary.csv"
_TABLES = (_SUMMARY, "parameters.csv")
_PAGE = "summary.html"
_SPARING = 10.0
"""Time between two writings of the output folder over the time that the last one took."""


def is_batch(measured: Sequence[Path], responses: int) -> bool:
    """Return whether each file is a separate measurement: several of an assembly with one response, or a folder."""
    return any(path.is_dir() for path in measured) or (responses == 1 and len(measured) > 1)


def check_batch(truth: Path | None, output: Path | None, *selected: Sequence[object] | None) -> None:
    """Check, before any work, that a batch can be identified and written."""
    from dovetail.cli.result_files import prepare_folder

    if truth is not None:
        raise typer.BadParameter("a truth belongs to one measurement, and these are several.", param_hint="--truth")
    if any(selected):
        remedy = "one file of several FRFs takes --index, --response or --force; several files do not."
        raise typer.BadParameter(remedy, param_hint="MEASURED")
    prepare_folder(output, (*_TABLES, _PAGE), _SUMMARY)


def identify_batch(
    assembly: Assembly,
    measured: Sequence[Path],
    contents: Mapping[str, Any],
    method: str | IdentificationMethod,
    model: Identifier | None,
    output: Path | None,
    *,
    as_json: bool,
    **options: Any,
) -> None:
    """Identify the joint from each file, read with options of `read_frf`; exit with 1 if a file failed.

    The files of each result are written when it arrives, so that they are there if this process is killed.
    """
    from dovetail import identify_many
    from dovetail.identification.identifier import unique_names

    frfs, unread = _read(_files(measured, contents.get("plugins", ())), contents)
    with TemporaryDirectory(prefix="dovetail-") as staging:
        files = _Files(assembly, unique_names(frfs), output, Path(staging))
        with progress_bars() as progress:
            options |= {"on_outcome": files.add, "progress": progress}
            done = identify_many(assembly, frfs, method, model=model, **options)
        batch = files.complete(done, unread)
        with writing(output, lambda folder: files.write(batch, folder), _SUMMARY, files.written):
            if as_json:
                print_json({"results": _summary(batch), "parameters": batch.table, "failures": dict(batch.failures)})
            else:
                _print(assembly, batch)
    for failure in batch.failures.values():
        say_on_stderr(failure)
    if batch.interrupted:
        note(f"Interrupted after {len(batch.results) + len(batch.failures)} of {len(frfs) + len(unread)} measurements.")
        raise typer.Exit(INTERRUPTED)
    if batch.failures:
        raise typer.Exit(1)
    exit_unless_trustworthy(batch)


def _read(files: Sequence[Path], contents: Mapping[str, Any]) -> tuple[list[Frf], dict[str, str]]:
    """Return the FRFs of all files that can be read, and by their names why the others cannot be."""
    from dovetail.errors import as_dovetail_error

    frfs, unread = [], {}
    for file in files:
        try:
            frfs.append(read_measured(file, **contents))
        except Exception as error:  # whatever is wrong with one file, the others are read
            name = file.name if sum(other.name == file.name for other in files) == 1 else str(file)
            unread[name] = str(as_dovetail_error(error, str(file)))
    return frfs, unread


def _files(measured: Sequence[Path], plugins: Sequence[Path]) -> list[Path]:
    """Return the files and, in alphabetical order, those in folders that have the suffix of an FRF."""
    from dovetail.errors import Fault, MeasurementError, listing
    from dovetail.measurement import frf_suffixes

    suffixes = frf_suffixes(plugins)
    files: list[Path] = []
    for path in measured:
        inside = sorted(file for file in path.iterdir() if file.suffix.lower() in suffixes) if path.is_dir() else []
        if path.is_dir() and not inside:
            raise MeasurementError(Fault(str(path), "this folder holds no measurement.", listing(suffixes)))
        files += inside or [path]
    return files


def _summary(batch: Batch) -> list[dict[str, Any]]:
    """Return a row for each result: how well the model fits, and how many parameters are identified."""
    rows = []
    for name, result in batch.results.items():
        verdicts = [row.verdict for row in result.table if not row.tied_to]
        rows.append(
            {
                "measurement": name,
                "model": "" if result.adequacy is None else result.adequacy.word,
                "mean_coherence": result.mean_coherence,
                "chi_squared": None if result.fit is None else result.fit.chi_squared,
                "identified": None if result.posterior is None else verdicts.count("identified"),
                "parameters": len(verdicts),
                "is_trustworthy": result.is_trustworthy,
                "warnings": " ".join(result.warnings),
            }
        )
    return rows


def _print(assembly: Assembly, batch: Batch) -> None:
    from dovetail.errors import by_importance
    from dovetail.report.content import parameter_rows, warnings_of

    title(f"{assembly.name}: joint identified from {len(batch.results)} measurements")
    headers = ["measurement", "model", "mean coherence", "chi-squared", "identified"]
    rows = []
    for row in _summary(batch):
        fixed = "" if row["identified"] is None else f"{row['identified']} of {row['parameters']}"
        chi_squared = "" if row["chi_squared"] is None else f"{row['chi_squared']:.3g}"
        rows.append([row["measurement"], row["model"], f"{row['mean_coherence']:.3f}", chi_squared, fixed])
    rows += [[name, "failed", "", "", ""] for name in batch.failures]
    table(headers, rows, numbers=headers[2:], split=True)
    if not batch.results:
        return
    texts = {name: parameter_rows(result, None) for name, result in batch.results.items()}
    known = any(row.interval for rows in texts.values() for row in rows)
    heading("Estimates, 90 % intervals and precision" if known else "Estimates")
    cells = [[same[0].identified.name, same[0].unit, *map(_text, same)] for same in zip(*texts.values(), strict=True)]
    table(["parameter", "unit", *texts], cells, numbers=list(texts), split=True)
    if batch.warning:
        say()
        say(f"Warning: {batch.warning}")
    names: dict[str, list[str]] = {}
    for name, result in batch.results.items():
        for warning in warnings_of(result, None):
            names.setdefault(warning, []).append(name)
    for warning in by_importance(names):
        say(f"Note: {', '.join(names[warning])}: {warning}")


def _text(row: ParameterRow) -> str:
    details = ", ".join(filter(None, [row.interval, row.identified.precision]))
    return f"{row.estimate} ({details})" if details else row.estimate


class _Files:
    """The files of a batch, of which those of each measurement are written when its result arrives."""

    def __init__(self, assembly: Assembly, names: Sequence[str], output: Path | None, staging: Path) -> None:
        self._assembly, self._output, self._staging = assembly, output, staging
        self._stems = dict(zip(names, _stems(names), strict=True))
        self._arrived: dict[str, Identification] = {}
        self._failures: dict[str, str] = {}
        self._next = 0.0
        self.written: set[str] = set()

    def add(self, name: str, outcome: Identification | str) -> None:
        """Keep a result, and write what there is unless that was done a moment ago."""
        if isinstance(outcome, str):
            self._failures[name] = outcome
        elif self._output is None or self._is_made(name, outcome):
            self._arrived[name] = outcome
        began = time.monotonic()
        if self._output is None or began < self._next:
            return
        batch = self._batch(self._arrived, self._failures)
        with suppress(FileError):  # which is tried again at the end, and then reported
            self.written |= set(write_folder(self._output, lambda to: self.write(batch, to), _SUMMARY, self.written))
        self._next = time.monotonic() + _SPARING * (time.monotonic() - began)

    def complete(self, done: Batch, unread: Mapping[str, str]) -> Batch:
        """Return the batch in the order of the measurements, with what could not be read or made a report of."""
        results = {name: result for name, result in done.results.items() if name in self._arrived}
        return self._batch(results, {**unread, **done.failures, **self._failures}, interrupted=done.interrupted)

    def _batch(
        self, results: Mapping[str, Identification], failures: Mapping[str, str], *, interrupted: bool = False
    ) -> Batch:
        from dovetail import Batch

        return Batch(dict(results), dict(failures), interrupted)

    def _is_made(self, name: str, result: Identification) -> bool:
        """Make the files of a result, and return whether that was possible."""
        from dovetail.cli.result_files import json_text, write_texts
        from dovetail.errors import as_dovetail_error
        from dovetail.report.html_report import write_report

        stem = self._stems[name]
        try:
            write_texts(self._staging, {f"{stem}.json": json_text(result.to_dict())})
            write_report(result, self._staging / f"{stem}.html", assembly=self._assembly)
        except Exception as error:  # whatever is wrong with one result, the others are written
            self._failures[name] = str(as_dovetail_error(error, name))
            return False
        return True

    def write(self, batch: Batch, folder: Path) -> None:
        """Write the tables and the page of a batch, and the files of results that are not in the output folder yet."""
        from dovetail.cli.result_files import csv_text, write_texts
        from dovetail.report.batch import write_batch

        for stem in (self._stems[name] for name in batch.results):
            for file in (f"{stem}.json", f"{stem}.html"):
                if file not in self.written:
                    shutil.copyfile(self._staging / file, folder / file)
        texts = {}
        for name, rows in zip(_TABLES, (_summary(batch), batch.table), strict=True):
            texts[name] = csv_text(list(rows[0]), [row.values() for row in rows]) if rows else ""
        pages = {name: f"{self._stems[name]}.html" for name in batch.results}
        write_batch(batch, folder / _PAGE, self._assembly.name, pages)
        write_texts(folder, texts)


def _stems(names: Sequence[str]) -> list[str]:
    """Return a safe and unique file name for each measurement, different from that of the batch's page."""
    taken_by_page = Path(_PAGE).stem
    stems: list[str] = []
    for name in names:
        stem = re.sub(r"[^\w.-]+", "_", name).strip("._") or "measurement"
        taken = {known.casefold() for known in [taken_by_page, *stems]}  # as macOS and Windows compare
        numbered = (f"{stem}_{number}" for number in count(len(stems) + 1))
        stems.append(next(known for known in chain([stem], numbered) if known.casefold() not in taken))
    return stems
