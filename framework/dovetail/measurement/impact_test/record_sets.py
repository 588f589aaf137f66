"""Time records of impact tests in universal files."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.errors import Fault, MeasurementError
from dovetail.measurement.formats.uff_reader import read_data
from dovetail.measurement.formats.uff_sets import FORCE, ORDINATE, TIME, UffSet, scan_sets
from dovetail.measurement.formats.uff_statements import check_unit_system
from dovetail.measurement.frf_units import read_unit
from dovetail.measurement.impact_test.records import AxisFact, Pair, Point, TimeRecord
from dovetail.measurement.impact_test.remarks import Remarks
from dovetail.measurement.quantity_words import read_label
from dovetail.measurement.statements import Statement

Array = NDArray[np.float64]
_UNKNOWN = (0, 1)
_WORDS = {number: name for number, name, _ in ORDINATE.values()}
_TIME_TYPES = (0, 1, 17)
_NO_LABEL = ("", "none")
_COUNTS = ("sample", "samples", "point", "points", "index", "n", "#")
"""Units of an abscissa that counts samples, so that the rate is not stated."""


def read_sets(path: Path, content: bytes, remarks: Remarks) -> list[Pair]:
    """Return force and response of each impact in a universal file.

    Parameters
    ----------
    path : Path
    content : bytes
    remarks : Remarks
        Receives the numbers in id lines that may act on the samples.

    Raises
    ------
    MeasurementError
        No time responses, or no pairs of a force and a motion.
    """
    every = scan_sets(path, content)
    sets = [uff_set for uff_set in every if uff_set.function == TIME]
    forces = [uff_set for uff_set in sets if _is_force(uff_set)]
    motions = [uff_set for uff_set in sets if not _is_force(uff_set)]
    if not forces or len(motions) < len(forces):
        problem = f"the file holds {len(forces)} time records of a force and {len(motions)} of a motion."
        accepted = "a pair for each impact (function type 1, data type 13 a force)"
        raise MeasurementError(Fault(str(path), problem, accepted))
    is_si_file = check_unit_system(content, every)
    read: dict[int, TimeRecord] = {}
    for uff_set in sets:
        record = _record(content, uff_set, _is_force(uff_set), remarks)
        read[uff_set.number] = record._replace(is_si_file=is_si_file)
    pairs = _paired(path, sets, forces, motions)
    if len({(one.number, other.points[0], abs(other.points[1])) for one, other in pairs}) < len(pairs):
        problem = (
            f"the file holds {len(motions)} time records of a motion for {len(forces)} of a force at the same point."
        )
        raise MeasurementError(Fault(str(path), problem, "nodes and directions that tell the sensors from one another"))
    return [_with_points(read[one.number], read[other.number], one, other) for one, other in pairs]


def _paired(
    path: Path, sets: Sequence[UffSet], forces: Sequence[UffSet], motions: Sequence[UffSet]
) -> list[tuple[UffSet, UffSet]]:
    """Return force and motion of each impact; a force may belong to several motions.

    Each response DOF has as many records as there are forces, in the order of the impacts; or there are as many motions
    as forces; or each motion follows its force.
    """
    dofs: dict[tuple[int, int], list[UffSet]] = {}
    for motion in motions:
        dofs.setdefault((motion.points[0], abs(motion.points[1])), []).append(motion)
    if all(len(group) == len(forces) for group in dofs.values()):
        return [pair for group in dofs.values() for pair in zip(forces, group, strict=True)]
    if len(motions) == len(forces):
        return list(zip(forces, motions, strict=True))
    pairs, last = [], None
    for uff_set in sets:
        last = uff_set if uff_set in forces else last
        if uff_set in motions:
            if last is None:
                problem = f"the file holds {len(forces)} time records of a force and {len(motions)} of a motion."
                remedy = "Put the motions of each impact behind its force."
                raise MeasurementError(Fault(str(path), problem, remedy=remedy))
            pairs.append((last, uff_set))
    return pairs


def _is_force(uff_set: UffSet) -> bool:
    kind = uff_set.fields["ordinate_spec_data_type"]
    if kind not in _UNKNOWN:
        return bool(kind == FORCE)
    reading = read_unit(str(uff_set.fields["ordinate_axis_units_lab"]))
    named = read_label(str(uff_set.fields["ordinate_axis_lab"]))
    return (reading is not None and reading.kind == "load") or bool(named.moments and not named.motions)


def _record(content: bytes, uff_set: UffSet, is_force: bool, remarks: Remarks) -> TimeRecord:
    _check_types(uff_set, is_force)
    fields = uff_set.fields
    times, samples = read_data(content, uff_set)
    if np.iscomplexobj(samples):
        raise MeasurementError(Fault(uff_set.where, "a time record is complex."))
    kind = fields["ordinate_spec_data_type"]
    word = [Statement("motion quantity", _WORDS[kind], f"{uff_set.where}, data type")] if kind in _WORDS else []
    about: Any = ("load label", "load unit") if is_force else ("label", "motion unit")
    texts = [_label(uff_set, name) for name in ("ordinate_axis_lab", "ordinate_axis_units_lab")]
    statements = [*word, *(Statement(a, text, uff_set.where) for a, text in zip(about, texts, strict=True) if text)]
    unit = _label(uff_set, "abscissa_axis_units_lab")
    label = read_label(_label(uff_set, "abscissa_axis_lab"))
    units = {one for one in (unit, *label.units) if one} or {""}
    axis = tuple(AxisFact("times", times, one, uff_set.where) for one in units if one.lower() not in _COUNTS)
    said = Remarks(skip=remarks.skip)
    for line in ("id1", "id2", "id3", "id4", "id5"):
        said.read_line(_label(uff_set, line), f"{uff_set.where}, {line}")
    remarks.numbers += said.numbers
    role = "force" if is_force else "response"
    return TimeRecord(uff_set.where, samples, said.of(role, statements), (*axis, *said.facts()))


def _check_types(uff_set: UffSet, is_force: bool) -> None:
    """Refuse what is not a force or a motion over time, such as a strain, a rotation or an impulse response."""
    fields = uff_set.fields
    kind, below = fields["ordinate_spec_data_type"], fields["orddenom_spec_data_type"]
    if kind not in (*_UNKNOWN, *_WORDS, FORCE):
        name = _label(uff_set, "ordinate_axis_lab")
        accepted = "displacement (8), velocity (11), acceleration (12), excitation force (13)"
        raise MeasurementError(Fault(uff_set.where, f"the data are of type {kind} ('{name}').", accepted))
    if below not in _UNKNOWN or _label(uff_set, "orddenom_axis_units_lab"):
        problem = "the time record has a denominator, as an impulse response has."
        raise MeasurementError(Fault(uff_set.where, problem, "the time record of a force or of a motion"))
    if fields["abscissa_spec_data_type"] not in _TIME_TYPES:
        problem = f"the abscissa is of type {fields['abscissa_spec_data_type']}."
        raise MeasurementError(Fault(uff_set.where, problem, "a time (17)"))
    if abs(fields["rsp_dir"]) > 3 or (is_force and abs(fields["ref_dir"]) > 3):
        raise MeasurementError(
            Fault(uff_set.where, "the record is that of a rotation or a moment.", "directions 1 to 3")
        )


def _label(uff_set: UffSet, field: str) -> str:
    text = str(uff_set.fields[field]).strip()
    return "" if text.lower() in _NO_LABEL else text


def _with_points(force: TimeRecord, motion: TimeRecord, one: UffSet, other: UffSet) -> Pair:
    """Return a pair with its points. A force has its own, or that of the reference that it shares with its response."""
    pushed, moved, reference = _point(one, "rsp"), _point(other, "rsp"), _point(other, "ref")
    own_reference = _point(one, "ref")
    if own_reference.label and (not pushed.label or one.points == other.points):
        pushed = own_reference
    pushed = pushed if pushed.label else reference
    return force._replace(point=pushed), motion._replace(point=moved, reference=reference)


def _point(uff_set: UffSet, end: str) -> Point:
    label = uff_set.response if end == "rsp" else uff_set.force
    code = uff_set.fields[f"{end}_dir"]
    return Point(label.replace("-", "").replace("+", ""), label, -1.0 if code < 0 else 1.0)
