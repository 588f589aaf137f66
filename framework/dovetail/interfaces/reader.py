"""The contract of a file reader, which decodes the bytes of a file to the FRFs in it."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from dovetail.interfaces.component import Component, Kind


@dataclass(frozen=True, eq=False)
class RecordedFrf:
    """One FRF as a file contains it; Dovetail checks it and converts its unit.

    Parameters
    ----------
    frequency : (n_freq,) array
        Hz.
    values : (n_freq,) array
        Complex; real for amplitudes only.
    unit : str
        Of the values, such as ``"um/N"``, ``"m/s^2/N"`` or ``"g/N"``; it determines the quantity too. Empty if the file
        does not contain it; then the user must state it.
    coherence : (n_freq,) array, optional
    averages : int, optional
    response, force : str
        DOFs, such as ``"3+x"``; empty if the file does not contain them.
    note : str
        The file's comment on it.
    """

    frequency: NDArray[np.float64]
    values: NDArray[np.complexfloating] | NDArray[np.floating]
    unit: str = ""
    coherence: NDArray[np.float64] | None = None
    averages: int | None = None
    response: str = ""
    force: str = ""
    note: str = ""


class FrfReader(Component):
    """A reader of measured FRFs.

    Attributes
    ----------
    suffixes : tuple of str
        Of the files that it may read, in lower case: ``(".abc",)``. Other readers may have the same.
    """

    kind: ClassVar[Kind] = "reader"
    suffixes: ClassVar[tuple[str, ...]]

    @abstractmethod
    def sniff(self, content: bytes) -> bool:
        """Return whether a file with one of the suffixes has this reader's format, from its first 4096 bytes."""

    @abstractmethod
    def read(self, path: Path, content: bytes) -> Sequence[RecordedFrf]:
        """Return the FRFs of a file, in its order.

        Parameters
        ----------
        path : Path
            For messages, and for other files in the same folder.
        content : bytes
            The whole file, 100 MB at most.

        Raises
        ------
        ValueError
            The file is damaged or has another format; the user sees the text. A parser that is not written in Python
            should run in a separate process: `dovetail.call_guarded`.
        """

    def samples(self, folder: Path) -> Sequence[Path]:  # noqa: ARG002
        """Write small files of the format into an empty folder, for ``dovetail check-plugin``."""
        return ()
