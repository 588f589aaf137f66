"""A frequency axis from the start and the step that an archive contains instead of the frequencies."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.errors import Fault, MeasurementError
from dovetail.interfaces import ArrayEntry, RecordedArrays
from dovetail.measurement.content.column_names import FIELD_NAMES, plain_name
from dovetail.measurement.frf_units import frequency_factor
from dovetail.measurement.quantity_words import axis_unit_in_name
from dovetail.measurement.recording import MOST_LINES

_STEPS = (
    *("df", "df_hz", "delta_f", "deltaf", "f_step", "fstep", "freq_step", "frequency_step", "increment", "step"),
    *("freq_increment", "frequency_increment", "frequency_resolution", "freq_resolution"),
)
_FREQUENCY_STEPS = tuple(name for name in _STEPS if name.startswith(("df", "delta", "f")))
"""Names of steps that can only be those of a frequency."""
_SAME = 0.01
"""Largest relative difference of two steps, or of two frequencies, that are equal: programs write few digits."""
_STARTS = (
    *("f_start", "fstart", "f_start_hz", "start", "start_value", "f0", "f_min", "fmin", "start_frequency"),
    *("frequency_start", "freq_start", "start_freq", "first_frequency"),
)
_ENDS = (
    "f_end",
    "fend",
    "f_stop",
    "fstop",
    "f_last",
    "end_frequency",
    "stop_frequency",
    "frequency_end",
    "last_frequency",
)
_COUNTS = ("number_of_values", "n_lines", "num_lines", "n_freq", "nf", "number_of_lines")
_VALUES = ("values", "real", "amplitude", "db")


def with_even_axis(archive: RecordedArrays, names: Mapping[str, str]) -> RecordedArrays:
    """Return an archive with an entry ``frequency`` in place of each start and step, unless it has frequencies.

    Raises
    ------
    MeasurementError
        A step without a start.
    """
    entries = archive.entries
    if "frequency" in names and names["frequency"] in entries:
        return archive
    if any(plain_name(name) in FIELD_NAMES["frequency"] for name in entries):
        return archive
    made: dict[str, ArrayEntry] = {}
    used: set[str] = set()
    for step in [name for name in entries if plain_name(name) in _STEPS]:
        folder = re.match(r"(?:.*[/.])?", step)
        prefix = folder[0] if folder else ""
        start, count, end = (_entry_next_to(entries, prefix, words) for words in (_STARTS, _COUNTS, _ENDS))
        if start is None:
            problem = f"'{step}' is the step of the frequency, and there is no start."
            remedy = "Save the first frequency too, as f_start, or the frequencies themselves."
            raise MeasurementError(Fault(str(archive.path), problem, ", ".join(_STARTS[:4]), remedy))
        load = partial(_axis, archive, (start, step, end), count, names)
        made[f"{prefix}frequency"] = ArrayEntry(f"from {start} in steps of {step}", load)
        used |= {step, start, *([count] if count is not None else [])}
    kept = {name: entry for name, entry in entries.items() if name not in used}
    return replace(archive, entries={**kept, **made}) if made else archive


def check_other_axes(
    archive: RecordedArrays,
    fields: Mapping[str, str],
    frequency: NDArray[np.float64],
    scale: float,
    skip: Sequence[str],
) -> None:
    """Refuse an archive in which a step, or another array of frequencies, contradicts the frequencies that are read.

    Parameters
    ----------
    archive : RecordedArrays
    fields : mapping of str to str
        From fields of the FRF to the names of entries; entries of other folders are left out.
    frequency : (n_freq,) array
        As in the file.
    scale : float
        Converts them to Hz.
    skip : sequence of str
        Names that do not concern the values, as the caller says.

    Raises
    ------
    MeasurementError
    """
    if not np.isfinite(frequency).all():
        return  # refused where frequencies are checked
    folder = re.match(r"(?:.*[/.])?", fields["frequency"])
    prefix = folder[0] if folder else ""
    steps = np.diff(frequency)
    for name, entry in archive.entries.items():
        last_part = name[len(prefix) :]
        if not name.startswith(prefix) or re.search(r"[/.]", last_part) or name in fields.values() or last_part in skip:
            continue
        said = ""
        if plain_name(name) in _FREQUENCY_STEPS and len(steps) and np.allclose(steps, steps[0], rtol=_SAME):
            step = _loaded(entry)
            if step.size == 1 and not np.isclose(step.ravel()[0], steps[0], rtol=_SAME):
                said = f"'{name}' = {step.ravel()[0]:g} is not the step of the frequencies, which is {steps[0]:g}."
        elif (unit := axis_unit_in_name(last_part)) and not entry.what.startswith("text") and last_part.lower() != "w":
            other, factor = _loaded(entry), frequency_factor(unit)
            if (
                other.size == frequency.size
                and factor
                and not np.allclose(
                    other.ravel() * factor,
                    frequency * scale,
                    rtol=_SAME,
                    atol=_SAME * scale * abs(steps).max(initial=0.0),
                )
            ):
                said = f"'{name}' [{unit}] and '{fields['frequency']}' are different frequencies."
        if said:
            remedy = f"Correct the file; or, if it does not concern the values: `names={{'skip': '{last_part}'}}`."
            raise MeasurementError(Fault(f"{archive.path}  {name}", said, remedy=remedy))


def _loaded(entry: ArrayEntry) -> NDArray[Any]:
    """Return the real numbers of an entry; none of one that cannot be read."""
    try:
        array = entry.load()
    except MeasurementError:
        return np.zeros(0)
    return array if array.dtype.kind in "fiu" else np.zeros(0)


def _entry_next_to(entries: Mapping[str, ArrayEntry], prefix: str, words: tuple[str, ...]) -> str | None:
    """Return the name of the only entry in a folder that is called by one of some words."""
    found = [name for name in entries if name.startswith(prefix) and plain_name(name) in words]
    found = [name for name in found if not re.search(r"[/.]", name[len(prefix) :])]
    return found[0] if len(found) == 1 else None


def _axis(
    archive: RecordedArrays, ends: tuple[str, str, str | None], count: str | None, names: Mapping[str, str]
) -> NDArray[Any]:
    start, step, end = ends
    first, width = (_number(archive, name) for name in (start, step))
    lines = int(_number(archive, count)) if count is not None else _length(archive, names)
    if not (0 < lines <= MOST_LINES and np.isfinite(first) and width > 0):
        problem = f"the frequency starts at {first:g} with a step of {width:g} and has {lines} lines."
        raise MeasurementError(Fault(str(archive.path), problem))
    axis = np.asarray(first + width * np.arange(lines), dtype=np.float64)
    if end is not None and abs(_number(archive, end) - axis[-1]) > 2.0 * width + _SAME * axis[-1]:
        problem = f"'{end}' = {_number(archive, end):g}, and {lines} lines from {first:g} in steps of {width:g} end at"
        raise MeasurementError(Fault(str(archive.path), f"{problem} {axis[-1]:g}."))
    return axis


def _number(archive: RecordedArrays, name: str) -> float:
    array = archive.entries[name].load()
    if array.size != 1 or array.dtype.kind not in "fiu":
        raise MeasurementError(Fault(f"{archive.path}  {name}", "one real number was expected."))
    return float(array.ravel()[0])


def _length(archive: RecordedArrays, names: Mapping[str, str]) -> int:
    """Return the largest dimension of the values, which is that of the frequency."""
    chosen = [names[field] for field in _VALUES if field in names]
    known = [name for name in archive.entries if any(plain_name(name) in FIELD_NAMES[field] for field in _VALUES)]
    for name in chosen or known:
        if name in archive.entries:
            return max(archive.entries[name].load().shape, default=0)
    return 0
