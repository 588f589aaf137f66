"""Time records that a format states one by one: the pairs of a force and a response."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from dovetail.errors import Fault, MeasurementError
from dovetail.interfaces import RecordedSignal
from dovetail.measurement.frf_units import read_unit
from dovetail.measurement.impact_test.records import AxisFact, Pair, Point, TimeRecord
from dovetail.measurement.impact_test.remarks import Remarks
from dovetail.measurement.quantity_words import read_label

_Numbered = tuple[int, RecordedSignal]


def read_sets(path: Path, signals: Sequence[RecordedSignal], remarks: Remarks) -> list[Pair]:
    """Return force and response of each impact.

    Parameters
    ----------
    path : Path
    signals : sequence of RecordedSignal
        In the order of the file.
    remarks : Remarks
        Receives the numbers in texts that may act on the samples.

    Raises
    ------
    MeasurementError
        No time records, or no pairs of a force and a motion.
    """
    numbered = list(enumerate(signals))
    forces = [pair for pair in numbered if _is_force(pair[1])]
    motions = [pair for pair in numbered if not _is_force(pair[1])]
    if not forces or len(motions) < len(forces):
        problem = f"the file holds {len(forces)} time records of a force and {len(motions)} of a motion."
        accepted = "a pair for each impact (function type 1, data type 13 a force)"
        raise MeasurementError(Fault(str(path), problem, accepted))
    read = [_record(signal, _is_force(signal), remarks) for signal in signals]
    pairs = _paired(path, forces, motions)
    if len({(force[0], _point(motion[1].point).name) for force, motion in pairs}) < len(pairs):
        problem = (
            f"the file holds {len(motions)} time records of a motion for {len(forces)} of a force at the same point."
        )
        raise MeasurementError(Fault(str(path), problem, "nodes and directions that distinguish the sensors"))
    return [_with_points(read[force[0]], read[motion[0]], force[1], motion[1]) for force, motion in pairs]


def _paired(path: Path, forces: Sequence[_Numbered], motions: Sequence[_Numbered]) -> list[tuple[_Numbered, _Numbered]]:
    """Return force and motion of each impact; a force may belong to several motions.

    Each response DOF has as many records as there are forces, in the order of the impacts; or there are as many motions
    as forces; or each motion follows its force.
    """
    dofs: dict[str, list[_Numbered]] = {}
    for motion in motions:
        dofs.setdefault(_point(motion[1].point).name, []).append(motion)
    if all(len(group) == len(forces) for group in dofs.values()):
        return [pair for group in dofs.values() for pair in zip(forces, group, strict=True)]
    if len(motions) == len(forces):
        return list(zip(forces, motions, strict=True))
    pairs = []
    for motion in motions:
        before = [force for force in forces if force[0] < motion[0]]
        if not before:
            problem = f"the file holds {len(forces)} time records of a force and {len(motions)} of a motion."
            remedy = "Put the motions of each impact behind its force."
            raise MeasurementError(Fault(str(path), problem, remedy=remedy))
        pairs.append((before[-1], motion))
    return pairs


def _is_force(signal: RecordedSignal) -> bool:
    if signal.role:
        return signal.role == "force"
    units = [read_unit(one.text) for one in signal.statements if one.about in ("unit", "load unit")]
    labels = [read_label(one.text) for one in signal.statements if one.about in ("label", "load label")]
    is_load = any(reading is not None and reading.kind == "load" for reading in units)
    return is_load or any(label.moments and not label.motions for label in labels)


def _record(signal: RecordedSignal, is_force: bool, remarks: Remarks) -> TimeRecord:
    about: dict[Any, Any] = {"unit": "load unit", "label": "load label"} if is_force else {"unit": "motion unit"}
    declared = [
        statement._replace(about=about.get(statement.about, statement.about))
        for statement in signal.statements
        if statement.about not in ("text", "axis unit", "axis label")
    ]
    said = Remarks(skip=remarks.skip)
    for text in (statement for statement in signal.statements if statement.about == "text"):
        if text.key:
            said.read(text.key, text.text, text.where, "force" if is_force else "response")
        else:
            said.read_line(text.text, text.where)
    remarks.take_over(said)
    statements = said.of("force" if is_force else "response", declared)
    samples = np.asarray(signal.samples, dtype=np.float64)
    axis = (*_axis(signal), *said.facts())
    return TimeRecord(signal.where, samples, statements, axis, is_si_file=signal.is_si_file)


def _axis(signal: RecordedSignal) -> list[AxisFact]:
    """Return the times, once for each unit that labels state."""
    if signal.times is None:
        return []
    units = [one.text for one in signal.statements if one.about == "axis unit"]
    units += [unit for one in signal.statements if one.about == "axis label" for unit in read_label(one.text).units]
    times = np.asarray(signal.times, dtype=np.float64)
    return [AxisFact("times", times, unit, signal.where) for unit in dict.fromkeys(units) or [""]]


def _with_points(force: TimeRecord, motion: TimeRecord, one: RecordedSignal, other: RecordedSignal) -> Pair:
    """Return a pair with its points. A force has its own, or that of the reference that it shares with its response."""
    pushed, moved, reference = _point(one.point), _point(other.point), _point(other.reference)
    if one.reference and (not one.point or (one.point, one.reference) == (other.point, other.reference)):
        pushed = _point(one.reference)
    pushed = pushed if pushed.label else reference
    return force._replace(point=pushed), motion._replace(point=moved, reference=reference)


def _point(label: str) -> Point:
    is_negative = re.search(r"\d-", label.rpartition(":")[2]) is not None
    return Point(label.replace("-", "").replace("+", ""), label, -1.0 if is_negative else 1.0)
