"""FRFs in files of named arrays: the common part of the readers of NPZ, HDF5 and MATLAB files."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.errors import Fault, MeasurementError
from dovetail.frf import Quantity
from dovetail.measurement.formats.column_names import (
    NUMERIC_FIELDS,
    assign_fields,
    combine_values,
    quantity_of_name,
    taken_for,
)
from dovetail.measurement.frf_units import UnitMeaning, meaning_of_unit
from dovetail.measurement.recording import MOST_LINES, ReadOptions, Recording, parse_quantity

__all__ = ["LARGEST_ARRAY", "Archive", "Entry", "read_recording"]

LARGEST_ARRAY = 40_000_000
"""Largest size of an unpacked array in bytes."""
_HERTZ = {"": 1.0, "hz": 1.0, "1/s": 1.0, "khz": 1e3, "rad/s": 1.0 / (2.0 * np.pi)}
_LONGEST_TEXT = 1000


@dataclass(frozen=True)
class Entry:
    """One array or text of a file, not loaded yet.

    Parameters
    ----------
    what : str
        Shape and type in words.
    load : callable
        Returns the array; a text is an array of one string.
    attributes : mapping of str to str
        Texts that the file attaches to the entry, such as its unit.
    """

    what: str
    load: Callable[[], NDArray[Any]] = field(repr=False)
    attributes: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Archive:
    """A file of named arrays.

    Parameters
    ----------
    path : Path
    entries : mapping of str to Entry
    attributes : mapping of str to str
        Texts that the file attaches to itself.
    """

    path: Path
    entries: Mapping[str, Entry]
    attributes: Mapping[str, str] = field(default_factory=dict)


def read_recording(archive: Archive, options: ReadOptions) -> Recording:
    """Return the FRF in an archive.

    Raises
    ------
    MeasurementError
        Fields that are missing or ambiguous, with a list of the file's contents; shapes and types that do not fit.
    """
    where = str(archive.path)
    _check_is_no_table(archive)
    names = assign_fields(where, {name: entry.what for name, entry in archive.entries.items()}, options.names)
    fields = _load_fields(archive, names, options)

    def locate(index: int) -> str:
        return f"{where}  line {index + 1} of the arrays"

    values, has_phase = combine_values(fields, locate)
    meaning = _read_unit(archive, names)
    quantity = _read_quantity(archive, names, meaning)
    return Recording(
        where=where,
        label=archive.path.name,
        frequency=fields["frequency"] * _hertz_per_unit(archive, names["frequency"]),
        values=values,
        has_phase=has_phase,
        quantity=quantity,
        is_stated=quantity is not None,
        coherence=fields.get("coherence"),
        locate=locate,
        how_to_state_quantity="a text 'quantity' or 'unit' in the file",
        note=_read_text(archive, names, "note"),
        factor=1.0 if meaning is None else meaning.factor,
        unit=_read_text(archive, names, "unit"),
        averages=_read_averages(archive, names),
        variance=fields.get("variance"),
        rotation=meaning is not None and meaning.rotation,
        moment=meaning is not None and meaning.moment,
        response=_read_text(archive, names, "response"),
        force=_read_text(archive, names, "force"),
        taken=taken_for(names, list(archive.entries)),
    )


def _check_is_no_table(archive: Archive) -> None:
    """Refuse a file whose only array is a matrix: its columns have no names."""
    if len(archive.entries) != 1:
        return
    ((name, entry),) = archive.entries.items()
    array = entry.load()
    if array.ndim == 2 and min(array.shape) > 1:
        problem = f"the only array, '{name}', has the shape {array.shape}, and its columns have no names."
        remedy = "Save each column under a name of its own, or all as a table (.csv), to be read with --columns."
        raise MeasurementError(
            Fault(str(archive.path), problem, "frequency and values | real, imag | amplitude", remedy)
        )


def _load_fields(archive: Archive, names: Mapping[str, str], options: ReadOptions) -> dict[str, NDArray[Any]]:
    """Return the arrays with a number for each line, each of shape (n_freq,)."""
    frequency = _load_numbers(archive, names["frequency"], "frequency", "real")
    if frequency.size != max(frequency.shape, default=0) or frequency.size == 0:
        raise _shape_error(archive, names["frequency"], frequency, "(n_freq,) real numbers")
    fields = {"frequency": frequency.ravel()}
    lines = frequency.size
    several = False
    for field_name in NUMERIC_FIELDS[1:]:
        if field_name in names:
            array = _load_numbers(
                archive, names[field_name], field_name, "complex" if field_name == "values" else "real"
            )
            several |= array.size > lines
            fields[field_name] = _select_frf(archive, names[field_name], array, lines, options)
    if options.chooses and not several:
        problem = f"{options.chooses} chooses one of several FRFs, and the file holds one."
        raise MeasurementError(Fault(str(archive.path), problem))
    return fields


def _load_numbers(archive: Archive, name: str, field_name: str, kind: str) -> NDArray[Any]:
    array = archive.entries[name].load()
    accepted = {"real": "fiu", "complex": "c"}[kind]
    if array.dtype.kind not in accepted:
        is_real = field_name == "values" and array.dtype.kind in "fiu"
        amplitude = "; an amplitude alone is called amplitude" if is_real else ""
        raise _shape_error(archive, name, array, f"(n_freq,) {kind} numbers{amplitude}")
    return array.astype(np.complex128 if kind == "complex" else np.float64)


def _select_frf(archive: Archive, name: str, array: NDArray[Any], lines: int, options: ReadOptions) -> NDArray[Any]:
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


def _select_column(archive: Archive, name: str, shape: tuple[int, ...], options: ReadOptions) -> int:
    """Return the index of the selected FRF among those of an array, in C order."""
    selectors: tuple[str, ...] = ("response", "force") if len(shape) > 1 else ("index", "response", "force")
    wanted = [value for selector in selectors if (value := getattr(options, selector)) is not None]
    numbers = tuple(int(wish) if re.fullmatch(r"\d{1,6}", str(wish)) else 0 for wish in wanted)
    if len(numbers) != len(shape) or any(not 1 <= n <= length for n, length in zip(numbers, shape, strict=True)):
        say = " and ".join(selectors) if len(shape) > 1 else "one of " + ", ".join(selectors)
        ranges = ", ".join(f"1 to {length}" for length in shape)
        problem = f"'{name}' holds {' x '.join(map(str, shape))} FRFs, and one is wanted."
        raise MeasurementError(
            Fault(str(archive.path), problem, f"numbers of {ranges}", f"Choose it by {say}, counted from 1.")
        )
    return int(np.ravel_multi_index([number - 1 for number in numbers], shape))


def _shape_error(archive: Archive, name: str, array: NDArray[Any], accepted: str) -> MeasurementError:
    problem = f"'{name}' has the shape {array.shape} and the type {array.dtype}."
    return MeasurementError(Fault(str(archive.path), problem, accepted))


def _read_text(archive: Archive, names: Mapping[str, str], field_name: str) -> str:
    """Return a text by its name in the file, or from the attributes of the values or of the file; '' without one."""
    if field_name in names:
        array = archive.entries[names[field_name]].load()
        if array.size != 1 or array.dtype.kind not in "US":
            raise MeasurementError(Fault(f"{archive.path}  {names[field_name]}", "the array is not one word."))
        word = array.reshape(())[()]
        text = word.decode("utf-8", errors="replace") if isinstance(word, bytes) else str(word)
        return text.strip()[:_LONGEST_TEXT]
    of_values = next(names[kind] for kind in ("values", "real", "amplitude", "db") if kind in names)
    for attributes in (archive.entries[of_values].attributes, archive.attributes):
        for key in (field_name, f"{field_name}s"):
            if key in attributes:
                return attributes[key].strip()[:_LONGEST_TEXT]
    return ""


def _read_unit(archive: Archive, names: Mapping[str, str]) -> UnitMeaning | None:
    label = _read_text(archive, names, "unit")
    return meaning_of_unit(label, f"{archive.path}  unit") if label else None


def _read_quantity(archive: Archive, names: Mapping[str, str], meaning: UnitMeaning | None) -> Quantity | None:
    """Return the quantity that the file states in words, by its unit or by the name of the values; all must agree."""
    word = _read_text(archive, names, "quantity")
    statements = {
        "its word": parse_quantity(word, f"{archive.path}  quantity") if word else None,
        "its unit": None if meaning is None else meaning.quantity,
        "the name of the values": quantity_of_name(names.get("values", "")),
    }
    stated = {source: quantity for source, quantity in statements.items() if quantity is not None}
    if len(set(stated.values())) > 1:
        each = ", ".join(f"{quantity} by {source}" for source, quantity in stated.items())
        raise MeasurementError(Fault(str(archive.path), f"the file contradicts itself: {each}."))
    return next(iter(stated.values()), None)


def _read_averages(archive: Archive, names: Mapping[str, str]) -> int | None:
    if "averages" not in names:
        return None
    array = archive.entries[names["averages"]].load()
    number = array.reshape(-1)[0] if array.size == 1 and array.dtype.kind in "fiu" else np.nan
    if not (1 <= number <= MOST_LINES and number == int(number)):
        raise _shape_error(archive, names["averages"], array, "a number of averages of 1 or more")
    return int(number)


def _hertz_per_unit(archive: Archive, name: str) -> float:
    """Return the factor from the frequency's unit, stated by its attribute, to Hz."""
    attributes = archive.entries[name].attributes
    label = attributes.get("unit", attributes.get("units", "")).strip()
    if label.lower() not in _HERTZ:
        raise MeasurementError(Fault(str(archive.path), f"'{name}' is in {label[:40]!r}.", "Hz, kHz, rad/s"))
    return _HERTZ[label.lower()]
