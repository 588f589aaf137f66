"""Reading a measured FRF: the choice of the reader by suffix and format, what it returns, and the FRF in it."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from dovetail.atomic_files import read_bounded
from dovetail.errors import Fault, MeasurementError, PluginError, argument
from dovetail.frf import Frf
from dovetail.interfaces import (
    ArrayEntry,
    FrfReader,
    Recorded,
    RecordedArrays,
    RecordedChannels,
    RecordedFrf,
    RecordedSet,
    RecordedSignal,
    logged,
)
from dovetail.measurement.accelerometer import remove_accelerometer_mass
from dovetail.measurement.content.channels import decode_channels
from dovetail.measurement.content.column_arrays import columns_of_array
from dovetail.measurement.content.named_arrays import read_recording
from dovetail.measurement.content.sets import decode_set, select_set, sets_of
from dovetail.measurement.content.tables import decode_table
from dovetail.measurement.recording import ReadOptions, Recording, parse_quantity
from dovetail.registry import Offer, PluginPaths, Registry, components
from dovetail.registry.catalogue import find_reader, label_of, make_reader, refusals_reported


def read_frf(
    path: str | os.PathLike[str],
    *,
    quantity: str | None = None,
    unit: str | None = None,
    accelerometer_mass: float | str = 0.0,
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
    accelerometer_mass : float or str
        kg, or a text such as ``"50 g"``, at the drive point, removed from the FRF: A / (1 - m A).
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
        Name of the reader for the file. By default the one that recognises the format among those that have the
        suffix, or else Dovetail's own.
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
    if quantity is not None:
        parse_quantity(quantity, "the argument quantity")
    recording, _ = recording_and_content(
        Path(path),
        components(plugins),
        index=index,
        response=response,
        force=force,
        names=names,
        columns=columns,
        dofs=dofs,
        ignore_dofs=ignore_dofs,
        reader=reader,
    )
    frf = recording.to_frf(quantity, unit)
    return remove_accelerometer_mass(frf, accelerometer_mass) if accelerometer_mass else frf


def recording_and_content(
    path: Path,
    registry: Registry,
    *,
    index: int | None = None,
    response: str | None = None,
    force: str | None = None,
    names: Mapping[str, str] | None = None,
    columns: Sequence[str] = (),
    dofs: tuple[str, str] | None = None,
    ignore_dofs: bool = False,
    reader: str | None = None,
) -> tuple[Recording, Recorded]:
    """Return the FRF that `read_frf` reads, and what its file contains; of several sets the one of this FRF."""
    if reader is None:
        check_suffix(path, registry)
    named = dict(names or {})
    skip = skipped_names(named.pop("skip", ""))
    options = ReadOptions(index, response, force, named, tuple(columns), skip)
    with logged(__name__, f"measurement {path} read"):
        chosen, recorded = read_content(path, registry, reader)
        recording = recording_of(path, recorded, chosen, options)
    if ignore_dofs:
        recording = recording.without_dofs()
    if isinstance(recorded, (list, tuple)) and not any(isinstance(part, RecordedChannels) for part in recorded):
        recorded = [select_set(path, sets_of(path, recorded), options)]
    return recording.with_dofs(*dofs) if dofs else recording, recorded


def skipped_names(text: str) -> tuple[str, ...]:
    """Return the names in a file that do not concern the values, from a text with commas between them."""
    return tuple(name.strip() for name in text.split(",") if name.strip())


def read_frfs(path: str | os.PathLike[str], *, ignore_dofs: bool = False, plugins: PluginPaths = ()) -> tuple[Frf, ...]:
    """Read all FRFs of a file, in their order: those of the sets of a UFF file, of a table the only one.

    Parameters
    ----------
    path : path
        Of a format that `read_frf` reads.
    ignore_dofs : bool
        As in `read_frf`.
    plugins : path or iterable of paths
        Plugin files with further readers.

    Raises
    ------
    DovetailError
        As in `read_frf`; or the file has no FRF.
    """
    source, registry = Path(path), components(plugins)
    check_suffix(source, registry)
    with logged(__name__, f"measurement {source} read"):
        reader, recorded = read_content(source, registry)
        numbers = frf_numbers(source, recorded)
        if not numbers:
            raise MeasurementError(Fault(str(source), "the file has no FRF."))
        recordings = [recording_of(source, recorded, reader, ReadOptions(index=number)) for number in numbers]
    return tuple((each.without_dofs() if ignore_dofs else each).to_frf(None, None) for each in recordings)


def frf_suffixes(plugins: PluginPaths) -> tuple[str, ...]:
    """Return the suffixes of the files that `read_frf` reads, including those of plugins."""
    return read_suffixes(components(plugins))


def read_content(path: Path, registry: Registry, name: str | None = None) -> tuple[FrfReader, Recorded]:
    """Return what a file contains, and the reader that decoded it.

    Parameters
    ----------
    path : Path
    registry : Registry
    name : str, optional
        Name of the reader; by default the one that recognises the file, or else the default reader of its suffix.

    Raises
    ------
    FileError
        The file is missing, empty, not a file, larger than 100 MB, or cannot be read.
    MeasurementError
        No reader or several read this file, or it is damaged.
    PluginError
        There is no reader of this name, or its code fails.
    """
    named = None if name is None else make_reader(registry.find("reader", name))
    if named is None:
        check_suffix(path, registry)
    content = read_bounded(path)
    reader = cast("FrfReader", named or find_reader(path, content, registry.readers(), MeasurementError))
    return reader, decode(path, content, reader)


def check_suffix(path: Path, registry: Registry) -> None:
    """Refuse a directory, and a file with a suffix that no reader has.

    Raises
    ------
    MeasurementError
    """
    if os.path.isdir(path):
        raise MeasurementError(Fault(str(path), "this is a directory.", "one measured file"))
    if path.suffix.lower() not in registry.readers():
        raise MeasurementError(unknown_suffix(path, read_suffixes(registry)))


def unknown_suffix(path: Path, known: Iterable[str]) -> Fault:
    """Return the fault of a file whose suffix is not that of a format."""
    remedy = f"For the format of a plugin file, add {argument('plugins')}."
    if path.suffix.lower() in (".yaml", ".yml"):
        remedy = "A description comes before the measured files."
    shown = f"'{path.suffix}' is not the suffix of a known format" if path.suffix else "the name has no suffix"
    return Fault(str(path), f"{shown}.", ", ".join(known), remedy if path.suffix else "")


def read_suffixes(registry: Registry) -> tuple[str, ...]:
    """Return the suffixes of the files that are read, those that have a default reader first."""
    offers = registry.readers()
    readers = dict.fromkeys(reader_class(offer) for suffix in offers for offer in offers[suffix])
    defaults = [suffix for reader in readers for suffix in reader.default_for]
    return tuple(dict.fromkeys((*defaults, *sorted(offers))))


def reader_class(offer: Offer) -> type[FrfReader]:
    """Return the class of an offered reader."""
    return cast("type[FrfReader]", offer.component)


def decode(path: Path, content: bytes, reader: FrfReader) -> Recorded:
    """Return what a reader returns for a file.

    Raises
    ------
    MeasurementError
        It cannot read the file.
    PluginError
        Its code fails, or it returns something else.
    """
    with refusals_reported(path, reader, MeasurementError):
        recorded = reader.read(path, content)
        _check_kind(recorded, label_of(reader))
    return recorded


def _check_kind(recorded: object, label: str) -> None:
    kinds = (RecordedFrf, RecordedSignal, RecordedSet, RecordedChannels)
    is_sequence = isinstance(recorded, (list, tuple)) and all(isinstance(one, kinds) for one in recorded)
    if not is_sequence and not isinstance(recorded, (str, np.ndarray, RecordedArrays)):
        accepted = "a list of dovetail.RecordedFrf or another kind of content that dovetail.FrfReader.read names"
        raise PluginError(Fault(label, f"read returned {recorded!r:.60}.", accepted))


def recording_of(path: Path, recorded: Recorded, reader: FrfReader, options: ReadOptions) -> Recording:
    """Return the FRF that `options` select.

    Parameters
    ----------
    path : Path
    recorded : Recorded
        What the reader returned.
    reader : FrfReader
    options : ReadOptions

    Raises
    ------
    MeasurementError
        There is no such FRF or there are several; statements that are not understood or contradict each other.
    PluginError
        The arrays that the reader returned are not vectors of equal length.
    """
    if isinstance(recorded, str):
        return decode_table(path, recorded, options)
    if isinstance(recorded, RecordedArrays):
        return read_recording(recorded, options)
    if isinstance(recorded, np.ndarray):
        return _decode_array(path, recorded, options)
    channels = [part for part in recorded if isinstance(part, RecordedChannels)]
    if channels:
        return decode_channels(path, channels, options)
    if options.columns:
        problem = f"columns={','.join(options.columns)} is for tables, not for {path.suffix} files."
        raise MeasurementError(Fault(str(path), problem))
    sets = sets_of(path, [part for part in recorded if not isinstance(part, RecordedChannels)])
    return decode_set(path, sets, reader, options)


def _decode_array(path: Path, array: NDArray[Any], options: ReadOptions) -> Recording:
    """Return the FRF in a structured array, in two complex columns, or in columns that the caller names."""
    if array.dtype.names:
        return read_recording(arrays_of_fields(path, array), options)
    if options.chooses or options.names:
        option = options.chooses or f"names={dict(options.names)}"
        raise MeasurementError(Fault(str(path), f"{option} is not for an array without names, which holds one FRF."))
    return columns_of_array(path, array, options, "the array")


def arrays_of_fields(path: Path, array: NDArray[Any]) -> RecordedArrays:
    """Return the fields of a structured array as named arrays."""
    fields = {name: ArrayEntry("", partial(np.asarray, array[name])) for name in array.dtype.names or ()}
    return RecordedArrays(path, fields)


def frf_numbers(path: Path, recorded: Recorded) -> list[int | None]:
    """Return the numbers by which the FRFs in what a reader returned are chosen; None for the only one."""
    if isinstance(recorded, (str, RecordedArrays, np.ndarray)):
        return [None]
    if any(isinstance(one, RecordedChannels) for one in recorded):
        return [*range(1, len(recorded) + 1)]
    sets = sets_of(path, [part for part in recorded if not isinstance(part, RecordedChannels)])
    return [one.number for one in sets if one.kind == "frf"]
