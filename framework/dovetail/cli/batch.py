"""``dovetail identify`` of many measurements: one table of all results, and the files of each."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import typer

from dovetail.cli.commands import INTERRUPTED, exit_unless_trustworthy
from dovetail.cli.output_files import writing
from dovetail.cli.reading import Reading
from dovetail.cli.terminal import heading, note, print_json, progress_bars, say, say_on_stderr, table, title
from dovetail.errors import counted

if TYPE_CHECKING:
    from dovetail.assembly import Assembly
    from dovetail.frf import Frf
    from dovetail.identification import Batch, Identifier
    from dovetail.interfaces import IdentificationMethod
    from dovetail.report.content import ParameterRow


def is_batch(measured: Sequence[Path], responses: int) -> bool:
    """Return whether each file is a separate measurement: several of an assembly with one response, or a folder."""
    return any(path.is_dir() for path in measured) or (responses == 1 and len(measured) > 1)


def check_batch(truth: Path | None, output: Path | None, *selected: Sequence[object] | None) -> None:
    """Check, before any work, that a batch can be identified and written."""
    from dovetail.report.batch import BatchFiles
    from dovetail.report.result_files import prepare_folder

    if truth is not None:
        raise typer.BadParameter("a truth belongs to one measurement, and these are several.", param_hint="--truth")
    if any(selected):
        remedy = "one file of several FRFs takes --index, --response or --force; several files do not."
        raise typer.BadParameter(remedy, param_hint="MEASURED")
    prepare_folder(output, BatchFiles.names, BatchFiles.mark)


def identify_batch(
    assembly: Assembly,
    measured: Sequence[Path],
    reading: Reading,
    method: str | IdentificationMethod,
    model: Identifier | None,
    output: Path | None,
    *,
    as_json: bool,
    **options: Any,
) -> None:
    """Identify the joint from each file, read as options say; exit with 1 if a file failed.

    The files of each result are written when it arrives, so that they are there if this process is killed.
    """
    from dovetail import identify_many
    from dovetail.identification.batch import measurement_files, unique_names
    from dovetail.report.batch import BatchFiles, batch_summary

    frfs, unread = _read(measurement_files(measured, reading.options.get("plugins", ())), reading)
    with TemporaryDirectory(prefix="dovetail-") as staging:
        files = BatchFiles(assembly, unique_names(frfs), output, Path(staging))
        with progress_bars() as progress:
            options |= {"on_outcome": files.add, "progress": progress}
            done = identify_many(assembly, frfs, method, model=model, **options)
        batch = files.complete(done, unread)
        with writing(output, lambda folder: files.write(batch, folder), files.mark, files.written):
            if as_json:
                print_json(
                    {"results": batch_summary(batch), "parameters": batch.table, "failures": dict(batch.failures)}
                )
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


def _read(files: Sequence[Path], reading: Reading) -> tuple[list[Frf], dict[str, str]]:
    """Return the FRFs of all files that can be read, and by their names why the others cannot be."""
    from dovetail.errors import as_dovetail_error

    frfs, unread = [], {}
    for file in files:
        try:
            frfs.append(reading.read(file))
        except Exception as error:  # whatever is wrong with one file, the others are read
            name = file.name if sum(other.name == file.name for other in files) == 1 else str(file)
            unread[name] = str(as_dovetail_error(error, str(file)))
    return frfs, unread


def _print(assembly: Assembly, batch: Batch) -> None:
    from dovetail.errors import by_importance
    from dovetail.report.batch import batch_summary
    from dovetail.report.content import parameter_rows, warnings_of

    title(f"{assembly.name}: joint identified from {counted(len(batch.results), 'measurement')}")
    headers = ["measurement", "model", "mean coherence", "chi-squared", "identified"]
    rows = []
    for row in batch_summary(batch):
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
