"""What the time records of a file mean: quantity, units, points, directions and times, the same for all formats.

Facts that the file and the caller state must agree. A missing unit is that of SI; a missing quantity is asked for,
unless the name of a column is that of the documented layout.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dovetail.errors import Fault, MeasurementError, argument, listing
from dovetail.frf import Quantity
from dovetail.interfaces import Statement
from dovetail.measurement.frf_units import frequency_factor, read_unit
from dovetail.measurement.impact_test.records import AxisFact, Pair, TimeRecord
from dovetail.measurement.impact_test.sensitivity import read_sensitivity, volts
from dovetail.measurement.quantity_words import read_label
from dovetail.measurement.statements import interpret

Array = NDArray[np.float64]
_SAME_RATE = 1e-3
"""Largest relative difference of two rates that are equal, since files write steps with few digits."""
_SAME_START = 0.1
"""Largest difference of two starts that are equal, relative to the step."""
_PER_SECOND = ("samples/s", "sample/s", "s/s", "sps", "1/s", "1/sec", "hz")


class Choice(NamedTuple):
    """What the caller states about one of the two signals.

    Parameters
    ----------
    unit, sensitivity : str or None
    point : str or None
        The point of the wanted FRF.
    """

    unit: str | None = None
    sensitivity: str | None = None
    point: str | None = None


class Scale(NamedTuple):
    """The conversion of a record to SI.

    Parameters
    ----------
    factor : float
    quantity : Quantity or None
        Of a response; None for a force.
    unit : str
        The unit as file or caller state it; empty if neither does, so that it is that of SI.
    """

    factor: float
    quantity: Quantity | None
    unit: str


def scale_of(record: TimeRecord, signal: str, choice: Choice) -> Scale:
    """Return the conversion of a force (``signal="force"``) or a response to SI.

    Raises
    ------
    MeasurementError
        Statements that are not understood or contradict each other, a voltage without a sensitivity, or a response
        of which nothing states what it is.
    """
    voltages, others = _voltages(record)
    if choice.sensitivity is not None or voltages:
        return _scale_of_voltage(record, signal, choice, voltages, others)
    _check_is_signal(signal, others)
    meaning = interpret(others, axis="s")
    if meaning.rotation or meaning.moment:
        raise MeasurementError(Fault(record.where, "the signal is a rotation or a moment.", "a force and a motion"))
    factor = meaning.load_factor if signal == "force" else meaning.motion_factor
    quantity = None if signal == "force" else meaning.quantity
    if record.is_si_file and factor not in (None, 1.0):
        factor = _disputed(record, signal, choice, _unit_of(others), factor)
    if choice.unit is not None:
        chosen, own = read_unit(choice.unit), factor
        if (
            chosen is None
            or (own is not None and not np.isclose(own, chosen.factor, rtol=1e-6))
            or (quantity is not None and quantity != chosen.quantity)
        ):
            file_units = _said(others)
            problem = f"the file states {file_units}, and the argument {signal}_unit '{choice.unit}'."
            raise MeasurementError(Fault(record.where, problem, remedy="Leave out the option, or correct the file."))
        factor, quantity = chosen.factor, chosen.quantity if signal == "response" else None
    if factor is None and record.is_counts:
        problem = f"the {signal} is in integers without a unit, such as the counts of a converter."
        chosen_by = argument("response_unit") if signal == "response" else argument("force_unit")
        raise MeasurementError(Fault(record.where, problem, remedy=f"Give its unit by {chosen_by}."))
    if signal == "response" and quantity is None:
        quantity = _documented(record)
    unit = choice.unit or ("" if factor is None else _unit_of(others))
    return Scale(1.0 if factor is None else factor, quantity, unit)


def _disputed(record: TimeRecord, signal: str, choice: Choice, unit: str, factor: float | None) -> float | None:
    """Return the factor of a unit in a file that states SI units, by which of the two the caller confirms."""
    if choice.unit is None:
        problem = f"set 164 states SI units (m, N), and the label of the {signal} is '{unit}'."
        raise MeasurementError(Fault(record.where, problem, remedy=f"Say which is right: --{signal}-unit."))
    chosen = read_unit(choice.unit)
    return 1.0 if chosen is not None and chosen.factor == 1.0 else factor


def _unit_of(statements: Sequence[Statement]) -> str:
    """Return the first unit that statements contain."""
    for about, text, _, _ in statements:
        units = read_label(text).units if "label" in about else (text,) if "unit" in about else ()
        for unit in units:
            if (reading := read_unit(unit)) is not None and reading.kind != "none":
                return unit
    return ""


def _said(statements: Sequence[Statement]) -> str:
    """Return the units and the quantities in statements, for a message."""
    texts = []
    for about, text, _, _ in statements:
        label = read_label(text) if "label" in about else None
        is_said = label is None or label.units or label.motions
        texts += [f"'{text.strip()}'"] if is_said and text.strip() else []
    return listing(dict.fromkeys(texts))


def _documented(record: TimeRecord) -> Quantity:
    """Return the quantity of a response by the documented name of its column, or ask for it."""
    if record.is_acceleration:
        return "accelerance"
    problem = "the file does not say whether the response is an acceleration, a velocity or a displacement."
    remedy = "Give its unit, such as `response_unit='m/s^2'`."
    raise MeasurementError(Fault(record.where, problem, "m/s^2, g, m/s, mm/s, m, um, ...", remedy))


def _check_is_signal(signal: str, statements: Sequence[Statement]) -> None:
    """Refuse an FRF in place of a signal, and a force in place of a response or the reverse."""
    for about, text, where, _ in statements:
        label = read_label(text) if "label" in about else None
        if label is not None and label.unclear:
            problem = f"'{text[:60]}' is not a {signal} in a unit: '{label.unclear}' is not understood."
            remedy = "If it is, choose the columns or arrays: `columns=`, or `names=` and the units."
            raise MeasurementError(Fault(where, problem, remedy=remedy))
        units = label.units if label is not None else (text,) if "unit" in about else ()
        kinds = {reading.kind for unit in units if (reading := read_unit(unit)) is not None}
        wrong = kinds - ({"load", "none"} if signal == "force" else {"motion", "none"})
        if wrong or (label is not None and (label.quantities or (signal == "force" and label.motions))):
            accepted = "N, lbf, ..." if signal == "force" else "m/s^2, g, m/s, mm/s, m, um, ..."
            raise MeasurementError(Fault(where, f"'{text[:60]}' is not the {signal} of an impact test.", accepted))


def _voltages(record: TimeRecord) -> tuple[list[tuple[str, str]], list[Statement]]:
    """Return the voltages that a record states, with their places, and the other statements."""
    voltages, others = [], []
    for statement in record.statements:
        about, text, where, _ = statement
        label = read_label(text) if "label" in about else None
        units = label.units if label is not None else (text,) if "unit" in about else ()
        found = [unit for unit in units if volts(unit) is not None]
        found += [label.unclear] if label is not None and volts(label.unclear) is not None else []
        voltages += [(unit, where) for unit in found]
        for unit in found:
            text = re.sub(re.escape(unit), " ", text, count=1, flags=re.IGNORECASE)
        if text.strip(" ()[]"):
            others.append(Statement(about, text.replace("( )", "").replace("[ ]", ""), where))
    return voltages, others


def _scale_of_voltage(
    record: TimeRecord, signal: str, choice: Choice, voltages: Sequence[tuple[str, str]], others: Sequence[Statement]
) -> Scale:
    """Return the conversion of a voltage; without a unit in file and options it is in volts."""
    if choice.sensitivity is None:
        unit, where = voltages[0]
        example = "'2.25 mV/N'" if signal == "force" else "'100 mV/g'"
        problem = f"the {signal} is a voltage, in '{unit}'."
        remedy = f"Give the sensitivity of the sensor: --{signal}-sensitivity {example}."
        raise MeasurementError(Fault(where, problem, remedy=remedy))
    sensitivity = read_sensitivity(choice.sensitivity, signal)
    units = [*(unit for unit, _ in voltages), *([choice.unit] if choice.unit is not None else [])]
    factors = {volts(unit) for unit in units} or {1.0}
    meaning = interpret(others, axis="s")
    unit_factor = meaning.load_factor if signal == "force" else meaning.motion_factor
    disagrees = signal == "response" and meaning.quantity not in (None, sensitivity.quantity)
    factor = factors.pop()
    if factor is None or factors or unit_factor is not None or disagrees:
        texts = _said(others)
        units_given = ", ".join((*(f"'{unit}'" for unit in units), *([texts] if texts else [])))
        problem = f"the {signal} has the sensitivity '{choice.sensitivity}', and its unit is given as {units_given}."
        raise MeasurementError(
            Fault(record.where, problem, "a voltage, and the motion or the force of the sensitivity")
        )
    unit = units[0] if units else "V"
    return Scale(factor * sensitivity.per_volt, sensitivity.quantity, f"{unit} with {choice.sensitivity}")


def choose_points(
    pairs: Sequence[Pair], path: str, response: str | None, force: str | None, is_point: Callable[[str, str], bool]
) -> list[Pair]:
    """Return the pairs of one response point and one force point: those that the caller chooses, or the only ones.

    Parameters
    ----------
    pairs : sequence of (force, response)
    path : str
        The file.
    response, force : str or None
        Points of the wanted FRF.
    is_point : callable
        Returns whether the name of a point in the file is that of the caller.

    Raises
    ------
    MeasurementError
        Several pairs of points that fit, or none; the fault lists them.
    """
    for pushed, moved in pairs:
        if moved.reference.name and pushed.point.name and moved.reference.name != pushed.point.name:
            problem = f"the force is at {pushed.point.label}, and the response refers to {moved.reference.label}."
            raise MeasurementError(Fault(moved.where, problem, "a force and a response of the same impact"))
    fitting = [
        pair
        for pair in pairs
        if (force is None or is_point(pair[0].point.label, force))
        and (response is None or is_point(pair[1].point.label, response))
    ]
    points = list(dict.fromkeys((moved.point.name, pushed.point.name) for pushed, moved in fitting))
    if len(points) == 1:
        return fitting
    held = dict.fromkeys((moved.point.label, pushed.point.label) for pushed, moved in (fitting or pairs))
    counts = [
        f"\n    response {to or 'unknown'}, force {at or 'unknown'}: "
        f"{sum((m.point.label, p.point.label) == (to, at) for p, m in pairs)} impacts"
        for to, at in list(held)[:20]
    ]
    which = f"impacts at {len(points)} pairs of points" if fitting else "no impact at these points"
    first = next(iter(held), ("", ""))
    remedy = f"Choose one: {argument('response', first[0] or 'POINT')} {argument('force', first[1] or 'POINT')}."
    raise MeasurementError(Fault(path, f"the file holds {which}; choose one pair:{''.join(counts)}", remedy=remedy))


def sampling_rate(pairs: Sequence[Pair], rate: float | None, rate_of: Callable[[Array], float]) -> float | None:
    """Return the sampling rate [Hz] on which all statements agree, or None if there is none.

    Parameters
    ----------
    pairs : sequence of (force, response)
    rate : float or None
        As the caller states it.
    rate_of : callable
        Returns the rate of even times [s].

    Raises
    ------
    MeasurementError
        Two rates, or a force and a response that do not start at the same time.
    """
    rates = [] if rate is None else [(float(rate), "the argument rate")]
    known: dict[tuple[int, str], tuple[float, float | None]] = {}
    for pair in pairs:
        starts = []
        for record in pair:
            first = None
            for fact in record.axis:
                key = id(fact.value), fact.unit
                if key not in known:
                    known[key] = _rate_and_start(fact, rate_of)
                own, start = known[key]
                rates += [(own, fact.where)] if own else []
                first = start if start is not None else first
            starts.append(first)
        _check_starts(pair, starts, rates)
    for other, where in rates[1:]:
        if abs(other / rates[0][0] - 1.0) > _SAME_RATE:
            problem = f"the sampling rate is {other:.6g} Hz here, and {rates[0][0]:.6g} Hz at {rates[0][1]}."
            raise MeasurementError(Fault(where, problem, "one sampling rate for all records"))
    from_file = [one for one in rates if one[1] != "the argument rate"] or rates
    return from_file[0][0] if from_file else None


def _rate_and_start(fact: AxisFact, rate_of: Callable[[Array], float]) -> tuple[float, float | None]:
    """Return the rate in hertz that a fact states, or 0, and the time of the first sample."""
    if fact.kind == "rate":
        factor = _rate_factor(fact)
        rate = float(fact.value) * factor
        if not (np.isfinite(rate) and rate > 0):
            raise MeasurementError(Fault(fact.where, f"the sampling rate is {rate!r} Hz.", "a positive number"))
        return rate, None
    scale = interpret([Statement("axis unit", fact.unit, fact.where)], axis="s").axis_factor or 1.0
    if fact.kind == "times":
        times = np.asarray(fact.value) * scale
        return rate_of(times), float(times[0])
    value = float(fact.value) * scale
    if fact.kind == "start":
        return 0.0, value
    if not (np.isfinite(value) and value > 0):
        raise MeasurementError(Fault(fact.where, f"the time between samples is {value!r} s.", "a positive number"))
    return 1.0 / value, None


def _rate_factor(fact: AxisFact) -> float:
    unit = fact.unit.strip().lower()
    for prefix, factor in (("", 1.0), ("k", 1e3), ("m", 1e6)):
        if unit in {prefix + spelling for spelling in _PER_SECOND}:
            return factor
    known = frequency_factor(fact.unit) if unit else 1.0
    if known is None or "rad" in unit:
        raise MeasurementError(Fault(fact.where, f"the sampling rate is in {fact.unit!r}.", "Hz, kHz"))
    return known


def _check_starts(pair: Pair, starts: Sequence[float | None], found: Sequence[tuple[float, str]]) -> None:
    first, second = starts
    if first is not None and second is not None and found and abs(first - second) * found[-1][0] > _SAME_START:
        problem = f"the response starts at {second:.6g} s, and the force at {first:.6g} s."
        raise MeasurementError(Fault(pair[1].where, problem, "records that start at the same time"))
