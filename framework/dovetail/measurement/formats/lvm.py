"""LabVIEW measurement files (.lvm), read with lvm_read: FRFs, and time records of impact tests."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dovetail.errors import Fault, MeasurementError, damage_reported, listing, require_package
from dovetail.measurement.formats.column_names import VALUE_FIELDS
from dovetail.measurement.formats.tables import check_columns, read_header, recording_of
from dovetail.measurement.formats.text_tables import split_lines
from dovetail.measurement.free_text import read_texts
from dovetail.measurement.recording import MOST_LINES, ReadOptions, Recording

_MOST_CELLS = MOST_LINES
"""Largest number of cells, enough for an FRF of 250,000 lines: the library stores each cell as an object."""
_READ = (
    "Channels",
    "Samples",
    "X_Dimension",
    "X_Unit_Label",
    "Y_Unit_Label",
    "X0",
    "Delta_X",
    "Channel names",
    "Comment",
)
"""Entries of headers that are read otherwise."""
_TIME = "time"
_FREQUENCY = "frequency"


class Segment(NamedTuple):
    """One table of a file.

    Parameters
    ----------
    where : str
        The file and the number of the segment.
    dimension : str
        Dimension of the abscissa, in lower case: time, unless the file states another.
    axis : (n,) array
        The abscissa.
    names, units : tuple of str
        Of the channels.
    channels : (n_channels, n) array
    axis_unit : str
        Of the abscissa; empty if none is stated.
    header : mapping of str to sequence of str
        All entries of the headers of the file and of the segment, with a cell for each channel.
    """

    where: str
    dimension: str
    axis: NDArray[np.float64]
    names: tuple[str, ...]
    units: tuple[str, ...]
    channels: NDArray[np.float64]
    axis_unit: str
    header: Mapping[str, Sequence[str]]


def decode(path: Path, content: bytes, options: ReadOptions) -> Recording:
    """Return the FRF in a LabVIEW measurement file: the only segment, or the one with the number `index`.

    Raises
    ------
    MeasurementError
        Not such a file, a damaged file, several segments, time records, channels that are not an FRF.
    DovetailError
        lvm_read is not installed.
    """
    if options.response is not None or options.force is not None:
        raise MeasurementError(Fault(str(path), "DOFs choose no FRF of this file.", "index, the number of a segment"))
    segment = _chosen(path, read_segments(path, content), options.index)
    cells, below = ("frequency", *segment.names), (segment.axis_unit, *segment.units)
    if options.columns:
        check_columns(options)
        if len(options.columns) != len(cells):
            problem = f"the segment has {len(cells)} columns, and {len(options.columns)} are named."
            raise MeasurementError(Fault(segment.where, problem, ",".join(options.columns)))
        header = read_header("the argument columns", options.columns, (), {}, {})
    elif segment.dimension != _FREQUENCY:
        problem = f"the abscissa is {segment.dimension}, the channels are {listing(segment.names)}."
        remedy = (
            "FRFs of time records: dovetail frf. If it is a frequency: `columns=['frequency', 'real', 'imag', 'skip']`."
        )
        raise MeasurementError(Fault(segment.where, problem, "an abscissa of frequency", remedy))
    else:
        header = read_header(segment.where, cells, below, options.names, {})
    rows = np.vstack([segment.axis, segment.channels])
    arrays = {field: rows[column] for field, column in header.columns.items()}
    used = [column - 1 for field, column in header.columns.items() if field in VALUE_FIELDS]
    found = read_texts(texts_of(segment, used), options.skip)
    return recording_of(path, header, arrays, lambda index: f"{segment.where}, line {index + 1}", found)


def texts_of(segment: Segment, channels: Sequence[int]) -> list[tuple[str, str, str]]:
    """Return the header's texts about some channels, each with its key and its place."""
    texts = []
    for key, cells in segment.header.items():
        if key not in _READ:
            wanted = [cells[channel] for channel in channels if channel < len(cells)] if len(cells) > 1 else cells
            texts += [
                (key, str(cell), f"{segment.where}  {key}") for cell in dict.fromkeys(wanted) if str(cell).strip()
            ]
    return texts


def _chosen(path: Path, segments: list[Segment], index: int | None) -> Segment:
    if index is None and len(segments) == 1:
        return segments[0]
    if index is None or not 1 <= index <= len(segments):
        rows = "".join(f"\n    {number}: {listing(s.names, 6)}" for number, s in enumerate(segments[:20], start=1))
        problem = f"the file holds {len(segments)} segments, and one is wanted:{rows}"
        raise MeasurementError(Fault(str(path), problem, remedy="Choose it by its number, for example `index=1`."))
    return segments[index - 1]


def read_segments(path: Path, content: bytes) -> list[Segment]:
    """Return the segments of a file.

    Raises
    ------
    MeasurementError, DovetailError
        As in `decode`.
    """
    lvm_read = require_package("lvm_read", "lvm", str(path))
    text = "\n".join(split_lines(path, content))
    if not text.lstrip().startswith("LabVIEW Measurement"):
        problem = "this is no LabVIEW measurement file: it does not begin with 'LabVIEW Measurement'."
        raise MeasurementError(Fault(str(path), problem))
    if max(map(text.count, "\t,; ")) > _MOST_CELLS:
        raise MeasurementError(Fault(str(path), "the file has too many numbers.", f"at most {_MOST_CELLS:,}"))
    with damage_reported(str(path), "the LabVIEW file is damaged"):  # ValueError, KeyError, SyntaxError and others
        parsed = lvm_read.read_str(text)
        return [_segment(path, parsed, number) for number in range(parsed["Segments"])]


def _segment(path: Path, parsed: dict[Any, Any], number: int) -> Segment:
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
    axis = table[:, 0] if kind == "One" else _even_axis(where, fields, len(table))
    units = [str(label).strip() for label in fields.get("Y_Unit_Label", ())][: len(names)]
    return Segment(
        where=where,
        dimension=(next(iter(fields.get("X_Dimension", ())), "") or _TIME).strip().lower(),
        axis=axis,
        names=tuple(names),
        units=(*units, *[""] * (len(names) - len(units))),
        channels=channels,
        axis_unit=next(iter(fields.get("X_Unit_Label", ())), "").strip(),
        header=_header(parsed) | _header(fields),
    )


def _header(entries: Mapping[Any, Any]) -> dict[str, Sequence[str]]:
    """Return the entries of a header that are texts, or lists of them."""
    texts: dict[str, Sequence[str]] = {}
    for key, value in entries.items():
        cells = value if isinstance(value, list) else [value]
        if isinstance(key, str) and all(isinstance(cell, (str, int, float)) for cell in cells):
            texts[key] = [str(cell) for cell in cells]
    return texts


def _even_axis(where: str, fields: dict[str, Any], count: int) -> NDArray[np.float64]:
    first, step = (float(fields.get(name, [math.nan])[0]) for name in ("X0", "Delta_X"))
    if not (math.isfinite(first) and math.isfinite(step) and step > 0):
        raise MeasurementError(Fault(where, f"the abscissa has X0 = {first:g} and Delta_X = {step:g}."))
    return np.asarray(first + step * np.arange(count), dtype=np.float64)
