"""What the header of a set 58 states: data types, axis labels, unit labels and id lines."""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterator, Sequence
from typing import Literal

from dovetail import Fault, MeasurementError, Statement, read_unit
from dovetail_plugins.readers.uff_sets import FORCE, ORDINATE, UNKNOWN, UffSet

_SI_SYSTEM = 1
_OTHER_SYSTEM = re.compile(r"\bmm\b|\bcm\b|milli|inch|\bin\b|foot|\bft\b|pound|kilogram f", re.IGNORECASE)
"""Words in the description of the units that are not those of SI."""
_OWN_LINE = re.compile(r"\s*(response|force)\s*[:=]", re.IGNORECASE)
"""Keys of id lines that the reader uses if the header gives no node."""
_NODES = {"response": "rsp_node", "force": "ref_node"}
_TIME_TYPES = (*UNKNOWN, 17)
_COUNTS = ("sample", "samples", "point", "points", "index", "n", "#")
"""Units of an abscissa that counts samples, so that the rate is not given."""


def id_lines(uff_set: UffSet) -> Iterator[Statement]:
    """Yield the id lines of a set that the reader does not use."""
    for number in range(1, 6):
        text = uff_set.label(f"id{number}")
        own = _OWN_LINE.match(text) if number > 1 else None
        if text and not (own and not uff_set.fields[_NODES[own[1].lower()]]):
            yield Statement("text", text, f"{uff_set.where}, id line {number}")


def frf_statements(uff_set: UffSet) -> list[Statement]:
    """Return what data types, labels, unit labels and id lines of an FRF state.

    Raises
    ------
    MeasurementError
        Not a motion over a force or a moment, or frequencies that are not in Hz.
    """
    _check_frf_types(uff_set)
    statements = [
        Statement("motion quantity", word, f"{uff_set.where}, data type {number}")
        for number, word, _ in ORDINATE.values()
        if uff_set.fields["ordinate_spec_data_type"] == number
    ]
    for about, field, name in (
        ("label", "ordinate_axis_lab", "label of the ordinate"),
        ("load label", "orddenom_axis_lab", "label of the denominator"),
        ("axis label", "abscissa_axis_lab", "label of the abscissa"),
        ("unit", "ordinate_axis_units_lab", "unit of the ordinate"),
        ("load unit", "orddenom_axis_units_lab", "unit of the denominator"),
        ("axis unit", "abscissa_axis_units_lab", "unit of the abscissa"),
    ):
        if text := uff_set.label(field):
            statements.append(Statement(about, text, f"{uff_set.where}, {name}"))  # type: ignore[arg-type]
    per_load = read_unit(text := uff_set.label("z_axis_axis_units_lab"))
    if per_load is not None and per_load.kind == "ratio":  # otherwise that of a covariate, such as rpm
        statements.append(Statement("unit", text, f"{uff_set.where}, unit of the z axis"))
    return [*statements, *_other_half(uff_set), *id_lines(uff_set)]


def _other_half(uff_set: UffSet) -> Iterator[Statement]:
    """Yield the unit of the motion or of the load that the header leaves out: it is that of SI."""
    above, below = uff_set.label("ordinate_axis_units_lab"), uff_set.label("orddenom_axis_units_lab")
    reading = read_unit(above)
    if above and not below and reading is not None and reading.kind == "motion":
        yield Statement("load unit", "N m" if uff_set.moment else "N", f"{uff_set.where}, unit of the denominator")
    if below and not above and not uff_set.rotation:
        units = {number: unit for number, _, unit in ORDINATE.values()}
        if unit := units.get(uff_set.fields["ordinate_spec_data_type"]):
            yield Statement("motion unit", unit, f"{uff_set.where}, unit of the ordinate")


def _check_frf_types(uff_set: UffSet) -> None:
    fields = uff_set.fields
    numerator, denominator = fields["ordinate_spec_data_type"], fields["orddenom_spec_data_type"]
    known = (*UNKNOWN, *(number for number, _, _ in ORDINATE.values()))
    if numerator not in known or denominator not in (*UNKNOWN, FORCE):
        problem = f"the data are of type {numerator} over type {denominator}."
        accepted = "displacement (8), velocity (11) or acceleration (12) over excitation force (13)"
        raise MeasurementError(Fault(uff_set.where, problem, accepted))
    directions, word = (abs(fields["rsp_dir"]), abs(fields["ref_dir"])), uff_set.label("orddenom_axis_lab").lower()
    if max(directions) > 3 and min(directions) == 0 and word not in ("force", "moment"):
        accepted = "directions of both, 1 to 3 or 4 to 6; or 'Force' or 'Moment' on the axis of the denominator"
        raise MeasurementError(Fault(uff_set.where, "either the response or the reference is a rotation.", accepted))
    label = uff_set.label("abscissa_axis_units_lab").lower()
    if label not in ("", "hz"):
        raise MeasurementError(Fault(uff_set.where, f"the frequencies are in {label!r}.", "Hz"))


def signal_statements(uff_set: UffSet) -> list[Statement]:
    """Return what data type, labels, unit labels and id lines of a time record state.

    Raises
    ------
    MeasurementError
        Not a force or a motion over time, such as a strain, a rotation or an impulse response.
    """
    _check_signal_types(uff_set)
    where, statements = uff_set.where, []
    for number, word, _ in ORDINATE.values():
        if uff_set.fields["ordinate_spec_data_type"] == number:
            statements.append(Statement("motion quantity", word, f"{where}, data type"))
    texts = {"label": "ordinate_axis_lab", "unit": "ordinate_axis_units_lab", "axis label": "abscissa_axis_lab"}
    for about, field in texts.items():
        if text := uff_set.label(field):
            statements.append(Statement(about, text, where))  # type: ignore[arg-type]
    if (unit := uff_set.label("abscissa_axis_units_lab")) and not counts_samples(uff_set):
        statements.append(Statement("axis unit", unit, where))
    lines = (f"id{number}" for number in range(1, 6))
    return statements + [Statement("text", uff_set.label(line), f"{where}, {line}") for line in lines]


def counts_samples(uff_set: UffSet) -> bool:
    """Return whether the abscissa of a time record counts samples."""
    return uff_set.label("abscissa_axis_units_lab").lower() in _COUNTS


def signal_role(uff_set: UffSet) -> Literal["force", "response", ""]:
    """Return what a time record is of according to its data type; empty if the type is unknown."""
    kind = uff_set.fields["ordinate_spec_data_type"]
    return "" if kind in UNKNOWN else "force" if kind == FORCE else "response"


def _check_signal_types(uff_set: UffSet) -> None:
    fields = uff_set.fields
    kind, below = fields["ordinate_spec_data_type"], fields["orddenom_spec_data_type"]
    if kind not in (*UNKNOWN, FORCE, *(number for number, _, _ in ORDINATE.values())):
        name = uff_set.label("ordinate_axis_lab")
        accepted = "displacement (8), velocity (11), acceleration (12), excitation force (13)"
        raise MeasurementError(Fault(uff_set.where, f"the data are of type {kind} ('{name}').", accepted))
    if below not in UNKNOWN or uff_set.label("orddenom_axis_units_lab"):
        problem = "the time record has a denominator, as an impulse response has."
        raise MeasurementError(Fault(uff_set.where, problem, "the time record of a force or of a motion"))
    if fields["abscissa_spec_data_type"] not in _TIME_TYPES:
        problem = f"the abscissa is of type {fields['abscissa_spec_data_type']}."
        raise MeasurementError(Fault(uff_set.where, problem, "a time (17)"))
    if abs(fields["rsp_dir"]) > 3 or (kind == FORCE and abs(fields["ref_dir"]) > 3):
        problem = "the record is that of a rotation or a moment."
        raise MeasurementError(Fault(uff_set.where, problem, "directions 1 to 3"))


def check_unit_system(content: bytes, sets: Sequence[UffSet]) -> bool:
    """Return whether set 164 states SI units (m, N); refuse a file in which it states others.

    Raises
    ------
    MeasurementError
        Units code other than 1, or a factor to SI other than 1.
    """
    is_si = False
    for uff_set in sets:
        if uff_set.kind != 164:
            continue
        is_si = True
        records = content[uff_set.start : uff_set.end][:500].splitlines()[2:4]
        code = records[0][:10].strip() if records else b""
        factors = re.findall(rb"[-+]?\d+(?:\.\d*)?(?:[eEdD][-+]?\d+)?", records[1])[:2] if len(records) > 1 else []
        if code == b"%d" % _SI_SYSTEM and any(float(number.upper().replace(b"D", b"E")) != 1.0 for number in factors):
            problem = "the units code is 1 (m, N), and the factors to SI are not 1."
            raise MeasurementError(Fault(uff_set.where, problem, "factors of 1", "Export it in SI units."))
        if code != b"%d" % _SI_SYSTEM:
            problem = f"the file is in the system of units {code.decode('ascii', errors='replace')!r}."
            raise MeasurementError(Fault(uff_set.where, problem, "1 (m, N)", "Export it in SI units."))
        words = records[0][10:30].decode("latin-1").strip()
        if _OTHER_SYSTEM.search(words):
            warnings.warn(f"{uff_set.where}: the units code is 1 (m, N), and its text is '{words}'.", stacklevel=2)
    return is_si
