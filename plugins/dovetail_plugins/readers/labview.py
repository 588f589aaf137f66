"""LabVIEW measurement files (.lvm), read with lvm_read: FRFs, and time records of impact tests."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail import (
    Fault,
    FrfReader,
    MeasurementError,
    RecordedChannels,
    Statement,
    damage_reported,
    decode_text,
    require_package,
)

_SIGNATURE = "LabVIEW Measurement"
_TIME = "time"
_MOST_CELLS = 1_000_000
"""Largest number of cells, enough for an FRF of 250,000 lines: the library stores each cell as an object."""
_READ = (
    *("Channels", "Samples", "X_Dimension", "X_Unit_Label", "Y_Unit_Label", "X0", "Delta_X"),
    *("Channel names", "Comment"),
)
"""Entries of headers that are read otherwise."""


class LabViewReader(FrfReader):
    """Segments of channels over time or frequency."""

    name = "labview"
    summary = "LabVIEW measurement files: .lvm"
    suffixes = (".lvm", ".txt")
    default_for = (".lvm",)

    def sniff(self, content: bytes) -> bool:
        """Look for the first words of the header."""
        return content.removeprefix(b"\xef\xbb\xbf").lstrip().startswith(_SIGNATURE.encode())

    def read(self, path: Path, content: bytes) -> Sequence[RecordedChannels]:
        """Return the segments.

        Raises
        ------
        MeasurementError
            Not such a file, or a damaged one.
        DovetailError
            lvm_read is not installed.
        """
        lvm_read = require_package("lvm_read", "lvm", str(path))
        text = decode_text(path, content)
        if not text.lstrip().startswith(_SIGNATURE):
            problem = f"this is not a LabVIEW measurement file: it does not begin with '{_SIGNATURE}'."
            raise MeasurementError(Fault(str(path), problem))
        if max(map(text.count, "\t,; ")) > _MOST_CELLS:
            raise MeasurementError(Fault(str(path), "the file has too many numbers.", f"at most {_MOST_CELLS:,}"))
        with damage_reported(str(path), "the LabVIEW file is damaged"):  # ValueError, KeyError, SyntaxError and others
            parsed = lvm_read.read_str(text)
            return [_segment(path, parsed, number) for number in range(parsed["Segments"])]

    def samples(self, folder: Path) -> Sequence[Path]:
        """Write an FRF in two channels."""
        file = folder / "sample.lvm"
        head = "LabVIEW Measurement\t\nSeparator\tTab\nX_Columns\tOne\n***End_of_Header***\t\n\n"
        segment = "Channels\t2\t\t\nX_Dimension\tFrequency\tFrequency\t\nY_Unit_Label\tm/N\tm/N\t\n"
        segment += "***End_of_Header***\t\t\t\n"
        rows = "X_Value\tReal\tImag\tComment\n10.0\t1.0\t-1.0\t\n20.0\t2.0\t-2.0\n30.0\t3.0\t-3.0\n"
        file.write_text(head + segment + rows, encoding="ascii")
        return [file]


def _segment(path: Path, parsed: dict[Any, Any], number: int) -> RecordedChannels:
    """Return a segment from lvm_read's table, whose first column may be the abscissa."""
    where, fields = f"{path}: segment {number + 1}", parsed[number]
    kind = str(parsed.get("X_Columns", "One")).strip()
    kind = "One" if kind == "Multi" and fields.get("Channels") == 1 else kind
    if kind not in ("One", "No"):
        accepted = "One or No, or one channel"
        raise MeasurementError(Fault(where, f"the file has X_Columns '{kind[:40]}'.", accepted, "Export it so."))
    names = [str(name).strip() for name in fields["Channel names"]]
    names = names[kind == "One" :]
    names = names[: names.index("Comment")] if "Comment" in names else names
    table = np.atleast_2d(np.asarray(fields["data"], dtype=np.float64))
    if not table.size:
        raise MeasurementError(Fault(where, "there is no line of numbers."))
    while names and not names[-1]:
        names.pop()
    channels = table.T[kind == "One" :][: len(names)]
    if not names or len(channels) < len(names):
        raise MeasurementError(Fault(where, f"there are {len(channels)} columns for {len(names)} channels."))
    counts = _numbers(map(str, fields.get("Samples", ())))
    announced = max((int(number) for number in counts if math.isfinite(number)), default=0)
    if len(table) < announced:
        problem = f"the header announces {announced} samples, and there are {len(table)} rows."
        raise MeasurementError(Fault(where, problem, remedy="The file is truncated or damaged: export it again."))
    axis = table[:, 0] if kind == "One" else _even_axis(where, fields, len(table))
    units = [str(label).strip() for label in fields.get("Y_Unit_Label", ())][: len(names)]
    header = _header(parsed) | _header(fields)
    dimension = (next(iter(fields.get("X_Dimension", ())), "") or _TIME).strip().lower()
    common, channel_statements = _statements(where, header, len(names))
    axis_unit = next(iter(fields.get("X_Unit_Label", ())), "").strip()
    if kind == "One" and dimension != _TIME:
        common += _axis_statements(where, header, axis_unit)
    return RecordedChannels(
        where=where,
        axis=axis,
        channels=channels,
        names=names,
        units=(*units, *[""] * (len(names) - len(units))),
        dimension=dimension,
        axis_unit=axis_unit,
        statements=common,
        channel_statements=channel_statements,
        steps=_steps(where, header, len(names)) if dimension == _TIME else (),
    )


def _header(entries: Mapping[Any, Any]) -> dict[str, Sequence[str]]:
    """Return the entries of a header that are texts, or lists of them."""
    texts: dict[str, Sequence[str]] = {}
    for key, value in entries.items():
        cells = value if isinstance(value, list) else [value]
        if isinstance(key, str) and all(isinstance(cell, (str, int, float)) for cell in cells):
            texts[key] = [str(cell) for cell in cells]
    return texts


def _statements(
    where: str, header: Mapping[str, Sequence[str]], count: int
) -> tuple[list[Statement], list[list[Statement]]]:
    """Return what the header states about all channels, and about each of them, which has its cell of an entry."""
    common: list[Statement] = []
    channel_statements: list[list[Statement]] = [[] for _ in range(count)]
    for key, cells in header.items():
        if key in _READ:
            continue
        if len(set(cells)) <= 1:
            common += [Statement("text", cell, f"{where}  {key}", key) for cell in cells[:1] if cell.strip()]
            continue
        for channel, cell in enumerate(cells[:count]):
            if cell.strip():
                channel_statements[channel].append(Statement("text", cell, f"{where}  {key}", key))
    return common, channel_statements


def _axis_statements(where: str, header: Mapping[str, Sequence[str]], unit: str) -> list[Statement]:
    """Return start and step of the frequencies in the header, which may differ from the column of frequencies."""
    statements = []
    for entry, key, unstated in (("X0", "frequency start", 0.0), ("Delta_X", "frequency step", 1.0)):
        value = next(_numbers(header.get(entry, ())), unstated)
        if value != unstated:  # these are written of signals without a start and a step
            statements.append(Statement("text", f"{value:g} {unit}".strip(), f"{where}  {entry}", key))
    return statements


def _steps(where: str, header: Mapping[str, Sequence[str]], count: int) -> list[tuple[float, str]]:
    """Return the steps of the abscissa that the header states.

    Raises
    ------
    MeasurementError
        The channels have different abscissas.
    """
    for key in ("X_Unit_Label", "X_Dimension"):
        labels = {text.lower() for text in header.get(key, ())[:count] if text}
        if len(labels) > 1:
            raise MeasurementError(Fault(where, f"the channels have {key} {', '.join(sorted(labels))}.", "one"))
    if len({text for text in header.get("X0", ())[:count] if text}) > 1:
        raise MeasurementError(Fault(where, "the channels start at different times (X0).", "one X0"))
    values = _numbers(header.get("Delta_X", ())[:count])
    return [(value, f"{where}, Delta_X") for value in values if value != 1.0]  # 1 is written of signals without a step


def _numbers(cells: Iterable[str]) -> Iterator[float]:
    for cell in cells:
        try:
            yield float(cell.replace(",", "."))
        except ValueError:
            continue


def _even_axis(where: str, fields: dict[str, Any], count: int) -> NDArray[np.float64]:
    first, step = (float(fields.get(name, [math.nan])[0]) for name in ("X0", "Delta_X"))
    if not (math.isfinite(first) and math.isfinite(step) and step > 0):
        raise MeasurementError(Fault(where, f"the abscissa has X0 = {first:g} and Delta_X = {step:g}."))
    return np.asarray(first + step * np.arange(count), dtype=np.float64)
