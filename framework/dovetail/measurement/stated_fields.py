"""The fields of a `Recording` that follow from the statements of a file."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from dovetail.errors import Fault, MeasurementError
from dovetail.measurement.frf_units import frequency_factor
from dovetail.measurement.statements import Meaning, Statement

__all__ = ["check_axis", "fields_of"]


def fields_of(meaning: Meaning) -> dict[str, Any]:
    """Return the fields of a `Recording` that follow from the statements of a file."""
    alone = meaning.is_half
    return {
        "quantity": meaning.quantity,
        "is_stated": meaning.quantity is not None and meaning.per_load,
        "factor": 1.0 if alone else meaning.factor,
        "unit": "" if alone else meaning.unit,
        "half_unit": meaning.unit if alone else "",
        "rotation": bool(meaning.rotation),
        "moment": bool(meaning.moment),
    }


def check_axis(meaning: Meaning, mentions: Sequence[Statement], remedy: str) -> float:
    """Return the factor from the frequency's unit to Hz; 1 without a unit.

    Raises
    ------
    MeasurementError
        The file states no unit, and mentions one other than Hz.
    """
    if meaning.axis_factor is not None:
        return meaning.axis_factor
    for about, text, where in mentions:
        if about == "axis unit" and frequency_factor(text) != 1.0:
            raise MeasurementError(
                Fault(where, f"'{text[:40]}' is mentioned, and the frequency has no unit.", "Hz", remedy)
            )
    return 1.0
