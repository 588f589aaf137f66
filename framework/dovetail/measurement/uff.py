"""FRFs in universal files (set 58, ASCII and binary) by pyuff, with its traps closed.

pyuff scans and splits whole files whatever their size, says only that something failed, ignores the number of values
that a set declares, empties the file when a binary set overwrites it, writes NaN as 0, and counts the bytes of a
binary set wrongly. So a file is scanned here first, pyuff sees one checked set at a time, and a set is written into
an empty file.
"""

from __future__ import annotations

import re
import struct
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.errors import Fault, MeasurementError
from dovetail.frf import Frf
from dovetail.measurement.recording import MOST_LINES, Recording
from dovetail.measurement.uff_sets import (
    COHERENCE,
    END,
    FRF,
    UffSet,
    chosen_set,
    clean_header,
    parsed_set,
    scanned_sets,
)
from dovetail.measurement.uff_units import ABSCISSA_TYPES, FORCE, ORDINATE, check_unit_system, meaning_of

__all__ = ["decode", "encode"]

_REAL, _COMPLEX = (2, 4), (5, 6)
_DOUBLE = (4, 6)
_LONGEST_ROW = 60
"""Characters of ASCII data for one line of an FRF, at most, whatever its form."""
_NOT_NUMERIC = re.compile(rb"[^0-9eE+\-.\s]\S*")
_BYTE_COUNT = slice(38, 50)
"""Where the first set of a file, when it is binary, counts its data."""


def decode(path: Path, content: bytes, index: int | None) -> Recording:
    """Return what a universal file holds: its only FRF, or the set with the number `index`.

    A coherence of the same points and frequencies comes along when there is exactly one.

    Raises
    ------
    MeasurementError
        Not a universal file, damaged or truncated sets, no FRF or several, units that are not understood.
    """
    sets = scanned_sets(path, content)
    chosen = chosen_set(path, sets, index)
    check_unit_system(content, sets)
    meaning = meaning_of(chosen)
    frequency, values = _data(content, chosen)
    has_phase = np.iscomplexobj(values)
    with np.errstate(invalid="ignore"):  # what is not finite is refused with its line, later
        values = values * (meaning.factor if has_phase else abs(meaning.factor))
    return Recording(
        where=chosen.where,
        label=path.name,
        frequency=frequency,
        values=values,
        has_phase=has_phase,
        quantity=meaning.quantity,
        is_stated=meaning.quantity is not None and meaning.over_force,
        coherence=_coherence(content, chosen, sets, frequency),
        place=lambda line: f"{chosen.where}, line {line + 1} of its data",
        how_to_state_quantity="data types 8, 11 or 12 over 13 in the set's header",
        note="" if chosen.fields["id1"].strip() == "NONE" else chosen.fields["id1"].strip(),
    )


def _coherence(
    content: bytes, chosen: UffSet, sets: list[UffSet], frequency: NDArray[np.float64]
) -> NDArray[np.float64] | None:
    partners = [one for one in sets if one.function == COHERENCE and one.points == chosen.points]
    if len(partners) != 1:
        return None
    axis, coherence = _data(content, partners[0])
    if np.iscomplexobj(coherence) or not np.array_equal(axis, frequency):
        return None
    return coherence


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
    if fields["abscissa_spec_data_type"] not in ABSCISSA_TYPES:
        raise MeasurementError(
            Fault(one.where, f"the abscissa has the data type {fields['abscissa_spec_data_type']}.", "18 (frequency)")
        )
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


def encode(frf: Frf, path: Path, binary: bool | None) -> bytes:
    """Return a universal file: the FRF from +X of node 1 to +X of node 1, and its coherence as a second set.

    Raises
    ------
    MeasurementError
        One line only, a coherence that is not finite, or `binary` false and frequencies that six digits cannot hold.
    """
    if frf.frequency.size < 2:
        raise MeasurementError(Fault(str(path), "a universal file needs two lines or more.", ".csv, .npz"))
    if frf.coherence is not None and not np.all(np.isfinite(frf.coherence)):
        raise MeasurementError(Fault(str(path), f"the coherence of {frf.label} is not finite: nothing is written."))
    spacing = _spacing(frf.frequency)
    if spacing is None and binary is False:
        raise MeasurementError(
            Fault(
                str(path),
                "the six digits that ASCII gives to frequencies cannot hold these.",
                remedy="Write .csv, .npz or binary UFF.",
            )
        )
    common = {
        "type": 58,
        "binary": int(spacing is None if binary is None else binary),
        "x": frf.frequency,
        "abscissa_spacing": spacing or 0,
        "id1": _id_line(frf.note or frf.label),
        "rsp_node": 1,
        "rsp_dir": 1,
        "ref_node": 1,
        "ref_dir": 1,
        "abscissa_spec_data_type": 18,
        "abscissa_axis_lab": "Frequency",
        "abscissa_axis_units_lab": "Hz",
    }
    number, name, unit = ORDINATE[frf.quantity]
    response = {
        "func_type": FRF,
        "data": frf.values if frf.has_phase else frf.amplitude,
        "ordinate_spec_data_type": number,
        "ordinate_axis_lab": name,
        "ordinate_axis_units_lab": unit,
        "orddenom_spec_data_type": FORCE,
        "orddenom_axis_lab": "Force",
        "orddenom_axis_units_lab": "N",
    }
    written = _written(common | response)
    if frf.coherence is not None:
        written += _written(common | {"func_type": COHERENCE, "data": frf.coherence, "orddenom_spec_data_type": 0})
    return written


def _spacing(frequency: NDArray[np.float64]) -> int | None:
    """Return 1 or 0 where six digits hold the frequencies as even or uneven steps, else None."""
    first, step = (float(f"{value:.5e}") for value in (frequency[0], frequency[1] - frequency[0]))
    if np.allclose(first + step * np.arange(frequency.size), frequency, rtol=1e-12, atol=0.0):
        return 1
    if all(float(f"{value:.5e}") == value for value in frequency.tolist()):
        return 0
    return None


def _id_line(label: str) -> str:
    printable = "".join(character if 32 <= ord(character) < 127 else "?" for character in label)
    return printable.strip()[:80] or "NONE"


def _written(dataset: dict[str, Any]) -> bytes:
    """Return the bytes of one set: pyuff adds it to an empty file, and the byte count is corrected."""
    import pyuff

    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "set.uff")
        pyuff.UFF(str(file)).write_sets(dict(dataset), mode="add")
        content = bytearray(file.read_bytes())
    if dataset["binary"]:
        numbers = (2 if np.iscomplexobj(dataset["data"]) else 1) + (dataset["abscissa_spacing"] == 0)
        content[_BYTE_COUNT] = b"%12d" % (struct.calcsize("d") * numbers * len(dataset["data"]))
    return bytes(content)
