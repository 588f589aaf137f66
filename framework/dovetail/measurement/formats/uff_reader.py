"""FRFs in universal files (set 58, ASCII and binary), read with pyuff after checks of the file.

pyuff scans and splits whole files whatever their size, reports only that something failed, ignores the number of values
that a set declares, empties the file when a binary set overwrites it, writes NaN as 0, and counts the bytes of a binary
set wrongly. A file is therefore scanned here first, pyuff gets one checked set at a time, and a set is written into an
empty file.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.errors import Fault, MeasurementError
from dovetail.measurement.formats.uff_sets import (
    ABSCISSA_TYPES,
    COHERENCE,
    END,
    GENERAL,
    TIME,
    UffSet,
    clean_header,
    meaning_of,
    parse_set,
    scan_sets,
    select_set,
)
from dovetail.measurement.formats.uff_statements import check_unit_system, interpret_set
from dovetail.measurement.formats.uff_writer import VARIANCE
from dovetail.measurement.recording import MOST_LINES, ReadOptions, Recording
from dovetail.measurement.statements import check_axis

Array = NDArray[np.float64]
_REAL, _COMPLEX = (2, 4), (5, 6)
_DOUBLE = (4, 6)
_LONGEST_ROW = 60
"""Largest number of characters of ASCII data for one line of an FRF."""
_ROUNDED = 0.1
"""Largest difference of the frequencies of two sets that are the same lines, relative to the smallest step."""
_NOT_NUMERIC = re.compile(rb"[^0-9eE+\-.\s]\S*")


def decode(path: Path, content: bytes, options: ReadOptions) -> Recording:
    """Return the FRF in a universal file: the only one, or the one that is chosen by number or DOFs.

    The coherence is also read if exactly one set contains it for the same points and frequencies; so are the variance
    as Dovetail writes it and a number of averages that an id line states as ``averages: 10``.

    Raises
    ------
    MeasurementError
        Not a universal file, damaged or truncated sets, no FRF or several, units that are not understood.
    """
    if options.names:
        raise MeasurementError(Fault(str(path), "names are for files of named arrays or columns, not for sets."))
    sets = scan_sets(path, content)
    chosen = select_set(path, sets, options)
    is_si_file = check_unit_system(content, sets)
    meaning = meaning_of(chosen)
    stated, mentions = interpret_set(chosen, meaning, options, is_si_file=is_si_file)
    frequency, values = read_data(content, chosen)
    scale = check_axis(stated, mentions, "Export the frequencies in Hz.")
    frequency = frequency * scale
    return Recording(
        where=chosen.where,
        label=path.name,
        frequency=frequency,
        values=values,
        has_phase=np.iscomplexobj(values),
        quantity=stated.quantity,
        is_stated=stated.quantity is not None and stated.per_load,
        coherence=_matching_data(content, chosen, filter(_is_coherence, sets), frequency, scale),
        locate=lambda line: f"{chosen.where}, line {line + 1} of its data",
        how_to_state_quantity="data types 8, 11 or 12 over 13 in the set's header",
        note="" if chosen.fields["id1"].strip() == "NONE" else chosen.fields["id1"].strip(),
        factor=stated.factor,
        unit=stated.unit,
        averages=_averages(chosen),
        variance=_matching_data(content, chosen, filter(_is_variance, sets), frequency, scale),
        rotation=chosen.rotation,
        moment=chosen.moment,
        response=_id_line_value(chosen, "response") or chosen.response,
        force=_id_line_value(chosen, "force") or chosen.force,
        mentions=mentions,
    )


def _matching_data(
    content: bytes, chosen: UffSet, candidates: Iterable[UffSet], frequency: Array, scale: float
) -> Array | None:
    """Return the real data for the points and frequencies of the chosen set, if exactly one set has them."""
    matching = [candidate for candidate in candidates if candidate.points == chosen.points]
    if len(matching) != 1:
        return None
    axis, data = read_data(content, matching[0])
    return None if np.iscomplexobj(data) or not _is_same_axis(axis * scale, frequency) else data


def _is_same_axis(axis: Array, frequency: Array) -> bool:
    """Return whether two axes differ by the rounding of their digits only: by less than a tenth of a step."""
    if axis.shape != frequency.shape:
        return False
    steps = np.diff(frequency)
    tolerance = _ROUNDED * float(np.abs(steps).min()) if steps.size else 0.0
    return bool(np.all(np.abs(axis - frequency) <= tolerance))


def _is_coherence(uff_set: UffSet) -> bool:
    return uff_set.function == COHERENCE


def _is_variance(uff_set: UffSet) -> bool:
    return uff_set.function == GENERAL and str(uff_set.fields["id1"]).startswith(VARIANCE)


def _averages(uff_set: UffSet) -> int | None:
    """Return the number of averages that an id line states, or None."""
    number = _id_line_value(uff_set, r"averages", r"0*([1-9]\d{0,5})\b")
    return int(number) if number else None


def _id_line_value(uff_set: UffSet, key: str, value: str = r"(.+?)\s*$") -> str:
    """Return the value of a key in an id line after the first, as in ``averages: 10``, or an empty text."""
    for line in ("id2", "id3", "id4", "id5"):
        if match := re.search(rf"\b{key}\s*[:=]\s*{value}", str(uff_set.fields[line]), re.IGNORECASE):
            return match[1]
    return ""


def read_data(content: bytes, uff_set: UffSet) -> tuple[Array, NDArray[Any]]:
    """Return the abscissa and the values of a set whose header can be read.

    Raises
    ------
    MeasurementError
        Data that do not fit the header.
    """
    _check_form(uff_set)
    fields = uff_set.fields
    payload = content[uff_set.header_end : uff_set.end]
    if fields["binary"]:
        _check_size(uff_set, payload)
    else:
        payload = _ascii_data(uff_set, content, payload)
    parsed = parse_set(clean_header(content[uff_set.start : uff_set.header_end]) + payload + END)
    if not parsed:
        raise MeasurementError(
            Fault(uff_set.where, "the data are damaged: they do not stand in the columns of their form.")
        )
    frequency, values = np.asarray(parsed["x"]), np.asarray(parsed["data"])
    if values.size != fields["num_pts"] or frequency.size != values.size:
        raise MeasurementError(
            Fault(
                uff_set.where,
                f"the header announces {fields['num_pts']} lines, and there are {values.size}.",
                remedy="The file is truncated or damaged: export it again.",
            )
        )
    return frequency, values


def _check_form(uff_set: UffSet) -> None:
    fields = uff_set.fields
    if fields["ord_data_type"] not in (*_REAL, *_COMPLEX) or fields["abscissa_spacing"] not in (0, 1):
        raise MeasurementError(
            Fault(
                uff_set.where,
                f"the data form {fields['ord_data_type']} with spacing {fields['abscissa_spacing']} is not known.",
                "forms 2, 4, 5, 6 with spacing 0 or 1",
            )
        )
    if not 1 <= fields["num_pts"] <= MOST_LINES:
        raise MeasurementError(
            Fault(uff_set.where, f"the header announces {fields['num_pts']} lines.", f"1 to {MOST_LINES:,} lines")
        )
    kind = fields["abscissa_spec_data_type"]
    if kind not in ((0, 1, 17) if uff_set.function == TIME else ABSCISSA_TYPES):
        accepted = "17 (time)" if uff_set.function == TIME else "18 (frequency)"
        raise MeasurementError(Fault(uff_set.where, f"the abscissa has the data type {kind}.", accepted))
    if fields["binary"] and fields["fp_format"] != 2:
        raise MeasurementError(
            Fault(uff_set.where, f"the floating-point format {fields['fp_format']} is not read.", "2 (IEEE 754)")
        )


def _check_size(uff_set: UffSet, payload: bytes) -> None:
    fields = uff_set.fields
    numbers = (1 if fields["ord_data_type"] in _REAL else 2) + (fields["abscissa_spacing"] == 0)
    expected = fields["num_pts"] * numbers * (8 if fields["ord_data_type"] in _DOUBLE else 4)
    if not expected <= len(payload) <= expected + 2:  # a line end may precede the end tag
        raise MeasurementError(
            Fault(
                uff_set.where,
                f"the header announces {fields['num_pts']} lines, which take {expected} bytes, "
                f"and there are {len(payload)}.",
                remedy="The file is truncated or damaged: export it again.",
            )
        )


def _ascii_data(uff_set: UffSet, content: bytes, payload: bytes) -> bytes:
    """Return the data lines without trailing blanks and empty lines, which pyuff does not accept."""
    rows = max(payload.count(b"\n"), payload.count(b"\r"))
    if len(payload) > (uff_set.fields["num_pts"] + 2) * _LONGEST_ROW or rows > uff_set.fields["num_pts"] + 2:
        raise MeasurementError(
            Fault(
                uff_set.where,
                f"there are more data than the {uff_set.fields['num_pts']} lines that the header announces.",
            )
        )
    if odd := _NOT_NUMERIC.search(payload):
        line = content.count(b"\n", 0, uff_set.header_end + odd.start()) + 1
        word = odd[0][:40].decode("ascii", errors="replace")
        raise MeasurementError(Fault(f"{uff_set.where}, line {line} of the file", f"{word!r} is not a number."))
    return b"".join(line.rstrip() + b"\n" for line in payload.splitlines() if line.strip())
