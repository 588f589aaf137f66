"""Conversion of quantities with units to SI numbers.

``"583.6 GPa"`` becomes ``583.6e9`` where a pascal is expected; a number without a unit is in SI. Pint is loaded with
the first unit that is read, not on import.
"""

from __future__ import annotations

import contextlib
import math
import re
from collections.abc import Sequence
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

_LONGEST_TEXT = 100
"""Characters of a text that is read as a number with a unit."""
_WRITTEN_TOGETHER = ("newton_meter = N m = Nm", "newton_millimeter = N mm = Nmm", "newton_second = N s = Ns",
                     "newton_meter_second = N m s = Nms", "inch_per_second = inch / second = ips")  # fmt: skip
"""Units that laboratories write as one word; pint reads Nm as a measure of yarn."""
_HOMONYMS = {
    **dict.fromkeys(("ton", "tons"), "'t' (1000 kg), 'short_ton' (907.2 kg) or 'long_ton' (1016 kg)"),
    "mt": "'t' (1000 kg) or 'kg'",
    **dict.fromkeys(("gr", "grs"), "'g' or 'grain'"),
    **dict.fromkeys(("hundredweight", "cwt", "quarter", "quarters"), "'kg'"),
    **dict.fromkeys(("dram", "drams", "dr", "drachm", "dwt"), "'g'"),
    **dict.fromkeys(("ton_force", "force_ton", "tonf"), "'kN', 'metric_ton_force' or 'short_ton_force'"),
    **dict.fromkeys(("hp", "horsepower"), "'W', 'metric_horsepower' (735.5 W) or 'UK_horsepower' (745.7 W)"),
    **dict.fromkeys(("grad", "grade", "grads", "grades"), "'deg' (360 in a circle) or 'gon' (400 in a circle)"),
    **dict.fromkeys(("gal", "gals"), "'Gal' (1 cm/s^2), 'US_liquid_gallon' or 'imperial_gallon'"),
    **dict.fromkeys(("gallon", "gallons"), "'US_liquid_gallon' or 'imperial_gallon'"),
    **dict.fromkeys(("pint", "quart", "qt", "cup", "fluid_ounce", "floz", "fl_oz", "bushel", "barrel", "bbl"), "'l'"),
    **dict.fromkeys(("point", "points", "pt", "pica", "picas", "hand", "hands", "pole", "perch"), "'mm'"),
    **dict.fromkeys(("mile_us", "league", "leagues", "link", "links"), "'m'"),
    **dict.fromkeys(("calorie", "calories", "cal", "btu", "Btu", "BTU", "therm", "thm"), "'J'"),
    **dict.fromkeys(("month", "months", "year", "years", "a", "yr"), "'s' or 'day'"),
    **dict.fromkeys(("c", "c_0"), "'m/s'"),
    "u": "'um' (a length) or 'amu' (a mass)",
}
"""Words with two meanings of the same dimension, which no check of the dimension can distinguish, and what to write.

All names of units of mechanics in pint's registry were looked through: masses, lengths, times, forces, pressures,
speeds, energies, powers, volumes and angles."""
_PREFIXES = ("", "k", "kilo", "M", "mega", "m", "milli", "d", "c")
_THOUSANDS = re.compile(r"^[+-]?\d{1,3}(?:[ _'\u2019,.\u00a0\u202f]\d{3})+(?!\d)")
_POWER = r"(?:\^|\*\*)\s*-?\d{1,2}(?:\.\d{1,3})?|[⁻⁰¹²³⁴⁵⁶⁷⁸⁹]{1,3}"
_UNIT = re.compile(rf"(?:[^\W\d⁰¹²³⁴⁵⁶⁷⁸⁹]|(?:{_POWER})(?![\d.⁻⁰¹²³⁴⁵⁶⁷⁸⁹]|\s*(?:\^|\*\*))|1(?=\s*/)|[\s*/·()°%])*+")
"""Names, small powers and products. Pint's parser would not return from a tower of powers."""
_MIL = re.compile(r"(?<![^\W\d])mils?(?![^\W\d])")
"""A thousandth of an inch, which pint calls thou; its mil is an angle of gunners."""
_GLUED_POWER = re.compile(r"(?<=[a-z])(?=[234](?![\d.]))")
"""A power that follows its unit without a sign, as in kg/m3."""


_CYCLES = re.compile(r"Hz|hertz|rad|rpm|rev|turn", re.IGNORECASE)
"""Words of frequencies, which are no rates of decay."""
_PLAIN = frozenset(
    ("m", "kg", "s", "rad", "N", "Pa", "Hz", "1/s", "N s", "N m", "N/m", "N s/m", "N/m^2", "N s/m^2", "N m/rad")
) | {"N m s/rad", "kg/m^3", "kg m^2", "m/s", "m/s^2"}
_COMMON = {
    ("mm", "m"): 1e-3, ("um", "m"): 1e-6, ("g", "kg"): 1e-3, ("ms", "s"): 1e-3, ("us", "s"): 1e-6, ("kHz", "Hz"): 1e3,
    ("kN", "N"): 1e3, ("MPa", "Pa"): 1e6, ("GPa", "Pa"): 1e9, ("kN/m", "N/m"): 1e3, ("MN/m", "N/m"): 1e6,
    ("N/mm", "N/m"): 1e3,
}  # fmt: skip
"""Units and factors of most descriptions, as pint computes them: without pint, which takes a third of a second to load
and to read its definitions, a command starts sooner."""


@cache
def _registry() -> pint.UnitRegistry[Any]:
    import pint

    registry: pint.UnitRegistry[Any] = pint.UnitRegistry(cache_folder=None, on_redefinition="ignore")
    for definition in _WRITTEN_TOGETHER:
        registry.define(definition)
    return registry


CLEAR_FRACTION = 0.5
"""Largest fraction that needs no percent sign; the highest noise level of the documentation."""


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
    try:
        number = _parse_text(value, unit) if isinstance(value, str) else float(value)
    except OverflowError:  # a whole number of hundreds of digits
        number = math.inf
    if not math.isfinite(number):
        raise UnitError(f"{value!r:.40} is not a finite quantity in {unit}.")
    return number


def to_fraction(value: object) -> float:
    """Convert a fraction of 0 or more, such as a noise level, to a float.

    Parameters
    ----------
    value : float, int or str
        ``0.01`` or ``"1%"``. Above `CLEAR_FRACTION` the percent sign is required: "1" may mean 1 % or 100 %.

    Raises
    ------
    UnitError
        It is not such a fraction.
    """
    text = str(value).strip()[:_LONGEST_TEXT]
    is_percent = text.endswith("%")
    try:
        number = float(text.removesuffix("%")) / (100.0 if is_percent else 1.0)
    except ValueError:
        raise UnitError(f"'{text}' is not a number such as 0.01 or 1%.") from None
    if isinstance(value, bool) or not 0.0 <= number < math.inf:
        raise UnitError(f"'{text}' is not 0 or more.")
    if number > CLEAR_FRACTION and not is_percent:
        raise UnitError(f"'{text}' may mean {number:.6g} % or {100.0 * number:.6g} %. Write it with a percent sign.")
    return number


@cache
def is_unit(unit: str) -> bool:
    """Return whether `unit` is a unit in pint's spelling to which values can be converted; ``"1"`` is a unit."""
    if unit == "1":
        return True
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


def find_homonym(unit: str) -> str:
    """Return a sentence on the first word of a unit that has two meanings, and what to write; empty without one."""
    for word in re.findall(r"[^\W\d]+", unit):
        for prefix in _PREFIXES:
            base = word.removeprefix(prefix)
            if base in _HOMONYMS and word == prefix + base and (len(base) > 1 or not prefix):
                return f"'{word}' has more than one meaning: write {_HOMONYMS[base]}."
    return ""


def refuse_marks(value: object) -> object:
    """Return a value, or raise a ValueError if it is a text of a number with marks of thousands, such as ``10_000``."""
    if not isinstance(value, str) or not (match := _THOUSANDS.match(value.strip())):
        return value
    with contextlib.suppress(ValueError):
        plain_float(value)
        return value
    rest = value.strip()[match.end() :].replace(",", ".")
    raise ValueError(f"{value!r} has marks of thousands: write {re.sub(r'[^0-9+-]', '', match[0])}{rest}")


def plain_float(text: str) -> float:
    """Return the number that a text writes in ASCII; `float` takes ``1_0`` and the digits of other scripts too.

    Raises
    ------
    ValueError
        The text is not a number.
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
    if re.match(r"\d{3}", suffix.strip()):
        raise UnitError(f"{text!r} is not a quantity in {unit}." + _decimal_mark(text))
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


def _factor(unit: str, target: str, text: str) -> float:
    """Return the factor from one unit to another; `text`, from which it was taken, is for the message."""
    if unit == target and unit in _PLAIN:
        return 1.0
    factor = _COMMON.get((unit, target))
    return factor if factor is not None else _factor_by_pint(unit, target, text)


@cache
def _factor_by_pint(unit: str, target: str, text: str) -> float:
    """Return the same factor of any unit. A declared unit, which is the whole text, is in pint's spelling."""
    spelled = _MIL.sub("thou", _GLUED_POWER.sub("^", unit) if text != unit else unit)
    if homonym := find_homonym(spelled):
        raise UnitError(f"in {text!r}, {homonym}")
    if target == "1/s" and _CYCLES.search(spelled):
        raise UnitError(f"{text!r} may be a rate or 2 pi times one. Write it in 1/s.")
    no_unit = UnitError(f"{unit!r} in {text!r} is not a unit; a unit of {target} was expected." + _decimal_mark(text))
    if not _UNIT.fullmatch(spelled):
        raise no_unit
    import pint

    registry = _registry()
    try:
        source = registry.Unit(spelled)
        one, four = (registry.convert(number, source, registry.Unit(target)) for number in (1.0, 4.0))
        if four != 4.0 * one:  # a decibel is not a factor
            raise ValueError(unit)
        angular = target == "Hz" and "radian" in dict(registry.Quantity(1.0, source).to_root_units().unit_items())
        return float(one) / (2.0 * math.pi if angular else 1.0)
    except pint.DimensionalityError:
        wanted = "a plain number" if target == "1" else f"in {target}, or in a unit that can be converted to it"
        problem = f"{text!r} is not {wanted}."
        raise UnitError(problem + _force_hint(spelled, target)) from None
    except Exception:  # pint's parser may raise anything
        raise no_unit from None


def _force_hint(unit: str, target: str) -> str:
    """Return what to write if a unit of mass is used for its weight, as in lb/in."""
    registry = _registry()
    masses = [word for word in ("lb", "lbs", "pound", "oz", "kg") if word in re.findall(r"[a-z]+", unit)]
    weight = registry.Unit(unit) * registry.Unit("standard_gravity")
    if not masses or not weight.is_compatible_with(registry.Unit(target)):
        return ""
    return f" '{masses[0]}' is a mass; a force is written 'N', 'lbf', 'ozf' or 'kgf'."


def _decimal_mark(text: str) -> str:
    if _THOUSANDS.match(text.strip()):
        return " Write numbers without marks of thousands, and with a decimal point: 10000 or 1000.5."
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
"""Units that are easier to read than the SI unit: factor, name, and the smallest SI value that is given in it."""


def format_quantity(value: float, unit: str, digits: int = 5) -> str:
    """Return an SI value as a text: lengths in mm, moduli of solids in GPa, all others in their SI unit."""
    factor, name, least = _DISPLAY.get(unit, (1.0, unit, 0.0))
    if abs(value) < least:
        factor, name = 1.0, unit
    return f"{value * factor:.{digits}g} {name}".rstrip() if name != "1" else f"{value:.{digits}g}"


def format_point(point: Sequence[float]) -> str:
    """Return coordinates [m] in words: ``"(0, 10, 25) mm"``."""
    return f"({', '.join(f'{1e3 * coordinate + 0.0:.6g}' for coordinate in point)}) mm"
