"""What the data types and unit labels of a universal file say."""

from __future__ import annotations

from typing import NamedTuple

from dovetail.errors import Fault, MeasurementError
from dovetail.frf import QUANTITIES, Quantity, unit_of
from dovetail.measurement.uff_sets import UffSet
from dovetail.measurement.unit_labels import converted, motion_unit, spelled

__all__ = ["ABSCISSA_TYPES", "FORCE", "ORDINATE", "Meaning", "check_unit_system", "meaning_of"]

ORDINATE: dict[Quantity, tuple[int, str, str]] = {
    "receptance": (8, "Displacement", "m"),
    "mobility": (11, "Velocity", "m/s"),
    "accelerance": (12, "Acceleration", "m/s^2"),
}
"""Data type of the ordinate's numerator, its name and its SI unit."""
FORCE = 13
ABSCISSA_TYPES = (0, 1, 18)
"""Unknown, general, frequency."""
_UNKNOWN = (0, 1)
_QUANTITY_OF: dict[int, Quantity] = {number: quantity for quantity, (number, _, _) in ORDINATE.items()}
_NO_LABEL = ("", "none")
_SI_SYSTEM = 1


class Meaning(NamedTuple):
    """What the values of a set are.

    Parameters
    ----------
    quantity : Quantity or None
        From the data types or the unit labels.
    over_force : bool
        The header says that the motion is per force.
    factor : float
        Makes the values SI; negative where response and reference point in directions of opposite sense.
    unit : str
        Its label, empty where there is none.
    """

    quantity: Quantity | None
    over_force: bool
    factor: float
    unit: str = ""


def meaning_of(one: UffSet) -> Meaning:
    """Return what the header of a set says about its values.

    Raises
    ------
    MeasurementError
        Not a motion over a force, half a rotation, or a unit label that is not understood.
    """
    _check_types(one)
    fields = one.fields
    sign = -1.0 if fields["rsp_dir"] * fields["ref_dir"] < 0 else 1.0
    stated = _QUANTITY_OF.get(fields["ordinate_spec_data_type"])
    above, below = _spelled(one, "ordinate_axis_units_lab"), _spelled(one, "orddenom_axis_units_lab")
    over_force = fields["orddenom_spec_data_type"] == FORCE or bool(below)
    if not above:
        return Meaning(stated, over_force, sign / _force(one, below))
    candidates = QUANTITIES if stated is None else (stated,)
    units = [(q, unit_of(q, rotation=one.is_rotation), motion_unit(q, rotation=one.is_rotation)) for q in candidates]
    for quantity, frf, motion in units:
        if (whole := converted(above, frf)) is not None:
            return Meaning(quantity, True, sign * whole, above)
        if (alone := converted(above, motion)) is not None:
            return Meaning(quantity, over_force, sign * alone / _force(one, below), f"{above} over {below or 'N'}")
    accepted = " or ".join(f"{motion}, {frf}" for _, frf, motion in units)
    raise _not_understood(one, above, accepted)


def _check_types(one: UffSet) -> None:
    fields = one.fields
    numerator, denominator = fields["ordinate_spec_data_type"], fields["orddenom_spec_data_type"]
    if numerator not in (*_UNKNOWN, *_QUANTITY_OF) or denominator not in (*_UNKNOWN, FORCE):
        raise MeasurementError(
            Fault(
                one.where,
                f"the data are of type {numerator} over type {denominator}.",
                "displacement (8), velocity (11) or acceleration (12) over excitation force (13)",
            )
        )
    if (abs(fields["rsp_dir"]) > 3) != (abs(fields["ref_dir"]) > 3):
        accepted = "a translation over a force, or a rotation over a moment"
        raise MeasurementError(Fault(one.where, "either the response or the reference is a rotation.", accepted))
    label = fields["abscissa_axis_units_lab"].strip().lower()
    if label not in (*_NO_LABEL, "hz"):
        raise MeasurementError(Fault(one.where, f"the frequencies are in {label!r}.", "Hz"))


def _force(one: UffSet, label: str) -> float:
    """Return newtons, or newton metres, per labelled unit of the denominator; 1 where there is no label."""
    unit = "N m" if one.is_rotation else "N"
    si = converted(label, unit) if label else 1.0
    if si is None:
        raise _not_understood(one, label, unit)
    return si


def _spelled(one: UffSet, field: str) -> str:
    return spelled(one.fields[field])


def _not_understood(one: UffSet, label: str, accepted: str) -> MeasurementError:
    return MeasurementError(
        Fault(
            one.where, f"the unit label '{label}' is not understood.", f"a unit of {accepted}", "Export it in SI units."
        )
    )


def check_unit_system(content: bytes, sets: list[UffSet]) -> None:
    """Refuse a file whose set 164 announces another system of units than SI (m, N).

    Raises
    ------
    MeasurementError
        Units code other than 1.
    """
    for one in sets:
        if one.kind != 164:
            continue
        record = content[one.start : one.end][:500].splitlines()[2:3]
        code = record[0][:10].strip() if record else b""
        if code != b"%d" % _SI_SYSTEM:
            shown = code.decode("ascii", errors="replace")
            raise MeasurementError(
                Fault(one.where, f"the file is in the system of units {shown!r}.", "1 (m, N)", "Export it in SI units.")
            )
