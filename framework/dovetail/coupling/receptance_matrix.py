"""The receptance of a part between some of its DOFs, and the file of such a matrix for x and rz of one point."""

from __future__ import annotations

import io
import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.atomic_files import write_whole
from dovetail.errors import Fault, MeasurementError
from dovetail.frf import Frf, refuse_masked
from dovetail.interfaces import ArrayEntry, RecordedArrays
from dovetail.measurement.content.even_axis import check_other_axes
from dovetail.measurement.content.unused_entries import read_unused
from dovetail.measurement.frf_files import read_content
from dovetail.measurement.frf_units import is_si
from dovetail.measurement.resampling import on_grid
from dovetail.measurement.statements import meaning_of_file
from dovetail.registry import components


@dataclass(frozen=True, eq=False)
class ReceptanceMatrix:
    """Receptance between n DOFs, such as x and rz of one point.

    Parameters
    ----------
    frequency : (n_freq,) array
        Hz, positive and increasing.
    values : (n_freq, n, n) complex array
        m or rad per N or N m.
    note : str
        Where it comes from.

    Raises
    ------
    MeasurementError
        Wrong shapes, values that are not finite, or frequencies that are not positive and increasing.
    """

    frequency: NDArray[np.float64]
    values: NDArray[np.complex128]
    note: str = ""

    def __post_init__(self) -> None:
        refuse_masked("receptance matrix", {"frequency": self.frequency, "values": self.values})
        square = self.values.ndim == 3 and self.values.shape[1] == self.values.shape[2] > 0
        if self.frequency.ndim != 1 or not square or len(self.values) != self.frequency.size:
            raise MeasurementError(
                f"a receptance matrix of the shape {self.values.shape} does not fit {self.frequency.shape} frequencies."
            )
        if not (np.isfinite(self.frequency).all() and np.isfinite(self.values).all()):
            raise MeasurementError("a receptance matrix has values that are not finite.")
        if np.any(np.diff(self.frequency, prepend=0.0) <= 0):
            raise MeasurementError("the frequencies of a receptance matrix must be positive and increase.")

    def at(self, frequency: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Return the receptance on other lines, interpolated as `on_grid` does.

        Raises
        ------
        MeasurementError
            The lines extend beyond the known ones, or the spacing of the known lines is too wide to interpolate a
            receptance on the diagonal.
        """
        lines, numbers = np.unique(frequency, return_inverse=True)
        values = np.empty((len(lines), *self.values.shape[1:]), dtype=np.complex128)
        for row, column in np.ndindex(*self.values.shape[1:]):
            frf = Frf(self.frequency, self.values[:, row, column], "receptance", label=self.note or "receptance matrix")
            check = row == column  # off the diagonal an FRF may be mere noise
            values[:, row, column] = on_grid(frf, lines, check_spacing=check).values
        return values[numbers]


_FIELDS = {"frequency": "frequency", "values": "receptance"}
"""The fields of an FRF, and the arrays of an archive that hold them."""


def write_receptance(matrix: ReceptanceMatrix, path: str | os.PathLike[str]) -> None:
    """Write a receptance matrix as an NPZ file, atomically.

    Raises
    ------
    FileError
        The file cannot be written.
    """
    buffer = io.BytesIO()
    np.savez(buffer, frequency=matrix.frequency, receptance=matrix.values, note=np.array(matrix.note))
    write_whole(Path(path), buffer.getvalue(), overwrite=True)


def read_receptance(path: str | os.PathLike[str]) -> ReceptanceMatrix:
    """Read a receptance matrix over x and rz of one point, as `write_receptance` or ``dovetail spindle`` wrote it.

    Raises
    ------
    FileError
        The file is missing, too large, or cannot be read.
    MeasurementError
        It does not contain such a receptance matrix.
    """
    file = Path(path)
    try:
        _, recorded = read_content(file, components(), "npz")
        if not isinstance(recorded, RecordedArrays):
            raise TypeError(f"{type(recorded).__name__} in place of named arrays")
        entries = recorded.entries
        frequency = entries["frequency"].load().astype(np.float64, casting="safe")
        values = entries["receptance"].load().astype(np.complex128, casting="safe")
        note = str(entries["note"].load()) if "note" in entries else ""
        arrays = {name: entry.load() for name, entry in entries.items() if entry.is_small}
    except (MeasurementError, KeyError, TypeError):
        accepted = "an archive (.npz) as 'dovetail spindle' writes it"
        raise MeasurementError(Fault(str(file), "this is not a receptance matrix.", accepted)) from None
    check_receptance_units(file, arrays | {"frequency": frequency, "receptance": values})
    try:
        matrix = ReceptanceMatrix(frequency, values, note or file.name)
    except MeasurementError as error:
        raise MeasurementError(*(replace(fault, where=str(file)) for fault in error.faults)) from None
    if matrix.values.shape[1] != 2:
        problem = f"it is between {matrix.values.shape[1]} DOFs, and no table names them."
        raise MeasurementError(Fault(str(file), problem, "x and rz of one point: 2 DOFs"))
    return matrix


def check_receptance_units(path: str | os.PathLike[str], arrays: Mapping[str, NDArray[Any]]) -> None:
    """Check that an archive with a receptance matrix has SI units only.

    Parameters
    ----------
    path : path
        For messages.
    arrays : mapping of str to array
        The arrays of the archive, with ``frequency`` and ``receptance`` among them.

    Raises
    ------
    MeasurementError
        Another unit or quantity, or a number that may act on the values.
    """
    archive = RecordedArrays(
        Path(path), {name: ArrayEntry("", partial(np.asarray, array)) for name, array in arrays.items()}
    )
    found = read_unused(archive, _FIELDS, ())
    meaning, mentions = meaning_of_file((), found)
    other = [mention for mention in mentions if mention.about.endswith("unit") and not is_si(mention.text)]
    where = other[0].where if other else str(path)
    if other or meaning.factor != 1.0 or meaning.quantity not in (None, "receptance"):
        unit = other[0].text if other else meaning.unit or meaning.quantity
        problem = f"the archive has the unit '{unit}', but receptances are read in SI units."
        accepted = "m/N, rad/N, m/(N m), rad/(N m)"
        raise MeasurementError(Fault(where, problem, accepted, "Convert the values, and remove the unit."))
    if meaning.axis_factor not in (None, 1.0):
        raise MeasurementError(Fault(where, "the frequencies of a receptance matrix are read in Hz.", "Hz"))
    check_other_axes(archive, _FIELDS, arrays["frequency"], 1.0, ())
