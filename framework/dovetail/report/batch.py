"""The report of a batch: one HTML file with a verdict on each measurement and all parameters of all measurements."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from dovetail.errors import is_decisive
from dovetail.identification import Batch, Identification
from dovetail.report.content import parameter_rows, verdict, warnings_of
from dovetail.report.pages import write_page


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
    mark, sentence = verdict(result)
    return mark, " ".join([*filter(is_decisive, warnings_of(result, None)), sentence])


def _parameters(batch: Batch) -> list[tuple[Any, list[tuple[str, Any]]]]:
    """Return for each parameter its row in the first result, for name and unit, and its rows in all results."""
    tables = [[(name, row) for row in parameter_rows(result, None)] for name, result in batch.results.items()]
    return [(rows[0][1], list(rows)) for rows in zip(*tables, strict=True)]
