"""Units that files of matrices state in texts and comments; the description gives the units of the numbers."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from dovetail import DovetailError, Fault

_ABOUT_UNITS = re.compile(r"\b(?:units?|einheit(?:en)?|unit[ _-]?system|dimensions?)\b", re.IGNORECASE)
_SI = frozenset(("m", "kg", "s", "n", "si", "mks", "rad", "pa", "none", "nm", "hz", ""))
_WORDS = re.compile(r"[^\W\d_]+")
_HEAD = 4000
"""Bytes of a Matrix Market file in which comments are looked for."""
_LONGEST, _MOST_TEXTS = 500, 50


def check_stated_units(texts: Iterator[tuple[str, str]]) -> None:
    """Refuse a text about units other than SI, for files whose units the description does not give.

    Parameters
    ----------
    texts : iterator of (str, str)
        Texts with their places.

    Raises
    ------
    DovetailError
    """
    for text, where in texts:
        match = _ABOUT_UNITS.search(text.replace("_", " "))
        if match is None:
            continue
        remark = text.replace("_", " ")[match.end() :].strip(" :=,;'\"")
        short = [word for word in _WORDS.findall(remark) if len(word) <= 4]
        if remark and short and not {word.lower() for word in short} <= _SI:
            problem = f"the file says '{text.strip()[:80]}', and its numbers are read in SI units."
            remedy = "Give 'units' in the description: {length: 1 mm, mass: 1 t, stiffness: 1 N/mm}, or those of SI."
            raise DovetailError(Fault(where, problem, "m, kg, N/m", remedy))


def texts_in(archive: Mapping[str, Any], file: str) -> Iterator[tuple[str, str]]:
    """Yield the texts of an archive with their names in front."""
    for name, value in archive.items():
        array = np.asarray(value)
        if array.dtype.kind in "US" and array.size <= _MOST_TEXTS:
            words = [one.decode("utf-8", "replace") if isinstance(one, bytes) else str(one) for one in array.flat]
            yield f"{name}: {', '.join(words)}"[:_LONGEST], f"{file}  {name}"


def comments_in(content: bytes, file: str) -> Iterator[tuple[str, str]]:
    """Yield the comments at the start of a Matrix Market file, from its bytes."""
    head = content[:_HEAD].decode("utf-8", errors="replace")
    for number, line in enumerate(head.splitlines()[1:_MOST_TEXTS], start=2):
        if line.startswith("%"):
            yield line.strip("% ")[:_LONGEST], f"{file}:{number}"
