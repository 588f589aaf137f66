"""Conversion of quantities with units to SI numbers.

``"583.6 GPa"`` becomes ``583.6e9`` where a pascal is expected; a number without a unit is in SI. Pint is loaded with
the first unit that is read, not on import.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import Field
from pydantic_core import PydanticCustomError, core_schema

from dovetail.errors import UnitError

if TYPE_CHECKING:
    from collections.abc import Mapping

    import pint
    from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler

__all__ = ["Frequency", "InUnit", "Mass", "dimension", "format_quantity", "is_unit", "to_si"]

_LONGEST_TEXT = 100
_WRITTEN_TOGETHER = ("newton_meter = N m = Nm", "newton_millimeter = N mm = Nmm", "newton_second = N s = Ns",
                     "newton_meter_second = N m s = Nms", "mil = 25.4 micrometer = _ = mils")  # fmt: skip
"""Products that laboratories write as one word, with and without a prefix; pint takes Nm for a measure of yarn."""
_POWER = r"(?:\^|\*\*)\s*-?\d{1,2}(?:\.\d{1,3})?|[⁻⁰¹²³⁴⁵⁶⁷⁸⁹]{1,3}"
_UNIT = re.compile(rf"(?:[^\W\d⁰¹²³⁴⁵⁶⁷⁸⁹]|(?:{_POWER})(?![\d.⁻⁰¹²³⁴⁵⁶⁷⁸⁹]|\s*(?:\^|\*\*))|1(?!\d)|[\s*/·()°%])*+")
"""Names, small powers and products. Pint's parser would not return from a tower of powers."""
_GLUED_POWER = re.compile(r"(?<=[a-z])(?=[234](?![\d.]))")
"""Where a power follows its unit without a mark, as in kg/m3."""


@cache
def _registry() -> pint.UnitRegistry[Any]:
    import pint

    registry: pint.UnitRegistry[Any] = pint.UnitRegistry(cache_folder=None, on_redefinition="ignore")
    for definition in _WRITTEN_TOGETHER:
        registry.define(definition)
    return registry


def to_si(value: object, unit: str) -> float:
    """Convert a number or a text with a unit to a float in `unit`.

    Parameters
    ----------
    value : float, int or str
        ``0.01``, ``"10 mm"`` or ``"1e8 N/m"``. A number without a unit, also as text, is in `unit`.
    unit : str
        The SI unit in pint's spelling (``"N m/rad"``); ``"1"`` for a pure number.

    Returns
    -------
    float

    Raises
    ------
    UnitError
        The text is not a quantity, has another dimension than `unit`, or is not finite.
    """
    if isinstance(value, bool) or not isinstance(value, (int, float, str)):
        raise UnitError(f"a quantity in {unit} is a number or a text such as '1 {unit}', not {value!r}.")
    number = _parse_text(value, unit) if isinstance(value, str) else float(value)
    if not math.isfinite(number):
        raise UnitError(f"{value!r} is not a finite quantity in {unit}.")
    return number


@cache
def is_unit(unit: str) -> bool:
    """Return whether `unit` is a unit in pint's spelling to which values can be converted; ``"1"`` is a unit."""
    try:
        _factor(unit, unit, unit)
    except UnitError:
        return False
    return True


@cache
def dimension(unit: str) -> tuple[float, Mapping[str, float]]:
    """Return a unit's factor to the base units of SI, and its exponents by the name of each base dimension.

    Parameters
    ----------
    unit : str
        In pint's spelling: ``"kN/m"`` gives 1000 and ``{"mass": 1, "time": -2}``.
    """
    quantity = _registry().Quantity(1.0, "" if unit == "1" else unit).to_base_units()
    dimensions: Mapping[Any, Any] = quantity.dimensionality
    return float(quantity.magnitude), {str(name).strip("[]"): float(power) for name, power in dimensions.items()}


def plain_float(text: str) -> float:
    """Return the number that a text writes in ASCII; `float` takes ``1_0`` and the digits of other scripts too.

    Raises
    ------
    ValueError
        The text is no number.
    """
    if "_" in text or not text.isascii():
        raise ValueError(f"{text!r} is not a number")
    return float(text)


def _parse_text(text: str, unit: str) -> float:
    try:
        return plain_float(text)
    except ValueError:
        pass
    if len(text) > _LONGEST_TEXT:
        raise UnitError(f"a quantity in {unit} was expected, not a text of {len(text)} characters.")
    number, _, suffix = text.strip().partition(" ")
    if not suffix.strip():
        number, suffix = _split_glued(number)
    try:
        magnitude = plain_float(number)
    except ValueError:
        problem = f"{text!r} is not a quantity: write a number, a space and a unit of {unit}."
        raise UnitError(problem + _decimal_mark(text)) from None
    return magnitude * _factor(suffix.strip(), unit, text)


def _split_glued(text: str) -> tuple[str, str]:
    """Split ``"10mm"`` into ``("10", "mm")``, after the longest beginning that is a number."""
    for end in range(len(text), 0, -1):
        try:
            plain_float(text[:end])
        except ValueError:
            continue
        return text[:end], text[end:]
    return text, ""


@cache
def _factor(unit: str, target: str, text: str) -> float:
    """Return the factor from one unit to another; `text`, from which it was taken, is for the message.

    A declared unit, which is the whole text, is in pint's spelling.
    """
    import pint

    registry, spelled = _registry(), _GLUED_POWER.sub("^", unit) if text != unit else unit
    if "gr" in re.findall(r"[a-z]+", spelled):  # of powder, 65 mg, but written for grams as well
        raise UnitError(f"'gr' in {text!r} is a grain to some and a gram to others: write 'g' or 'grain'.")
    try:
        if not _UNIT.fullmatch(spelled):
            raise ValueError(unit)
        source = registry.Unit(spelled)
        one, four = (registry.convert(number, source, registry.Unit(target)) for number in (1.0, 4.0))
        if four != 4.0 * one:  # a decibel is no factor
            raise ValueError(unit)
        angular = target == "Hz" and "radian" in dict(registry.Quantity(1.0, source).to_root_units().unit_items())
        return float(one) / (2.0 * math.pi if angular else 1.0)
    except pint.DimensionalityError as error:
        raise UnitError(
            f"{text!r} has the dimension {error.dim1}, but a unit of {target} {error.dim2} was expected."
        ) from None
    except Exception:  # pint's parser raises whatever its tokenizer does
        problem = f"{unit!r} in {text!r} is not a unit; a unit of {target} was expected."
        raise UnitError(problem + _decimal_mark(text)) from None


def _decimal_mark(text: str) -> str:
    return " The decimal mark is a point." if "," in text else ""


@dataclass(frozen=True)
class InUnit:
    """Pydantic annotation of a float that may be written with a unit.

    Examples
    --------
    >>> from typing import Annotated
    >>> from pydantic import TypeAdapter
    >>> TypeAdapter(Annotated[float, InUnit("m")]).validate_python("10 mm")
    0.01
    """

    unit: str

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> core_schema.CoreSchema:
        return core_schema.no_info_before_validator_function(self._parse, handler(source))

    def __get_pydantic_json_schema__(
        self, schema: core_schema.CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        number = handler(schema)
        text = {"type": "string", "description": f"a number and a unit of {self.unit}"}
        return {"anyOf": [number, text], "x-unit": self.unit}

    def _parse(self, value: object) -> float:
        try:
            return to_si(value, self.unit)
        except UnitError as error:
            raise PydanticCustomError("unit", "{reason}", {"reason": error.faults[0].problem}) from None


Mass = Annotated[float, Field(ge=0), InUnit("kg")]
Frequency = Annotated[float, Field(gt=0), InUnit("Hz")]

_DISPLAY = {"m": (1e3, "mm", 0.0), "Pa": (1e-9, "GPa", 1e8)}
"""Units that are easier to read than the SI unit: factor, name, and the least SI value that is given in them."""


def format_quantity(value: float, unit: str, digits: int = 5) -> str:
    """Return an SI value as a text: lengths in mm, moduli of solids in GPa, all others in their SI unit."""
    factor, name, least = _DISPLAY.get(unit, (1.0, unit, 0.0))
    if abs(value) < least:
        factor, name = 1.0, unit
    return f"{value * factor:.{digits}g} {name}".rstrip() if name != "1" else f"{value:.{digits}g}"
