"""Levels of noise in a description: a fraction, or a text with a percent sign."""

from __future__ import annotations

from typing import Annotated

from pydantic import BeforeValidator, Field
from pydantic_core import PydanticCustomError

from dovetail.errors import UnitError
from dovetail.units import to_fraction


def _fraction(value: object) -> float:
    try:
        return to_fraction(value)
    except UnitError as error:
        raise PydanticCustomError("fraction", "{reason}", {"reason": error.faults[0].problem}) from None


NoiseLevel = Annotated[float, Field(ge=0, le=10), BeforeValidator(_fraction, json_schema_input_type=float | str)]
"""``0.2`` or ``20%``."""
