"""The files of a batch: those of each measurement, tables of all, and a page with a verdict on each."""

from __future__ import annotations

import re
import shutil
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from itertools import chain, count
from pathlib import Path
from typing import Any

from dovetail.assembly import Assembly
from dovetail.errors import FileError, as_dovetail_error, is_decisive
from dovetail.identification import Batch, Identification
from dovetail.report.content import parameter_rows, verdict_on, warnings_of
from dovetail.report.html_report import write_report
from dovetail.report.pages import write_page
from dovetail.report.result_files import csv_text, json_text, write_folder, write_texts

_SHARE = 0.1
"""Part of the time since the batch began that the output folder may be written."""


def write_batch(batch: Batch, path: str | Path, title: str, reports: Mapping[str, str]) -> Path:
    """Write a batch as one self-contained HTML file without scripts, which loads nothing.

    Parameters
    ----------
    batch : Batch
    path : str or Path
        An existing file is replaced; the file is written atomically.
    title : str
        Such as the assembly's name.
    reports : mapping of str to str
        The file of each measurement's report, in the same folder.

    Returns
    -------
    Path
    """
    judged = {name: _judged(result) for name, result in batch.results.items()}
    content = {
        "title": title,
        "count": len(batch.results) + len(batch.failures),
        "warning": batch.warning,
        "measurements": [
            (name, mark, sentence, f"{batch.results[name].mean_coherence:.3f}", reports.get(name, ""))
            for name, (mark, sentence) in judged.items()
        ],
        "failures": dict(batch.failures),
        "parameters": _parameters(batch),
        "is_trustworthy": {name: result.is_trustworthy for name, result in batch.results.items()},
    }
    return write_page(path, "batch.html.jinja", content, charts=False)


def _judged(result: Identification) -> tuple[str, str]:
    """Return the mark of a result, and its verdict after the warnings that decide what it is worth."""
    mark, sentence = verdict_on(result)
    return mark, " ".join([*filter(is_decisive, warnings_of(result, None)), sentence])


def _parameters(batch: Batch) -> list[tuple[Any, list[tuple[str, Any]]]]:
    """Return for each parameter its row in the first result, for name and unit, and its rows in all results."""
    tables = [[(name, row) for row in parameter_rows(result, None)] for name, result in batch.results.items()]
    return [(rows[0][1], list(rows)) for rows in zip(*tables, strict=True)]


def batch_summary(batch: Batch) -> list[dict[str, Any]]:
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


class BatchFiles:
    """The files of a batch, of which those of each measurement are written when its result arrives.

    Parameters
    ----------
    assembly : Assembly
        Drawn in the reports.
    names : sequence of str
        The measurements, as `identify_many` names them.
    output : Path or None
        The folder, in which nothing is written without one.
    staging : Path
        An empty folder, which is needed until the batch is complete.
    """

    mark = "summary.csv"
    """The file that identifies a folder as the output of a batch, for `write_folder`."""
    names = (mark, "parameters.csv", "summary.html")
    """The files of the batch itself."""

    def __init__(self, assembly: Assembly, names: Sequence[str], output: Path | None, staging: Path) -> None:
        self._assembly, self._output, self._staging = assembly, output, staging
        self._stems = dict(zip(names, file_stems(names), strict=True))
        self._arrived: dict[str, Identification] = {}
        self._failures: dict[str, str] = {}
        self._began, self._writing = time.monotonic(), 0.0
        self.written: set[str] = set()

    def add(self, name: str, outcome: Identification | str) -> None:
        """Keep a result, and write what there is unless that has taken too much of the time."""
        if isinstance(outcome, str):
            self._failures[name] = outcome
        elif self._output is None or self._is_made(name, outcome):
            self._arrived[name] = outcome
        now = time.monotonic()
        if self._output is None or self._writing > _SHARE * (now - self._began):
            return
        batch = Batch(dict(self._arrived), dict(self._failures))
        with suppress(FileError):  # which is tried again at the end, and then reported
            self.written |= set(write_folder(self._output, lambda to: self.write(batch, to), self.mark, self.written))
        self._writing += time.monotonic() - now

    def complete(self, done: Batch, unread: Mapping[str, str]) -> Batch:
        """Return the batch in the order of the measurements, with what could not be read or made a report of."""
        for name in done.results.keys() - self._arrived.keys() - self._failures.keys():  # where Ctrl-C came in between
            self.add(name, done.results[name])
        results = {name: result for name, result in done.results.items() if name in self._arrived}
        return Batch(results, {**unread, **done.failures, **self._failures}, done.interrupted)

    def _is_made(self, name: str, result: Identification) -> bool:
        """Make the files of a result, and return whether that was possible."""
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
        for stem in (self._stems[name] for name in batch.results):
            for file in (f"{stem}.json", f"{stem}.html"):
                if file not in self.written:
                    shutil.copyfile(self._staging / file, folder / file)
        texts = {}
        for name, rows in zip(self.names, (batch_summary(batch), batch.table), strict=False):
            texts[name] = csv_text(list(rows[0]), [row.values() for row in rows]) if rows else ""
        pages = {name: f"{self._stems[name]}.html" for name in batch.results}
        write_batch(batch, folder / self.names[-1], self._assembly.name, pages)
        write_texts(folder, texts)


def file_stems(names: Sequence[str]) -> list[str]:
    """Return a safe and unique file name for each measurement, different from that of the batch's page."""
    taken_by_page = Path(BatchFiles.names[-1]).stem
    stems: list[str] = []
    for name in names:
        stem = re.sub(r"[^\w.-]+", "_", name).strip("._") or "measurement"
        taken = {known.casefold() for known in [taken_by_page, *stems]}  # as macOS and Windows compare
        numbered = (f"{stem}_{number}" for number in count(len(stems) + 1))
        stems.append(next(known for known in chain([stem], numbered) if known.casefold() not in taken))
    return stems
