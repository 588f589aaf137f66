"""FRFs in files of named arrays, such as NPZ, HDF5 and MATLAB files."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.errors import Fault, MeasurementError, listing
from dovetail.frf import MOST_AVERAGES
from dovetail.interfaces import RecordedArrays, Statement
from dovetail.measurement.content.column_arrays import columns_of_array, find_matrix
from dovetail.measurement.content.column_names import (
    FIELD_NAMES,
    NUMERIC_FIELDS,
    VALUE_FIELDS,
    assign_fields,
    combine_values,
    plain_name,
    quantity_of_name,
    taken_for,
)
from dovetail.measurement.content.even_axis import check_other_axes, with_even_axis
from dovetail.measurement.content.part_units import check_parts
from dovetail.measurement.content.unused_entries import points_of_columns, read_unused
from dovetail.measurement.point_statements import End
from dovetail.measurement.quantity_words import axis_unit_in_name, unit_in_name
from dovetail.measurement.recording import ReadOptions, Recording, parse_quantity, point_fields
from dovetail.measurement.statements import check_axis, fields_of, interpret, meaning_of_file

_LONGEST_TEXT = 1000
_MISSING = ("fillvalue", "_fillvalue", "missing_value", "missingvalue", "fill_value")
_NUMBER = re.compile(r"[-+]?\d[\d.]*(?:[eE][-+]?\d+)?")
_SAY_UNIT = "Save a text frequency_unit with the array, or the frequencies in Hz."


def read_recording(archive: RecordedArrays, options: ReadOptions) -> Recording:
    """Return the FRF in an archive.

    Raises
    ------
    MeasurementError
        Fields that are missing or ambiguous, with a list of the file's contents; shapes and types that do not fit;
        statements that contradict each other or are not understood.
    """
    if (matrix := find_matrix(archive, options)) is not None:
        free_text = read_unused(archive, {"values": matrix}, options.skip)
        table = archive.entries[matrix].load()
        return columns_of_array(archive.path, table, replace(options, names={}), _shown(archive, matrix), free_text)
    archive = with_even_axis(archive, options.names)
    if archive.closed and not any(plain_name(name) in FIELD_NAMES["frequency"] for name in archive.entries):
        raise MeasurementError(*archive.closed)
    where = str(archive.path)
    names = assign_fields(where, {name: entry.what for name, entry in archive.entries.items()}, options.names)
    _check_folders(where, names, options.names)
    fields = _load_fields(archive, names, options)

    def locate(index: int) -> str:
        return f"{where}  line {index + 1} of the arrays"

    values, has_phase = combine_values(fields, locate)
    free_text = read_unused(archive, names, options.skip)
    meaning, mentions = meaning_of_file(_statements(archive, names), free_text)
    averages = _read_averages(archive, names)
    scale = check_axis(meaning, mentions, _SAY_UNIT)
    check_parts(names, free_text.claims, meaning.unit, where, averages, fields["frequency"] * scale)
    check_other_axes(archive, names, fields["frequency"], scale, options.skip)
    axes = _axes_of_frfs(archive, names)
    points = [*free_text.points, *points_of_columns(archive, names, _chosen(options), axes)]
    return Recording(
        where=where,
        label=archive.path.name,
        frequency=fields["frequency"] * scale,
        values=values,
        has_phase=has_phase,
        coherence=fields.get("coherence"),
        locate=locate,
        how_to_state_quantity="a text 'quantity' or 'unit' in the file",
        averages=averages,
        variance=fields.get("variance"),
        taken=taken_for(names, list(archive.entries)),
        mentions=[one for one in mentions if not ("db" in names and one.text.lower() == "db")],
        **fields_of(meaning),
        **point_fields({name: _read_text(archive, names, name) for name in ("response", "force", "note")}, points),
    )


def _axes_of_frfs(archive: RecordedArrays, names: Mapping[str, str]) -> list[int]:
    """Return the lengths of the axes of an array of values that are not that of the frequency; one FRF has none."""
    lines = archive.entries[names["frequency"]].load().size
    field = next(field for field in ("values", "real", "amplitude", "db") if field in names)
    shape = archive.entries[names[field]].load().shape
    wide = [length for length in shape if length > 1]
    return wide[: wide.index(lines)] + wide[wide.index(lines) + 1 :] if lines in wide else []


def _chosen(options: ReadOptions) -> dict[End, int]:
    """Return the numbers of the response and the force that the options choose."""
    given: dict[End, Any] = {"response": options.response, "force": options.force, "point": options.index}
    return {end: int(number) for end, number in given.items() if re.fullmatch(r"[1-9]\d{0,5}", str(number))}


def _shown(archive: RecordedArrays, name: str) -> str:
    return f"the only array, '{name}'," if len(archive.entries) == 1 else f"'{name}'"


def _statements(archive: RecordedArrays, names: Mapping[str, str]) -> list[Statement]:
    """Return what the quantity, the unit and the names of the values state."""
    statements = []
    if word := _read_text(archive, names, "quantity"):
        parse_quantity(word, f"{archive.path}  quantity")
        statements.append(Statement("quantity", word, f"{archive.path}  its word"))
    if label := _read_text(archive, names, "unit"):
        statements.append(Statement("unit", label, f"{archive.path}  unit"))
    _check_quantities(archive, names, statements)
    for field_name in VALUE_FIELDS & set(names):
        name = re.split(r"[/.]", names[field_name])[-1]
        if field_name == "db":
            continue
        statements.append(Statement("label", name, f"{archive.path}  {names[field_name]}"))
        if unit := unit_in_name(name):
            statements.append(Statement("unit", unit, f"{archive.path}  {names[field_name]}"))
    axis = names["frequency"]
    if unit := axis_unit_in_name(re.split(r"[/.]", axis)[-1]):
        statements.append(Statement("axis unit", unit, f"{archive.path}  {axis}"))
    return statements


def _check_quantities(archive: RecordedArrays, names: Mapping[str, str], statements: Sequence[Statement]) -> None:
    """Refuse a word, a unit and a name of the values that state different quantities."""
    meanings = {"quantity": "its word", "unit": "its unit"}
    quantities = {meanings[one.about]: interpret([one]).quantity for one in statements}
    quantities["the name of the values"] = quantity_of_name(names.get("values", ""))
    known = {source: quantity for source, quantity in quantities.items() if quantity is not None}
    if len(set(known.values())) > 1:
        each = ", ".join(f"{quantity} by {source}" for source, quantity in known.items())
        raise MeasurementError(Fault(str(archive.path), f"the file contradicts itself: {each}."))


def _check_folders(where: str, names: Mapping[str, str], chosen: Mapping[str, str]) -> None:
    """Refuse parts of the values from different folders, unless the caller chooses them."""
    parts = [names[name] for name in VALUE_FIELDS & set(names) if name not in chosen]
    if len({re.sub(r"[^/.]*$", "", part) for part in parts}) > 1:
        problem = f"{listing(repr(part) for part in sorted(parts))} are not parts of one FRF."
        raise MeasurementError(
            Fault(where, problem, remedy="Say which they are: `names={'real': 'NAME', 'imag': 'NAME'}`.")
        )


def _load_fields(archive: RecordedArrays, names: Mapping[str, str], options: ReadOptions) -> dict[str, NDArray[Any]]:
    """Return the arrays with a number for each line, each of shape (n_freq,)."""
    frequency = _load_numbers(archive, names["frequency"], "frequency", "real")
    if frequency.size != max(frequency.shape, default=0) or frequency.size == 0:
        raise _shape_error(archive, names["frequency"], frequency, "(n_freq,) real numbers")
    fields = {"frequency": frequency.ravel()}
    lines = frequency.size
    sizes: dict[str, int] = {}
    for field_name in NUMERIC_FIELDS[1:]:
        if field_name in names:
            array = _load_numbers(
                archive, names[field_name], field_name, "complex" if field_name == "values" else "real"
            )
            sizes[field_name] = array.size
            fields[field_name] = _select_frf(archive, names[field_name], array, lines, options)
    several = sorted({size // lines for size in sizes.values()})
    if len(several) > 1:
        held = listing(f"'{names[field]}' holds {size // lines}" for field, size in sizes.items())
        remedy = "Say that one does not belong to these FRFs: `names={'skip': 'coherence'}`, with its name."
        raise MeasurementError(Fault(str(archive.path), f"{held}: not one for each FRF.", remedy=remedy))
    if options.chooses and several[-1:] == [1]:
        problem = f"{options.chooses} chooses one of several FRFs, and the file holds one."
        raise MeasurementError(Fault(str(archive.path), problem))
    return fields


def _load_numbers(archive: RecordedArrays, name: str, field_name: str, kind: str) -> NDArray[Any]:
    array = archive.entries[name].load()
    accepted = {"real": "fiu", "complex": "c"}[kind]
    if array.dtype.kind not in accepted:
        is_real = field_name == "values" and array.dtype.kind in "fiu"
        amplitude = "; an amplitude alone is called amplitude" if is_real else ""
        raise _shape_error(archive, name, array, f"(n_freq,) {kind} numbers{amplitude}")
    numbers = array.astype(np.complex128 if kind == "complex" else np.float64)
    _check_filled(archive, name, numbers)
    return numbers


def _check_filled(archive: RecordedArrays, name: str, numbers: NDArray[Any]) -> None:
    """Refuse numbers that stand for missing ones, as attributes say in netCDF and other files."""
    for key, text in archive.entries[name].attributes.items():
        if plain_name(key) in _MISSING and (match := _NUMBER.search(text)):
            lines = np.flatnonzero(numbers.real == float(match[0]))
            if lines.size:
                problem = f"{lines.size} of its numbers are {match[0]}, which says that they are missing ({key})."
                remedy = "Remove these lines from the file: a measurement need not be evenly spaced."
                raise MeasurementError(Fault(f"{archive.path}  {name}", problem, remedy=remedy))


def _select_frf(
    archive: RecordedArrays, name: str, array: NDArray[Any], lines: int, options: ReadOptions
) -> NDArray[Any]:
    """Return the values (n_freq,) of the selected FRF from an array with an axis of frequencies."""
    if array.size == max(array.shape, default=0) != lines:
        raise MeasurementError(Fault(str(archive.path), f"'{name}' has {array.size} lines, the frequency has {lines}."))
    axes = [axis for axis, length in enumerate(array.shape) if length == lines]
    if len(axes) != 1 and array.size != lines:
        problem = f"'{name}' has the shape {array.shape}, and {len(axes)} axes are as long as the frequency ({lines})."
        raise MeasurementError(Fault(str(archive.path), problem, "one axis of frequencies, at most two of DOFs"))
    if array.size == lines:
        return array.ravel()
    others = np.moveaxis(array, axes[0], 0)
    wide = [length for length in others.shape[1:] if length > 1]
    table = others.reshape(lines, *wide)
    frf: NDArray[Any] = table.reshape(lines, -1)[:, _select_column(archive, name, tuple(wide), options)]
    return frf


def _select_column(archive: RecordedArrays, name: str, shape: tuple[int, ...], options: ReadOptions) -> int:
    """Return the index of the selected FRF among those of an array, in C order."""
    selectors: tuple[str, ...] = ("response", "force") if len(shape) > 1 else ("index", "response", "force")
    wanted = [value for selector in selectors if (value := getattr(options, selector)) is not None]
    numbers = tuple(int(wish) if re.fullmatch(r"\d{1,6}", str(wish)) else 0 for wish in wanted)
    if len(numbers) != len(shape) or any(not 1 <= n <= length for n, length in zip(numbers, shape, strict=True)):
        say = " and ".join(selectors) if len(shape) > 1 else "one of " + ", ".join(selectors)
        ranges = ", ".join(f"1 to {length}" for length in shape)
        problem = f"'{name}' holds {' x '.join(map(str, shape))} FRFs; choose one."
        raise MeasurementError(
            Fault(str(archive.path), problem, f"numbers of {ranges}", f"Choose it by {say}, counted from 1.")
        )
    return int(np.ravel_multi_index([number - 1 for number in numbers], shape))


def _shape_error(archive: RecordedArrays, name: str, array: NDArray[Any], accepted: str) -> MeasurementError:
    problem = f"'{name}' has the shape {array.shape} and the type {array.dtype}."
    return MeasurementError(Fault(str(archive.path), problem, accepted))


def _read_text(archive: RecordedArrays, names: Mapping[str, str], field_name: str) -> str:
    """Return a text by its name in the file, or from the attributes of the values or of the file; '' without one."""
    if field_name in names:
        array = archive.entries[names[field_name]].load()
        if array.size != 1 or array.dtype.kind not in "US":
            raise MeasurementError(Fault(f"{archive.path}  {names[field_name]}", "the array is not one word."))
        word = array.reshape(())[()]
        text = word.decode("utf-8", errors="replace") if isinstance(word, bytes) else str(word)
        return text.strip()[:_LONGEST_TEXT]
    values_entry = next(names[kind] for kind in ("values", "real", "amplitude", "db") if kind in names)
    for attributes in (archive.entries[values_entry].attributes, archive.attributes):
        for key in (field_name, f"{field_name}s"):
            if key in attributes:
                return attributes[key].strip()[:_LONGEST_TEXT]
    return ""


def _read_averages(archive: RecordedArrays, names: Mapping[str, str]) -> int | None:
    if "averages" not in names:
        return None
    array = archive.entries[names["averages"]].load()
    number = array.reshape(-1)[0] if array.size == 1 and array.dtype.kind in "fiu" else np.nan
    if not (1 <= number <= MOST_AVERAGES and number == int(number)):
        raise _shape_error(archive, names["averages"], array, "a number of averages of 1 or more")
    return int(number)
