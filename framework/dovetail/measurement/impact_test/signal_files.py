"""Files with time records of impact tests: arrays, tables and universal files."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from dovetail.atomic_files import read_bounded
from dovetail.errors import Fault, MeasurementError, did_you_mean, listing
from dovetail.frf import QUANTITIES, Quantity
from dovetail.measurement.formats import guarded, lvm, npz, tables, uff_reader
from dovetail.measurement.formats.archives import Archive
from dovetail.measurement.formats.column_names import plain_name
from dovetail.measurement.formats.text_tables import find_rows, find_table, read_rows, split_lines, suffix_by_content
from dovetail.measurement.frf_units import conversion_factor, motion_unit, pint_spelling

__all__ = ["Signals", "read_signals"]

_NAMES = {
    "force": ("force", "excitation", "hammer", "exc"),
    "response": ("response", "acceleration", "velocity", "displacement", "resp"),
    "rate": ("rate", "sampling_rate", "sample_rate", "fs"),
    "time": ("time", "t", "time_s"),
}
_ARCHIVES = (".npz", ".mat", ".h5", ".hdf5")
_TABLES = (".csv", ".tsv", ".txt")
_SUFFIXES = (*_ARCHIVES, *_TABLES, ".lvm", ".uff", ".unv")
_HEADERS = "time,force,response | time,force 1,response 1,..."
_EVEN = 0.1
"""Largest error of a time, relative to the step, since files have few decimals."""

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Signals:
    """The records of an impact test.

    Parameters
    ----------
    force, response : (n_impacts, n_samples) arrays
        N, and the SI unit of the response.
    rate : float
        Samples per second.
    quantity : Quantity
        Quantity of the response over the force.
    """

    force: Array
    response: Array
    rate: float
    quantity: Quantity


def read_signals(
    path: str | os.PathLike[str],
    *,
    force_unit: str = "N",
    response_unit: str = "m/s^2",
    rate: float | None = None,
    names: Mapping[str, str] | None = None,
    columns: Sequence[str] = (),
) -> Signals:
    """Read force and response of one or more impacts.

    Parameters
    ----------
    path : path
        ``.npz``, ``.mat``, ``.h5``: arrays ``force`` and ``response`` of shape (n_impacts, n_samples) or
        (n_samples,), and ``rate`` [Hz] or ``time`` [s]. ``.csv``, ``.tsv``, ``.txt``: any lines, a header, a column
        ``time`` [s] unless `rate` is given, and columns whose names begin with ``force`` and ``response``, a pair for
        each impact.
        ``.uff``, ``.unv``: time responses (function type 1) in pairs of a force (data type 13) and a motion.
        ``.lvm``: channels whose names begin with one of a force and one of a motion; a segment for each impact.
    force_unit, response_unit : str
        Units of the numbers; ``"g"`` is the standard gravity. Labels in the file take precedence.
    rate : float, optional
        Samples per second, if the file does not state it.
    names : mapping of str to str, optional
        Names of ``force``, ``response``, ``rate`` and ``time`` in an archive.
    columns : sequence of str, optional
        The columns of a table, instead of its header: ``("time", "force", "response", "skip")``.

    Returns
    -------
    Signals

    Raises
    ------
    FileError
        The file is missing, empty, not a file, larger than 100 MB, or cannot be read.
    MeasurementError
        It does not contain pairs of evenly sampled records.
    DovetailError
        HDF5 and MATLAB 7.3 need h5py, which is not installed.
    """
    source = Path(path)
    if source.suffix.lower() not in _SUFFIXES:
        raise MeasurementError(Fault(str(source), "this is no file of time records.", ", ".join(_SUFFIXES)))
    content = read_bounded(source)
    suffix = suffix_by_content(source, content)
    if columns and suffix not in _TABLES:
        problem = f"columns={','.join(columns)} is for tables, not for {suffix} files."
        raise MeasurementError(Fault(str(source), problem))
    file_rate: float | None
    if suffix in (".uff", ".unv"):
        force, response, file_rate, units = uff_reader.read_time_records(source, content)
    elif suffix == ".lvm":
        force, response, file_rate, units = _from_labview(source, content)
    elif suffix in _ARCHIVES:
        archive, units = _open_archive(source, content, names or {}), ("", "")
        force, response, file_rate = _from_archive(archive, names or {})
    else:
        force, response, file_rate, units = _from_table(source, content, columns)
    force_unit, response_unit = units[0] or force_unit, units[1] or response_unit
    sampling_rate = file_rate if rate is None else rate
    if sampling_rate is None:
        raise MeasurementError(Fault(str(source), "the file does not say the sampling rate.", remedy="Give the rate."))
    quantity, factor = _response_unit(response_unit)
    return Signals(force * _force_unit(force_unit), response * factor, float(sampling_rate), quantity)


def _open_archive(path: Path, content: bytes, names: Mapping[str, str]) -> Archive:
    if path.suffix.lower() == ".npz":
        return npz.open_archive(path, content)
    wanted = [*names.values(), *(name for spellings in _NAMES.values() for name in spellings)]
    return guarded.read_arrays(path, content, wanted)


def _force_unit(label: str) -> float:
    newtons = conversion_factor(pint_spelling(label), "N")
    if newtons is None:
        raise MeasurementError(Fault("the argument force_unit", f"'{label}' is no unit of a force.", "N, lbf, ..."))
    return newtons


def _response_unit(label: str) -> tuple[Quantity, float]:
    for quantity in QUANTITIES:
        if (factor := conversion_factor(pint_spelling(label), motion_unit(quantity, rotation=False))) is not None:
            return quantity, factor
    accepted = "m/s^2, g, m/s, mm/s, m, um, ..."
    raise MeasurementError(Fault("the argument response_unit", f"'{label}' is no unit of a motion.", accepted))


def _from_archive(archive: Archive, chosen: Mapping[str, str]) -> tuple[Array, Array, float | None]:
    arrays: dict[str, Array] = {}
    for signal, spellings in _NAMES.items():
        matching = [name for name in archive.entries if plain_name(name) in spellings]
        names = [chosen[signal]] if signal in chosen else matching
        if len(names) > 1:
            raise MeasurementError(Fault(str(archive.path), f"{listing(names)} may each be the {signal}: say which."))
        for name in names:
            if name not in archive.entries:
                hint = did_you_mean(name, archive.entries)
                raise MeasurementError(Fault(str(archive.path), f"there is no '{name}' in the file.", remedy=hint))
            array = archive.entries[name].load()
            if array.dtype.kind not in "fiu" or array.ndim > 2 or (signal == "rate" and np.unique(array).size != 1):
                problem = f"'{name}' has the shape {array.shape} and the type {array.dtype}."
                raise MeasurementError(Fault(str(archive.path), problem, "real numbers, and one rate"))
            arrays[signal] = array.astype(np.float64)
    if not {"force", "response"} <= set(arrays):
        held = ", ".join(list(archive.entries)[:20]) or "nothing"
        accepted = "arrays force and response, of shape (n_impacts, n_samples), and rate or time"
        raise MeasurementError(Fault(str(archive.path), f"force or response are missing; there is: {held}.", accepted))
    force, response = (_rows(arrays[signal]) for signal in ("force", "response"))
    if "rate" in arrays:
        return force, response, float(arrays["rate"].reshape(-1)[0])
    return force, response, _rate(archive.path, arrays["time"].ravel()) if "time" in arrays else None


def _rows(array: Array) -> Array:
    """Return records as rows; in MATLAB, a single record, and often several, are columns."""
    table = np.atleast_2d(array)
    return table.T if table.shape[0] > table.shape[1] else table


def _from_table(path: Path, data: bytes, columns: Sequence[str]) -> tuple[Array, Array, float | None, tuple[str, str]]:
    lines = split_lines(path, data)
    if columns:
        table = find_rows(str(path), lines, columns, [*chain(*_signal_columns(columns).values())])
    else:
        remedy = "Say what each column holds: --columns time,force,response,skip."
        table = find_table(str(path), lines, lambda cells: bool(_signal_columns(cells)["force"]), _HEADERS, remedy)
    signals = _signal_columns(table.header)
    if not signals["force"] or len(signals["force"]) != len(signals["response"]):
        problem = f"the header has {len(signals['force'])} columns of force and {len(signals['response'])} of response."
        raise MeasurementError(Fault(f"{path}:{table.line + 1}", problem, _HEADERS))
    wanted = [*chain(*signals.values())]
    _, rows = read_rows(table, table.header, wanted)
    count = len(signals["force"])
    beside = tables.names_and_units(table.header)[1]
    stated = [own or below.strip("[]()") for own, below in zip(beside, table.units or beside, strict=True)]
    labels = [{stated[column] for column in part if not stated[column].isdigit()} for part in signals.values()]
    second = conversion_factor("".join(labels[2]) or "s", "s")
    if second is None or any(len(each) > 1 for each in labels):
        raise MeasurementError(Fault(f"{path}:{table.line + 1}", f"the columns are in {', '.join(stated)}.", "s, N, g"))
    units = "".join(labels[0]), "".join(labels[1])
    return rows[:count], rows[count : 2 * count], _rate(path, rows[-1] * second) if signals["time"] else None, units


def _from_labview(path: Path, content: bytes) -> tuple[Array, Array, float, tuple[str, str]]:
    """Return force and response (n_impacts, n_samples), the sampling rate [Hz], and the units of both."""
    segments = lvm.read_segments(path, content)
    first = segments[0]
    if any(s.names != first.names or s.axis.shape != first.axis.shape for s in segments):
        raise MeasurementError(Fault(str(path), "the segments differ in channels or length."))
    columns = [
        [i for i, name in enumerate(first.names) if plain_name(name).startswith(_NAMES[signal])]
        for signal in ("force", "response")
    ]
    if first.dimension != "time" or any(len(column) != 1 for column in columns):
        problem = f"the abscissa is {first.dimension}, the channels are {', '.join(first.names[:20])}."
        accepted = "time, and channels whose names begin with Force and Response, one of each"
        raise MeasurementError(Fault(first.where, problem, accepted))
    force, response = (np.array([segment.channels[column[0]] for segment in segments]) for column in columns)
    units = first.units[columns[0][0]], first.units[columns[1][0]]
    return force, response, _rate(path, first.axis), ("N" if units[0] == "Newtons" else units[0], units[1])


def _signal_columns(cells: Sequence[str]) -> dict[str, list[int]]:
    """Return the columns of forces, of responses and, at most one, of the time."""
    names = [plain_name(name) for name in tables.names_and_units(cells)[0]]
    columns = {part: [i for i, name in enumerate(names) if re.match(part, name)] for part in ("force", "response")}
    return columns | {"time": [i for i, name in enumerate(names) if name in _NAMES["time"]][:1]}


def _rate(path: Path, time: Array) -> float:
    mean = float(np.mean(np.diff(time))) if len(time) > 1 else 0.0
    even = time[:1] + mean * np.arange(len(time))
    if not (np.isfinite(mean) and mean > 0 and np.all(np.abs(time - even) <= _EVEN * mean)):
        remedy = "If it has too few digits, leave it out (--columns skip,force,response) and give the rate (--rate)."
        raise MeasurementError(Fault(str(path), "the time does not increase in even steps.", remedy=remedy))
    return 1.0 / mean
