"""The time records of impact tests in files of any format."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dovetail.errors import Fault, MeasurementError, argument, counted, did_you_mean, listing
from dovetail.frf import QUANTITIES, Quantity
from dovetail.interfaces import Recorded, RecordedArrays, RecordedChannels, RecordedSignal, plugin_errors
from dovetail.measurement.content.sets import is_dof, sets_of
from dovetail.measurement.frf_files import arrays_of_fields, check_suffix, read_content
from dovetail.measurement.frf_units import motion_unit, read_unit
from dovetail.measurement.impact_test.interpretation import Choice, Scale, choose_points, sampling_rate, scale_of
from dovetail.measurement.impact_test.record_arrays import read_archive
from dovetail.measurement.impact_test.record_length import contradicted
from dovetail.measurement.impact_test.record_sets import read_sets
from dovetail.measurement.impact_test.record_tables import read_channels, read_columns, read_table
from dovetail.measurement.impact_test.records import Pair
from dovetail.measurement.impact_test.remarks import Remarks
from dovetail.measurement.impact_test.sensitivity import volts
from dovetail.measurement.point_statements import PointStatement
from dovetail.registry import PluginPaths, components
from dovetail.registry.catalogue import label_of

_PARTS = ("force", "response", "rate", "time", "skip")
_EVEN = 0.1
"""Largest error of a time, relative to the step, since files have few decimals."""

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Signals:
    """The records of an impact test.

    Parameters
    ----------
    force, response : (n_impacts, n_samples) arrays
        N, and the SI unit of the response. A record along a negative axis has its sign changed.
    rate : float
        Samples per second.
    quantity : Quantity
        Quantity of the response over the force.
    response_point, force_point : str
        Where they were measured, such as ``5-x``; empty if the file does not say.
    origin : str
        How the file was read: impacts, rate, and units.
    warnings : tuple of str
        What looks wrong in the records.
    named_points : sequence of PointStatement
        What texts in the file say of the points.
    """

    force: Array
    response: Array
    rate: float
    quantity: Quantity
    response_point: str = ""
    force_point: str = ""
    origin: str = ""
    warnings: tuple[str, ...] = ()
    named_points: Sequence[PointStatement] = ()


class _Options(NamedTuple):
    names: dict[str, str]
    columns: Sequence[str]
    remarks: Remarks


def read_signals(
    path: str | os.PathLike[str],
    *,
    force_unit: str | None = None,
    response_unit: str | None = None,
    force_sensitivity: str | None = None,
    response_sensitivity: str | None = None,
    rate: float | None = None,
    names: Mapping[str, str] | None = None,
    columns: Sequence[str] = (),
    response: str | None = None,
    force: str | None = None,
    plugins: PluginPaths = (),
) -> Signals:
    """Read force and response of one or more impacts.

    Parameters
    ----------
    path : path
        ``.npz``, ``.mat``, ``.h5``: arrays ``force`` and ``response`` of shape (n_impacts, n_samples) or
        (n_samples,), and ``rate`` [Hz] or ``time`` [s]. ``.npy``: a structured array of them, or columns that
        `columns` names. ``.csv``, ``.tsv``, ``.txt``: any lines, a header, a column ``time`` [s] unless `rate` is
        given, and columns of a force and a response, a pair for each impact.
        ``.uff``, ``.unv``: time responses (function type 1) in pairs of a force (data type 13) and a motion.
        ``.lvm``: channels whose names begin with one of a force and one of a motion; a segment for each impact.
    force_unit, response_unit : str, optional
        Units of the numbers, if the file does not state them; ``"g"`` is the standard gravity. A unit that neither
        states is that of SI.
    force_sensitivity, response_sensitivity : str, optional
        Sensitivities of the sensors, such as ``"2.25 mV/N"`` and ``"100 mV/g"``; the numbers are then voltages, in V
        unless file or unit state another.
    rate : float, optional
        Samples per second, if the file does not state it.
    names : mapping of str to str, optional
        Names of ``force``, ``response``, ``rate`` and ``time`` in an archive, of the first two in a table or a LabVIEW
        file; ``skip`` names entries, separated by commas, that need not be understood.
    columns : sequence of str, optional
        The columns of a table, instead of its header: ``("time", "force", "response", "skip")``.
    response, force : str, optional
        The points of the wanted FRF, in a file with several: ``"5+x"``, or ``"5"``.
    plugins : path or iterable of paths
        Plugin files with further readers.

    Returns
    -------
    Signals

    Raises
    ------
    FileError
        The file is missing, empty, not a file, larger than 100 MB, or cannot be read.
    MeasurementError
        It does not contain pairs of evenly sampled records, facts contradict each other, or one is missing.
    DovetailError
        HDF5 and MATLAB 7.3 need h5py, which is not installed.
    """
    source = Path(path)
    registry = components(plugins)
    check_suffix(source, registry)
    chosen = dict(names or {})
    if unknown := set(chosen) - set(_PARTS):
        part = sorted(unknown)[0]
        hint = did_you_mean(part, _PARTS)
        raise MeasurementError(
            Fault("the argument names", f"'{part}' is not a field of signals.", ", ".join(_PARTS), hint)
        )
    _check_force_unit(force_unit, force_sensitivity)
    _check_response_unit(response_unit, response_sensitivity)
    remarks = Remarks(skip=chosen.pop("skip", "").split(","))
    reader, recorded = read_content(source, registry)
    with plugin_errors(reader, label_of(reader)):
        pairs = _read_pairs(source, recorded, _Options(chosen, columns, remarks))
    pairs = choose_points(pairs, str(source), response, force, is_dof)
    choices = Choice(force_unit, force_sensitivity), Choice(response_unit, response_sensitivity)
    scales = [tuple(scale_of(record, role, choice) for record, role, choice in zip(pair, ("force", "response"), choices,
              strict=True)) for pair in pairs]  # fmt: skip
    remarks.check_numbers(all(scale.unit for pair in scales for scale in pair))
    signals = _signals(source, pairs, scales, rate)
    wrong = contradicted(remarks.lengths, len(signals.force), signals.force.shape[1], signals.rate)
    return replace(signals, warnings=(*signals.warnings, *wrong), named_points=tuple(remarks.named_points))


def _signals(path: Path, pairs: Sequence[Pair], scales: Sequence[tuple[Scale, ...]], rate: float | None) -> Signals:
    """Return all records in SI units."""
    quantities = {scale[1].quantity: pair[1].where for pair, scale in zip(pairs, scales, strict=True)}
    if len(quantities) > 1:
        each = ", ".join(f"{quantity} at {where}" for quantity, where in quantities.items())
        raise MeasurementError(Fault(str(path), f"the responses are of different quantities: {each}."))
    shapes = {record.samples.size: record.where for pair in pairs for record in pair}
    if len(shapes) > 1:
        each = ", ".join(f"{size} samples at {where}" for size, where in shapes.items())
        raise MeasurementError(Fault(str(path), f"the records have different lengths: {each}.", "one length"))
    known = sampling_rate(pairs, rate, lambda times: _rate(path, times))
    if known is None:
        raise MeasurementError(Fault(str(path), "the file does not say the sampling rate.", remedy="Give the rate."))
    both = [
        np.array(
            [
                pair[n].samples * (pair[n].point.sign * scale[n].factor)
                for pair, scale in zip(pairs, scales, strict=True)
            ]
        )
        for n in (0, 1)
    ]
    quantity = next(iter(quantities)) or QUANTITIES[0]
    pushed, moved = pairs[0]
    origin = _origin([[scale[n].unit for scale in scales] for n in (0, 1)], both[0].shape, known, quantity)
    warnings = _negative_pulses(np.array([pair[0].samples for pair in pairs]))
    return Signals(both[0], both[1], known, quantity, moved.point.label, pushed.point.label, origin, warnings)


def _origin(units: Sequence[Sequence[str]], shape: tuple[int, ...], rate: float, quantity: Quantity) -> str:
    """Return a sentence on what was read, and in which units."""
    described = []
    for name, each, usual in zip(
        ("force", "response"), units, ("N", motion_unit(quantity, rotation=False)), strict=True
    ):
        unit_text = listing(dict.fromkeys(unit or f"{usual}, since no unit is given" for unit in each))
        described.append(f"{name} in {unit_text}")
    count = f"{counted(shape[0], 'impact')} of {shape[1]} samples"
    return f"{count} at {rate:.6g} Hz; {'; '.join(described)}."


def _negative_pulses(force: Array) -> tuple[str, ...]:
    """Return a warning of pulses that are negative as they were recorded."""
    peaks = np.take_along_axis(force, np.abs(force).argmax(axis=1)[:, np.newaxis], axis=1)[:, 0]
    negative = np.flatnonzero(peaks < 0) + 1
    if not negative.size:
        return ()
    which = "each impact" if negative.size == len(force) else f"impact {listing(map(str, negative))}"
    problem = f"the force of {which} is recorded as a negative pulse."
    return (f"{problem} If the hammer's sensor counts a push as negative, the FRF has the wrong sign.",)


def _read_pairs(path: Path, recorded: Recorded, options: _Options) -> list[Pair]:
    """Return the records in what a reader returned."""
    if isinstance(recorded, str):
        return read_table(path, recorded, options.columns, options.names, options.remarks)
    if isinstance(recorded, np.ndarray) and not recorded.dtype.names:
        return read_columns(path, recorded, options.columns, options.remarks)
    if options.columns and not isinstance(recorded, np.ndarray):
        problem = f"columns={','.join(options.columns)} is for tables, not for {path.suffix.lower()} files."
        raise MeasurementError(Fault(str(path), problem))
    if isinstance(recorded, np.ndarray):
        return read_archive(arrays_of_fields(path, recorded), options.names, options.remarks)
    if isinstance(recorded, RecordedArrays):
        return read_archive(recorded, options.names, options.remarks)
    channels = [part for part in recorded if isinstance(part, RecordedChannels)]
    if channels:
        return read_channels(channels, options.names, options.remarks)
    if options.names:
        raise MeasurementError(Fault(str(path), "names are for files of named arrays or columns, not for sets."))
    sets = sets_of(path, [part for part in recorded if not isinstance(part, RecordedChannels)])
    signals = [part.load() for part in sets if part.kind == "signal"]
    return read_sets(path, [signal for signal in signals if isinstance(signal, RecordedSignal)], options.remarks)


def _check_force_unit(unit: str | None, sensitivity: str | None) -> None:
    reading = None if unit is None else read_unit(unit)
    is_voltage = sensitivity is not None and unit is not None and volts(unit) is not None
    if unit is not None and not is_voltage and (reading is None or reading.kind != "load" or reading.moment):
        raise MeasurementError(Fault("the argument force_unit", f"'{unit}' is not a unit of force.", "N, lbf, ..."))


def _check_response_unit(unit: str | None, sensitivity: str | None) -> None:
    reading = None if unit is None else read_unit(unit)
    is_voltage = sensitivity is not None and unit is not None and volts(unit) is not None
    if unit is not None and not is_voltage and (reading is None or reading.kind != "motion" or reading.rotation):
        accepted = "m/s^2, g, m/s, mm/s, m, um, ..."
        raise MeasurementError(Fault("the argument response_unit", f"'{unit}' is not a unit of motion.", accepted))


def _rate(path: Path, time: Array) -> float:
    mean = float(np.mean(np.diff(time))) if len(time) > 1 else 0.0
    even = time[:1] + mean * np.arange(len(time))
    if not (np.isfinite(mean) and mean > 0 and np.all(np.abs(time - even) <= _EVEN * mean)):
        columns = argument("columns", ["skip", "force", "response"])
        remedy = f"If it has too few digits, leave it out ({columns}) and give the rate ({argument('rate')})."
        raise MeasurementError(Fault(str(path), "the time does not increase in even steps.", remedy=remedy))
    return 1.0 / mean
