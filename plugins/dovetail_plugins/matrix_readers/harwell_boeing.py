"""Harwell-Boeing files in ASCII: `scipy.io.hb_read` reads neither symmetric matrices nor exponents with a D."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
from numpy.typing import NDArray

_FORMAT = re.compile(r"\(\s*(?:\d+P,?\s*)?(\d*)\s*([IEDFG])\s*(\d+)(?:\.\d+)?(?:E\d+)?\s*\)", re.IGNORECASE)
"""A Fortran format such as (I14), (10I8), (1P,5E16.8) or (d25.15): repeats, letter and width."""
_MOST_DOFS = 2_000_000
"""Which bounds the memory."""


def read_harwell_boeing(content: bytes) -> tuple[str, Any, bool]:
    """Return the title, the matrix and whether it is one half of a symmetric one.

    Returns
    -------
    title : str
    matrix : scipy.sparse.csc_array
    is_half : bool

    Raises
    ------
    ValueError
        The file is damaged, binary, or not of an assembled real square matrix.

    References
    ----------
    I. S. Duff, R. G. Grimes, J. G. Lewis, Users' Guide for the Harwell-Boeing Sparse Matrix Collection, 1992.
    """
    from scipy.sparse import csc_array

    if b"\0" in content[:400]:
        raise ValueError("the file is binary: write it with the option ASCII.")
    lines = content.decode("ascii", "replace").splitlines()
    if len(lines) < 5:
        raise ValueError("the file ends within its header.")
    kind = lines[2][:3].upper()
    if kind not in ("RSA", "RUA"):
        raise ValueError(f"the matrix is of the type '{kind}'; real assembled ones are read (RSA, RUA).")
    counts, sizes = _integers(lines[1], 4), _integers(lines[2][3:], 3)
    n_rows, n_columns, n_entries = sizes[:3]
    if n_rows != n_columns or not 0 < n_rows <= _MOST_DOFS or 2 * n_entries > len(content):
        raise ValueError(f"the file announces {n_entries} entries of a {n_rows} x {n_columns} matrix.")
    formats = _FORMAT.findall(lines[3])
    if len(formats) < 3:
        raise ValueError(f"the formats '{lines[3].strip()[:60]}' are not understood.")
    rest = lines[5 if len(counts) > 4 and counts[4] > 0 else 4 :]
    columns_rows_values = []
    for (_, letter, width), count, wanted in zip(
        formats, counts[1:4], (n_columns + 1, n_entries, n_entries), strict=False
    ):
        columns_rows_values.append(_fields(rest[:count], int(width), wanted, is_real=letter.upper() != "I"))
        rest = rest[count:]
    pointers, rows, values = columns_rows_values
    indptr, indices = pointers.astype(np.int64) - 1, rows.astype(np.int64) - 1
    if indptr[0] != 0 or indptr[-1] != n_entries or np.any(np.diff(indptr) < 0):
        raise ValueError("the pointers to the columns do not increase from 1 to the number of entries.")
    if n_entries and not (indices.min() >= 0 and indices.max() < n_rows):
        raise ValueError("the number of a row is not one of the matrix.")
    return lines[0][:72].strip(), csc_array((values, indices, indptr), shape=(n_rows, n_columns)), kind[1] == "S"


def _integers(line: str, least: int) -> list[int]:
    words = line.split()
    if len(words) < least or not all(word.isdigit() for word in words):
        raise ValueError(f"'{line.strip()[:60]}' are not {least} numbers of the header.")
    return [int(word) for word in words]


def _fields(lines: list[str], width: int, count: int, *, is_real: bool) -> NDArray[np.float64]:
    """Return numbers of a fixed width."""
    cells = [line[start : start + width] for line in lines for start in range(0, len(line.rstrip()), width)]
    if len(cells) != count:
        raise ValueError(f"the file has {len(cells)} numbers where {count} are announced.")
    try:
        return np.array(
            [float(cell.replace("D", "E").replace("d", "e")) for cell in cells]
            if is_real
            else [int(cell) for cell in cells],
            dtype=np.float64,
        )
    except ValueError as error:
        raise ValueError(f"a number of the matrix is damaged: {str(error)[:80]}.") from None
