"""What a measurement file states about its values, and what all of it means together.

A reader declares every statement with its place: units, quantities, labels, free text and entries that it does not
use. `interpret` combines them. Statements that agree give the quantity and the factors to SI; a contradiction is
refused with both places; what looks like a statement and is not understood is refused with its place. The same
function serves FRFs (a motion per load) and signals (a motion or a load alone).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

from dovetail.errors import Fault, MeasurementError
from dovetail.frf import QUANTITIES, Quantity, unit_of
from dovetail.interfaces import About, Statement
from dovetail.measurement.frf_units import UnitReading, frequency_factor, motion_unit, read_unit
from dovetail.measurement.quantity_words import ANGULAR, read_label, word_set, words_of
from dovetail.units import find_homonym

if TYPE_CHECKING:
    from dovetail.measurement.free_text import FreeText

_ROUNDING = 1e-6
"""Largest relative difference of two factors that are equal, since files write factors with few digits."""
_SHOWN = 60
_NO_FREQUENCY = word_set("time zeit temps order orders ordnung rpm speed angle position period wavelength ratio")
_NO_TIME = word_set("frequency freq frequenz order orders rpm angle position lag")
"""Words for another abscissa."""


class _Claim(NamedTuple):
    """One fact that a statement contains.

    `fact` names the fact: ratio, motion, load, axis, quantity, motion quantity, moment.
    """

    fact: str
    value: Any
    quoted: str
    where: str


class Meaning(NamedTuple):
    """What all statements together mean.

    Parameters
    ----------
    quantity : Quantity or None
        None if it is not given.
    per_load : bool
        Whether the file says that the values are a motion per load, so that `quantity` is that of an FRF.
    factor : float
        Converts values that are a motion per load to SI; 1 without a unit.
    motion_factor, load_factor : float or None
        Convert a motion and a load alone; None without a unit.
    rotation, moment : bool or None
        Whether the motion is a rotation and the load a moment; None if no statement says so.
    axis_factor : float or None
        Converts the abscissa to Hz or s; None without a unit.
    unit : str
        The unit of the values, for messages; empty if none is given.
    is_half : bool
        Whether the unit is that of a motion alone or of a load alone; the other half is taken to be in SI.
    """

    quantity: Quantity | None = None
    per_load: bool = False
    factor: float = 1.0
    motion_factor: float | None = None
    load_factor: float | None = None
    rotation: bool | None = None
    moment: bool | None = None
    axis_factor: float | None = None
    unit: str = ""
    is_half: bool = False


def interpret(statements: Iterable[Statement], *, axis: Literal["Hz", "s"] = "Hz") -> Meaning:
    """Return what statements about one FRF, or about one signal and its time, mean together.

    Parameters
    ----------
    statements : iterable of Statement
    axis : {"Hz", "s"}
        What the abscissa has to be.

    Returns
    -------
    Meaning

    Raises
    ------
    MeasurementError
        A statement that is not understood, or two that contradict each other; the fault names their places.
    """
    claims = [claim for statement in statements for claim in _claims(statement, axis)]
    ratio, motion, load, scale = (_agreed(claims, fact) for fact in ("ratio", "motion", "load", "axis"))
    whole = _whole(ratio, motion, load)
    quantity = _agreed_quantity(claims)
    moment = _agreed([*claims, *_moments(ratio, load)], "moment")
    unit: UnitReading | None = None if whole is None else whole.value
    moving: UnitReading | None = unit or (motion.value if motion else None)
    return Meaning(
        quantity=None if quantity is None else quantity.value,
        per_load=ratio is not None or load is not None or moment is not None or _names(claims, "quantity"),
        factor=1.0 if unit is None else unit.factor,
        motion_factor=None if motion is None else motion.value.factor,
        load_factor=None if load is None else load.value.factor,
        rotation=None if moving is None else moving.rotation,
        moment=None if moment is None else moment.value,
        axis_factor=None if scale is None else scale.value,
        unit="" if whole is None else whole.quoted.replace("'", ""),
        is_half=ratio is None and whole is not None and (motion is None or load is None),
    )


def meaning_of_file(statements: Sequence[Statement], free_text: FreeText) -> tuple[Meaning, list[Statement]]:
    """Return what all statements mean, and what is only mentioned.

    A unit in a sentence counts against a statement elsewhere; without one it is a mention.

    Raises
    ------
    MeasurementError
        As `interpret`.
    """
    every = [*statements, *free_text.statements]
    meaning, mentions = interpret(every), list(free_text.mentions)
    for sentence in free_text.sentences:
        is_axis = sentence.about == "axis unit"
        if meaning.axis_factor is not None if is_axis else meaning.unit:
            interpret([*every, sentence])
        elif is_axis or (reading := read_unit(sentence.text)) is None or reading.factor != 1.0:
            mentions.append(sentence if is_axis else sentence._replace(about="unit"))
    return meaning, mentions


def _names(claims: Sequence[_Claim], fact: str) -> bool:
    return any(claim.fact == fact for claim in claims)


def _claims(statement: Statement, axis: Literal["Hz", "s"]) -> list[_Claim]:
    """Return the facts in one statement."""
    about, text, where, _ = statement
    if about in ("quantity", "motion quantity"):
        kind: About = "unit" if about == "quantity" else "motion unit"
        units = [claim for unit in read_label(text).units for claim in _unit_claims(Statement(kind, unit, where))]
        return [_quantity_claim(statement), *units]
    if about in ("unit", "motion unit", "load unit"):
        return _unit_claims(statement)
    if about == "axis unit":
        return _axis_claims(text, where, axis)
    label = read_label(text)
    if about == "word" and not (label.quantities or label.motions or label.unclear):
        raise MeasurementError(Fault(where, f"the word {text[:_SHOWN]!r} is not understood.", _ACCEPTED_LABELS))
    if about == "axis label":
        return _axis_label_claims(text, label.units, where, axis)
    if about == "load label" and label.motions and not label.moments:
        problem = f"'{text[:_SHOWN]}' is that of the load, and is a motion."
        raise MeasurementError(Fault(where, problem, "a force or a moment", _HOW_TO_CORRECT))
    if label.unclear:
        problem = f"'{text[:_SHOWN]}' is not a motion per load: '{label.unclear}' is not understood."
        raise MeasurementError(Fault(where, problem, _ACCEPTED_LABELS, _HOW_TO_CORRECT))
    claims = [_Claim("moment", moment, f"'{text[:_SHOWN]}'", where) for moment in label.moments]
    kind = "load unit" if about == "load label" else "unit"
    for unit in label.units:
        is_axis = frequency_factor(unit) is not None and (reading := read_unit(unit)) and reading.kind == "frequency"
        claims += _axis_claims(unit, where, axis) if is_axis else _unit_claims(Statement(kind, unit, where))
    if about == "load label":
        return claims
    motions = [_Claim("motion quantity", word, f"'{text[:_SHOWN]}'", where) for word in label.motions]
    return claims + motions + [_Claim("quantity", word, f"'{text[:_SHOWN]}'", where) for word in label.quantities]


def _axis_label_claims(text: str, units: Sequence[str], where: str, axis: Literal["Hz", "s"]) -> list[_Claim]:
    """Return the facts in the label of the abscissa: its unit, and that of an angular frequency."""
    words = set(words_of(text))
    if wrong := words & (_NO_FREQUENCY if axis == "Hz" else _NO_TIME):
        accepted = "a frequency" if axis == "Hz" else "a time"
        raise MeasurementError(Fault(where, f"the abscissa is '{text[:_SHOWN]}'.", accepted, f"'{min(wrong)}' is not."))
    claims = [claim for unit in units for claim in _axis_claims(unit, where, axis)]
    is_angular = axis == "Hz" and words & ANGULAR and len(text) > 1
    return claims + (_axis_claims("rad/s", where, axis) if is_angular else [])


def _quantity_claim(statement: Statement) -> _Claim:
    about, text, where, _ = statement
    if about == "quantity" and text in QUANTITIES:
        return _Claim("quantity", text, f"'{text}'", where)
    label = read_label(text)
    named = dict.fromkeys((*label.quantities, *label.motions))
    if label.unclear or len(named) != 1:
        accepted = ", ".join(QUANTITIES)
        raise MeasurementError(Fault(where, f"{text[:_SHOWN]!r} is not a quantity.", accepted, _HOW_TO_CORRECT))
    per_load = about == "quantity" and bool(label.quantities or label.moments)
    return _Claim("quantity" if per_load else "motion quantity", next(iter(named)), f"'{text[:_SHOWN]}'", where)


def _unit_claims(statement: Statement) -> list[_Claim]:
    """Return the facts in a unit: what it is of, and the quantity."""
    about, text, where, _ = statement
    reading = read_unit(text)
    accepted = {"motion unit": ("motion", "ratio"), "load unit": ("load",)}.get(about, ("motion", "ratio", "load"))
    if reading is not None and reading.kind == "none":
        return []
    quoted = f"'{text[:_SHOWN]}'"
    if reading is None or reading.kind not in accepted:
        problem = f"the unit {quoted} is not understood."
        is_inverse = reading is not None and reading.kind == "inverse"
        remedy = "It is that of a load per motion." if is_inverse else find_homonym(text) or _HOW_TO_CORRECT
        raise MeasurementError(Fault(where, problem, _ACCEPTED_UNITS[about], remedy))
    claims = [_Claim(reading.kind, reading, quoted, where)]
    if reading.quantity is not None:
        fact = "quantity" if reading.kind == "ratio" else "motion quantity"
        claims.append(_Claim(fact, reading.quantity, f"the unit {quoted}", where))
    return claims


def _axis_claims(text: str, where: str, axis: Literal["Hz", "s"]) -> list[_Claim]:
    if text.lower() == "hz" == axis.lower():  # most files, for which no unit has to be converted
        return [_Claim("axis", 1.0, f"'{text}'", where)]
    reading = read_unit(text)
    if reading is not None and reading.kind == "none":
        return []
    time = reading.factor if reading is not None and reading.kind == "time" else None
    factor = frequency_factor(text) if axis == "Hz" else time
    if factor is None:
        accepted = "Hz, kHz, rad/s" if axis == "Hz" else "s, ms, us"
        what = "the frequency" if axis == "Hz" else "the time"
        raise MeasurementError(Fault(where, f"{what} is in {text[:40]!r}.", accepted))
    return [_Claim("axis", factor, f"'{text[:_SHOWN]}'", where)]


def _agreed(claims: Sequence[_Claim], fact: str) -> _Claim | None:
    """Return the claim on which all about one fact agree, or None without any."""
    about = [claim for claim in claims if claim.fact == fact]
    for other in about[1:]:
        if not _equal(about[0].value, other.value):
            raise _contradiction(about[0], other)
    return about[0] if about else None


def _equal(one: Any, other: Any) -> bool:
    if isinstance(one, UnitReading) and isinstance(other, UnitReading):
        return one[2:] == other[2:] and math.isclose(one.factor, other.factor, rel_tol=_ROUNDING)
    return bool(one == other) or (
        isinstance(one, float) and isinstance(other, float) and math.isclose(one, other, rel_tol=_ROUNDING)
    )


def _agreed_quantity(claims: Sequence[_Claim]) -> _Claim | None:
    """Return the claim on the quantity, from quantities per load, or else from those of a motion; all must agree."""
    named = [claim for claim in claims if claim.fact in ("quantity", "motion quantity")]
    for other in named[1:]:
        if other.value != named[0].value:
            raise _contradiction(
                *(claim._replace(quoted=f"{claim.value} ({claim.quoted})") for claim in (named[0], other))
            )
    return named[0] if named else None


def _whole(ratio: _Claim | None, motion: _Claim | None, load: _Claim | None) -> _Claim | None:
    """Return the unit of a motion per load: as it is given, or from that of the motion and that of the load.

    What is not given is in SI; the caller asks for it where the file need not mean SI.
    """
    if ratio is not None:
        above, _, below = ratio.quoted.strip("'").rpartition("/")
        for part, text in ((motion, above), (load, below)):
            if part is not None and not _agrees_with_part(part, text, ratio):
                raise _contradiction(ratio, part)
        return ratio
    if motion is None:
        return None if load is None or load.value.factor == 1.0 else _per_load(load)
    divisor = 1.0 if load is None else load.value.factor
    moment = False if load is None else load.value.moment
    reading = motion.value._replace(kind="ratio", factor=motion.value.factor / divisor, moment=moment)
    quoted = motion.quoted if load is None else f"{motion.quoted} over {load.quoted}"
    return _Claim("ratio", reading, quoted, motion.where)


def _per_load(load: _Claim) -> _Claim:
    """Return the unit of a motion in SI per load in a unit of its own."""
    reading = UnitReading("ratio", 1.0 / load.value.factor, moment=load.value.moment)
    return _Claim("ratio", reading, load.quoted, load.where)


def _agrees_with_part(part: _Claim, text: str, ratio: _Claim) -> bool:
    """Return whether the unit of a motion or a load is that in the unit of the whole, as lbf is in g/lbf."""
    reading = read_unit(text.strip())
    if reading is None or reading.kind != part.fact:
        return (part.value.quantity in (None, ratio.value.quantity)) and part.value.moment in (
            False,
            ratio.value.moment,
        )
    return _equal(part.value, reading)


def _moments(ratio: _Claim | None, load: _Claim | None) -> list[_Claim]:
    return [claim._replace(fact="moment", value=claim.value.moment) for claim in (ratio, load) if claim is not None]


def _contradiction(one: _Claim, other: _Claim) -> MeasurementError:
    problem = f"the file contradicts itself: {one.quoted} here, and {other.quoted} at {other.where}."
    if one.where == other.where:
        problem = f"the file contradicts itself: {one.quoted} and {other.quoted}."
    return MeasurementError(Fault(one.where, problem, remedy="Correct the file, or export it again."))


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
    for about, text, where, _ in mentions:
        if about == "axis unit" and frequency_factor(text) != 1.0:
            raise MeasurementError(
                Fault(where, f"'{text[:40]}' is mentioned, and the frequency has no unit.", "Hz", remedy)
            )
    return 1.0


_FRF_UNITS = "um/N, mm/s/N, m/s^2/N, g/N, in/lbf, rad/(N m)"
_ACCEPTED_UNITS: dict[str, str] = {
    "unit": f"a motion per force or moment, such as {_FRF_UNITS}",
    "motion unit": ", ".join(motion_unit(q, rotation=r) for r in (False, True) for q in QUANTITIES)
    + ", or "
    + ", ".join(unit_of(q) for q in QUANTITIES),
    "load unit": "N, lbf, N m",
}
_ACCEPTED_LABELS = f"a motion per force or moment: {', '.join(QUANTITIES)}"
_HOW_TO_CORRECT = "Correct the file, or export it in SI units."
