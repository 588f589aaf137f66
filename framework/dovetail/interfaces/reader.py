"""The contracts of file readers, which decode the bytes of a file to what is recorded in it."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from pathlib import Path
from typing import ClassVar

from dovetail.interfaces.component import Component, Kind
from dovetail.interfaces.recorded import FrfToWrite, Recorded
from dovetail.interfaces.recorded_model import RecordedModel


class FileReader(Component):
    """What readers of FRFs and of matrices have in common.

    Attributes
    ----------
    suffixes : tuple of str
        Of the files that it may read, in lower case: ``(".abc",)``. Other readers may have the same.
    default_for : tuple of str
        Those of the suffixes of which it also reads the files that no reader recognises; its error then says what is
        wrong with them.
    package : str
        Optional package that it needs, if any; without it the conformance kit leaves the reader's files out.
    """

    suffixes: ClassVar[tuple[str, ...]]
    default_for: ClassVar[tuple[str, ...]] = ()
    package: ClassVar[str] = ""

    @abstractmethod
    def sniff(self, content: bytes) -> bool:
        """Return whether a file with one of the suffixes has this reader's format, from its first 4096 bytes."""

    def samples(self, folder: Path) -> Sequence[Path]:  # noqa: ARG002
        """Write small files of the format into an empty folder, for ``dovetail check-plugin``."""
        return ()


class FrfReader(FileReader):
    """A reader of measured FRFs or of time records, and perhaps a writer of FRFs.

    A reader only decodes its format. Units, names of columns, the choice of one FRF among several and all checks are
    the same for every format, and are Dovetail's.

    Attributes
    ----------
    suffixes, default_for : tuple of str
        As in `FileReader`.
    written : tuple of str
        Suffixes of the files that it writes.
    """

    kind: ClassVar[Kind] = "reader"
    written: ClassVar[tuple[str, ...]] = ()

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


class MatrixReader(FileReader):
    """A reader of files with which finite element programs export a model: matrices, DOFs, coordinates of nodes.

    A reader only decodes its format. Dovetail mirrors halves, joins the DOFs of several files, checks the matrices
    (symmetric, no negative mass or stiffness, no mechanism), and asks for the units of files that do not state them.

    Attributes
    ----------
    suffixes, default_for : tuple of str
        As in `FileReader`.
    """

    kind: ClassVar[Kind] = "matrix_reader"

    @abstractmethod
    def read(self, path: Path, content: bytes) -> RecordedModel:
        """Return what a file contains: matrices, the DOFs of their rows, coordinates of nodes, or some of these.

        Parameters
        ----------
        path : Path
            For messages, and for other files in the same folder.
        content : bytes
            The whole file, 1 GB at most.

        Raises
        ------
        ValueError
            The file is damaged or has another format; the user sees the text. A `DovetailError` gives a place too. A
            parser that is not written in Python should run in a separate process: `dovetail.call_guarded`.
        """
