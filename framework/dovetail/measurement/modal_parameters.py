"""Natural frequencies and damping ratios that another program identified, as a kind of measurement."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.atomic_files import read_bounded
from dovetail.errors import DovetailError, Fault, MeasurementError
from dovetail.frf import refuse_masked
from dovetail.measurement.content.column_names import names_and_units, plain_name
from dovetail.measurement.content.text_tables import TextTable, decode_text, find_table, read_rows, single_column
from dovetail.measurement.frf_units import frequency_factor
from dovetail.measurement.modal_remarks import check_lines, number_fault, warn_of_sizes

_SUFFIXES = (".csv", ".tsv", ".txt")
_NAMES = {
    "frequency": ("frequency", "natural_frequency", "natural_freq", "eigenfrequency", "freq", "f", "fn", "f_n", "f0"),
    "frequency_sd": ("frequency_sd", "natural_frequency_sd", "freq_sd", "frequency_std", "f_sd"),
    "damping_ratio": ("damping_ratio", "zeta", "damping", "damping_percent"),
    "damping_sd": ("damping_sd", "damping_ratio_sd", "damping_std", "zeta_sd", "damping_sd_percent"),
    "mode": ("mode", "no", "nr", "number"),
}
_RATIO = ("damping_ratio", "zeta", "damping_ratio_sd", "zeta_sd")
"""Names that imply that 1 is the critical damping."""
_UNITS = {"percent": "%", "per cent": "%", "1": "-", "none": "-", "ratio": "-", "rad/sec": "rad/s"}
"""Spellings of units that are equal."""
_ACCEPTED = "frequency_Hz[,damping_ratio or damping_percent][,frequency_sd_Hz][,damping_ratio_sd or damping_sd_percent]"
_PERCENT = 0.01
_MOST_MODES = 10_000

_LEAST = 1e-30
"""Least frequency [Hz] and least standard deviation; one over it is the largest. Their squares are still numbers."""


@dataclass(frozen=True, eq=False)
class ModalParameters:
    """Modal parameters from a measurement.

    Parameters
    ----------
    frequency : (n_modes,) array
        Natural frequencies in Hz, positive and increasing.
    damping_ratio : (n_modes,) array, optional
        Relative to the critical damping, from 0 to below 1.
    frequency_sd : (n_modes,) array, optional
        Standard deviation of each natural frequency in Hz, positive.
    damping_sd : (n_modes,) array, optional
        Standard deviation of each damping ratio, positive.
    label : str
        Their source.

    Raises
    ------
    MeasurementError
        Wrong shapes, or values outside these limits.
    """

    frequency: NDArray[np.float64]
    damping_ratio: NDArray[np.float64] | None = None
    frequency_sd: NDArray[np.float64] | None = None
    damping_sd: NDArray[np.float64] | None = None
    label: str = field(default="modal parameters")

    def __post_init__(self) -> None:
        for name in ("frequency", "damping_ratio", "frequency_sd", "damping_sd"):
            if (values := getattr(self, name)) is not None:
                refuse_masked(self.label, {name: values})
                array = np.array(values, dtype=np.float64)
                array.flags.writeable = False
                object.__setattr__(self, name, array)
                self._check(name, array)
        if self.damping_sd is not None and self.damping_ratio is None:
            raise MeasurementError(f"{self.label}: there are standard deviations of the damping, and no damping.")

    def to_dict(self) -> dict[str, Any]:
        """Return everything as plain values for JSON."""
        columns = {name: getattr(self, name) for name in ("frequency", "damping_ratio", "frequency_sd", "damping_sd")}
        return {name: None if at is None else at.tolist() for name, at in columns.items()} | {"label": self.label}

    def _check(self, name: str, array: NDArray[np.float64]) -> None:
        if array.ndim != 1 or array.shape != self.frequency.shape or not array.size:
            raise MeasurementError(f"{self.label}: {name} has the shape {array.shape}, not (n_modes,).")
        within = (array >= 0) & (array < 1) if name == "damping_ratio" else (array >= _LEAST) & (array <= 1.0 / _LEAST)
        bad = np.flatnonzero(~within)
        if bad.size:
            limits = (
                "from 0 to below 1" if name == "damping_ratio" else f"positive, from {_LEAST:g} to {1.0 / _LEAST:g}"
            )
            raise MeasurementError(
                f"{self.label}: {name} of mode {bad[0] + 1} is {array[bad[0]]:g}; it must be {limits}."
            )
        if name == "frequency" and (falling := np.flatnonzero(np.diff(array) <= 0)).size:
            raise MeasurementError(f"{self.label}: the frequency does not increase after mode {falling[0] + 1}.")


def read_modal_parameters(path: str | os.PathLike[str]) -> ModalParameters:
    """Read a table of modal parameters, a mode in each row.

    Parameters
    ----------
    path : path
        ``.csv``, ``.tsv`` or ``.txt``: any lines, a header such as ``frequency_Hz,damping_ratio`` or ``Natural
        frequency [kHz];Damping [%];Frequency SD [Hz];Damping SD [%]``, and the rows. Units of a frequency are Hz, kHz
        and rad/s; a damping is a ratio or in per cent, and its header says which. A standard deviation of a frequency
        in per cent is relative.

    Returns
    -------
    ModalParameters

    Raises
    ------
    FileError
        The file is missing, empty, not a file, too large, or cannot be read.
    MeasurementError
        A column that is not understood or has no unit, a cell that is not a number, or impossible values.
    """
    source = Path(path)
    if source.suffix.lower() not in _SUFFIXES:
        raise MeasurementError(Fault(str(source), "this is not a table of modal parameters.", ", ".join(_SUFFIXES)))
    table = _find_table(source)
    where = f"{source}:{table.line + 1}"
    names, units = names_and_units(table.header)
    units = _with_row_of_units(where, names, units, table.units)
    columns = [_meaning(where, name, unit) for name, unit in zip(names, units, strict=True)]
    wanted = [column for column, (parameter, _) in enumerate(columns) if parameter != "mode"]
    parameters = [columns[column][0] for column in wanted]
    if len(set(parameters)) < len(parameters) or "frequency" not in parameters:
        problem = "the header names a parameter twice, or no frequency."
        raise MeasurementError(Fault(where, problem, _ACCEPTED))
    _, rows = read_rows(table, names, wanted)
    if numbered := [column for column, (parameter, _) in enumerate(columns) if parameter == "mode"]:
        _check_numbers(table, names, numbered[:1])
    if rows.shape[1] > _MOST_MODES:
        raise MeasurementError(
            Fault(str(source), f"the table has {rows.shape[1]:,} modes.", f"at most {_MOST_MODES:,}")
        )
    values = {columns[column][0]: row * columns[column][1] for column, row in zip(wanted, rows, strict=True)}
    factors = dict(zip(parameters, [columns[column][1] for column in wanted], strict=True))
    check_lines(table, str(source), factors, values)
    if "frequency_sd" in values and _is_percent(*_split_unit(names, units, columns, "frequency_sd")):
        values["frequency_sd"] = values["frequency_sd"] * values["frequency"]
    modes = ModalParameters(**values, label=str(source))
    warn_of_sizes(str(source), values, factors)
    return modes


def _check_numbers(table: TextTable, names: Sequence[str], column: Sequence[int]) -> None:
    """Refuse numbers of modes that do not increase; names of modes are accepted.

    Raises
    ------
    MeasurementError
    """
    try:
        numbers = read_rows(table, names, column)[1][0]
    except MeasurementError:
        return
    if (fault := number_fault(table.where, numbers)) is not None:
        raise MeasurementError(fault)


def is_modal_table(path: str | os.PathLike[str]) -> bool:
    """Return whether a file is a table of modal parameters, valid or not, and thus not an FRF."""
    source = Path(path)
    if source.suffix.lower() not in _SUFFIXES:
        return False
    try:
        header = _find_table(source).header
    except DovetailError:
        return False
    meant = [_parameter(name)[0] for name in names_and_units(header)[0]]
    return "frequency" in meant and all(meant)


def _find_table(path: Path) -> TextTable:
    where, lines = str(path), decode_text(path, read_bounded(path)).split("\n")
    return single_column(where, lines, _is_header) or find_table(where, lines, _is_header, _ACCEPTED)


def _with_row_of_units(where: str, names: Sequence[str], units: Sequence[str], below: Sequence[str]) -> list[str]:
    """Return the units of the columns, in their names or in a row below, which must agree.

    Raises
    ------
    MeasurementError
    """
    row = [cell.strip("[]() ") for cell in below] or [""] * len(names)
    for name, unit, lower in zip(names, units, row, strict=True):
        said = [one for one in (_parameter(name)[1], unit.strip(), lower) if one]
        if len({_UNITS.get(one.lower(), one.lower()) for one in said}) > 1 or (lower == "%" and _is_a_ratio(name)):
            problem = f"'{name[:60]}' has the units {' and '.join(map(repr, said))}."
            raise MeasurementError(Fault(where, problem, "one unit", "Correct the header, or the row below it."))
    return [unit or lower for unit, lower in zip(units, row, strict=True)]


def _is_a_ratio(name: str) -> bool:
    return plain_name(name) in ("damping_ratio", "damping_ratio_sd")


def _is_header(cells: Sequence[str]) -> bool:
    return any(_parameter(name)[0] == "frequency" for name in names_and_units(cells)[0])


def _split_unit(
    names: Sequence[str], units: Sequence[str], columns: Sequence[tuple[str, float]], parameter: str
) -> tuple[str, str]:
    column = [known for known, _ in columns].index(parameter)
    return names[column], units[column]


def _parameter(name: str) -> tuple[str, str]:
    """Return the parameter of a column, or an empty text, and the unit at the end of its name."""
    word = plain_name(name)
    for unit in ("hz", "khz", "percent", ""):
        stem = word.removesuffix(f"_{unit}") if unit and word.endswith(f"_{unit}") else word
        for parameter, spellings in _NAMES.items():
            if stem in spellings and (unit or stem == word):
                return parameter, unit if stem != word else ("percent" if word.endswith("percent") else "")
    return "", ""


def _is_percent(name: str, unit: str) -> bool:
    return unit.strip() in ("%", "percent", "per cent") or _parameter(name)[1] == "percent"


def _meaning(where: str, name: str, unit: str) -> tuple[str, float]:
    """Return the parameter of a column and the factor that converts its numbers to Hz or ratios.

    Raises
    ------
    MeasurementError
        Not a parameter, or a unit that is missing or not understood.
    """
    parameter, ending = _parameter(name)
    if not parameter:
        raise MeasurementError(Fault(where, f"the column '{name[:60]}' is not understood.", _ACCEPTED))
    if parameter == "mode":
        return parameter, 1.0
    if parameter != "frequency" and _is_percent(name, unit):
        return parameter, _PERCENT
    label = (unit or ending).strip().lower()
    if parameter.startswith("frequency"):
        if label in ("hz", "khz", "rad/s") and (factor := frequency_factor(label)) is not None:
            return parameter, factor
        problem = f"the unit of '{name[:60]}' is {label[:40]!r}." if label else f"'{name[:60]}' has no unit."
        raise MeasurementError(Fault(where, problem, "Hz, kHz, rad/s, as in frequency_Hz or Frequency [kHz]"))
    if label in ("1", "-") or (not label and plain_name(name) in _RATIO):
        return parameter, 1.0
    problem = f"'{name[:60]}' may be a ratio or in per cent." if not label else f"'{name[:60]}' is in {label[:40]!r}."
    remedy = "Call it damping_ratio or damping_percent, its error damping_ratio_sd or damping_sd_percent."
    raise MeasurementError(Fault(where, problem, "a ratio, or [%]", remedy))
