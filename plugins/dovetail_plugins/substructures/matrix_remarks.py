"""Units that files of matrices state in texts and comments; the description gives the units of the numbers."""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from dovetail import DovetailError, Fault

_ABOUT_UNITS = re.compile(r"\b(?:units?|einheit(?:en)?|unit[ _-]?system|dimensions?)\b", re.IGNORECASE)
_SI = frozenset(("m", "kg", "s", "n", "si", "mks", "rad", "pa", "none", "nm", "hz", ""))
_WORDS = re.compile(r"[^\W\d_]+")
_ALONE = re.compile(r"(?<![\w/*^.-])[^\W\d_]{1,5}(?![\w/*^])")
"""Words of units that are no part of a compound one."""
_UNITS = {
    "length": {"m": 1.0, "mm": 1e-3, "cm": 1e-2, "um": 1e-6, "inch": 0.0254},
    "mass": {"kg": 1.0, "g": 1e-3, "t": 1e3, "tonne": 1e3},
}
_ROUNDED = 1e-3
_DAMPING = frozenset(("loss", "eta", "damping", "zeta", "alpha", "beta", "rayleigh"))
_MATRICES = ("M", "K", "C", "D")
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


def check_units_of_texts(texts: Iterator[tuple[str, str]], units: Mapping[str, float]) -> None:
    """Refuse a text whose unit of length or mass is another one than that of the description.

    Parameters
    ----------
    texts : iterator of (str, str)
        Texts with their places.
    units : mapping of str to float
        SI values of the description's units, by ``length`` and ``mass``.

    Raises
    ------
    DovetailError
    """
    for text, where in texts:
        match = _ABOUT_UNITS.search(text.replace("_", " "))
        words = set() if match is None else {word.lower() for word in _ALONE.findall(text.replace("_", " "))}
        for kind, known in _UNITS.items():
            said = words & set(known)
            if len(said) == 1 and abs(known[(word := min(said))] / units[kind] - 1.0) > _ROUNDED:
                problem = f"the file says '{text.strip()[:80]}', and the description has {units[kind]:g} for {kind}."
                raise DovetailError(Fault(where, problem, remedy=f"Correct 'units', or the text about {word}."))


def warn_of_unused(archive: Mapping[str, Any], shape: tuple[int, ...], file: str) -> None:
    """Warn of damping numbers and of further matrices of the same size in an archive, which are not read.

    Parameters
    ----------
    archive : mapping of str to array
    shape : tuple of int
        Of the matrix K.
    file : str
    """
    damped = {"C", "D", "C_data", "D_data"} & set(archive)
    for name, value in archive.items():
        words, array = set(re.findall(r"[a-z]+", name.lower())), np.asarray(value)
        is_number = array.size == 1 and array.dtype.kind in "fiu" and bool(array.ravel()[0])
        if is_number and words & _DAMPING and not damped:
            remedy = "Give 'loss_factor' in the description, or save a matrix C or D."
            warnings.warn(f"{file}: '{name}' = {array.ravel()[0]:g} is not used. {remedy}", stacklevel=2)
        elif name not in _MATRICES and len(shape) == 2 and shape[0] > 1 and array.shape == shape:
            text = f"the matrix '{name}' is not used; M, K, C and D are read by these names."
            warnings.warn(f"{file}: {text}", stacklevel=2)


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
