"""What the header of a set 58 states: data types, axis labels, unit labels and id lines."""

from __future__ import annotations

import re
from collections.abc import Iterator

from dovetail.errors import Fault, MeasurementError
from dovetail.measurement.formats.uff_sets import ORDINATE, Meaning, UffSet
from dovetail.measurement.free_text import read_texts
from dovetail.measurement.recording import ReadOptions
from dovetail.measurement.statements import About, Statement, interpret
from dovetail.measurement.statements import Meaning as StatedMeaning

_NO_LABEL = ("", "none")
_SI_SYSTEM = 1
_OWN_LINE = re.compile(r"\s*(averages|response|force)\s*[:=]", re.IGNORECASE)
"""Keys of id lines that the reader uses."""
_LABELS: dict[str, About] = {
    "ordinate_axis_lab": "label",
    "orddenom_axis_lab": "load label",
    "abscissa_axis_lab": "axis label",
}
_UNITS: dict[str, About] = {
    "ordinate_axis_units_lab": "unit",
    "orddenom_axis_units_lab": "load unit",
    "abscissa_axis_units_lab": "axis unit",
}
_NAMES = {
    "ordinate_axis_lab": "label of the ordinate",
    "orddenom_axis_lab": "label of the denominator",
    "abscissa_axis_lab": "label of the abscissa",
    "ordinate_axis_units_lab": "unit of the ordinate",
    "orddenom_axis_units_lab": "unit of the denominator",
    "abscissa_axis_units_lab": "unit of the abscissa",
}


def statements_of(uff_set: UffSet) -> list[Statement]:
    """Return what data types, axis labels and unit labels of a set state."""
    fields, where = uff_set.fields, uff_set.where
    statements = [
        Statement("motion quantity", word, f"{where}, data type {number}")
        for number, word, _ in ORDINATE.values()
        if fields["ordinate_spec_data_type"] == number
    ]
    for key, about in (_LABELS | _UNITS).items():
        text = str(fields[key]).strip()
        if text.lower() not in _NO_LABEL:
            statements.append(Statement(about, text, f"{where}, {_NAMES[key]}"))
    return statements


def texts_of(uff_set: UffSet) -> Iterator[tuple[str, str, str]]:
    """Yield the id lines of a set that the reader does not use."""
    for key in ("id1", "id2", "id3", "id4", "id5"):
        text = str(uff_set.fields[key]).strip()
        if text.lower() not in _NO_LABEL and not (key != "id1" and _OWN_LINE.match(text)):
            yield "", text, f"{uff_set.where}, id line {key[2:]}"


def interpret_set(
    uff_set: UffSet, meaning: Meaning, options: ReadOptions, *, is_si_file: bool
) -> tuple[StatedMeaning, list[Statement]]:
    """Return what all statements of an FRF's set mean together, and what is only mentioned.

    Parameters
    ----------
    uff_set : UffSet
    meaning : Meaning
        Of types and unit labels.
    options : ReadOptions
    is_si_file : bool
        Whether set 164 states SI units.

    Raises
    ------
    MeasurementError
        A contradiction, or a statement that is not understood.
    """
    free_text = read_texts(texts_of(uff_set), options.skip)
    stated = interpret([*statements_of(uff_set), *free_text.statements])
    if stated.moment and not uff_set.moment:
        problem = "the denominator is a moment by its label, and a force by its direction."
        raise MeasurementError(Fault(uff_set.where, problem, remedy="Correct the file, or export it again."))
    sign = -1.0 if meaning.factor < 0 else 1.0
    factor = meaning.factor if meaning.unit else sign * stated.factor
    stated = stated._replace(
        quantity=stated.quantity or meaning.quantity,
        per_load=stated.per_load or meaning.over_force,
        factor=factor,
        unit=meaning.unit or stated.unit,
    )
    mentions = list(free_text.mentions)
    if is_si_file and abs(factor) != 1.0:
        mentions.append(Statement("disputed unit", stated.unit, uff_set.where))
        stated = stated._replace(factor=sign, unit="")
    return stated, mentions


def check_unit_system(content: bytes, sets: list[UffSet]) -> bool:
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
            shown = code.decode("ascii", errors="replace")
            raise MeasurementError(
                Fault(
                    uff_set.where,
                    f"the file is in the system of units {shown!r}.",
                    "1 (m, N)",
                    "Export it in SI units.",
                )
            )
    return is_si
