"""Reading and writing a measured FRF in the format that the suffix names."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from dovetail.errors import Fault, MeasurementError
from dovetail.frf import Frf
from dovetail.measurement import delimited, npz, uff
from dovetail.measurement.accelerometer import remove_accelerometer_mass
from dovetail.measurement.disk import read_bounded, write_whole
from dovetail.measurement.recording import Recording, known_quantity

__all__ = ["read_frf", "write_frf"]


class Format(NamedTuple):
    """How files with one suffix are read and written."""

    decode: Callable[[Path, bytes, int | None], Recording]
    encode: Callable[[Frf, Path, bool | None], bytes]


_UFF = Format(uff.decode, uff.encode)
_FORMATS = {
    ".uff": _UFF,
    ".unv": _UFF,
    ".csv": Format(delimited.decode, delimited.encode),
    ".npz": Format(npz.decode, npz.encode),
}


def read_frf(
    path: str | os.PathLike[str],
    *,
    quantity: str | None = None,
    accelerometer_mass: float = 0.0,
    index: int | None = None,
) -> Frf:
    """Read one measured FRF.

    A line at 0 Hz is left out. In UFF, response and reference directions of opposite sense turn the sign, so that the
    FRF is along positive axes; a unit label that is not SI is converted, or refused when it is not understood.

    Parameters
    ----------
    path : path
        ``.uff`` or ``.unv`` (set 58, ASCII or binary), ``.csv`` (header ``frequency_Hz,real,imag``,
        ``frequency_Hz,amplitude,phase_deg`` or ``frequency_Hz,amplitude``; a line ``# quantity: accelerance`` may come
        first and a column ``coherence`` last), ``.npz`` (arrays ``frequency``, and ``values`` or ``amplitude``;
        optional ``coherence`` and ``quantity``). SI units.
    quantity : {"receptance", "mobility", "accelerance"}, optional
        What the file holds. Needed when the file does not say it; must not contradict the file when it does.
    accelerometer_mass : float
        kg at the drive point, removed from the FRF: A / (1 - m A).
    index : int, optional
        Which set of a UFF file, counted from 1; the error for a file with several FRFs lists them.

    Returns
    -------
    Frf
        `label` is the file's name, `note` what the file says of it in words (the first id line of a UFF set).

    Raises
    ------
    MeasurementError
        The file cannot be read or does not hold one valid FRF; the fault names the line or the set.
    """
    source = Path(path)
    chosen = _format_of(source)
    if quantity is not None:
        known_quantity(quantity, "the argument quantity")
    if index is not None and chosen is not _UFF:
        raise MeasurementError(
            Fault(str(source), f"index={index} chooses a set of a UFF file; a {source.suffix} file holds one FRF.")
        )
    recording = chosen.decode(source, read_bounded(source), index)
    return remove_accelerometer_mass(recording.to_frf(quantity), accelerometer_mass)


def write_frf(frf: Frf, path: str | os.PathLike[str], *, overwrite: bool = False, binary: bool | None = None) -> None:
    """Write an FRF; `read_frf` gives back the same quantity, values and coherence.

    CSV, NPZ and binary UFF hold every digit; ASCII UFF holds 12 digits of the values.

    Parameters
    ----------
    frf : Frf
        The FRF.
    path : path
        The suffix names the format, as in `read_frf`.
    overwrite : bool
        Replace a file that is there.
    binary : bool, optional
        UFF only. By default ASCII, unless six digits cannot hold the frequencies, which is all that ASCII gives them.

    Raises
    ------
    MeasurementError
        An unknown suffix, a file that is there, a folder that is missing, or an FRF that the format cannot hold.
    """
    target = Path(path)
    chosen = _format_of(target)
    if binary is not None and chosen is not _UFF:
        raise MeasurementError(Fault(str(target), f"binary={binary} is for UFF files, not for {target.suffix}."))
    write_whole(target, chosen.encode(frf, target, binary), overwrite=overwrite)


def _format_of(path: Path) -> Format:
    if os.path.isdir(path):
        raise MeasurementError(Fault(str(path), "this is a directory.", "one measured file"))
    suffix = path.suffix.lower()
    if suffix not in _FORMATS:
        shown = f"'{path.suffix}' is not the suffix of a known format" if suffix else "the name has no suffix"
        raise MeasurementError(Fault(str(path), f"{shown}.", ", ".join(_FORMATS)))
    return _FORMATS[suffix]
