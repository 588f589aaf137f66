"""Checks of file readers with their sample files, intact and damaged."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from dovetail.errors import MeasurementError, PluginError
from dovetail.frf import Frf
from dovetail.interfaces import FrfReader
from dovetail.measurement.frf_files import HEAD, decode, frf_numbers, recording_of
from dovetail.measurement.recording import ReadOptions
from dovetail.measurement.writing import prepare_for_writing
from dovetail.testing.outcomes import Nonconformity
from dovetail.testing.specimen import SEED, Specimen
from dovetail.testing.surroundings import observe

_DAMAGES = 200
_STRANGERS = (
    ("", b""),
    ("", b"\x00" * 512),
    (".csv", b"frequency_Hz,real,imag\n10,1e-6,0\n20,1e-6,0\n"),
    (".uff", b"    -1\n    58\nNONE\n"),
    ("", bytes(np.random.default_rng(SEED).integers(0, 256, HEAD, dtype=np.uint8))),
)
"""Nothing, zeros, a table, UFF, and random bytes; with the suffix of a reader to which they are no strangers."""


@dataclass(frozen=True, eq=False)
class ReaderSpecimen(Specimen):
    """A reader, and files of its format."""

    component: FrfReader

    @cached_property
    def files(self) -> tuple[tuple[Path, bytes], ...]:
        """Names and contents of the sample files."""
        with tempfile.TemporaryDirectory(prefix="dovetail-examples-") as folder:
            files = tuple(Path(file) for file in self.component.samples(Path(folder)))
            return tuple((Path(file.name), file.read_bytes()) for file in files)

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


def check_sample_files_have_a_suffix_of_it(specimen: ReaderSpecimen) -> None:
    """`samples` writes at least one file with one of the reader's suffixes."""
    if not specimen.files:
        raise Nonconformity("samples wrote no file.", "Override `samples`: it writes small files of the format.")
    for name, _ in specimen.files:
        if name.suffix.lower() not in specimen.component.suffixes:
            raise Nonconformity(f"the sample '{name}' has none of its suffixes.", "List them in `suffixes`.")


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


def check_other_files_are_not_taken(specimen: ReaderSpecimen) -> None:
    """`sniff` refuses an empty file, zeros, a table, a UFF set and random bytes."""
    for suffix, content in _STRANGERS:
        if suffix not in specimen.component.default_for and specimen.component.sniff(content):
            raise Nonconformity(f"sniff accepts a file that begins with {content[:20]!r}.", "Look for a signature.")


def check_reading_twice_gives_the_same(specimen: ReaderSpecimen) -> None:
    """The same bytes give the same FRFs, whatever was read in between."""
    first = [specimen.first(name, content) for name, content in specimen.files]
    again = [specimen.first(name, content) for name, content in reversed(specimen.files)][::-1]
    for one, other in zip(first, again, strict=True):
        if not np.array_equal(one.values, other.values):
            raise Nonconformity("a file read twice gave different FRFs.", "Store nothing between calls.")


def check_damaged_files_are_refused_or_read(specimen: ReaderSpecimen) -> str:
    """A truncated or damaged file is read, or refused with a ValueError that gives the reason."""
    refused = 0
    for name, content in specimen.files:
        for damage in _damaged(content):
            try:
                specimen.first(name, damage)
            except PluginError as error:
                remedy = "Raise a ValueError that says what is wrong."
                raise Nonconformity(f"for a damaged file: {error.faults[0].problem}", remedy) from None
            except MeasurementError as error:
                refused += 1
                if not error.faults[0].problem.strip():
                    raise Nonconformity(
                        "it refuses a damaged file without a reason.", "Give the reason in the error."
                    ) from None
    return f"{refused} of {_DAMAGES * len(specimen.files)} refused"


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


def check_nothing_is_printed_or_changed(specimen: ReaderSpecimen) -> None:
    """Reading prints nothing, and changes no global settings or random numbers."""
    name, content = specimen.files[0]
    seen = observe(lambda: specimen.component.read(name, content))
    changed = [*seen.generators, *seen.settings, *(["the standard output"] if seen.printed.strip() else [])]
    if changed:
        raise Nonconformity(f"reading changes {', '.join(changed)}.", "Restore it.")


def _damaged(content: bytes) -> Iterator[bytes]:
    """Yield copies of a file that are truncated, have a few bytes changed, or repeat a piece."""
    random = np.random.default_rng(SEED)
    for number in range(_DAMAGES):
        cut, other = sorted(int(place) for place in random.integers(0, len(content) + 1, 2))
        if number % 3 == 0:
            yield content[:cut]
        elif number % 3 == 1:
            changed = bytearray(content)
            for place in random.integers(0, max(len(content), 1), 4):
                if changed:
                    changed[place] = int(random.integers(0, 256))
            yield bytes(changed)
        else:
            yield content[:other] + content[cut:]
