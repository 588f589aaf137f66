"""Time records of impact tests in files of named arrays: NPZ, NPY, MATLAB and HDF5."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from itertools import islice
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.errors import Fault, MeasurementError, did_you_mean, listing
from dovetail.interfaces import ArrayEntry, RecordedArrays, Statement
from dovetail.measurement.impact_test.records import AxisFact, Pair, Point, TimeRecord
from dovetail.measurement.impact_test.remarks import Remarks
from dovetail.measurement.impact_test.signal_names import SignalName, read_name
from dovetail.measurement.quantity_words import words_of

Array = NDArray[np.float64]
_PARTS = {"force": "force", "response": "response", "rate": "rate", "time": "times"}
"""Parts that the caller may name, and their roles."""
_GENERIC = frozenset(("data", "values", "value", "y", "samples", "signal"))
"""Last parts of a path that are named by the part in front."""
_MOST_ENTRIES = 200
_SMALL = 64
_POINTS = frozenset(("node", "nodes", "dof", "dofs", "point", "points", "position", "positions", "direction"))


def read_archive(archive: RecordedArrays, chosen: Mapping[str, str], remarks: Remarks) -> list[Pair]:
    """Return force and response of each impact in a file of named arrays.

    Parameters
    ----------
    archive : RecordedArrays
    chosen : mapping of str to str
        Names of ``force``, ``response``, ``rate`` and ``time``, as the caller gives them.
    remarks : Remarks
        Receives what other entries state.

    Raises
    ------
    MeasurementError
        Force or response are missing, or several arrays may be one of them; arrays of other shapes.
    """
    names = _named(archive, chosen)
    forces, responses = (_signals(archive, names, signal, chosen) for signal in ("force", "response"))
    if not forces or not responses:
        held = ", ".join(list(archive.entries)[:20]) or "nothing"
        accepted = "arrays force and response, of shape (n_impacts, n_samples), and rate or time"
        raise MeasurementError(
            Fault(str(archive.path), f"a force or a response is missing; the file holds: {held}.", accepted)
        )
    _read_others(archive, names, remarks)
    points = _points_of_impacts(archive, names)
    pairs = []
    for number, force_name in enumerate(forces):
        force, response = _rows(archive, force_name), _rows(archive, responses[number])
        if force.shape != response.shape:
            problem = f"the force has the shape {force.shape}, the response {response.shape}."
            raise MeasurementError(Fault(str(archive.path), problem, "the same shape (n_impacts, n_samples)"))
        axis = _axis(archive, names, force.shape, remarks)
        pushed = _record(archive, force_name, names[force_name], "force", remarks)
        moved = _record(archive, responses[number], names[responses[number]], "response", remarks)
        for row, (pulse, signal) in enumerate(zip(force, response, strict=True)):
            times = tuple(_row_of(fact, row) for fact in axis)
            point = Point(points[row], points[row]) if len(points) == len(force) else pushed.point
            hit = pushed._replace(samples=pulse, axis=(*pushed.axis, *times), point=point)
            pairs.append((hit, moved._replace(samples=signal, axis=(*moved.axis, *times))))
    return pairs


def _named(archive: RecordedArrays, chosen: Mapping[str, str]) -> dict[str, SignalName]:
    """Return what the name of each entry states; the caller's names replace those of the file."""
    names = {}
    for name in archive.entries:
        parts = re.split(r"[/.]", name)
        word = parts[-2] if len(parts) > 1 and parts[-1].lower() in _GENERIC else parts[-1]
        names[name] = read_name(word)
        if _POINTS & set(words_of(word)) and not _is_array(archive, name):
            names[name] = SignalName("")
    for part, name in chosen.items():
        if name not in archive.entries:
            hint = did_you_mean(name, archive.entries)
            raise MeasurementError(Fault(str(archive.path), f"there is no '{name}' in the file.", remedy=hint))
        names = {key: SignalName("") if signal.role == _PARTS[part] else signal for key, signal in names.items()}
    for part, name in chosen.items():
        role: Any = _PARTS[part]
        names[name] = read_name(re.split(r"[/.]", name)[-1], role)
    return names


def _signals(
    archive: RecordedArrays, names: Mapping[str, SignalName], role: str, chosen: Mapping[str, str]
) -> list[str]:
    """Return the arrays of a signal: one, or one for each impact in the order of their numbers."""
    found = [name for name, one in names.items() if one.role == role and (role in chosen or _is_array(archive, name))]
    numbers = [names[name].impact for name in found]
    others = [one.impact for one in names.values() if one.role == ("response" if role == "force" else "force")]
    if len(found) > 1 and (not all(numbers) or len(set(numbers)) < len(numbers) or set(numbers) != set(others)):
        raise MeasurementError(Fault(str(archive.path), f"{listing(found)} may each be the {role}: say which."))
    return sorted(found, key=lambda name: [int(number) for number in names[name].impact.split()])


def _is_array(archive: RecordedArrays, name: str) -> bool:
    array = archive.entries[name].load()
    return array.dtype.kind in "fiu" and (array.size > 1 if not _POINTS & set(words_of(name)) else array.size > _SMALL)


def _numbers(archive: RecordedArrays, name: str, most_axes: int = 2) -> Array:
    array = archive.entries[name].load()
    if array.dtype.kind not in "fiu" or array.ndim > most_axes:
        problem = f"'{name}' has the shape {array.shape} and the type {array.dtype}."
        raise MeasurementError(Fault(str(archive.path), problem, "real numbers, and one rate"))
    return array.astype(np.float64)


def _points_of_impacts(archive: RecordedArrays, names: Mapping[str, SignalName]) -> list[str]:
    """Return the points of the impacts of a roving hammer, if an entry lists several."""
    for name in archive.entries:
        if _POINTS & set(words_of(name)) and not names[name].role:
            array = archive.entries[name].load()
            if array.dtype.kind in "iufU" and np.unique(array).size > 1:
                return [f"{one:g}" if array.dtype.kind in "iuf" else str(one) for one in array.flat]
    return []


def _rows(archive: RecordedArrays, name: str) -> Array:
    """Return records as rows; in MATLAB, a single record, and often several, are columns."""
    table = np.atleast_2d(_numbers(archive, name))
    return table.T if table.shape[0] > table.shape[1] else table


def _record(archive: RecordedArrays, name: str, signal: SignalName, role: str, remarks: Remarks) -> TimeRecord:
    """Return a record without its samples: what name, attributes and other entries state about it."""
    where = f"{archive.path}  {name}"
    if signal.unclear:
        problem = f"'{name}' holds '{signal.unclear}', not samples in a unit."
        raise MeasurementError(Fault(str(archive.path), problem, "forces and motions in their units, or voltages"))
    attached = Remarks(skip=remarks.skip)
    for key, text in archive.entries[name].attributes.items():
        attached.read(key, text, f"{where}  {key}", "force" if role == "force" else "response")
    remarks.take_over(attached)
    label = "load label" if role == "force" else "label"
    unit = "load unit" if role == "force" else "motion unit"
    own = [Statement(label, signal.label or re.split(r"[/.]", name)[-1], where)]  # type: ignore[arg-type]
    own += [Statement(unit, one, where) for one in signal.units]  # type: ignore[arg-type]
    statements = remarks.of(role, [*own, *attached.statements[role]])
    point = remarks.point(role, attached.point(role, Point(signal.point, signal.point, signal.sign)))
    dtype = archive.entries[name].load().dtype
    is_counts = dtype.kind in "iu" and dtype.itemsize <= 2  # bytes of a number
    return TimeRecord(
        where,
        np.zeros(0),
        statements,
        attached.facts(),
        point,
        is_acceleration=signal.is_acceleration,
        is_counts=is_counts,
    )


def _axis(
    archive: RecordedArrays,
    names: Mapping[str, SignalName],
    shape: tuple[int, ...],
    remarks: Remarks,
) -> list[AxisFact]:
    """Return the facts on the times of the records, of which those of the file hold for all."""
    facts = list(remarks.facts())
    for name, signal in names.items():
        if signal.role not in ("times", "rate", "step", "start"):
            continue
        where = f"{archive.path}  {name}"
        array = _numbers(archive, name)
        attributes = archive.entries[name].attributes
        unit = signal.unit or next((attributes[key] for key in ("unit", "units") if key in attributes), "")
        if signal.role == "times" and array.size > 1:
            if array.size not in (shape[1], shape[0] * shape[1]):
                problem = f"'{name}' has the shape {array.shape}, and the records have {shape[1]} samples."
                raise MeasurementError(Fault(str(archive.path), problem, "a time for each sample"))
            value: Any = array.ravel() if array.size == shape[1] else _rows(archive, name)
        elif np.unique(array).size == 1:
            value = float(array.reshape(-1)[0])
        else:
            problem = f"'{name}' has the shape {array.shape} and the type {array.dtype}."
            raise MeasurementError(Fault(str(archive.path), problem, "real numbers, and one rate"))
        if signal.role != "times" or array.size > 1:
            facts.append(remarks.with_unit(AxisFact(signal.role, value, unit, where)))
    return facts


def _row_of(fact: AxisFact, row: int) -> AxisFact:
    value = np.asarray(fact.value)
    return fact._replace(value=value[row]) if value.ndim == 2 else fact


def _read_others(archive: RecordedArrays, names: Mapping[str, SignalName], remarks: Remarks) -> None:
    """Read the entries and attributes that are neither signals nor times."""
    for key, text in archive.attributes.items():
        remarks.read(key, text, f"{archive.path}  {key}")
    for group, attributes in archive.group_attributes.items():
        for key, text in attributes.items():
            remarks.read(key, text, f"{archive.path}  {group}{key}")
    for name, entry in islice(_unread(archive, names), _MOST_ENTRIES):
        try:
            array = entry.load()
        except MeasurementError:  # a value of another kind, which states nothing that can be read
            continue
        key = " ".join(re.split(r"[/.]", name)[-2:])
        where = f"{archive.path}  {name}"
        if array.dtype.kind in "US" and 0 < array.size <= _SMALL:
            words = [_as_text(word) for word in array.flat]
            remarks.read(key, ", ".join(words), where)
            for word in words if len(words) > 1 else ():
                if ":" in word:
                    remarks.read_line(word, where)
        elif array.dtype.kind == "b" and array.size == 1 and array.all():
            remarks.read_line(re.sub(r"[\W_]+", " ", name), where)
        elif array.dtype.kind in "fiu" and 0 < array.size <= _SMALL:
            remarks.read(key, " ".join(f"{float(number)!r}" for number in np.unique(array)), where)


def _as_text(word: str | bytes) -> str:
    return word.decode("utf-8", "replace") if isinstance(word, bytes) else str(word)


def _unread(archive: RecordedArrays, names: Mapping[str, SignalName]) -> Iterator[tuple[str, ArrayEntry]]:
    """Yield the small entries that are neither samples nor times."""
    for name, entry in archive.entries.items():
        describes_signal = names[name].role in ("force", "response") and not _is_array(archive, name)
        if entry.is_small and (not names[name].role or describes_signal):
            yield name, entry
