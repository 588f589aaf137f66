"""``dovetail identify`` of many measurements: one table of all results, and the files of each."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from itertools import chain, count
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from dovetail.cli.commands import exit_unless_believable
from dovetail.cli.reading import read_measured
from dovetail.cli.terminal import heading, print_json, progress_bars, say, say_on_stderr, table, title

if TYPE_CHECKING:
    from dovetail.assembly import Assembly
    from dovetail.identification import Batch, Identifier
    from dovetail.interfaces import IdentificationMethod
    from dovetail.report.content import ParameterRow

__all__ = ["check_batch", "identify_batch", "is_batch"]

_SUMMARY = "summary.csv"
_TABLES = (_SUMMARY, "parameters.csv")
_PAGE = "summary.html"


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
    """Identify the joint from each file, read with options of `read_frf`; exit with 1 if a file failed."""
    from dovetail import Batch, DovetailError, identify_many
    from dovetail.cli.result_files import writing

    frfs, unread = [], {}
    for file in (files := _files(measured, contents.get("plugins", ()))):
        try:
            frfs.append(read_measured(file, **contents))
        except DovetailError as error:
            unread[file.name if sum(other.name == file.name for other in files) == 1 else str(file)] = str(error)
    with progress_bars() as progress:
        done = identify_many(assembly, frfs, method, model=model, progress=progress, **options)
    batch = Batch(done.results, {**unread, **done.failures})
    with writing(output, lambda folder: _write(batch, assembly, folder), _SUMMARY):
        if as_json:
            print_json({"results": _summary(batch), "parameters": batch.table, "failures": dict(batch.failures)})
        else:
            _print(assembly, batch)
    for failure in batch.failures.values():
        say_on_stderr(failure)
    if batch.failures:
        raise typer.Exit(1)
    exit_unless_believable(batch)


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
        verdicts = [row.verdict for row in result.table if not row.follows]
        rows.append(
            {
                "measurement": name,
                "model": "" if result.adequacy is None else result.adequacy.word,
                "mean_coherence": result.mean_coherence,
                "chi_squared": None if result.fit is None else result.fit.chi_squared,
                "identified": None if result.posterior is None else verdicts.count("identified"),
                "parameters": len(verdicts),
                "believable": result.believable,
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
    if batch.caveat:
        say()
        say(f"Warning: {batch.caveat}")
    names: dict[str, list[str]] = {}
    for name, result in batch.results.items():
        for warning in warnings_of(result, None):
            names.setdefault(warning, []).append(name)
    for warning in by_importance(names):
        say(f"Note: {', '.join(names[warning])}: {warning}")


def _text(row: ParameterRow) -> str:
    details = ", ".join(filter(None, [row.interval, row.identified.precision]))
    return f"{row.estimate} ({details})" if details else row.estimate


def _write(batch: Batch, assembly: Assembly, folder: Path) -> None:
    from dovetail.cli.result_files import csv_text, json_text, write_texts
    from dovetail.report.batch import write_batch
    from dovetail.report.report import write_report

    texts = {}
    for name, rows in zip(_TABLES, (_summary(batch), batch.table), strict=True):
        texts[name] = csv_text(list(rows[0]), [row.values() for row in rows]) if rows else ""
    stems = dict(zip(batch.results, _stems(list(batch.results)), strict=True))
    for name, result in batch.results.items():
        texts[f"{stems[name]}.json"] = json_text(result.to_dict())
        write_report(result, folder / f"{stems[name]}.html", assembly=assembly)
    write_batch(batch, folder / _PAGE, assembly.name, {name: f"{stem}.html" for name, stem in stems.items()})
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
