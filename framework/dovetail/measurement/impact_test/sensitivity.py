"""Sensitivities of sensors, by which voltages become forces and motions."""

from __future__ import annotations

import math
import re
from typing import NamedTuple

from dovetail.errors import Fault, MeasurementError
from dovetail.frf import Quantity
from dovetail.measurement.frf_units import conversion_factor, pint_spelling, read_unit

_NUMBER = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(\S.*?)\s*")
_ACCEPTED = {"force": "2.25 mV/N, 10 mV/lbf", "response": "100 mV/g, 10.2 mV/(m/s^2), 4 V/(m/s)"}


class Sensitivity(NamedTuple):
    """The sensitivity of a sensor.

    Parameters
    ----------
    per_volt : float
        SI units of the signal per volt.
    quantity : Quantity or None
        Of a response; None for a force.
    """

    per_volt: float
    quantity: Quantity | None


def volts(label: str) -> float | None:
    """Return the factor from a unit to volts, or None if it is not a voltage."""
    text = label.strip()
    if text.lower() in ("volt", "volts", "voltage"):
        text = "V"
    return conversion_factor(pint_spelling(text), "V") if re.search(r"[vV]", text) else None


def read_sensitivity(text: str, signal: str) -> Sensitivity:
    """Return the meaning of ``2.25 mV/N`` or ``100 mV/g``; also of its inverse, such as ``444.4 N/V``.

    Parameters
    ----------
    text : str
    signal : {"force", "response"}

    Raises
    ------
    MeasurementError
        Not a voltage per unit of the signal, or not a finite number other than 0.
    """
    where = f"the argument {signal}_sensitivity"
    match = _NUMBER.fullmatch(text)
    value = float(match[1]) if match else 0.0
    if match and math.isfinite(value) and value:
        above, _, below = (part.strip().removeprefix("(").removesuffix(")") for part in match[2].partition("/"))
        if (factor := volts(above)) is not None and (found := _signal_unit(below, signal)) is not None:
            return Sensitivity(found[0] / (value * factor), found[1])
        above, _, below = (part.strip().removeprefix("(").removesuffix(")") for part in match[2].rpartition("/"))
        if (factor := volts(below)) is not None and (found := _signal_unit(above, signal)) is not None:
            return Sensitivity(value * found[0] / factor, found[1])
    problem = f"{text[:60]!r} is not a sensitivity: a number and a voltage per unit of the {signal}."
    raise MeasurementError(Fault(where, problem, _ACCEPTED[signal]))


def _signal_unit(label: str, signal: str) -> tuple[float, Quantity | None] | None:
    reading = read_unit(label)
    kind = "load" if signal == "force" else "motion"
    if reading is None or reading.kind != kind or reading.rotation or reading.moment:
        return None
    return reading.factor, reading.quantity
