"""FRFs between channels and impacts, from an archive or from all sets of a file, as receptances."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail import DovetailError, Fault, Frf, check_receptance_units, read_frfs
from dovetail_plugins.substructures.channel_tables import ChannelTable
from dovetail_plugins.substructures.matrix_files import read_archive

_FREQUENCY, _VALUES = ("frequency", "freq"), ("frfs", "Y")
"""Names in an archive, those of pyFBS second."""
_NAMES = ("channels", "impacts")
_HARMLESS = ("note", "description", "comment")
_SENSE = re.compile(r"(.*?)([+-]?)((?:r?[xyz])?)", re.IGNORECASE)


def read_channel_frfs(
    file: str, channels: ChannelTable, impacts: ChannelTable
) -> tuple[NDArray[np.float64], NDArray[np.complex128]]:
    """Return the frequencies [Hz] and the receptances (n_freq, n_channels, n_impacts).

    Parameters
    ----------
    file : str
        NPZ archive with 'frequency' and 'frfs' (or 'freq' and 'Y'), in SI and in the order of the tables; or a file
        whose FRFs have the names of channels and impacts as DOFs, such as UFF.
    channels, impacts : ChannelTable
        FRFs of an archive have the quantities of the channels.

    Raises
    ------
    DovetailError
        FRFs are missing, occur twice or have other DOFs, shapes differ, or values are not finite.
    """
    if Path(file).suffix.lower() == ".npz":
        return _from_archive(file, channels, impacts)
    return _from_sets(file, channels, impacts)


def _from_archive(
    file: str, channels: ChannelTable, impacts: ChannelTable
) -> tuple[NDArray[np.float64], NDArray[np.complex128]]:
    archive = read_archive(Path(file))
    keys = [next((name for name in names if name in archive), None) for names in (_FREQUENCY, _VALUES)]
    if None in keys:
        listed = ", ".join(sorted(archive)[:12]) or "nothing"
        accepted = "'frequency' and 'frfs', or 'freq' and 'Y'"
        raise DovetailError(Fault(file, f"the archive has {listed}.", accepted))
    known = {*keys, *_NAMES, *_HARMLESS}
    if others := [name for name in archive if name not in known and archive[name].dtype.kind in "US"]:
        remedy = "Convert the FRFs to SI, in the quantities of the channels' table, and remove the text."
        raise DovetailError(Fault(file, f"the archive has the text '{others[0]}', which is not read.", remedy=remedy))
    frequency, values = archive[str(keys[0])], archive[str(keys[1])]
    numbers = {name: archive[name] for name in archive if name not in known}
    check_receptance_units(file, {"frequency": frequency, "receptance": values, **numbers})
    shape = len(channels.names), len(impacts.names)
    if frequency.ndim != 1 or frequency.dtype.kind not in "fiu" or values.shape != (len(frequency), *shape):
        problem = f"'{keys[1]}' has the shape {values.shape}, '{keys[0]}' {frequency.shape}."
        accepted = f"(n_freq, {shape[0]}, {shape[1]}), by the rows of {channels.file} and {impacts.file}"
        raise DovetailError(Fault(file, problem, accepted))
    _check_names(archive, channels, impacts, file)
    moving = frequency > 0.0
    axis, matrix = frequency[moving].astype(np.float64), values[moving].astype(np.complex128)
    omega = 2j * np.pi * axis
    return axis, matrix / omega[:, np.newaxis, np.newaxis] ** channels.derivatives[:, np.newaxis]


def _check_names(archive: Mapping[str, Any], channels: ChannelTable, impacts: ChannelTable, file: str) -> None:
    """Compare the names in an archive, if it has any, with those of the tables."""
    for key, table in zip(_NAMES, (channels, impacts), strict=True):
        if key not in archive:
            continue
        names = [str(name) for name in np.ravel(archive[key])]
        pairs = zip(names, table.names, strict=False)
        other = next((number for number, (one, two) in enumerate(pairs) if one != two), None)
        if other is not None or len(names) != len(table.names):
            at = min(len(names), len(table.names)) if other is None else other
            one, two = (list(some)[at] if at < len(some) else "none" for some in (names, table.names))
            problem = f"{key} number {at + 1} is '{one}' in the archive and '{two}' in {table.file}."
            raise DovetailError(Fault(file, problem, "the same names in the same order"))


def _from_sets(
    file: str, channels: ChannelTable, impacts: ChannelTable
) -> tuple[NDArray[np.float64], NDArray[np.complex128]]:
    frfs = read_frfs(file)
    axis = frfs[0].frequency
    values = np.full((len(axis), len(channels.names), len(impacts.names)), np.nan, dtype=np.complex128)
    for number, frf in enumerate(frfs, 1):
        where = f"{file}  FRF {number}"
        row, column = _row(frf.response, channels, where), _row(frf.force, impacts, where)
        if row is None or column is None:
            continue
        if not np.array_equal(frf.frequency, axis):
            raise DovetailError(Fault(where, "its frequencies are not those of the first FRF."))
        _check_kind(frf, channels, impacts, row, column, where)
        if not np.isnan(values[0, row, column]):
            raise DovetailError(Fault(where, f"there is another FRF of '{frf.response}' by '{frf.force}'."))
        sense = _sense(channels.names[row]) * _sense(impacts.names[column])
        values[:, row, column] = sense * frf.to("receptance").values
    missing = np.argwhere(np.isnan(values[0]))
    if len(missing):
        row, column = missing[0]
        problem = f"there is no FRF of channel '{channels.names[row]}' by impact '{impacts.names[column]}'"
        more = f" ({len(missing)} of {values[0].size} pairs are missing)"
        remedy = "Names in the tables are those of the DOFs in the file, such as 5+x."
        raise DovetailError(Fault(file, f"{problem}{more}.", remedy=remedy))
    return axis, values


def _row(name: str, table: ChannelTable, where: str) -> int | None:
    """Return the row of a DOF in a table, whatever its sense; None if the table does not have it."""
    if not name:
        raise DovetailError(Fault(where, "the file does not say of which DOFs this FRF is.", "names of both"))
    if name in table.names:
        return table.names.index(name)
    plain = [_without_sense(each) for each in table.names]
    return plain.index(_without_sense(name)) if plain.count(_without_sense(name)) == 1 else None


def _without_sense(name: str) -> str:
    match = _SENSE.fullmatch("".join(name.split()))
    return f"{match[1]}{match[3]}".lower() if match and match[3] else name.lower()


def _sense(name: str) -> float:
    """Return the sign by which an FRF along the positive axis of its DOF becomes one in the sense of its name."""
    match = _SENSE.fullmatch("".join(name.split()))
    return -1.0 if match and match[3] and match[2] == "-" else 1.0


def _check_kind(frf: Frf, channels: ChannelTable, impacts: ChannelTable, row: int, column: int, where: str) -> None:
    """Compare what an FRF measures with the tables."""
    if not frf.has_phase:
        raise DovetailError(Fault(where, "it has no phase.", "a complex FRF"))
    derivatives = {"receptance": 0, "mobility": 1, "accelerance": 2}[frf.quantity]
    sides = (
        (frf.rotation, channels, row, "a rotation", "a displacement"),
        (frf.by_moment, impacts, column, "by a moment", "by a force"),
    )
    for turns, table, at, yes, no in sides:
        assert table.dofs.rotational is not None
        if turns != table.dofs.rotational[at]:
            found, wanted = (yes, no) if turns else (no, yes)
            problem = f"it is {found}, and '{table.names[at]}' in {table.file} is {wanted}."
            raise DovetailError(Fault(where, problem, remedy="Correct the column 'Quantity'."))
    if derivatives != channels.derivatives[row]:
        problem = f"it is {frf.quantity}, and '{channels.names[row]}' in {channels.file} is another quantity."
        raise DovetailError(Fault(where, problem, remedy="Correct the column 'Quantity'."))
