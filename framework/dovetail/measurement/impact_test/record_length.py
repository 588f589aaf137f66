"""How long a file says its records are, next to how long they are: a wrong sampling rate shows in this."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import Literal, NamedTuple

from dovetail.measurement.frf_units import read_unit
from dovetail.measurement.quantity_words import words_of

_RECORDS = ("record", "block", "frame", "signal", "acquisition", "recording")
_OF_A_RECORD = frozenset(f"{record} {size}" for record in _RECORDS for size in ("length", "duration", "size"))
_OF_SAMPLES = frozenset(
    ("n samples", "nsamples", "num samples", "number of samples", "samples per record", "samples per block", "npts")
)
_LENGTHS = _OF_A_RECORD | _OF_SAMPLES | {name.replace(" ", "") for name in _OF_A_RECORD}
_SAMPLES = ("samples", "sample", "points", "pts", "s/ch")
NUMBER_AND_UNIT = re.compile(r"([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(\S*)")
_SAME_LENGTH = 0.01
"""Relative difference up to which a stated length counts as rounded."""


class StatedLength(NamedTuple):
    """What a file says of the length of its records.

    Parameters
    ----------
    value : float
        In seconds, or samples.
    kind : {"time", "samples", "either"}
    text : str
        As the file has it.
    where : str
    """

    value: float
    kind: Literal["time", "samples", "either"]
    text: str
    where: str


def read_length(key: str, text: str, where: str) -> StatedLength | None:
    """Return the length of records that a key, such as ``record length``, and its text state; None if they do not."""
    match, words = NUMBER_AND_UNIT.fullmatch(text.strip()), words_of(key)
    if match is None or not words:
        return None
    is_length = " ".join(words) in _LENGTHS
    if not is_length and " ".join(words[:-1]) not in _LENGTHS:
        return None
    value, unit = float(match[1]), match[2] if is_length else words[-1]
    stated, reading = f"{value:g} {unit}".strip(), read_unit(unit)
    if reading is not None and reading.kind == "time":
        return StatedLength(reading.factor * value, "time", stated, where)
    if unit and unit.lower() not in _SAMPLES:
        return None
    in_samples = bool(unit) or " ".join(words) in _OF_SAMPLES
    return StatedLength(value, "samples" if in_samples else "either", stated, where)


def contradicted(lengths: Sequence[StatedLength], records: int, samples: int, rate: float) -> tuple[str, ...]:
    """Return a warning for each length that records with these samples and this rate [Hz] do not have."""
    times, counts = (samples / rate, (samples - 1) / rate), (samples, records * samples)
    possible = {"time": times, "samples": counts, "either": (*times, *counts)}

    def is_right(one: StatedLength) -> bool:
        return any(math.isclose(one.value, length, rel_tol=_SAME_LENGTH) for length in possible[one.kind])

    wrong = dict.fromkeys(one for one in lengths if not is_right(one))
    return tuple(
        f"{one.where}: a length of {one.text} is stated, but the records have {samples} samples, "
        f"{samples / rate:.4g} s at {rate:.6g} Hz. If the sampling rate is wrong, all frequencies are."
        for one in wrong
    )
