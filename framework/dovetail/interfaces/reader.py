"""The contract of a file reader: from the bytes of a file to the FRFs in it."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from dovetail.interfaces.component import Component, Kind

__all__ = ["FrfReader", "RecordedFrf"]


@dataclass(frozen=True, eq=False)
class RecordedFrf:
    """One FRF as it stands in a file; Dovetail checks it, and converts its unit.

    Parameters
    ----------
    frequency : (n_freq,) array
        Hz.
    values : (n_freq,) array
        Complex; real for amplitudes alone.
    unit : str
        Of the values, such as ``"um/N"``, ``"m/s^2/N"`` or ``"g/N"``; it says the quantity too. Empty where the file
        does not tell it: then the user is asked for it.
    coherence : (n_freq,) array, optional
    averages : int, optional
    response, force : str
        DOFs, such as ``"3+x"``; empty where the file does not tell them.
    note : str
        What the file says about it in words.
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
        Of the files that it may read, in small letters: ``(".abc",)``. Other readers may have the same.
    """

    kind: ClassVar[Kind] = "reader"
    suffixes: ClassVar[tuple[str, ...]]

    @abstractmethod
    def sniff(self, content: bytes) -> bool:
        """Return whether a file with one of the suffixes is of this reader's format, by its first 4096 bytes."""

    @abstractmethod
    def read(self, path: Path, content: bytes) -> Sequence[RecordedFrf]:
        """Return the FRFs of a file, in its order.

        Parameters
        ----------
        path : Path
            For messages, and for files beside it.
        content : bytes
            The whole file, 100 MB at most.

        Raises
        ------
        ValueError
            The file is damaged or of another format; its text is what the user is told. Code that is no Python should
            run in a process of its own: `dovetail.call_guarded`.
        """

    def samples(self, folder: Path) -> Sequence[Path]:  # noqa: ARG002
        """Write small files of the format into an empty folder, for ``dovetail check-plugin``."""
        return ()
