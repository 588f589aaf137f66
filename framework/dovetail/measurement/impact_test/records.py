"""Time records of an impact test as a file has them, with everything that it states about each.

Every reader of a format returns pairs of records, a force and a response. What they mean is decided in
`interpretation`, the same for all formats.
"""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dovetail.interfaces import Statement

Array = NDArray[np.float64]


class AxisFact(NamedTuple):
    """One statement about the times of a record.

    Parameters
    ----------
    kind : {"times", "rate", "step", "start"}
    value : (n_samples,) array or float
        The times, the sampling rate, the time between samples, or the time of the first sample.
    unit : str
        Its unit; empty for seconds or hertz.
    where : str
        Its place.
    """

    kind: Literal["times", "rate", "step", "start"]
    value: Array | float
    unit: str
    where: str


class Point(NamedTuple):
    """A measurement point.

    Parameters
    ----------
    name : str
        Without a sign, such as ``5x``; empty if the file states none.
    label : str
        As it is shown, such as ``5-x``.
    sign : float
        -1 if the record counts along the negative axis.
    """

    name: str = ""
    label: str = ""
    sign: float = 1.0


class TimeRecord(NamedTuple):
    """One channel of one impact.

    Parameters
    ----------
    where : str
        Its place, for messages.
    samples : (n_samples,) array
    statements : tuple of Statement
        On quantity and unit: of a response labels, motion quantities and motion units; of a force labels and units of
        a load.
    axis : tuple of AxisFact
    point : Point
    reference : Point
        Of a response, the point of the force that belongs to it, if the file states it.
    is_acceleration : bool
        Whether a response without any statement is an acceleration, by the documented name of its column.
    is_counts : bool
        Whether the samples are short integers, which are counts of a converter if no unit is given.
    is_si_file : bool
        Whether the file as a whole states that it is in SI units, so that another unit of a record is in doubt.
    """

    where: str
    samples: Array
    statements: tuple[Statement, ...]
    axis: tuple[AxisFact, ...] = ()
    point: Point = Point()
    reference: Point = Point()
    is_acceleration: bool = False
    is_counts: bool = False
    is_si_file: bool = False


Pair = tuple[TimeRecord, TimeRecord]
"""Force and response of one impact."""
