"""Writing an FRF, in the quantity and the unit of the file."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

from dovetail.atomic_files import write_whole
from dovetail.errors import Fault, MeasurementError, PluginError
from dovetail.frf import Frf
from dovetail.interfaces import FrfReader, FrfToWrite, plugin_errors
from dovetail.measurement.frf_files import read_suffixes, reader_class, unknown_suffix
from dovetail.measurement.frf_units import meaning_of_unit
from dovetail.registry import Offer, PluginPaths, Registry, components
from dovetail.registry.catalogue import label_of


def write_frf(
    frf: Frf,
    path: str | os.PathLike[str],
    *,
    overwrite: bool = False,
    binary: bool | None = None,
    unit: str | None = None,
    plugins: PluginPaths = (),
) -> None:
    """Write an FRF; `read_frf` gives back the same quantity, values, coherence, averages, variance and DOFs.

    CSV, NPZ and binary UFF hold every digit; ASCII UFF holds 12 digits of the values.

    Parameters
    ----------
    frf : Frf
        The FRF.
    path : path
        The suffix names the format: ``.uff``, ``.unv``, ``.csv``, ``.npz``, or one that a plugin writes.
    overwrite : bool
        Replace a file that is there.
    binary : bool, optional
        UFF only. By default ASCII, unless its six digits cannot represent the frequencies.
    unit : str, optional
        Unit of the values in the file, such as ``"um/N"``, which also determines the quantity; SI by default.
    plugins : path or iterable of paths
        Plugin files with further writers.

    Raises
    ------
    FileError
        The file exists, its folder is missing, or it cannot be written.
    MeasurementError
        An unknown suffix, or an FRF that the format cannot represent.
    """
    target, registry = Path(path), components(plugins)
    if os.path.isdir(target):
        raise MeasurementError(Fault(str(target), "this is a directory.", "one measured file"))
    suffix, writers = target.suffix.lower(), _writers(registry)
    if suffix not in writers:
        if suffix not in registry.readers():
            raise MeasurementError(unknown_suffix(target, writers))
        raise MeasurementError(Fault(str(target), f"{target.suffix} files are read, not written.", ", ".join(writers)))
    writer = _writer(writers[suffix], target, binary)
    content = prepare_for_writing(frf, target, unit)
    write_whole(target, _encode(writer, content, target), overwrite=overwrite)


def written_suffixes(plugins: PluginPaths) -> tuple[str, ...]:
    """Return the suffixes of the files that `write_frf` writes, including those of plugins."""
    return tuple(_writers(components(plugins)))


def _writers(registry: Registry) -> dict[str, Offer]:
    """Return the reader that writes the files of each suffix, in the order in which messages list the suffixes."""
    readers = registry.readers()
    writers = {
        suffix: offer
        for offers in reversed(readers.values())
        for offer in offers
        for suffix in reader_class(offer).written
    }
    return {suffix: writers[suffix] for suffix in (*read_suffixes(registry), *writers) if suffix in writers}


def _writer(offer: Offer, target: Path, binary: bool | None) -> FrfReader:
    """Return the writer of a format, with its option `binary` if it has one."""
    config = offer.component.Config
    options = {} if binary is None else {"binary": binary}
    if options and "binary" not in config.model_fields:
        raise MeasurementError(Fault(str(target), f"binary={binary} is for UFF files, not for {target.suffix}."))
    with plugin_errors(offer.component, f"reader '{offer.component.name}'"):
        return reader_class(offer)(config.model_validate(options))


def _encode(writer: FrfReader, content: FrfToWrite, target: Path) -> bytes:
    """Return the bytes of the file; a ValueError is how a writer refuses an FRF."""
    try:
        with plugin_errors(writer, label_of(writer)):
            encoded = writer.write(content, target)
            if not isinstance(encoded, bytes):
                raise PluginError(Fault(label_of(writer), f"write returned {encoded!r:.60}.", "bytes"))
    except PluginError as error:
        if isinstance(error.__cause__, ValueError):
            raise MeasurementError(Fault(str(target), str(error.__cause__))) from None
        raise
    return encoded


def prepare_for_writing(frf: Frf, path: Path, unit: str | None) -> FrfToWrite:
    """Return an FRF for writing, in a given unit or in SI.

    Raises
    ------
    MeasurementError
        A coherence that is not finite, a unit that is not one of an FRF, or that of a displacement for a rotation.
    """
    if frf.coherence is not None and not np.all(np.isfinite(frf.coherence)):
        raise MeasurementError(Fault(str(path), f"the coherence of {frf.label} is not finite: nothing is written."))
    if unit is None:
        return FrfToWrite(frf, frf.unit, 1.0)
    meaning = meaning_of_unit(unit, "the argument unit")
    if meaning.kind != (frf.rotation, frf.by_moment):
        problem = f"{frf.label} is a {frf.kind}, and '{unit}' is not one of its units."
        raise MeasurementError(Fault("the argument unit", problem))
    return FrfToWrite(frf.to(meaning.quantity), unit, meaning.factor)
