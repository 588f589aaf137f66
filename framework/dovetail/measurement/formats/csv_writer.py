"""FRFs written as CSV."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from dovetail.errors import Fault, MeasurementError
from dovetail.measurement.writing import FrfToWrite
from dovetail.plain_text import csv_comment


def encode(content: FrfToWrite, path: Path, _binary: bool | None) -> bytes:
    """Return a CSV file with every digit of the numbers, and the FRF's other data in comments.

    Raises
    ------
    MeasurementError
        A number that is not finite.
    """
    frf = content.frf
    columns = {"frequency_Hz": frf.frequency}
    if frf.has_phase:
        columns |= {"real": content.values.real, "imag": content.values.imag}
    else:
        columns |= {"amplitude": np.abs(content.values)}
    for name, array in (("coherence", frf.coherence), ("variance", content.variance)):
        if array is not None:
            columns[name] = array
    table = np.column_stack(list(columns.values()))
    if not np.all(np.isfinite(table)):
        raise MeasurementError(Fault(str(path), f"{frf.label} holds numbers that are not finite: nothing is written."))
    rows = "\n".join(",".join(map(repr, row)) for row in table.tolist())
    return f"{_comments(content)}{','.join(columns)}\n{rows}\n".encode()


def _comments(content: FrfToWrite) -> str:
    frf = content.frf
    comments: dict[str, str] = {"quantity": frf.quantity}
    if frf.kind != "displacement per force" or content.factor != 1.0:
        comments["unit"] = content.unit
    if frf.averages is not None:
        comments["averages"] = str(frf.averages)
    comments |= {name: csv_comment(text) for name in ("note", "response", "force") if (text := getattr(frf, name))}
    return "".join(f"# {name}: {text}\n" for name, text in comments.items())
