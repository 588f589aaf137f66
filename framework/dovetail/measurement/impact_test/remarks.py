"""What a file states about signals elsewhere: in lines above a table, attributes, and other entries of an archive."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field

from dovetail.errors import Fault, MeasurementError, argument
from dovetail.interfaces import Statement
from dovetail.measurement.acting_numbers import find_acting_number
from dovetail.measurement.frf_units import frequency_factor, read_unit
from dovetail.measurement.impact_test.record_length import NUMBER_AND_UNIT, StatedLength, read_length
from dovetail.measurement.impact_test.records import AxisFact, Point
from dovetail.measurement.impact_test.sensitivity import volts
from dovetail.measurement.impact_test.signal_names import Role, read_name
from dovetail.measurement.other_quantities import find_other_quantity, warn_of_exponential_window
from dovetail.measurement.point_statements import PointStatement, point_statements
from dovetail.measurement.quantity_words import read_label, word_set, words_of
from dovetail.measurement.text_pairs import json_entries, sentence

_UNIT_WORDS = word_set("unit units einheit einheiten uom eu")
_QUANTITY_WORDS = word_set("quantity type kind measurand dimension signal response motion label name")
_FORCE_WORDS = word_set("force forces excitation hammer exc load kraft")
_RESPONSE_WORDS = word_set("response responses resp acceleration velocity displacement accelerometer motion")
_KEY = re.compile(r"[#%!*;/\s\"]*([^:=]{1,60}?)\s*[:=]\s*(\S.*?)[\s\"]*")
_TWO_CELLS = re.compile(r"[#%!*/\s\"]*([^,;\t]{1,60}?)[\s\"]*[,;\t][\s\"]*([^,;\t]+?)[\s\"]*")
_IN_UNIT = re.compile(r"\bin\s+([^\s,;:=\"'()\[\]]+)")
_SENSITIVITY = re.compile(r"sensitiv|\bsens\b|empfindl|calib|kalib", re.IGNORECASE)
_POINT_WORDS = word_set("dof dofs node nodes point points direction directions position location")
_DOF = r"(?:[\w ]*:)?\d*\s?[+-]?\s?(?:r?[xyz])?"
_REMARKS = word_set(
    "title name file filename path project test comment comments note notes description remark operator"
)
_LONGEST = 1000


@dataclass
class Remarks:
    """Statements about the signals of a file.

    Parameters
    ----------
    skip : sequence of str
        Keys that the caller says do not concern the samples.
    statements : dict of str to list of Statement
        On units and quantities of force and response.
    mentions : dict of str to list of Statement
        Units in running text, which count only if nothing else gives one.
    points : dict of str to Point
        Of force and response.
    axis : list of AxisFact
    axis_units : dict of str to str
        Units of times, rates and steps that stand under a key of their own.
    numbers : list of (str, str, str)
        Keys, texts and places of numbers that may act on the samples.
    lengths : list of StatedLength
        Of the records.
    named_points : list of PointStatement
        Points in words, which only a model can explain.
    """

    skip: Sequence[str] = ()
    statements: dict[str, list[Statement]] = field(default_factory=lambda: {"force": [], "response": []})
    mentions: dict[str, list[Statement]] = field(default_factory=lambda: {"force": [], "response": []})
    points: dict[str, Point] = field(default_factory=dict)
    axis: list[AxisFact] = field(default_factory=list)
    axis_units: dict[str, str] = field(default_factory=dict)
    numbers: list[tuple[str, str, str]] = field(default_factory=list)
    lengths: list[StatedLength] = field(default_factory=list)
    named_points: list[PointStatement] = field(default_factory=list)

    def read_line(self, line: str, where: str) -> None:
        """Read a line of text, a key and a value or prose."""
        text = line[:_LONGEST].strip()
        cells = [cell.strip(" []()\"'#%") for cell in re.split(r"[,;\t]", text)]
        kinds = {reading.kind if (reading := read_unit(cell)) else "" for cell in cells}
        if len(cells) > 1 and kinds <= {"time", "load", "motion", "none"} and kinds & {"load", "motion"}:
            self.read("units", text, where)
        elif match := _KEY.fullmatch(text) or _TWO_CELLS.fullmatch(text):
            self.read(match[1].strip(), match[2], where)
        elif (pair := sentence(text.lstrip("#%!*;/ "))) is not None:
            self.read(pair.key, pair.value, where)
        elif text:
            self.named_points.extend(point_statements("", text))
            self._read_prose(text, where)
            warn_of_exponential_window("", text, where)

    def read(self, key: str, text: str, where: str, role: Role = "") -> None:
        """Read a key and its text; with a role, that of an attribute of this signal.

        Raises
        ------
        MeasurementError
            A unit that is not understood.
        """
        if key.strip().lower() in {name.strip().lower() for name in self.skip}:
            return
        if text.strip() and (entries := json_entries(key, text.strip())) is not None:
            for own, value in entries:
                self.read(own, value, where, role)
            return
        warn_of_exponential_window(key, text, where)
        words = set(words_of(key))
        role = role or _role_of(words)
        is_unit = role and (reading := read_unit(text)) is not None and reading.kind in ("load", "motion")
        if words & _UNIT_WORDS or is_unit:
            self._read_unit(words, text, where, role)
        elif words & _POINT_WORDS and re.fullmatch(_DOF, text.strip(), re.IGNORECASE):
            self._read_point(text.strip(), where, role)
        elif self._read_axis(key, text, where):
            return
        elif (length := read_length(key, text, where)) is not None:
            self.lengths.append(length)
        elif find_acting_number(key, text):
            self.numbers.append((key, text, where))
        elif _is_quantity(words, text) and role != "force":
            self.statements["response"].append(Statement("motion quantity", text, where))
        elif find_other_quantity(key, text):
            self.numbers.append((key, text, where))
        else:
            self.named_points.extend(point_statements(key, text))
            if (pair := sentence(text)) is not None:
                self.read(pair.key, pair.value, where, role)
            self._read_prose(text, where)

    def take_over(self, attached: Remarks) -> None:
        """Add what the statements on one signal say of the file as a whole."""
        self.numbers += attached.numbers
        self.lengths += attached.lengths

    def facts(self) -> tuple[AxisFact, ...]:
        """Return the facts on the times, in the units that other keys state."""
        return tuple(self.with_unit(fact) for fact in self.axis)

    def with_unit(self, fact: AxisFact) -> AxisFact:
        """Return a fact in the unit that another key states."""
        unit = self.axis_units.get(fact.kind, "")
        if unit and fact.unit and unit != fact.unit:
            problem = f"the unit of the {fact.kind} is given as '{fact.unit}' and as '{unit}'."
            raise MeasurementError(Fault(fact.where, problem, "one unit"))
        return fact._replace(unit=fact.unit or unit)

    def of(self, role: str, own: Sequence[Statement]) -> tuple[Statement, ...]:
        """Return the statements on a signal: its own, those on all of its kind, or else what text mentions."""
        statements = (*own, *self.statements[role])
        has_unit = any(
            "unit" in one.about or ("label" in one.about and read_label(one.text).units) for one in statements
        )
        return statements if has_unit else (*statements, *self.mentions[role])

    def point(self, role: str, own: Point) -> Point:
        """Return the point of a signal: its own, or that of all signals of its kind."""
        shared = self.points.get(role, Point())
        return own if own.name else shared._replace(sign=shared.sign * own.sign)

    def check_numbers(self, has_units: bool) -> None:
        """Refuse numbers that may act on the samples, such as a gain; a sensitivity only if no unit is given.

        Raises
        ------
        MeasurementError
        """
        for key, text, where in self.numbers:
            if has_units and (_SENSITIVITY.search(f"{key} {text}") or re.search(r"[mµuk]?V/", text)):
                continue
            problem = _problem(key, text)
            said = f"say so: {argument('names', {'skip': key})}" if key else "remove the line"
            remedy = (
                f"If the samples take it into account, {said}, and give their units: `force_unit=`, `response_unit=`. "
                "If they are voltages: `force_sensitivity=`, `response_sensitivity=`."
            )
            raise MeasurementError(Fault(where, problem, remedy=remedy))

    def _read_unit(self, words: set[str], text: str, where: str, role: Role) -> None:
        axis = next((read_name(word).role for word in words if read_name(word).role in ("times", "rate", "step")), "")
        if axis:
            if self.axis_units.setdefault(axis, text.strip()) != text.strip():
                problem = f"the unit of the {axis} is given as '{self.axis_units[axis]}' and as '{text.strip()[:40]}'."
                raise MeasurementError(Fault(where, problem, "one unit"))
            return
        cells = [cell.strip(" []()\"'") for cell in re.split(r"[,;\t|]", text) if cell.strip(" []()\"'")]
        for cell in cells:
            if cell.upper() == "SI":
                continue
            reading = read_unit(cell)
            by_kind = {"load": "force", "motion": "response"}.get(reading.kind if reading else "", "")
            roles = [role] if role else [by_kind] if by_kind else ["force", "response"] if volts(cell) else []
            if reading is not None and reading.kind in ("time", "none") and not role:
                continue
            if not roles or (len(cells) > 1 and role):
                whole = read_unit(text)
                of_frf = " (that of an FRF: the file has no signals)" if whole and whole.kind == "ratio" else ""
                problem = f"the unit '{text[:60]}' is not understood{of_frf}."
                raise MeasurementError(Fault(where, problem, "N, lbf, m/s^2, g, mm/s, ...", "Correct the file."))
            for one in roles:
                about = "load unit" if one == "force" else "motion unit"
                self.statements[one].append(Statement(about, cell, where))  # type: ignore[arg-type]

    def _read_point(self, text: str, where: str, role: Role) -> None:
        point = Point(re.sub(r"[+-]", "", text), text, -1.0 if "-" in text else 1.0)
        if role in ("force", "response"):
            self.points[role] = point
        elif point.sign < 0:
            problem = f"'{text}' does not say whether it is that of the force or of the response."
            raise MeasurementError(Fault(where, problem, "force direction, response direction"))

    def _read_axis(self, key: str, text: str, where: str) -> bool:
        name = read_name(key)
        if name.role not in ("rate", "step", "start"):
            return False
        match = NUMBER_AND_UNIT.fullmatch(text.strip())
        if match is None:
            return False
        if name.role == "start" and match[2] and getattr(read_unit(match[2]), "kind", "") != "time":
            return True  # the hour of the test
        if name.unit and match[2] and name.unit.lower() != match[2].lower():
            raise MeasurementError(Fault(where, f"'{key}: {text[:60]}' has two units.", "one unit"))
        self.axis.append(AxisFact(name.role, float(match[1]), match[2] or name.unit, where))
        return True

    def _read_prose(self, text: str, where: str) -> None:
        if _problem("", text):
            self.numbers.append(("", text, where))
        for match in _IN_UNIT.finditer(text):
            reading = read_unit(match[1].strip("."))
            if reading is not None and reading.kind in ("motion", "load") and frequency_factor(match[1]) is None:
                role = "force" if reading.kind == "load" else "response"
                about = "load unit" if role == "force" else "motion unit"
                self.mentions[role].append(Statement(about, match[1].strip("."), where))  # type: ignore[arg-type]


def _problem(key: str, text: str) -> str:
    """Return why a remark may act on the samples, which may be voltages if it gives a sensitivity."""
    sensitivity = re.search(r"\d\s*[mµu]?V/\S+", text)
    found = f"'{sensitivity[0]}' may act on the samples." if sensitivity else ""
    return find_acting_number(key, text) or find_other_quantity(key, text) or found


def _role_of(words: set[str]) -> Role:
    force, response = words & _FORCE_WORDS, words & _RESPONSE_WORDS
    if bool(force) == bool(response):
        return ""
    return "force" if force else "response"


def _is_quantity(words: set[str], text: str) -> bool:
    label = read_label(text)
    named = {*label.motions, *label.quantities}
    count = len(words_of(text))
    if words & _QUANTITY_WORDS:
        return 0 < count <= 3 and (len(named) == 1 or bool(label.unclear))
    return 0 < count <= 2 and len(label.motions) == 1 and not label.unclear and not words & _REMARKS
