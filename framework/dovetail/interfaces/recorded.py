"""What a reader returns: the contents of a file as it states them, not yet checked, chosen or converted."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from dovetail.errors import Fault
from dovetail.frf import Frf
from dovetail.plain_text import csv_comment

About = Literal["quantity", "motion quantity", "unit", "motion unit", "load unit", "axis unit", "label", "load label",
                "axis label", "word", "text", "unclear unit", "disputed unit"]  # fmt: skip


class Statement(NamedTuple):
    """One thing that a file states about its values.

    Parameters
    ----------
    about : str
        - ``"unit"``, of the values; ``"motion unit"`` and ``"load unit"``, of the motion and of the force or moment
          alone; ``"axis unit"``, of the frequency or the time.
        - ``"label"``, ``"load label"`` and ``"axis label"``: names with words and perhaps a unit in brackets, such as
          ``"FRF (g/N)"``.
        - ``"quantity"`` and ``"motion quantity"``: words such as ``"mobility"`` and ``"velocity"``.
        - ``"word"``: a word that has to be the name of a quantity; any other is refused.
        - ``"text"``: a line, a comment or an attribute. Dovetail looks for statements in it.
        - ``"unclear unit"``, which is not understood, and ``"disputed unit"``, which contradicts the file's system of
          units: the user has to give the unit of the values.
    text : str
        As the file contains it.
    where : str
        Its place, such as ``"frf.csv:3"``.
    key : str
        Of a text, the name under which the file has it.
    """

    about: About
    text: str
    where: str
    key: str = ""


@dataclass(frozen=True, eq=False)
class RecordedFrf:
    """One FRF as a file contains it; Dovetail checks it and converts its unit.

    Parameters
    ----------
    frequency : (n_freq,) array
        Hz, or in the unit that `statements` give.
    values : (n_freq,) array
        Complex; real for amplitudes only.
    unit : str
        Of the values, such as ``"um/N"``, ``"m/s^2/N"`` or ``"g/N"``; it determines the quantity too. Empty if the file
        does not contain it, or if `statements` do.
    coherence : (n_freq,) array, optional
    averages : int, optional
    response, force : str
        DOFs, such as ``"3+x"``; empty if the file does not contain them. If they have opposite senses, Dovetail changes
        the sign of the values.
    note : str
        The file's comment on it.
    variance : (n_freq,) array, optional
        E|error|^2 of the values, in the square of their unit.
    statements : sequence of Statement
        Everything else that the file states.
    is_turned : bool, optional
        Whether response and force have opposite senses, if the format states it otherwise than by the names of the
        DOFs, which may then be any texts.
    rotation, moment : bool, optional
        Whether the response is a rotation and the excitation a moment, if the format states it otherwise than by units.
    is_si_file : bool
        Whether the file as a whole states that it is in SI units; another unit of the values is then in doubt.
    is_per_load : bool
        Whether the format states that the values are a motion per force or moment.
    where : str
        Its place, for messages; by default the file and the number of the FRF.
    locate : callable, optional
        Returns the place in the file of the line with an index, for messages.
    how_to_state_quantity : str
        How files of this format state the quantity, for messages.
    meanings : sequence of str
        What each column was taken for, such as ``"column 1 is the frequency"``; the report shows it.
    """

    frequency: NDArray[np.float64]
    values: NDArray[np.complexfloating] | NDArray[np.floating]
    unit: str = ""
    coherence: NDArray[np.float64] | None = None
    averages: int | None = None
    response: str = ""
    force: str = ""
    note: str = ""
    variance: NDArray[np.float64] | None = None
    statements: Sequence[Statement] = ()
    is_turned: bool | None = None
    rotation: bool | None = None
    moment: bool | None = None
    is_si_file: bool = False
    is_per_load: bool = False
    where: str = ""
    locate: Callable[[int], str] | None = field(default=None, repr=False)
    how_to_state_quantity: str = "a unit, which the reader passes on"
    meanings: Sequence[str] = ()


@dataclass(frozen=True, eq=False)
class RecordedSignal:
    """The time record of one channel of an impact test.

    Parameters
    ----------
    where : str
        Its place, for messages.
    samples : (n_samples,) array
    times : (n_samples,) array or None
        s, or in the unit that `statements` give; None if the file does not contain them.
    role : {"force", "response", ""}
        Empty if the format does not state it; then labels and units decide.
    statements : sequence of Statement
        On the samples (``"unit"``, ``"label"``, ``"motion quantity"``) and on the time.
    point : str
        Where it was measured, such as ``"5-x"``; empty if unknown. Along a negative axis its sign is changed.
    reference : str
        Of a response, the point of the force.
    is_si_file : bool
        Whether the file as a whole states that it is in SI units.
    """

    where: str
    samples: NDArray[np.floating]
    times: NDArray[np.float64] | None
    role: Literal["force", "response", ""] = ""
    statements: Sequence[Statement] = ()
    point: str = ""
    reference: str = ""
    is_si_file: bool = False


@dataclass(frozen=True, eq=False)
class RecordedSet:
    """One FRF or time record among many, which is decoded when it is needed.

    Parameters
    ----------
    number : int
        By which a user chooses it, from 1.
    kind : {"frf", "signal", "other"}
    description : str
        A line for lists of the file's contents, such as ``"set 3: coherence, 5+x over 1+x"``.
    load : callable
        Returns the `RecordedFrf` or the `RecordedSignal`.
    response, force : str
        Names of the DOFs.
    """

    number: int
    kind: Literal["frf", "signal", "other"]
    description: str
    load: Callable[[], RecordedFrf | RecordedSignal] = field(repr=False)
    response: str = ""
    force: str = ""


@dataclass(frozen=True, eq=False)
class RecordedChannels:
    """Channels over a common abscissa; their names say what they are, or a user does.

    Parameters
    ----------
    where : str
        The file, and the part of it.
    axis : (n,) array
        The abscissa.
    channels : (n_channels, n) array
    names, units : sequence of str
        Of the channels; a missing unit is empty.
    dimension : str
        Of the abscissa: ``"time"``, ``"frequency"`` or another word of the file.
    axis_unit : str
        Of the abscissa; empty if the file does not contain it.
    statements : sequence of Statement
        On all channels.
    channel_statements : sequence of sequences of Statement
        On each channel.
    steps : sequence of (float, str)
        Distances of two abscissas, each with its place, that the file states in addition to `axis`.
    """

    where: str
    axis: NDArray[np.float64]
    channels: NDArray[np.float64]
    names: Sequence[str]
    units: Sequence[str]
    dimension: str = "time"
    axis_unit: str = ""
    statements: Sequence[Statement] = ()
    channel_statements: Sequence[Sequence[Statement]] = ()
    steps: Sequence[tuple[float, str]] = ()


@dataclass(frozen=True)
class ArrayEntry:
    """One array or text of a file of named arrays, not loaded yet.

    Parameters
    ----------
    what : str
        Shape and type in words, for lists; ``"text"`` for a text.
    load : callable
        Returns the array; a text is an array of one string.
    attributes : mapping of str to str
        Texts and numbers that the file attaches to the entry, such as its unit.
    is_small : bool
        Whether it may be loaded to see what it states.
    """

    what: str
    load: Callable[[], NDArray[Any]] = field(repr=False)
    attributes: Mapping[str, str] = field(default_factory=dict)
    is_small: bool = True


@dataclass(frozen=True)
class RecordedArrays:
    """A file of named arrays; their names say what they are, or a user does.

    Parameters
    ----------
    path : Path
    entries : mapping of str to ArrayEntry
        By their names; those of folders and structs have a slash or a dot between their parts.
    attributes : mapping of str to str
        Texts and numbers that the file attaches to itself.
    group_attributes : mapping of str to mapping of str to str
        Those that it attaches to its folders, by the folder's name with a slash at its end.
    closed : sequence of Fault
        Contents that cannot be opened and may be the FRF: what is raised if no entry is a frequency.
    """

    path: Path
    entries: Mapping[str, ArrayEntry]
    attributes: Mapping[str, str] = field(default_factory=dict)
    group_attributes: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    closed: Sequence[Fault] = ()


Recorded: TypeAlias = (
    str | NDArray[Any] | RecordedArrays | Sequence[RecordedFrf | RecordedSignal | RecordedSet | RecordedChannels]
)
"""What `FrfReader.read` may return."""


@dataclass(frozen=True)
class FrfToWrite:
    """An FRF in the quantity and the unit of the file to write.

    Parameters
    ----------
    frf : Frf
        In the quantity of the file.
    unit : str
        Of the values in the file.
    factor : float
        From the unit of the file to SI.
    """

    frf: Frf
    unit: str
    factor: float

    @property
    def values(self) -> NDArray[np.complex128]:
        """(n_freq,) values in the file's unit."""
        return self.frf.values if self.factor == 1.0 else self.frf.values / self.factor

    @property
    def variance(self) -> NDArray[np.float64] | None:
        """(n_freq,) variance in the square of the file's unit, if the FRF has one."""
        return None if self.frf.variance is None else self.frf.variance / self.factor**2

    @property
    def texts(self) -> dict[str, str]:
        """Note, response and force, those that are known, for a text file: one line, no cell that is a formula."""
        known = {"note": self.frf.note, "response": self.frf.response, "force": self.frf.force}
        return {name: csv_comment(text) for name, text in known.items() if text}
