"""Universal files (set 58, ASCII and binary), read with pyuff after checks of the file.

pyuff scans and splits whole files whatever their size, reports only that something failed, ignores the number of values
that a set declares, empties the file when a binary set overwrites it, writes NaN as 0, and counts the bytes of a binary
set wrongly. A file is therefore scanned here first, pyuff gets one checked set at a time, and a set is written into an
empty file.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from dovetail import (
    ComponentConfig,
    Fault,
    Frf,
    FrfReader,
    FrfToWrite,
    MeasurementError,
    RecordedFrf,
    RecordedSet,
    RecordedSignal,
)
from dovetail_plugins.readers.uff_data import read_data
from dovetail_plugins.readers.uff_sets import COHERENCE, FORCE, FRF, GENERAL, TIME, UffSet, scan_sets
from dovetail_plugins.readers.uff_statements import (
    check_unit_system,
    counts_samples,
    frf_statements,
    signal_role,
    signal_statements,
)
from dovetail_plugins.readers.uff_writer import VARIANCE, encode

Array = NDArray[np.float64]
_BEGINNING = re.compile(rb"\s*-1[ \t]*\r?\n *(\d+[ \t]*\r?\n|58b )")
_ROUNDED = 0.1
"""Largest difference of the frequencies of two sets that are the same lines, relative to the smallest step."""


class UffReader(FrfReader):
    """Sets of functions: FRFs with their coherence, and time records of impact tests."""

    name = "uff"
    summary = "Universal files: .uff, .unv"
    suffixes = (".uff", ".unv", ".txt")
    default_for = (".uff", ".unv")
    written = default_for

    class Config(ComponentConfig):
        """Options of the writer.

        Attributes
        ----------
        binary : bool, optional
            Write binary sets. By default ASCII, unless its six digits cannot represent the frequencies.
        """

        binary: bool | None = None

    def sniff(self, content: bytes) -> bool:
        """Look for the start of a set."""
        return _BEGINNING.match(content) is not None

    def read(self, path: Path, content: bytes) -> Sequence[RecordedSet]:
        """Return the sets, whose data are read when they are chosen.

        The coherence of an FRF is also read if exactly one set contains it for the same points and frequencies; so are
        the variance as Dovetail writes it and a number of averages that an id line states as ``averages: 10``.

        Raises
        ------
        MeasurementError
            Not a universal file, or a truncated one.
        """
        sets = scan_sets(path, content)
        return [_recorded(content, sets, uff_set) for uff_set in sets]

    def write(self, content: FrfToWrite, path: Path) -> bytes:
        """Return the FRF, then its coherence and its variance as sets of the same points.

        Raises
        ------
        MeasurementError
            A single line, or frequencies that the six digits of ASCII cannot represent.
        """
        return encode(content, path, self.config.binary)

    def samples(self, folder: Path) -> Sequence[Path]:
        """Write an ASCII and a binary file."""
        frequency, values = np.array([10.0, 20.0, 30.0]), np.array([1.0, 2.0j, 3.0])
        frf = Frf(frequency, values, "mobility", coherence=np.array([0.9, 1.0, 0.8]), response="3+x", force="1-x")
        files = folder / "ascii.uff", folder / "binary.unv"
        for file, binary in zip(files, (False, True), strict=True):
            file.write_bytes(encode(FrfToWrite(frf, frf.unit, 1.0), file, binary))
        return files


def _recorded(content: bytes, sets: Sequence[UffSet], uff_set: UffSet) -> RecordedSet:
    if uff_set.function == FRF:
        load: Callable[[], RecordedFrf | RecordedSignal] = partial(_frf, content, sets, uff_set)
        return RecordedSet(uff_set.number, "frf", str(uff_set), load, uff_set.response, uff_set.force)
    if uff_set.function == TIME:
        load = partial(_signal, content, sets, uff_set)
        return RecordedSet(uff_set.number, "signal", str(uff_set), load, uff_set.response, uff_set.force)
    return RecordedSet(uff_set.number, "other", str(uff_set), partial(_refuse, uff_set))


def _refuse(uff_set: UffSet) -> RecordedFrf:
    raise MeasurementError(Fault(uff_set.where, "the set is neither an FRF nor a time record."))


def _frf(content: bytes, sets: Sequence[UffSet], uff_set: UffSet) -> RecordedFrf:
    is_si_file = check_unit_system(content, sets)
    statements = frf_statements(uff_set)
    frequency, values = read_data(content, uff_set)
    coherences = [one for one in sets if one.function == COHERENCE]
    variances = [one for one in sets if one.function == GENERAL and str(one.fields["id1"]).startswith(VARIANCE)]
    fields = uff_set.fields
    return RecordedFrf(
        frequency,
        values,
        coherence=_matching_data(content, uff_set, coherences, frequency),
        averages=_averages(uff_set),
        response=(not fields["rsp_node"] and _id_line_value(uff_set, "response")) or uff_set.response,
        force=(not fields["ref_node"] and _id_line_value(uff_set, "force")) or uff_set.force,
        note=uff_set.label("id1"),
        variance=_matching_data(content, uff_set, variances, frequency),
        statements=statements,
        is_turned=fields["rsp_dir"] * fields["ref_dir"] < 0,
        rotation=uff_set.rotation,
        moment=uff_set.moment,
        is_si_file=is_si_file,
        is_per_load=fields["orddenom_spec_data_type"] == FORCE or bool(uff_set.label("orddenom_axis_units_lab")),
        where=uff_set.where,
        how_to_state_quantity="data types 8, 11 or 12 over 13 in the set's header",
    )


def _signal(content: bytes, sets: Sequence[UffSet], uff_set: UffSet) -> RecordedSignal:
    is_si_file = check_unit_system(content, sets)
    statements = signal_statements(uff_set)
    times, samples = read_data(content, uff_set)
    if np.iscomplexobj(samples):
        raise MeasurementError(Fault(uff_set.where, "a time record is complex."))
    return RecordedSignal(
        uff_set.where,
        samples,
        None if counts_samples(uff_set) else times,
        signal_role(uff_set),
        statements,
        uff_set.response,
        uff_set.force,
        is_si_file,
    )


def _matching_data(content: bytes, chosen: UffSet, candidates: Sequence[UffSet], frequency: Array) -> Array | None:
    """Return the real data for the points and frequencies of the chosen set, if exactly one set has them.

    They do not depend on the senses of the directions, which count only if several sets are of the same points.
    """
    matching = [
        candidate for candidate in candidates if tuple(map(abs, candidate.points)) == tuple(map(abs, chosen.points))
    ]
    if len(matching) > 1:
        matching = [candidate for candidate in matching if candidate.points == chosen.points] or matching
    if not matching:
        return None
    axis, data = read_data(content, matching[0])
    problem = ""
    if len(matching) > 1:
        problem = f"{len(matching)} sets are of the points of set {chosen.number}"
    elif np.iscomplexobj(data):
        problem = "its numbers are complex"
    elif not _is_same_axis(axis, frequency):
        problem = f"its frequencies are not those of set {chosen.number}"
    if problem:
        name = "coherence" if matching[0].function == COHERENCE else "variance"
        warnings.warn(f"{matching[0].where}: this {name} is not used: {problem}.", stacklevel=2)
    return None if problem else data


def _is_same_axis(axis: Array, frequency: Array) -> bool:
    """Return whether two axes differ by the rounding of their digits only: by less than a tenth of a step."""
    if axis.shape != frequency.shape:
        return False
    steps = np.diff(frequency)
    tolerance = _ROUNDED * float(np.abs(steps).min()) if steps.size else 0.0
    return bool(np.all(np.abs(axis - frequency) <= tolerance))


def _averages(uff_set: UffSet) -> int | None:
    """Return the number of averages that an id line states, or None."""
    number = _id_line_value(uff_set, r"averages", r"0*([1-9]\d{0,5})\b")
    return int(number) if number else None


def _id_line_value(uff_set: UffSet, key: str, value: str = r"(.+?)\s*$") -> str:
    """Return the value of a key in an id line after the first, as in ``averages: 10``, or an empty text."""
    for line in ("id2", "id3", "id4", "id5"):
        if match := re.search(rf"\b{key}\s*[:=]\s*{value}", str(uff_set.fields[line]), re.IGNORECASE):
            return match[1]
    return ""
