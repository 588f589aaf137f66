"""Files that plugins read: choice of the reader, and checks of the FRFs that it returns."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from numbers import Integral
from pathlib import Path

import numpy as np

from dovetail.errors import Fault, MeasurementError, PluginError, listing
from dovetail.interfaces import Component, FrfReader, RecordedFrf, plugin_errors
from dovetail.measurement.free_text import read_texts
from dovetail.measurement.frf_units import meaning_of_unit
from dovetail.measurement.recording import DOF, ReadOptions, Recording
from dovetail.measurement.statements import Statement, fields_of, interpret
from dovetail.registry import Registry

_HEAD = 4096
"""Number of bytes from which a reader recognises its format."""
_MOST_LISTED = 20


def find_reader(path: Path, content: bytes, registry: Registry, name: str | None) -> FrfReader | None:
    """Return the reader called `name`, or the one for the file's suffix and format; None if there is none.

    Raises
    ------
    MeasurementError
        Several readers accept the file.
    PluginError
        There is no reader of this name, or its code fails.
    """
    if name is not None:
        return _made(registry.find("reader", name).component)
    offers = registry.readers().get(path.suffix.lower(), [])
    takers = [offer for offer in offers if _accepts(_made(offer.component), content)]
    if len(takers) > 1:
        remedy = "Say which by `reader=`."
        problem = "several readers take this file."
        raise MeasurementError(Fault(str(path), problem, listing([o.qualified_name for o in takers]), remedy))
    return _made(takers[0].component) if takers else None


def _made(component: type[Component]) -> FrfReader:
    with plugin_errors(component, f"reader '{component.name}'"):
        reader = component()
    assert isinstance(reader, FrfReader)
    return reader


def _accepts(reader: FrfReader, content: bytes) -> bool:
    with plugin_errors(reader, _label(reader)):
        return bool(reader.sniff(content[:_HEAD]))


def _label(reader: FrfReader) -> str:
    return f"reader '{reader.name}'"


def decode(path: Path, content: bytes, reader: FrfReader, options: ReadOptions) -> Recording:
    """Return the FRF that a plugin reads from a file, or the one of several that `options` select.

    Raises
    ------
    MeasurementError
        The reader cannot read the file, or `options` do not select a single FRF.
    PluginError
        The reader fails, or returns no FRFs.
    """
    if options.names or options.columns:
        problem = f"names and columns are for tables and arrays, not for files of the {_label(reader)}."
        raise MeasurementError(Fault(str(path), problem))
    try:
        with plugin_errors(reader, _label(reader)):
            recorded = _read(path, content, reader)
    except PluginError as error:
        if isinstance(error.__cause__, ValueError):  # how a reader refuses a file
            raise MeasurementError(Fault(str(path), str(error.__cause__))) from None
        raise
    number, frf = _chosen(path, recorded, options)
    with plugin_errors(reader, _label(reader)):
        _check_arrays(frf, _label(reader))
    where = str(path) if len(recorded) == 1 else f"{path}: FRF {number}"
    noted = read_texts([("", frf.note, f"{where}, note")], options.skip)
    unit = [Statement("unit", frf.unit, where)] if frf.unit else []
    if frf.unit:
        meaning_of_unit(frf.unit, where)
    meaning = interpret([*unit, *noted.statements])
    recording = Recording(
        where=where,
        label=path.name,
        frequency=np.asarray(frf.frequency, dtype=np.float64),
        values=np.asarray(frf.values),
        has_phase=np.iscomplexobj(frf.values),
        coherence=None if frf.coherence is None else np.asarray(frf.coherence, dtype=np.float64),
        locate=lambda line: f"{where}, line {line + 1} of its data",
        how_to_state_quantity="a unit, which the reader passes on",
        note=frf.note,
        averages=frf.averages,
        taken=(f"read by {reader.name}",),
        mentions=noted.mentions,
        **fields_of(meaning),
    )
    if any(name and not DOF.fullmatch(name) for name in (frf.response, frf.force)):
        problem = f"the {_label(reader)} gives the DOFs '{frf.response:.40}' and '{frf.force:.40}'."
        accepted = "a node with its direction, such as 3+x, tool:5-y or 7rz"
        raise MeasurementError(Fault(where, problem, accepted, "Another name belongs into its note."))
    if frf.response and frf.force:
        return recording.with_dofs(frf.response, frf.force)
    return replace(recording, response=frf.response, force=frf.force)


def _read(path: Path, content: bytes, reader: FrfReader) -> Sequence[RecordedFrf]:
    recorded = reader.read(path, content)
    if not isinstance(recorded, (list, tuple)) or not all(isinstance(frf, RecordedFrf) for frf in recorded):
        problem = f"read returned {recorded!r:.60}."
        raise PluginError(Fault(_label(reader), problem, "a list of dovetail.RecordedFrf"))
    if not recorded:
        raise MeasurementError(Fault(str(path), "the file holds no FRF."))
    return recorded


def _chosen(path: Path, recorded: Sequence[RecordedFrf], options: ReadOptions) -> tuple[int, RecordedFrf]:
    """Return the number of the selected FRF, from 1, and the FRF."""
    fitting = [
        (number, frf)
        for number, frf in enumerate(recorded, start=1)
        if options.index in (None, number)
        and _matches(frf.response, options.response)
        and _matches(frf.force, options.force)
    ]
    if len(fitting) == 1:
        return fitting[0]
    listed = "".join(
        f"\n    {number}: {' '.join(filter(None, (frf.response, 'over', frf.force, frf.note)))[:80]}"
        for number, frf in (fitting or list(enumerate(recorded, start=1)))[:_MOST_LISTED]
    )
    problem = f"the file holds {len(recorded)} FRFs, {len(fitting)} of which are meant, and one is wanted:{listed}"
    raise MeasurementError(Fault(str(path), problem, remedy="Choose it by its number, for example `index=1`."))


def _matches(stated: str, wanted: str | None) -> bool:
    return wanted is None or stated.lower().replace("+", "") == wanted.lower().replace("+", "")


def _check_arrays(frf: RecordedFrf, label: str) -> None:
    """Check that a plugin's arrays are numeric vectors of equal length, and its texts are texts.

    Raises
    ------
    PluginError
    """
    size = np.shape(frf.frequency)
    for name, array in (("frequency", frf.frequency), ("values", frf.values), ("coherence", frf.coherence)):
        if array is None and name == "coherence":
            continue
        kinds = "fiuc" if name == "values" else "fiu"
        if not isinstance(array, np.ndarray) or array.dtype.kind not in kinds or array.shape != size or not size[0]:
            kind = f"shape {array.shape}, {array.dtype}" if isinstance(array, np.ndarray) else type(array).__name__
            raise PluginError(Fault(label, f"its {name} are {kind}.", "vectors of numbers of one length"))
    if any(not isinstance(text, str) for text in (frf.unit, frf.response, frf.force, frf.note)):
        raise PluginError(Fault(label, "its unit, DOFs and note are not all texts.", "texts, empty where it is silent"))
    averages = frf.averages
    if averages is not None and (isinstance(averages, bool) or not isinstance(averages, Integral)):
        raise PluginError(Fault(label, f"its averages are {averages!r:.40}.", "a whole number, or None"))
