"""FRFs that a format states as such: the choice of one among several, and what everything that it states means."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from numbers import Integral
from pathlib import Path
from typing import Any

import numpy as np

from dovetail.errors import Fault, MeasurementError, PluginError
from dovetail.interfaces import FrfReader, RecordedFrf, RecordedSet, RecordedSignal, Statement, plugin_errors
from dovetail.measurement.changed_values import find_scale
from dovetail.measurement.content.part_units import check_parts
from dovetail.measurement.free_text import FieldClaim, read_statements
from dovetail.measurement.frf_units import meaning_of_unit
from dovetail.measurement.named_points import DOF
from dovetail.measurement.recording import ReadOptions, Recording, point_fields
from dovetail.measurement.statements import Meaning, check_axis, fields_of, meaning_of_file

_SETS_SHOWN = 20


def sets_of(path: Path, recorded: Sequence[RecordedFrf | RecordedSignal | RecordedSet]) -> list[RecordedSet]:
    """Return what a reader returned as sets with numbers, those that it has decoded already too."""
    return [
        one if isinstance(one, RecordedSet) else _set(path, number, one, len(recorded))
        for number, one in enumerate(recorded, start=1)
    ]


def _set(path: Path, number: int, one: RecordedFrf | RecordedSignal, count: int) -> RecordedSet:
    if isinstance(one, RecordedSignal):
        return RecordedSet(number, "signal", f"{number}: {one.role or 'signal'} {one.point}".rstrip(), lambda: one)
    placed = one if one.where else replace(one, where=str(path) if count == 1 else f"{path}: FRF {number}")
    response, force = (text if isinstance(text, str) else "" for text in (one.response, one.force))
    words = " ".join(str(text) for text in (response, "over", force, one.note) if text)
    return RecordedSet(number, "frf", f"{number}: {words}"[:80], lambda: placed, response, force)


def decode_set(path: Path, sets: Sequence[RecordedSet], reader: FrfReader, options: ReadOptions) -> Recording:
    """Return the only FRF of a file, or the one that is chosen by its number or its DOFs.

    Raises
    ------
    MeasurementError
        No FRF or several; statements that are not understood or contradict each other.
    PluginError
        The reader returned something other than an FRF.
    """
    if options.names:
        problem = f"names are for files of named arrays or columns, not for files of the reader '{reader.name}'."
        raise MeasurementError(Fault(str(path), problem))
    chosen = select_set(path, sets, options)
    label = f"reader '{reader.name}'"
    with plugin_errors(reader, label):
        frf = chosen.load()
        if not isinstance(frf, RecordedFrf):
            raise PluginError(Fault(label, f"loading an FRF returned {frf!r:.60}.", "a dovetail.RecordedFrf"))
        _check_arrays(frf, label)
    return _recording_of(path, frf, frf.where or f"{path}: {chosen.number}", reader, options)


def _recording_of(path: Path, frf: RecordedFrf, where: str, reader: FrfReader, options: ReadOptions) -> Recording:
    statements = [*([Statement("unit", frf.unit, where)] if frf.unit else []), *frf.statements]
    if frf.unit:
        meaning_of_unit(frf.unit, where)
    if frf.note and all(one.text != frf.note for one in frf.statements):
        statements.append(Statement("text", frf.note, f"{where}, note"))
    read = read_statements(statements, options.skip)
    meaning, mentioned = meaning_of_file((), read)
    _check_kind(frf, meaning, where)
    has_phase = np.iscomplexobj(frf.values)
    claims = [*read.claims, *([] if has_phase else _claims_of_labels(read.statements))]
    fields, mentions = _fields(frf, meaning, mentioned, where)
    scale = check_axis(meaning, mentions, "Export the frequencies in Hz.")
    frequency = np.asarray(frf.frequency, dtype=np.float64) * scale
    present = [name for name in ("coherence", "variance") if getattr(frf, name) is not None]
    names = dict.fromkeys(["values" if has_phase else "amplitude", *present], "")
    check_parts(names, claims, meaning.unit, where, frf.averages, frequency)
    recording = Recording(
        where=where,
        label=path.name,
        frequency=frequency,
        values=np.asarray(frf.values),
        has_phase=has_phase,
        coherence=None if frf.coherence is None else np.asarray(frf.coherence, dtype=np.float64),
        variance=None if frf.variance is None else np.asarray(frf.variance, dtype=np.float64),
        locate=frf.locate or partial(_line_of_data, where),
        how_to_state_quantity=frf.how_to_state_quantity,
        note=frf.note,
        averages=frf.averages,
        taken=frf.meanings,
        mentions=mentions,
        **fields,
    )
    points = point_fields({"response": frf.response, "force": frf.force, "note": frf.note}, read.points)
    if frf.is_turned is not None:
        return replace(recording, **points, factor=-recording.factor if frf.is_turned else recording.factor)
    if any(name and not DOF.fullmatch(name) for name in (frf.response, frf.force)):
        problem = f"the reader '{reader.name}' gives the DOFs '{frf.response:.40}' and '{frf.force:.40}'."
        accepted = "a node with its direction, such as 3+x, tool:5-y or 7rz"
        raise MeasurementError(Fault(where, problem, accepted, "Another name belongs into its note."))
    if frf.response and frf.force:
        return replace(recording, note=points["note"]).with_dofs(frf.response, frf.force)
    return replace(recording, **points)


def _claims_of_labels(statements: Sequence[Statement]) -> list[FieldClaim]:
    """Return scales and parts in the labels of real values, which are amplitudes: decibels, a phase, a real part."""
    claims = []
    for about, text, where, _ in statements:
        part = re.search(r"\b(?:phase|angle|real|re|imag|im|imaginary)\b", text.lower())
        word = find_scale("", text) or (part[0] if part else "")
        claims += [FieldClaim("amplitude", word, where)] if word and about == "label" else []
    return claims


def _line_of_data(where: str, index: int) -> str:
    return f"{where}, line {index + 1} of its data"


def _fields(
    frf: RecordedFrf, meaning: Meaning, mentioned: Sequence[Statement], where: str
) -> tuple[dict[str, Any], list[Statement]]:
    """Return the fields of the recording that statements determine, and what is only mentioned."""
    fields = fields_of(meaning)
    fields["is_stated"] = meaning.quantity is not None and (meaning.per_load or frf.is_per_load)
    if frf.rotation is not None:
        fields["rotation"] = frf.rotation
    if frf.moment is not None:
        fields["moment"] = frf.moment
    mentions = list(mentioned)
    if frf.is_si_file and fields["factor"] != 1.0:
        mentions.append(Statement("disputed unit", meaning.unit, where))
        fields |= {"factor": 1.0, "unit": ""}
    return fields, mentions


def _check_kind(frf: RecordedFrf, meaning: Meaning, where: str) -> None:
    """Refuse a rotation or a moment by a unit or a label, and not by what the format states otherwise, or the reverse.

    Raises
    ------
    MeasurementError
    """
    kinds = (("response", ("displacement", "rotation"), frf.rotation, meaning.rotation),
             ("excitation", ("force", "moment"), frf.moment, meaning.moment))  # fmt: skip
    for part, words, by_direction, by_label in kinds:
        if by_direction is not None and by_label is not None and by_direction != by_label:
            problem = (
                f"the {part} is a {words[by_label]} by its label or unit, and a {words[by_direction]} by its direction."
            )
            raise MeasurementError(Fault(where, problem, remedy="Correct the file, or export it again."))


def select_set(path: Path, sets: Sequence[RecordedSet], options: ReadOptions) -> RecordedSet:
    """Return the FRF that the options choose by its number or by the names of its DOFs, or the only one.

    Raises
    ------
    MeasurementError
        No such set, no FRF, or several that match; the fault lists the sets.
    """
    inventory = _inventory(sets)
    if options.index is not None:
        numbered = [each for each in sets if each.number == options.index]
        if not numbered or numbered[0].kind != "frf":
            what = "is not an FRF" if numbered else "is not in the file"
            raise MeasurementError(Fault(str(path), f"set {options.index} {what}; it holds:{inventory}"))
        if not (is_dof(numbered[0].response, options.response) and is_dof(numbered[0].force, options.force)):
            problem = f"set {options.index} is not from {options.force or 'any force'} to "
            problem += f"{options.response or 'any response'}; it holds:{inventory}"
            raise MeasurementError(Fault(str(path), problem, remedy="Choose by index, or by response and force."))
        return numbered[0]
    functions = [each for each in sets if each.kind == "frf"]
    if not functions:
        held = f"; it holds:{inventory}" if sets else "."
        raise MeasurementError(Fault(str(path), f"the file holds no FRF{held}"))
    fitting = [
        each for each in functions if is_dof(each.response, options.response) and is_dof(each.force, options.force)
    ]
    if len(fitting) == 1:
        return fitting[0]
    if not fitting:
        wanted = f"from {options.force or 'any force'} to {options.response or 'any response'}"
        raise MeasurementError(Fault(str(path), f"no FRF {wanted} is in the file; it holds:{inventory}"))
    which = " that fit" if options.chooses else ""
    problem = f"the file holds {len(fitting)} FRFs{which}; choose one:{inventory}"
    remedy = f"Choose one by its DOFs (response, force) or its number, for example index={fitting[0].number}."
    raise MeasurementError(Fault(str(path), problem, remedy=remedy))


def _inventory(sets: Sequence[RecordedSet]) -> str:
    hidden = len(sets) - _SETS_SHOWN
    rows = "".join(f"\n    {one.description}" for one in sets[:_SETS_SHOWN])
    return f"{rows}\n    and {hidden} more" if hidden > 0 else rows


def is_dof(name: str, wanted: str | None) -> bool:
    """Return whether the caller's name is that of this DOF; component, sign and direction may be left out."""
    if wanted is None:
        return True
    entity, _, rest = name.lower().rpartition(":")
    node = re.match(r"\d*", rest)
    number = node[0] if node else rest
    forms = {rest, rest.replace("+", "").replace("-", ""), number}
    spellings = {re.sub(r"[\s:]", "", start + form) for form in forms for start in ("", entity)}
    return re.sub(r"[\s:]", "", wanted.lower()) in spellings


def _check_arrays(frf: RecordedFrf, label: str) -> None:
    """Check that the arrays are numeric vectors of equal length, and the texts are texts.

    Raises
    ------
    PluginError
    """
    size = np.shape(frf.frequency)
    for name in ("frequency", "values", "coherence", "variance"):
        array = getattr(frf, name)
        if array is None and name in ("coherence", "variance"):
            continue
        kinds = "fiuc" if name == "values" else "fiu"
        if not isinstance(array, np.ndarray) or array.dtype.kind not in kinds or array.shape != size or not size[0]:
            kind = f"shape {array.shape}, {array.dtype}" if isinstance(array, np.ndarray) else type(array).__name__
            raise PluginError(Fault(label, f"its {name} are {kind}.", "vectors of numbers of one length"))
    if any(not isinstance(text, str) for text in (frf.unit, frf.response, frf.force, frf.note)):
        raise PluginError(Fault(label, "its unit, DOFs and note are not all texts.", "texts, empty where it is silent"))
    averages = frf.averages
    if averages is not None and (isinstance(averages, bool) or not isinstance(averages, Integral)):
        raise PluginError(Fault(label, f"its averages are {averages!r:.40}.", "a whole number, or None"))
