"""The contract of a file reader, which decodes the bytes of a file to what is recorded in it."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from pathlib import Path
from typing import ClassVar

from dovetail.interfaces.component import Component, Kind
from dovetail.interfaces.recorded import FrfToWrite, Recorded


class FrfReader(Component):
    """A reader of measured FRFs or of time records, and perhaps a writer of FRFs.

    A reader only decodes its format. Units, names of columns, the choice of one FRF among several and all checks are
    the same for every format, and are Dovetail's.

    Attributes
    ----------
    suffixes : tuple of str
        Of the files that it may read, in lower case: ``(".abc",)``. Other readers may have the same.
    default_for : tuple of str
        Those of the suffixes of which it also reads the files that no reader recognises; its error then says what is
        wrong with them.
    written : tuple of str
        Suffixes of the files that it writes.
    """

    kind: ClassVar[Kind] = "reader"
    suffixes: ClassVar[tuple[str, ...]]
    default_for: ClassVar[tuple[str, ...]] = ()
    written: ClassVar[tuple[str, ...]] = ()

    @abstractmethod
    def sniff(self, content: bytes) -> bool:
        """Return whether a file with one of the suffixes has this reader's format, from its first 4096 bytes."""

    @abstractmethod
    def read(self, path: Path, content: bytes) -> Recorded:
        """Return what a file contains, in its order.

        Parameters
        ----------
        path : Path
            For messages, and for other files in the same folder.
        content : bytes
            The whole file, 100 MB at most.

        Returns
        -------
        sequence of RecordedFrf, RecordedSignal, RecordedSet or RecordedChannels
            If the format states which numbers are an FRF or a time record, or names its channels.
        RecordedArrays
            Named arrays, among which Dovetail finds the fields of an FRF or of time records by their names.
        array
            Of (n_freq, n_columns) numbers or its transpose, whose columns a user names; or a structured array.
        str
            Text with a table, whose header Dovetail finds; `dovetail.decode_text` returns it from bytes.

        Raises
        ------
        ValueError
            The file is damaged or has another format; the user sees the text. A `MeasurementError` gives a place too. A
            parser that is not written in Python should run in a separate process: `dovetail.call_guarded`.
        """

    def write(self, content: FrfToWrite, path: Path) -> bytes:
        """Return the file of an FRF; only called for the suffixes in `written`.

        Raises
        ------
        ValueError
            The format cannot represent the FRF.
        """
        raise NotImplementedError

    def samples(self, folder: Path) -> Sequence[Path]:  # noqa: ARG002
        """Write small files of the format into an empty folder, for ``dovetail check-plugin``."""
        return ()
