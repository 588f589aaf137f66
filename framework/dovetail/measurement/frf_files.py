"""Reading and writing a measured FRF in the format given by the suffix of the file."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from dovetail.atomic_files import read_bounded, write_whole
from dovetail.errors import Fault, MeasurementError
from dovetail.frf import Frf
from dovetail.interfaces import logged
from dovetail.measurement.accelerometer import remove_accelerometer_mass
from dovetail.measurement.formats import (
    csv_writer,
    cutpro,
    from_plugin,
    guarded,
    lvm,
    npz,
    tables,
    uff_reader,
    uff_writer,
)
from dovetail.measurement.formats.text_tables import suffix_by_content
from dovetail.measurement.recording import ReadOptions, Recording, parse_quantity
from dovetail.measurement.writing import FrfToWrite, prepare_for_writing
from dovetail.registry import PluginPaths, Registry, components


class Format(NamedTuple):
    """How files with one suffix are read and written; `encode` is None if they are only read."""

    decode: Callable[[Path, bytes, ReadOptions], Recording]
    encode: Callable[[FrfToWrite, Path, bool | None], bytes] | None = None
    has_columns: bool = False


_UFF = Format(uff_reader.decode, uff_writer.encode)
_TABLE = Format(tables.decode, has_columns=True)
_GUARDED = Format(guarded.decode, has_columns=True)
_FORMATS = {
    ".uff": _UFF,
    ".unv": _UFF,
    ".csv": Format(tables.decode, csv_writer.encode, has_columns=True),
    ".npz": Format(npz.decode, npz.encode, has_columns=True),
    ".npy": Format(npz.decode_array, has_columns=True),
    ".tsv": _TABLE,
    ".txt": _TABLE,
    ".txf": _TABLE,
    ".asc": _TABLE,
    ".dat": _TABLE,
    ".mat": _GUARDED,
    ".h5": _GUARDED,
    ".hdf5": _GUARDED,
    ".frf": Format(cutpro.decode),
    ".lvm": Format(lvm.decode, has_columns=True),
}


def read_frf(
    path: str | os.PathLike[str],
    *,
    quantity: str | None = None,
    unit: str | None = None,
    accelerometer_mass: float = 0.0,
    index: int | None = None,
    response: str | None = None,
    force: str | None = None,
    names: Mapping[str, str] | None = None,
    columns: Sequence[str] = (),
    dofs: tuple[str, str] | None = None,
    ignore_dofs: bool = False,
    reader: str | None = None,
    plugins: PluginPaths = (),
) -> Frf:
    """Read one measured FRF.

    A line at 0 Hz is left out. In UFF, the sign is changed if response and reference directions have opposite senses,
    so that the FRF is along positive axes. If the file states a unit other than SI, the values are converted, or the
    file is refused if the unit is not understood.

    Parameters
    ----------
    path : path
        ``.uff`` or ``.unv`` (set 58, ASCII or binary), ``.csv``, ``.tsv`` or ``.txt`` (any lines, a header such
        as ``frequency_Hz,real,imag``, ``Frequency [Hz],Magnitude [um/N],Phase [deg]``, or a row of units below it),
        ``.npz``, ``.npy`` (columns, or a structured array), ``.mat`` (version 5 or 7.3), ``.h5`` or ``.hdf5`` (arrays
        ``frequency`` and ``values``, or others that `names` gives), ``.frf`` (CutPro), ``.lvm`` (LabVIEW).
        Universal and LabVIEW files may also be called ``.txt``.
    quantity : {"receptance", "mobility", "accelerance"}, optional
        Needed if the file does not state it; must not contradict the file.
    unit : str, optional
        The unit of the values, such as ``"um/N"`` or ``"g/N"``, which also determines the quantity; SI by default. Must
        not contradict the file.
    accelerometer_mass : float
        kg at the drive point, removed from the FRF: A / (1 - m A).
    index : int, optional
        Number of the FRF in a file with several, from 1: that of the set in UFF, of the segment in LabVIEW files, of
        the column in an array.
    response, force : str, optional
        DOFs that select the FRF in a file with several: ``"5+x"``, ``"tool:5+x"`` or ``"5"`` in UFF, numbers from 1
        along the axes of an array.
    names : mapping of str to str, optional
        Names of the FRF's fields in the file, such as ``{"frequency": "f", "values": "data/H1"}``. Fields: frequency,
        values, real, imag, amplitude, db, phase_deg, phase_rad, coherence, variance, averages, quantity, unit. `skip`
        lists, with commas, names in the file that do not concern the values, such as a gain that has been applied.
    columns : sequence of str, optional
        The columns of a table, instead of its header: ``("frequency", "real", "imag", "skip")``, with a unit if
        necessary, ``"frequency [kHz]"``. `skip` leaves a column out.
    dofs : (str, str), optional
        DOFs of response and force, if the file does not state them: ``("3+x", "1-x")``. If they have opposite senses,
        the sign is changed, so that the FRF is along positive axes.
    ignore_dofs : bool
        Take the DOFs in the file for wrong: they are unknown, unless `dofs` gives others, and the values have
        the sign that they have in the file.
    reader : str, optional
        Name of a plugin's reader for the file. By default a plugin's reader that recognises suffix and format, or else
        that of Dovetail.
    plugins : path or iterable of paths
        Plugin files with further readers.

    Returns
    -------
    Frf
        `label` is the file's name, `note` the file's comment on it (the first id line of a UFF set).

    Raises
    ------
    FileError
        The file is missing, empty, not a file, larger than 100 MB, or cannot be read.
    MeasurementError
        It does not contain one valid FRF; the fault names the line, the set or the array, and lists the contents of a
        file with several FRFs or unknown names.
    DovetailError
        A package is not installed: HDF5 and MATLAB 7.3 need h5py, LabVIEW files lvm_read.
    PluginError
        There is no such reader, a plugin file cannot be loaded, or the code of a reader fails.
    """
    source, registry = Path(path), components(plugins)
    by_plugin = reader is not None or source.suffix.lower() in registry.readers()
    if not by_plugin:
        _format_of(source, registry)
    if quantity is not None:
        parse_quantity(quantity, "the argument quantity")
    named = dict(names or {})
    skip = tuple(name.strip() for name in named.pop("skip", "").split(",") if name.strip())
    options = ReadOptions(index, response, force, named, tuple(columns), skip)
    with logged(__name__, f"measurement {source} read"):
        content = read_bounded(source)
        chosen = from_plugin.find_reader(source, content, registry, reader) if by_plugin else None
        if chosen is not None:
            recording = from_plugin.decode(source, content, chosen, options)
        else:
            recording = _decode(source, content, registry, options)
    if ignore_dofs:
        recording = recording.without_dofs()
    frf = (recording.with_dofs(*dofs) if dofs else recording).to_frf(quantity, unit)
    return remove_accelerometer_mass(frf, accelerometer_mass) if accelerometer_mass else frf


def _decode(source: Path, content: bytes, registry: Registry, options: ReadOptions) -> Recording:
    suffix = suffix_by_content(source, content)
    file_format = _FORMATS.get(suffix) or _format_of(source, registry)
    if options.columns and not file_format.has_columns:
        problem = f"columns={','.join(options.columns)} is for tables, not for {suffix} files."
        raise MeasurementError(Fault(str(source), problem))
    return file_format.decode(source, content, options)


def write_frf(
    frf: Frf,
    path: str | os.PathLike[str],
    *,
    overwrite: bool = False,
    binary: bool | None = None,
    unit: str | None = None,
) -> None:
    """Write an FRF; `read_frf` gives back the same quantity, values, coherence, averages, variance and DOFs.

    CSV, NPZ and binary UFF hold every digit; ASCII UFF holds 12 digits of the values.

    Parameters
    ----------
    frf : Frf
        The FRF.
    path : path
        The suffix names the format: ``.uff``, ``.unv``, ``.csv`` or ``.npz``.
    overwrite : bool
        Replace a file that is there.
    binary : bool, optional
        UFF only. By default ASCII, unless its six digits cannot represent the frequencies.
    unit : str, optional
        Unit of the values in the file, such as ``"um/N"``, which also determines the quantity; SI by default.

    Raises
    ------
    FileError
        The file exists, its folder is missing, or it cannot be written.
    MeasurementError
        An unknown suffix, or an FRF that the format cannot represent.
    """
    target = Path(path)
    file_format = _format_of(target)
    if file_format.encode is None:
        accepted = ", ".join(suffix for suffix, file_format in _FORMATS.items() if file_format.encode is not None)
        raise MeasurementError(Fault(str(target), f"{target.suffix} files are read, not written.", accepted))
    if binary is not None and file_format is not _UFF:
        raise MeasurementError(Fault(str(target), f"binary={binary} is for UFF files, not for {target.suffix}."))
    content = prepare_for_writing(frf, target, unit)
    write_whole(target, file_format.encode(content, target, binary), overwrite=overwrite)


def frf_suffixes(plugins: PluginPaths) -> tuple[str, ...]:
    """Return the suffixes of the files that `read_frf` reads, including those of plugins."""
    return _suffixes(components(plugins))


def _suffixes(registry: Registry) -> tuple[str, ...]:
    return tuple(dict.fromkeys((*_FORMATS, *sorted(registry.readers()))))


def _format_of(path: Path, registry: Registry | None = None) -> Format:
    if os.path.isdir(path):
        raise MeasurementError(Fault(str(path), "this is a directory.", "one measured file"))
    suffix = path.suffix.lower()
    if suffix not in _FORMATS:
        shown = f"'{path.suffix}' is not the suffix of a known format" if suffix else "the name has no suffix"
        known = _FORMATS if registry is None else _suffixes(registry)
        raise MeasurementError(Fault(str(path), f"{shown}.", ", ".join(known)))
    return _FORMATS[suffix]
