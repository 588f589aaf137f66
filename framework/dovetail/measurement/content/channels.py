"""FRFs in channels over an abscissa of frequency, such as the segments of a LabVIEW file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from dovetail.errors import Fault, MeasurementError, listing
from dovetail.interfaces import RecordedChannels
from dovetail.measurement.content.column_names import VALUE_FIELDS
from dovetail.measurement.content.tables import check_columns, read_header, recording_of
from dovetail.measurement.free_text import read_statements
from dovetail.measurement.recording import ReadOptions, Recording

_FREQUENCY = "frequency"


def decode_channels(path: Path, segments: Sequence[RecordedChannels], options: ReadOptions) -> Recording:
    """Return the FRF in the only segment of a file, or in the one with the number `index`.

    Raises
    ------
    MeasurementError
        Several segments, time records, channels that are not an FRF.
    """
    if options.response is not None or options.force is not None:
        raise MeasurementError(Fault(str(path), "DOFs choose no FRF of this file.", "index, the number of a segment"))
    segment = _choose(path, segments, options.index)
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
    statements = [*segment.statements]
    statements += [one for channel in used for group in segment.channel_statements[channel:][:1] for one in group]
    found = read_statements(statements, options.skip)
    return recording_of(path, header, arrays, lambda index: f"{segment.where}, line {index + 1}", found)


def _choose(path: Path, segments: Sequence[RecordedChannels], index: int | None) -> RecordedChannels:
    if index is None and len(segments) == 1:
        return segments[0]
    if index is None or not 1 <= index <= len(segments):
        rows = "".join(f"\n    {number}: {listing(s.names, 6)}" for number, s in enumerate(segments[:20], start=1))
        problem = f"the file holds {len(segments)} segments; choose one:{rows}"
        raise MeasurementError(Fault(str(path), problem, remedy="Choose it by its number, for example `index=1`."))
    return segments[index - 1]
