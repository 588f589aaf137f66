"""Levels of noise in a description: a fraction, or a text with a percent sign."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

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


def refuse_useless(section: Mapping[str, Any]) -> None:
    """Raise a ValueError for an option of the augmentation without the one that gives it an effect.

    `section` has the options that differ from their defaults: a file may list all.
    """
    like, multiplicative = section.get("like"), section.get("multiplicative", 0.0 if section.get("like") else 0.02)
    needed = {"like_index": (like, "'like'"), "like_decades": (like, "'like'")}
    needed |= {"reuse": (section.get("fresh"), "'fresh: true'")}
    needed |= {"multiplicative_decades": (multiplicative, "'multiplicative'")}
    for name, (other, words) in needed.items():
        if section.get(name) and not other:
            raise ValueError(f"'{name}' has no effect without {words}")
