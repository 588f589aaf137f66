"""Values that a stranger's file may hold in place of a sound one, and where they can be put."""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from dovetail.errors import DovetailError

MISSING = "(missing)"
PLAIN: tuple[Any, ...] = (
    *(1e300, -1e300, 5e-324, 0, -1, 10**30, 10**400, True, None, [], {}, [[[[[1]]]]], {"a": 1}),
    *("x", "\ud800", "1e999", "1e300 N/m", MISSING),
)
"""For files of JSON and YAML."""

Place = tuple[str | int, ...]


def places(value: Any, at: Place = (), first: int = 2) -> Iterator[Place]:
    """Yield the place of each value within plain values; of a list only those of its first elements."""
    if at:
        yield at
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from places(inner, (*at, key), first)
    elif isinstance(value, list):
        for index, inner in enumerate(value[:first]):
            yield from places(inner, (*at, index), first)


def replaced(value: Any, at: Place, hostile: Any) -> Any:
    """Return plain values with another one at a place."""
    changed = copy.deepcopy(value)
    section = changed
    for step in at[:-1]:
        section = section[step]
    if hostile == MISSING:
        del section[at[-1]]
    else:
        section[at[-1]] = hostile
    return changed


def arrays_like(sound: np.ndarray) -> dict[str, np.ndarray]:
    """Return arrays of other types, shapes and values in place of one with a number for each line."""
    lines = len(sound)
    numbers = (1e300, -1e300, 1e155, 1e-300, 5e-324, np.inf, np.nan, -1.0, 0.0)
    single = {f"one of {number}": np.where(np.arange(lines) == 7, number, sound) for number in numbers}
    every = {f"all {number}": np.full(lines, number, sound.dtype) for number in numbers}
    real = np.real(sound)
    others = {
        "of booleans": real > 1,
        "of texts": real.astype("U20"),
        "of bytes": real.astype("S20"),
        "of dates": np.arange(lines).astype("datetime64[s]"),
        "of whole numbers": np.full(lines, 2**64 - 1, np.uint64),
        "of small numbers": real.astype(np.float16),
        "of wide numbers": real.astype(np.longdouble),
        "of records": np.zeros(lines, dtype=[("a", "f8")]),
        "of nothing": np.zeros(lines, "V8"),
        "scalar": sound[0],
        "empty": sound[:0],
        "one line": sound[:1],
        "one line less": sound[:-1],
        "backwards": sound[::-1],
        "in three axes": np.repeat(sound[:, None, None], 2, 1),
        "in four axes": sound[:, None, None, None],
        "the other way round": sound.astype(sound.dtype.newbyteorder(">")),
    }
    return {**single, **every, **others}


def texts() -> dict[str, np.ndarray]:
    """Return arrays in place of one with a word or a number."""
    codes = np.array(["note"])
    codes.view(np.uint32)[:2] = 0x110000, 0xFFFFFFFF
    swapped = codes.astype(codes.dtype.newbyteorder(">"))
    return {
        "codes of no character": codes,
        "codes of no character, the other way round": swapped,
        "half a character": np.array("\ud800"),
        "control characters": np.array("\x1b[2J\0"),
        "no text": np.array(""),
        "bytes": np.array(b"\xff\xfe"),
        "two": np.array(["a", "b"]),
        "a date": np.array("2020", "datetime64[s]"),
        **{repr(value): np.array(value) for value in (1e300, np.nan, 2**63 - 1, -3, 0, True, 1j)},
    }


def outcome(use: Callable[[], object], name: str) -> str:
    """Return "used", or "refused" where one of our errors names the file; anything else is a failure of the test."""
    said = refusal(use)
    assert said is None or name in said, said
    return "used" if said is None else "refused"


def refusal(use: Callable[[], object]) -> str | None:
    """Return the text of our error, or None if there is none."""
    try:
        use()
    except DovetailError as error:
        return str(error)
    return None


def written(path: Path, content: str | bytes) -> Path:
    """Write a file, and return its path."""
    path.write_bytes(content if isinstance(content, bytes) else content.encode("utf-8", "surrogatepass"))
    return path
