"""What the entries and attributes of an archive state that are not read as fields of the FRF."""

from __future__ import annotations

import math
import re
import warnings
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from numpy.typing import NDArray

from dovetail.errors import Fault, MeasurementError
from dovetail.frf import unit_of
from dovetail.interfaces import RecordedArrays, Statement
from dovetail.measurement.acting_numbers import is_harmless_number, may_act
from dovetail.measurement.changed_values import find_change
from dovetail.measurement.content.column_names import FIELD_NAMES, VALUE_FIELDS, plain_name
from dovetail.measurement.free_text import SKIP, FreeText, read_texts
from dovetail.measurement.frf_units import read_unit
from dovetail.measurement.named_points import DOF
from dovetail.measurement.point_statements import LISTS, End, PointStatement, end_of_key
from dovetail.measurement.quantity_words import words_of
from dovetail.measurement.text_pairs import UNIT_WORDS, axis_setting

_FRF_WORDS = frozenset(word for field in (*VALUE_FIELDS, "frequency") for word in FIELD_NAMES[field])
_FACTOR = re.compile(r"(.*)unit_transformation[./]factor")
_SUBJECTS = {
    **{name: name for name in ("frequency", "coherence", "variance")},
    **dict.fromkeys(("phase_deg", "phase_rad"), "phase"),
}
_LABELS = ("label", "name", "title", "long_name", "standard_name", "display_name")
"""Attributes of an array that say what it is."""
_LONGEST = 1000
_MOST_TEXTS = 100
"""Texts of an array that are read."""
_MOST_NUMBERS = 1000
"""Numbers of an array that are looked at, such as a delay for each channel."""
_FEWEST_OF_LIST = 2
_SAME = 1e-4
"""Largest relative difference of a factor from that of its unit, which programs write with few digits."""


def read_unused(archive: RecordedArrays, fields: Mapping[str, str], skip: tuple[str, ...]) -> FreeText:
    """Return what entries and attributes state that are not read as fields of the FRF.

    Entries of other FRFs, in folders or structs of their values_name, are left out.

    Parameters
    ----------
    archive : RecordedArrays
    fields : mapping of str to str
        From fields of the FRF to the names of entries.
    skip : tuple of str
        Names that do not concern the values, as the caller says.

    Raises
    ------
    MeasurementError
        A number that may act on the values, or a unit that is not understood.
    """
    texts, factors, values_name = list(_attribute_texts(archive, fields)), {}, _values_of(fields)
    if "note" in fields and not {"quantity", "unit"} <= set(fields):  # with both it is as Dovetail writes it
        note = _load(archive, fields["note"])
        texts += [] if note is None else [("note", text, f"{archive.path}  {fields['note']}") for text in _texts(note)]
    for name in ("response", "force"):
        if (
            name in fields
            and not {"quantity", "unit"} <= set(fields)
            and (words := _load(archive, fields[name])) is not None
        ):
            words_of_dof = [text for text in _texts(words) if not DOF.fullmatch(text)]
            texts += [(name, text, f"{archive.path}  {fields[name]}") for text in words_of_dof]
    of_columns = {cell for cells in _cells_of_columns(archive, fields).values() for cell in cells}
    for name in _concerned(archive, fields):
        if name in of_columns or {name, plain_name(name), re.split(r"[/.]", name)[-1]} & set(skip):
            continue
        value = _load(archive, name)
        if value is None or value.size == 0:
            if value is None and may_act(name):
                raise _acts(archive, name, "")
        elif value.dtype.kind in "US":
            if value.size > 1 and end_of_key(_key(name, fields)):
                continue  # names of columns, of which one is chosen
            key = f"dB {_key(name, fields)}" if "db" in fields and _is_reference(name) else _key(name, fields)
            texts += [(key, text, f"{archive.path}  {name}") for key, text in _keyed(key, value)]
        elif value.size == 1 and value.ravel()[0] == 1 and (value.dtype.kind == "b" or _is_flag(name)):
            texts.append(("", _as_words(_key(name, fields)), f"{archive.path}  {name}"))
        elif value.dtype.kind in "fiuc" and (match := _FACTOR.fullmatch(name)) and value.size == 1:
            factors[match[1]] = float(value.real.ravel()[0])
        elif value.dtype.kind in "iu" and value.size == 1 and end_of_key(_key(name, fields)) and value.ravel()[0] >= 0:
            texts.append((_key(name, fields), str(value.ravel()[0]), f"{archive.path}  {name}"))
        elif value.dtype.kind in "fiuc":
            _check_numbers(archive, name, value, is_near_values=not _branch(name, values_name))
            if value.size == 1 and axis_setting(key := _key(name, fields), text := f"{value.real.ravel()[0]:.17g}"):
                texts.append((key, text, f"{archive.path}  {name}"))
            if "db" in fields and value.size == 1 and _is_reference(name) and value.ravel()[0] != 1:
                raise _acts(archive, name, f" = {value.ravel()[0]:.6g}")
    return _with_factors(archive, read_texts(texts, skip), factors)


def points_of_columns(
    archive: RecordedArrays, fields: Mapping[str, str], chosen: Mapping[End, int], axes: Sequence[int]
) -> Iterator[PointStatement]:
    """Yield the points that lists of names or nodes give for the chosen FRF among those of an array.

    Parameters
    ----------
    archive : RecordedArrays
    fields : mapping of str to str
        From fields of the FRF to the names of entries.
    chosen : mapping of str to int
        Numbers of the chosen response and force, or of the FRF, from 1.
    axes : sequence of int
        Lengths of the axes of responses and forces, or of the only axis of FRFs.

    Warns
    -----
    UserWarning
        A list has another length than its axis; it is not used.
    """
    for name, (end, labels) in _lists_of_points(archive, fields).items():
        lengths = {axes[0 if end == "response" else 1]} if len(axes) == 2 and end != "point" else set(axes)
        if not axes and end == "point":
            continue  # such as both channels of one FRF
        if len(labels) not in lengths:
            held = f"{' x '.join(map(str, axes))} FRFs" if axes else "one FRF"
            text = f"the list names {len(labels)} points, and '{_values_of(fields)}' holds {held}; it is not used."
            warnings.warn(f"{archive.path}  {name}: {text} Check which point belongs to which FRF.", stacklevel=3)
            continue
        for one, number in chosen.items():
            if (end in (one, "point") or one == "point") and number <= len(labels):
                yield PointStatement(one if end == "point" else end, labels[number - 1])


def _lists_of_points(archive: RecordedArrays, fields: Mapping[str, str]) -> dict[str, tuple[End, list[str]]]:
    """Return each list with a point for each column: an array of texts or numbers, or a cell array of texts."""
    lists: dict[str, tuple[End, list[str]]] = {}
    cells = _cells_of_columns(archive, fields)
    for base, names in cells.items():
        values = [_load(archive, name) for name in names]
        if all(value is not None and _texts(value) for value in values):
            lists[base] = _end_of_list(_key(base, fields)), [_texts(value)[0] for value in values if value is not None]
    for name in _concerned(archive, fields):
        value = _load(archive, name)
        if value is None or value.size < _FEWEST_OF_LIST or value.dtype.kind not in "USiu":
            continue
        if end := _end_of_list(_key(name, fields)):
            lists[name] = end, _texts(value) if value.dtype.kind in "US" else list(map(str, value.ravel()))
    return lists


def _end_of_list(key: str) -> End:
    return end_of_key(key) or ("point" if LISTS & set(words_of(key)) else "")


def _cells_of_columns(archive: RecordedArrays, fields: Mapping[str, str]) -> dict[str, list[str]]:
    """Return the entries of each cell array with a point for each column, such as OutputName{1} and OutputName{2}."""
    cells: dict[str, list[str]] = {}
    for name in _concerned(archive, fields):
        base, _, number = name.removesuffix("}").rpartition("{")
        if name.endswith("}") and number.isdecimal() and _end_of_list(_key(base, fields)):
            cells.setdefault(base, []).append(name)
    return {base: names for base, names in cells.items() if len(names) >= _FEWEST_OF_LIST}


def _attribute_texts(archive: RecordedArrays, fields: Mapping[str, str]) -> Iterator[tuple[str, str, str]]:
    """Yield the attributes of the FRF's entries, of the groups that contain them, and of the file."""
    for field, name in fields.items():
        if field in VALUE_FIELDS or field in ("frequency", "coherence", "variance"):
            for key, text in archive.entries[name].attributes.items():
                subject = _SUBJECTS.get(field, "values" if plain_name(key) in _LABELS else "")
                yield f"{subject} {key}".strip(), text, f"{archive.path}  {name}, attribute {key}"
    groups = [group for group in archive.group_attributes if any(name.startswith(group) for name in fields.values())]
    for group in groups:
        for key, text in archive.group_attributes[group].items():
            yield key, text, f"{archive.path}  {group.rstrip('/')}, attribute {key}"
    for key, text in archive.attributes.items():
        if key not in ("quantity", "note"):
            yield key, text, f"{archive.path}  attribute {key}"


def _concerned(archive: RecordedArrays, fields: Mapping[str, str]) -> Iterator[str]:
    """Yield the names of entries that are not read and that do not belong to another FRF."""
    used = set(fields.values())
    values_name = _values_of(fields)
    others: dict[str, bool] = {}
    for name in archive.entries:
        if name in used:
            continue
        branch = _branch(name, values_name)
        if branch and branch not in others:
            inside = [other for other in archive.entries if other.startswith(branch) and other not in used]
            numbers = [other for other in inside if archive.entries[other].what != "text"]
            others[branch] = any(plain_name(other) in _FRF_WORDS for other in numbers)
        if not branch or not others[branch]:
            yield name


def _values_of(fields: Mapping[str, str]) -> str:
    return next((fields[field] for field in ("values", "real", "amplitude", "db") if field in fields), "")


def _branch(name: str, values_name: str) -> str:
    """Return the folder or struct that contains an entry and not the values, or an empty text."""
    steps = [match.end() for match in re.finditer(r"[/.]", name)]
    return next((name[:end] for end in steps if not values_name.startswith(name[:end])), "")


def _key(name: str, fields: Mapping[str, str]) -> str:
    """Return an entry's name without the folders that it shares with the values."""
    values_name = _values_of(fields)
    shared = max((m.end() for m in re.finditer(r"[/.]", name) if values_name.startswith(name[: m.end()])), default=0)
    return name[shared:]


def _load(archive: RecordedArrays, name: str) -> NDArray[Any] | None:
    """Return the contents of an entry, or None if it is large or cannot be read."""
    entry = archive.entries[name]
    if not entry.is_small:
        return None
    try:
        return entry.load()
    except MeasurementError:
        return None


def _texts(value: NDArray[Any]) -> list[str]:
    """Return the texts of an array."""
    words: list[Any] = value.reshape(-1)[:_MOST_TEXTS].tolist() if value.dtype.kind in "US" else []
    return [(one.decode("utf-8", errors="replace") if isinstance(one, bytes) else str(one))[:_LONGEST] for one in words]


def _as_words(name: str) -> str:
    """Return the last part of a name as words: ``is db`` for ``isDB`` and ``is_dB``."""
    own = re.split(r"[/.]", name)[-1].replace("dB", "db")
    return " ".join(re.findall(r"[^\W_]+", re.sub(r"(?<=[a-z])(?=[A-Z])", " ", own)))


def _is_flag(name: str) -> bool:
    return words_of(re.split(r"[/.]", name)[-1])[:1] in (["is"], ["has"])


def _is_reference(name: str) -> bool:
    return bool({"ref", "reference"} & set(words_of(name)))


def _keyed(key: str, value: NDArray[Any]) -> list[tuple[str, str]]:
    """Return the texts of an array with their keys: rows of two are keys and values, others have the array's name."""
    words = _texts(value)
    pairs = (value.ndim == 2 and value.shape[1] == 2) or (value.ndim == 1 and len(words) == 2)
    rows = list(zip(words[::2], words[1::2], strict=False)) if pairs and not UNIT_WORDS & set(words_of(key)) else []
    if rows:
        return [*rows, *([] if value.ndim == 2 else [(key, word) for word in words])]
    if len(words) > 1 and not UNIT_WORDS & set(words_of(key)):
        return [("", word) for word in words]
    return [(key, word) for word in words]


def _check_numbers(archive: RecordedArrays, name: str, value: NDArray[Any], *, is_near_values: bool) -> None:
    """Refuse numbers that may act on the values.

    A single one next to the values has to be a setting of the measurement; others are judged by their names.
    """
    if value.size == 1 and (is_near_values or may_act(name)):
        if value.ravel()[0] == 1 and find_change("", _as_words(name)):
            raise _acts(archive, name, " = 1")
        if not is_harmless_number(name, complex(value.ravel()[0])):
            raise _acts(archive, name, f" = {value.ravel()[0]:.6g}")
    elif value.size > 1 and may_act(name):
        numbers = set(value.ravel()[:_MOST_NUMBERS].tolist())
        if not all(is_harmless_number(name, complex(number)) for number in numbers):
            raise _acts(archive, name, "")


def _acts(archive: RecordedArrays, name: str, value: str) -> MeasurementError:
    problem = f"'{name[:60]}'{value} is not understood, and may act on the values."
    return MeasurementError(Fault(f"{archive.path}  {name[:60]}", problem, remedy=SKIP.replace("NAME", name[:60])))


def _with_factors(archive: RecordedArrays, free_text: FreeText, factors: Mapping[str, float]) -> FreeText:
    """Return the statements with those of Testlab's units, which a factor next to the label explains.

    Testlab stores SI and displays the label's unit, for which it multiplies by the factor. A factor to SI, or of 1,
    says that the values are in the label's unit.
    """
    for prefix, factor in factors.items():
        where = f"{archive.path}  {prefix}label"
        values_name = [statement for statement in free_text.statements if statement.where == where]
        reading = read_unit(values_name[0].text) if values_name else None
        if (
            reading is not None
            and reading.kind == "ratio"
            and math.isclose(factor * reading.factor, 1.0, rel_tol=_SAME)
        ):
            assert reading.quantity is not None
            unit = unit_of(reading.quantity, rotation=reading.rotation, moment=reading.moment)
            free_text.statements[free_text.statements.index(values_name[0])] = Statement("unit", unit, where)
        elif factor != 1.0 and (reading is None or not math.isclose(factor, reading.factor, rel_tol=_SAME)):
            raise _acts(archive, f"{prefix}unit_transformation.factor", f" = {factor:.6g}")
    return free_text
