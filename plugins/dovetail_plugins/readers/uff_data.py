"""The numbers of a set 58, read with pyuff after checks of the header and of the data."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail import Fault, MeasurementError
from dovetail_plugins.readers.uff_sets import ABSCISSA_TYPES, END, TIME, UffSet, clean_header, parse_set

Array = NDArray[np.float64]
_REAL, _COMPLEX = (2, 4), (5, 6)
_DOUBLE = (4, 6)
_LONGEST_ROW = 60
"""Largest number of characters of ASCII data for one line of an FRF."""
_MOST_LINES = 1_000_000
"""Largest number of lines of an FRF."""
_NOT_NUMERIC = re.compile(rb"[^0-9eE+\-.\s]\S*")


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
    if not 1 <= fields["num_pts"] <= _MOST_LINES:
        raise MeasurementError(
            Fault(uff_set.where, f"the header announces {fields['num_pts']} lines.", f"1 to {_MOST_LINES:,} lines")
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
