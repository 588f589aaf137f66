"""Time records of impact tests in tables, in arrays of columns, and in channels."""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.errors import Fault, MeasurementError, did_you_mean
from dovetail.interfaces import RecordedChannels, Statement
from dovetail.measurement.content.text_tables import find_rows, find_table, read_rows
from dovetail.measurement.frf_units import read_unit
from dovetail.measurement.impact_test.records import AxisFact, Pair, Point, TimeRecord
from dovetail.measurement.impact_test.remarks import Remarks
from dovetail.measurement.impact_test.signal_names import Role, SignalName, read_name
from dovetail.measurement.point_statements import PointStatement

Array = NDArray[np.float64]
_HEADERS = "time,force,response | time,force 1,response 1,..."
_SKIP = "skip"
_SLASH = re.compile(r"(.+?)\s+/\s+(\S.*)")
"""A name and its unit according to DIN 1313: ``Force / N``."""
_CHANNEL = re.compile(r"(?:ch|chan|channel|sensor|input|ai)\W*\d+|[+-]?\s?[xyz]|\d+[+-]?[xyz]?", re.IGNORECASE)
"""Brackets with the number of a channel or a direction, not a unit."""
_BRACKET = re.compile(r"([^\[(]*?)\s*[\[(](.*)[\])]")


class _Column:
    """A column of a table, or a channel."""

    def __init__(self, name: str, unit: str, signal: SignalName, where: str) -> None:
        self.name, self.unit, self.signal, self.where = name, unit, signal, where

    def record(self, samples: Array, axis: Sequence[AxisFact], remarks: Remarks) -> TimeRecord:
        """Return the record of these samples."""
        role = self.signal.role
        if self.signal.unclear:
            problem = f"'{self.name}' holds '{self.signal.unclear}', not samples in a unit."
            raise MeasurementError(Fault(self.where, problem, "forces and motions in their units, or voltages"))
        label: Any = "load label" if role == "force" else "label"
        about: Any = "load unit" if role == "force" else "motion unit"
        statements = [Statement(label, self.signal.label or self.name, self.where)]
        statements += [Statement(about, unit, self.where) for unit in (self.unit, *self.signal.units) if unit]
        point = remarks.point(role, Point(self.signal.point, self.signal.point, self.signal.sign))
        if self.signal.others and not point.name and (role == "force" or role == "response"):
            remarks.named_points.append(PointStatement(role, self.signal.others))
        is_acceleration = self.signal.is_acceleration
        return TimeRecord(
            self.where, samples, remarks.of(role, statements), tuple(axis), point, is_acceleration=is_acceleration
        )


def read_table(path: Path, text: str, columns: Sequence[str], names: dict[str, str], remarks: Remarks) -> list[Pair]:
    """Return force and response of each impact in a table.

    Parameters
    ----------
    path : Path
    text : str
    columns : sequence of str
        The columns, instead of the table's header.
    names : dict of str to str
        From ``force``, ``response`` and ``time`` to the names of columns, as the caller gives them.
    remarks : Remarks
        Receives what the lines above state.

    Raises
    ------
    MeasurementError
        No header, or no pairs of a force and a response.
    """
    lines = text.split("\n")
    if columns:
        wanted = [number for number, one in enumerate(_named(columns, names)) if one.role]
        table = find_rows(str(path), lines, columns, wanted)
    else:
        remedy = "Say what each column holds: `columns=['time', 'force', 'response', 'skip']`."
        table = find_table(str(path), lines, lambda cells: _has_force(cells, names), _HEADERS, remedy)
    for number, line in enumerate(table.lines[: table.line]):
        if not columns or line.lstrip()[:1] in ("#", "%"):
            remarks.read_line(line, f"{path}:{number + 1}")
    where = "the argument columns" if columns else f"{path}:{table.line + 1}"
    found = _columns(where, table.header, table.units if not columns else (), names)
    used = [number for number, column in enumerate(found) if column.signal.role]
    _check_pairs(where, found)
    _, rows = read_rows(table, table.header, used)
    return _pairs(where, [found[number] for number in used], rows, remarks)


def read_columns(path: Path, array: NDArray[Any], columns: Sequence[str], remarks: Remarks) -> list[Pair]:
    """Return force and response of each impact in an array of (n_samples, n_columns) numbers, or of its transpose.

    Raises
    ------
    MeasurementError
        As in `read_table`, or an array of another shape.
    """
    if array.ndim != 2 or array.dtype.kind not in "fiu" or len(columns) not in array.shape:
        problem = (
            f"the array has the shape {array.shape} and the type {array.dtype}, and {len(columns)} columns are named."
        )
        remedy = "Say what each column holds: `columns=['time', 'force', 'response', 'skip']`."
        raise MeasurementError(Fault(str(path), problem, "real numbers (n_samples, n_columns)", remedy))
    table = array if array.shape[1] == len(columns) else array.T
    found = _columns("the argument columns", columns, (), {})
    _check_pairs("the argument columns", found)
    used = [number for number, column in enumerate(found) if column.signal.role]
    rows = table.T[used].astype(np.float64)
    return _pairs(str(path), [found[number] for number in used], rows, remarks)


def _named(cells: Sequence[str], names: dict[str, str]) -> list[SignalName]:
    """Return what each name of a column states, where the caller's names replace those of the table."""
    bare = _names_and_units(cells)[0]
    signals = [SignalName("") if name in ("", _SKIP) else read_name(name) for name in bare]
    for part, chosen in names.items():
        role: Any = {"time": "times"}.get(part, part)
        for number, (name, cell) in enumerate(zip(bare, cells, strict=True)):
            if chosen in (name, cell):
                signals[number] = read_name(name, role)
            elif signals[number].role == role:
                signals[number] = SignalName("")
    return signals


def _names_and_units(cells: Sequence[str]) -> tuple[list[str], list[str]]:
    """Split cells such as ``Force [N]`` or ``Force / N`` into names and units."""
    names, units = list(cells), [""] * len(cells)
    for number, cell in enumerate(cells):
        match = _BRACKET.fullmatch(cell) or _SLASH.fullmatch(cell)
        if match and (cell.endswith((")", "]")) or read_name(match[1]).role):
            names[number], units[number] = match[1], match[2].strip("[]()")
    return names, units


def _has_force(cells: Sequence[str], names: dict[str, str]) -> bool:
    return any(one.role == "force" for one in _named(cells, names))


def _columns(where: str, cells: Sequence[str], below: Sequence[str], names: dict[str, str]) -> list[_Column]:
    bare, units = _names_and_units(cells)
    named = _named(cells, names)
    for part, chosen in names.items():
        if chosen not in (*bare, *cells):
            hint = did_you_mean(chosen, bare)
            raise MeasurementError(Fault(where, f"there is no '{chosen}' for the {part}.", remedy=hint))
    columns = []
    for number, cell in enumerate(cells):
        unit = "" if units[number].isdigit() else units[number]
        row = below[number].strip("[]()") if below else ""
        signal = named[number]
        if unit and row and read_unit(unit) != read_unit(row):
            problem = f"'{cell[:60]}' has the unit '{row[:40]}' in the row below."
            raise MeasurementError(Fault(where, problem, "one unit"))
        if unit and not signal.role.startswith(("times", "force", "response")):
            unit = ""
        if unit and read_unit(unit) is None and signal.role in ("force", "response"):
            signal = read_name(cell, signal.role)  # brackets with a word, such as (Trigger)
            is_word = (unit.replace(" ", "").isalpha() and len(unit) > 3) or _CHANNEL.fullmatch(unit)
            unit = "" if is_word or signal.impact or signal.point else unit
        columns.append(_Column(cell if not unit else bare[number], unit or row, signal, where))
    return columns


def _check_pairs(where: str, columns: Sequence[_Column]) -> None:
    """Refuse other columns than pairs of force and response and one time, in units of a time, a force and a motion."""
    forces, responses, times = (
        [c for c in columns if c.signal.role == role] for role in ("force", "response", "times")
    )
    if not forces or len(forces) != len(responses):
        problem = f"the header has {len(forces)} columns of force and {len(responses)} of response."
        remedy = (
            "Choose the columns: `names={'force': 'NAME', 'response': 'NAME'}`, "
            "or `columns=['time', 'force', 'response', 'skip']`."
        )
        raise MeasurementError(Fault(where, problem, _HEADERS, remedy))
    if len(times) > 1:
        raise MeasurementError(Fault(where, f"the header has {len(times)} columns of time.", _HEADERS))
    for column in times:
        reading = read_unit(column.unit) if column.unit else None
        if column.unit and (reading is None or reading.kind not in ("time", "none")):
            units = ", ".join(column.unit for column in columns if column.unit)
            raise MeasurementError(Fault(where, f"the columns are in {units}.", "s, N, g"))


def _pairs(where: str, columns: Sequence[_Column], rows: Array, remarks: Remarks) -> list[Pair]:
    by_role: dict[Role, list[int]] = {"force": [], "response": [], "times": []}
    for number, column in enumerate(columns):
        by_role.setdefault(column.signal.role, []).append(number)
    axis = list(remarks.facts())
    for number in by_role["times"]:
        column = columns[number]
        unit = column.unit or column.signal.unit
        if column.unit and column.signal.unit and read_unit(column.unit) != read_unit(column.signal.unit):
            problem = (
                f"'{column.name[:60]}' is in '{column.signal.unit}' by its name, and in '{column.unit}' elsewhere."
            )
            raise MeasurementError(Fault(where, problem, "one unit"))
        axis.append(remarks.with_unit(AxisFact("times", np.ascontiguousarray(rows[number]), unit, column.where)))
    forces, responses = by_role["force"], by_role["response"]
    for part in (forces, responses):
        if len({columns[number].signal.others for number in part}) > 1:  # other words name points
            for number in part:
                signal = columns[number].signal
                columns[number].signal = signal._replace(point=f"{signal.others} {signal.point}".strip())
    numbers = [[columns[number].signal.impact for number in part] for part in (forces, responses)]
    if len(forces) > 1 and any(chain(*numbers)):
        if any(len(set(part)) < len(part) for part in numbers) or set(numbers[0]) != set(numbers[1]):
            problem = "the numbers of the columns of force and response are not the same."
            raise MeasurementError(Fault(where, problem, _HEADERS))
        responses = [responses[numbers[1].index(number)] for number in numbers[0]]
    return [
        (columns[one].record(rows[one], axis, remarks), columns[other].record(rows[other], axis, remarks))
        for one, other in zip(forces, responses, strict=True)
    ]


def read_channels(segments: Sequence[RecordedChannels], names: dict[str, str], remarks: Remarks) -> list[Pair]:
    """Return force and response of each segment of channels.

    Raises
    ------
    MeasurementError
        A segment without one force and one response over time.
    """
    pairs = []
    for segment in segments:
        columns = _columns(segment.where, segment.names, (), names)
        chosen = [
            [n for n, column in enumerate(columns) if column.signal.role == role] for role in ("force", "response")
        ]
        if segment.dimension != "time" or any(len(part) != 1 for part in chosen):
            problem = f"the abscissa is {segment.dimension}, the channels are {', '.join(segment.names[:20])}."
            accepted = "time, and channels whose names begin with Force and Response, one of each"
            remedy = "Choose the channels: `names={'force': 'NAME', 'response': 'NAME'}`."
            raise MeasurementError(Fault(segment.where, problem, accepted, remedy))
        axis = [AxisFact("times", segment.axis, segment.axis_unit, segment.where)]
        axis += [AxisFact("step", step, segment.axis_unit, where) for step, where in segment.steps]
        axis += remarks.facts()
        force, response = (_channel(segment, part[0], columns[part[0]], axis, remarks) for part in chosen)
        pairs.append((force, response))
    return pairs


def _channel(
    segment: RecordedChannels, number: int, column: _Column, axis: Sequence[AxisFact], remarks: Remarks
) -> TimeRecord:
    unit = segment.units[number]
    column.unit = column.unit or unit
    if column.unit and unit and read_unit(column.unit) != read_unit(unit):
        problem = f"'{column.name}' has the unit '{unit}' in the header."
        raise MeasurementError(Fault(segment.where, problem, "one unit"))
    attached = Remarks(skip=remarks.skip)
    role: Role = column.signal.role
    for one in (*segment.statements, *(segment.channel_statements[number] if segment.channel_statements else ())):
        attached.read(one.key or "comment", one.text, one.where, role)
    remarks.take_over(attached)
    record = column.record(segment.channels[number], axis, remarks)
    return record._replace(statements=(*record.statements, *attached.statements[role]))
