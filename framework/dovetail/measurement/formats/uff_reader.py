"""FRFs in universal files (set 58, ASCII and binary) by pyuff, with its traps closed.

pyuff scans and splits whole files whatever their size, says only that something failed, ignores the number of values
that a set declares, empties the file when a binary set overwrites it, writes NaN as 0, and counts the bytes of a
binary set wrongly. So a file is scanned here first, pyuff sees one checked set at a time, and a set is written into
an empty file.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.errors import Fault, MeasurementError
from dovetail.measurement.formats.uff_sets import (
    ABSCISSA_TYPES,
    COHERENCE,
    END,
    FORCE,
    GENERAL,
    TIME,
    UffSet,
    check_unit_system,
    chosen_set,
    clean_header,
    meaning_of,
    parsed_set,
    scanned_sets,
)
from dovetail.measurement.formats.uff_writer import VARIANCE
from dovetail.measurement.recording import MOST_LINES, Recording, Selection

__all__ = ["decode", "time_records"]

_REAL, _COMPLEX = (2, 4), (5, 6)
_DOUBLE = (4, 6)
_LONGEST_ROW = 60
"""Characters of ASCII data for one line of an FRF, at most, whatever its form."""
_NOT_NUMERIC = re.compile(rb"[^0-9eE+\-.\s]\S*")


def decode(path: Path, content: bytes, selection: Selection) -> Recording:
    """Return what a universal file holds: its only FRF, or the one that is chosen by number or DOFs.

    A coherence of the same points and frequencies comes along when there is exactly one; so does the variance that
    Dovetail writes, and a number of averages that an id line gives as ``averages: 10``.

    Raises
    ------
    MeasurementError
        Not a universal file, damaged or truncated sets, no FRF or several, units that are not understood.
    """
    if selection.names:
        raise MeasurementError(Fault(str(path), "names are for files of named arrays or columns, not for sets."))
    sets = scanned_sets(path, content)
    chosen = chosen_set(path, sets, selection)
    check_unit_system(content, sets)
    meaning = meaning_of(chosen)
    frequency, values = _data(content, chosen)
    return Recording(
        where=chosen.where,
        label=path.name,
        frequency=frequency,
        values=values,
        has_phase=np.iscomplexobj(values),
        quantity=meaning.quantity,
        is_stated=meaning.quantity is not None and meaning.over_force,
        coherence=_partner(content, chosen, [one for one in sets if one.function == COHERENCE], frequency),
        place=lambda line: f"{chosen.where}, line {line + 1} of its data",
        how_to_state_quantity="data types 8, 11 or 12 over 13 in the set's header",
        note="" if chosen.fields["id1"].strip() == "NONE" else chosen.fields["id1"].strip(),
        factor=meaning.factor,
        unit=meaning.unit,
        averages=_averages(chosen),
        variance=_partner(content, chosen, [one for one in sets if _is_variance(one)], frequency),
        rotation=chosen.is_rotation,
        response=_said(chosen, "response") or chosen.response,
        force=_said(chosen, "force") or chosen.force,
    )


def time_records(path: Path, content: bytes) -> tuple[NDArray[np.float64], NDArray[np.float64], float, tuple[str, str]]:
    """Return force and response (n_impacts, n_samples), the sampling rate [Hz] and the units of the two.

    Raises
    ------
    MeasurementError
        No time responses, or not in pairs of a force and a motion with the same times.
    """
    sets = [one for one in scanned_sets(path, content) if one.function == TIME]
    forces, motions = ([one for one in sets if _is_force(one) == wanted] for wanted in (True, False))
    if not forces or len(forces) != len(motions):
        problem = f"the file holds {len(forces)} time records of a force and {len(motions)} of a motion."
        raise MeasurementError(
            Fault(str(path), problem, "a pair for each impact (function type 1, data type 13 a force)")
        )
    records, axes = [], []
    for one in (*forces, *motions):
        axis, values = _data(content, one)
        if np.iscomplexobj(values):
            raise MeasurementError(Fault(one.where, "a time record is complex."))
        axes.append(axis)
        records.append(values)
    if any(axis.shape != axes[0].shape or not np.allclose(np.diff(axis), np.diff(axes[0])) for axis in axes):
        raise MeasurementError(Fault(str(path), "the time records have different lengths or steps."))
    step = (axes[0][-1] - axes[0][0]) / max(axes[0].size - 1, 1)
    if not (step > 0 and np.allclose(np.diff(axes[0]), step, rtol=1e-3)):
        raise MeasurementError(Fault(str(path), "the time does not increase in even steps."))
    labels = {
        kind: {one.fields["ordinate_axis_units_lab"].strip() for one in some}
        for kind, some in (("force", forces), ("motion", motions))
    }
    units = [("" if label.lower() == "none" else label) for label in (min(labels["force"]), min(labels["motion"]))]
    if any(len(some) > 1 for some in labels.values()):
        raise MeasurementError(Fault(str(path), "the time records are in different units."))
    count = len(forces)
    return np.array(records[:count]), np.array(records[count:]), 1.0 / step, (units[0], units[1])


def _is_force(one: UffSet) -> bool:
    return bool(one.fields["ordinate_spec_data_type"] == FORCE)


def _partner(
    content: bytes, chosen: UffSet, candidates: list[UffSet], frequency: NDArray[np.float64]
) -> NDArray[np.float64] | None:
    """Return the real data that belong to the chosen set: same points, same frequencies, and only one such set."""
    partners = [one for one in candidates if one.points == chosen.points]
    if len(partners) != 1:
        return None
    axis, data = _data(content, partners[0])
    if np.iscomplexobj(data) or not np.array_equal(axis, frequency):
        return None
    return data


def _is_variance(one: UffSet) -> bool:
    return one.function == GENERAL and str(one.fields["id1"]).startswith(VARIANCE)


def _averages(one: UffSet) -> int | None:
    """Return the number of averages that an id line gives, or None."""
    number = _said(one, r"averages", r"0*([1-9]\d{0,5})\b")
    return int(number) if number else None


def _said(one: UffSet, key: str, value: str = r"(.+?)\s*$") -> str:
    """Return what an id line behind the first says of a key, as in ``averages: 10``."""
    for line in ("id2", "id3", "id4", "id5"):
        if match := re.search(rf"\b{key}\s*[:=]\s*{value}", str(one.fields[line]), re.IGNORECASE):
            return match[1]
    return ""


def _data(content: bytes, one: UffSet) -> tuple[NDArray[np.float64], NDArray[Any]]:
    """Return the frequencies and the values of a set whose header can be read."""
    _check_form(one)
    fields = one.fields
    payload = content[one.header_end : one.end]
    if fields["binary"]:
        _check_size(one, payload)
    else:
        payload = _ascii_data(one, content, payload)
    parsed = parsed_set(clean_header(content[one.start : one.header_end]) + payload + END)
    if not parsed:
        raise MeasurementError(
            Fault(one.where, "the data are damaged: they do not stand in the columns of their form.")
        )
    frequency, values = np.asarray(parsed["x"]), np.asarray(parsed["data"])
    if values.size != fields["num_pts"] or frequency.size != values.size:
        raise MeasurementError(
            Fault(
                one.where,
                f"the header announces {fields['num_pts']} lines, and there are {values.size}.",
                remedy="The file is truncated or damaged: export it again.",
            )
        )
    return frequency, values


def _check_form(one: UffSet) -> None:
    fields = one.fields
    if fields["ord_data_type"] not in (*_REAL, *_COMPLEX) or fields["abscissa_spacing"] not in (0, 1):
        raise MeasurementError(
            Fault(
                one.where,
                f"the data form {fields['ord_data_type']} with spacing {fields['abscissa_spacing']} is not known.",
                "forms 2, 4, 5, 6 with spacing 0 or 1",
            )
        )
    if not 1 <= fields["num_pts"] <= MOST_LINES:
        raise MeasurementError(
            Fault(one.where, f"the header announces {fields['num_pts']} lines.", f"1 to {MOST_LINES:,} lines")
        )
    kind = fields["abscissa_spec_data_type"]
    if kind not in ((0, 1, 17) if one.function == TIME else ABSCISSA_TYPES):
        accepted = "17 (time)" if one.function == TIME else "18 (frequency)"
        raise MeasurementError(Fault(one.where, f"the abscissa has the data type {kind}.", accepted))
    if fields["binary"] and fields["fp_format"] != 2:
        raise MeasurementError(
            Fault(one.where, f"the floating-point format {fields['fp_format']} is not read.", "2 (IEEE 754)")
        )


def _check_size(one: UffSet, payload: bytes) -> None:
    fields = one.fields
    numbers = (1 if fields["ord_data_type"] in _REAL else 2) + (fields["abscissa_spacing"] == 0)
    expected = fields["num_pts"] * numbers * (8 if fields["ord_data_type"] in _DOUBLE else 4)
    if not expected <= len(payload) <= expected + 2:  # a line end may stand before the end tag
        raise MeasurementError(
            Fault(
                one.where,
                f"the header announces {fields['num_pts']} lines, which take {expected} bytes, "
                f"and there are {len(payload)}.",
                remedy="The file is truncated or damaged: export it again.",
            )
        )


def _ascii_data(one: UffSet, content: bytes, payload: bytes) -> bytes:
    """Return the data lines without the blanks and empty lines at their ends, which pyuff does not take."""
    rows = max(payload.count(b"\n"), payload.count(b"\r"))
    if len(payload) > (one.fields["num_pts"] + 2) * _LONGEST_ROW or rows > one.fields["num_pts"] + 2:
        raise MeasurementError(
            Fault(one.where, f"there are more data than the {one.fields['num_pts']} lines that the header announces.")
        )
    if odd := _NOT_NUMERIC.search(payload):
        line = content.count(b"\n", 0, one.header_end + odd.start()) + 1
        word = odd[0][:40].decode("ascii", errors="replace")
        raise MeasurementError(Fault(f"{one.where}, line {line} of the file", f"{word!r} is not a number."))
    return b"".join(line.rstrip() + b"\n" for line in payload.splitlines() if line.strip())
