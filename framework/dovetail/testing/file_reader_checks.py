"""Checks that readers of FRFs and of matrices share, with their sample files, intact and damaged."""

from __future__ import annotations

import tempfile
from abc import abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.errors import DovetailError, PluginError
from dovetail.interfaces import FileReader
from dovetail.registry.catalogue import HEAD
from dovetail.testing.outcomes import Nonconformity, NotApplicable
from dovetail.testing.specimen import SEED, Specimen
from dovetail.testing.surroundings import observe

_DAMAGES = 200
"""Random changes of each intact file."""
_STRANGERS = (
    ("", b""),
    ("", b"\x00" * 512),
    (".csv", b"frequency_Hz,real,imag\n10,1e-6,0\n20,1e-6,0\n"),
    (".uff", b"    -1\n    58\nNONE\n"),
    ("", bytes(np.random.default_rng(SEED).integers(0, 256, HEAD, dtype=np.uint8))),
)
"""Nothing, zeros, a table, UFF, and random bytes; with the suffix of a reader that it might recognise."""


@dataclass(frozen=True, eq=False)
class FileReaderSpecimen(Specimen):
    """A reader, and files of its format."""

    component: FileReader

    @cached_property
    def files(self) -> tuple[tuple[Path, bytes], ...]:
        """Names and contents of the sample files.

        Raises
        ------
        NotApplicable
            The package that the reader needs is not installed.
        """
        needed = self.component.package
        if needed and find_spec(needed) is None:
            raise NotApplicable(f"the package {needed} is not installed")
        with tempfile.TemporaryDirectory(prefix="dovetail-examples-") as folder:
            files = tuple(Path(file) for file in self.component.samples(Path(folder)))
            return tuple((Path(file.name), file.read_bytes()) for file in files)

    @abstractmethod
    def arrays(self, name: Path, content: bytes) -> Sequence[NDArray[Any]]:
        """Return the numbers in a file, after Dovetail's checks of what the reader returned."""


def check_sample_files_have_a_suffix_of_it(specimen: FileReaderSpecimen) -> None:
    """`samples` writes at least one file with one of the reader's suffixes."""
    if not specimen.files:
        raise Nonconformity("samples wrote no file.", "Override `samples`: it writes small files of the format.")
    for name, _ in specimen.files:
        if name.suffix.lower() not in specimen.component.suffixes:
            raise Nonconformity(f"the sample '{name}' has none of its suffixes.", "List them in `suffixes`.")


def check_other_files_are_not_taken(specimen: FileReaderSpecimen) -> None:
    """`sniff` refuses an empty file, zeros, a table, a UFF set and random bytes."""
    for suffix, content in _STRANGERS:
        if suffix not in specimen.component.default_for and specimen.component.sniff(content):
            raise Nonconformity(f"sniff accepts a file that begins with {content[:20]!r}.", "Look for a signature.")


def check_reading_twice_gives_the_same(specimen: FileReaderSpecimen) -> None:
    """The same bytes give the same numbers, whatever was read in between."""
    first = [specimen.arrays(name, content) for name, content in specimen.files]
    again = [specimen.arrays(name, content) for name, content in reversed(specimen.files)][::-1]
    for one, other in zip(first, again, strict=True):
        if len(one) != len(other) or not all(map(np.array_equal, one, other)):
            raise Nonconformity("a file read twice gave different numbers.", "Store nothing between calls.")


def check_damaged_files_are_refused_or_read(specimen: FileReaderSpecimen) -> str:
    """A truncated or damaged file is read, or refused with a ValueError that gives the reason."""
    refused = 0
    for name, content in specimen.files:
        for damage in _damaged(content):
            try:
                specimen.arrays(name, damage)
            except PluginError as error:
                remedy = "Raise a ValueError that says what is wrong."
                raise Nonconformity(f"for a damaged file: {error.faults[0].problem}", remedy) from None
            except DovetailError as error:
                refused += 1
                if not error.faults[0].problem.strip():
                    raise Nonconformity(
                        "it refuses a damaged file without a reason.", "Give the reason in the error."
                    ) from None
    return f"{refused} of {_DAMAGES * len(specimen.files)} refused"


def check_nothing_is_printed_or_changed(specimen: FileReaderSpecimen) -> None:
    """Reading prints nothing, and changes no global settings or random numbers."""
    name, content = specimen.files[0]
    seen = observe(lambda: specimen.arrays(name, content))
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
