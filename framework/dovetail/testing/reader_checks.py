"""Checks of readers of FRFs, beyond those of all readers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.errors import MeasurementError
from dovetail.frf import Frf
from dovetail.interfaces import FrfReader
from dovetail.measurement.frf_files import decode, frf_numbers, recording_of
from dovetail.measurement.recording import ReadOptions
from dovetail.measurement.writing import prepare_for_writing
from dovetail.registry.catalogue import HEAD
from dovetail.testing.file_reader_checks import FileReaderSpecimen
from dovetail.testing.outcomes import Nonconformity


@dataclass(frozen=True, eq=False)
class ReaderSpecimen(FileReaderSpecimen):
    """A reader of FRFs, and files of its format."""

    component: FrfReader

    def frf(self, name: Path, content: bytes, index: int | None = None) -> Frf:
        """Return an FRF of a file as `dovetail.read_frf` does; an accelerance if the file states no quantity."""
        recorded = decode(name, content, self.component)
        recording = recording_of(name, recorded, self.component, ReadOptions(index))
        return recording.to_frf(None if recording.is_stated else "accelerance")

    def first(self, name: Path, content: bytes) -> Frf:
        """Return the first FRF of a file."""
        return self.frf(name, content, next(iter(self.numbers(name, content)), None))

    def numbers(self, name: Path, content: bytes) -> list[int | None]:
        """Return the numbers by which the FRFs of a file are chosen; None for the only one."""
        return frf_numbers(name, decode(name, content, self.component))

    def arrays(self, name: Path, content: bytes) -> Sequence[NDArray[Any]]:
        """Return the values of the first FRF."""
        return [self.first(name, content).values]


def check_sample_files_are_read(specimen: ReaderSpecimen) -> str:
    """`sniff` accepts each sample, and each of its FRFs passes Dovetail's checks."""
    count = 0
    for name, content in specimen.files:
        if not specimen.component.sniff(content[:HEAD]):
            raise Nonconformity(f"sniff rejects its own sample '{name}'.", "Test the first bytes only.")
        for index in specimen.numbers(name, content):
            try:
                specimen.frf(name, content, index)
            except MeasurementError as error:
                raise Nonconformity(f"FRF {index or 1} of '{name}': {error.faults[0].problem}") from None
            count += 1
    return f"{count} FRFs"


def check_written_files_are_read(specimen: ReaderSpecimen) -> str | None:
    """A file that it writes is recognised, and read as the FRF that was written."""
    frf = replace(specimen.first(*specimen.files[0]), note="", origin="")
    for suffix in specimen.component.written:
        target = Path(f"written{suffix}")
        content = specimen.component.write(prepare_for_writing(frf, target, None), target)
        if not specimen.component.sniff(content[:HEAD]):
            raise Nonconformity(f"sniff does not take the {suffix} file that it wrote.")
        read = specimen.first(target, content)
        is_same = np.allclose(read.frequency, frf.frequency) and np.allclose(read.values, frf.values)
        if not is_same or read.quantity != frf.quantity:
            raise Nonconformity(
                f"the {suffix} file that it wrote is read as another FRF.", "Compare `read` and `write`."
            )
    return None if specimen.component.written else "nothing is written"
