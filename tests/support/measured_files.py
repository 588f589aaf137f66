"""FRFs and universal files for the tests, the files written without the framework."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyuff
from hypothesis import assume
from hypothesis import strategies as st

from dovetail.errors import FileError, MeasurementError
from dovetail.measurement import read_frf


def accelerance(frequency: np.ndarray, *modes: tuple[float, float, float]) -> np.ndarray:
    """Sum of modes (natural frequency in Hz, loss factor, mass in kg)."""
    omega = 2 * np.pi * frequency
    return sum(
        -(omega**2) / (mass * ((2 * np.pi * natural) ** 2 * (1 + 1j * loss) - omega**2))
        for natural, loss, mass in modes
    )


def damaged(data: st.DataObject, content: bytes) -> bytes:
    """The content of a file after up to four bytes were changed or pieces lost; something is left of it."""
    pieces = bytearray(content)
    for _ in range(data.draw(st.integers(1, 4))):
        position = data.draw(st.integers(0, len(pieces) - 1))
        if data.draw(st.booleans()):
            pieces[position] = data.draw(st.integers(0, 255))
        else:
            del pieces[position : position + data.draw(st.integers(1, 30))]
        assume(pieces)
    return bytes(pieces)


def set_58(frequency: np.ndarray, values: np.ndarray, **fields: Any) -> dict[str, Any]:
    """A pyuff set of an accelerance, ASCII, uneven, double precision unless specified otherwise."""
    return {
        "type": 58,
        "func_type": 4,
        "rsp_node": 1,
        "rsp_dir": 1,
        "ref_node": 1,
        "ref_dir": 1,
        "x": frequency,
        "data": values,
        "id1": "hammer",
        "abscissa_spec_data_type": 18,
        "ordinate_spec_data_type": 12,
        "orddenom_spec_data_type": 13,
        **fields,
    }


def write_sets(path: Path, *sets: dict[str, Any], force_double: bool = True) -> Path:
    """Write sets by pyuff in the way that works: one by one into a file that is not there."""
    path.unlink(missing_ok=True)
    for one in sets:
        pyuff.UFF(str(path)).write_sets(dict(one), mode="add", force_double=force_double)
    return path


def fault_of(path: Path, **arguments: Any) -> str:
    """The message with which `read_frf` refuses a file, the folder left out."""
    with pytest.raises((FileError, MeasurementError)) as caught:
        read_frf(path, **arguments)
    return str(caught.value).replace(f"{path.parent}/", "")


REMOVE = (
    "\n  Remove these lines from the file: a measurement need not be evenly spaced. "
    "With NumPy: ok = np.isfinite(values), then frequency[ok] and values[ok]."
)
"""What is said to do where a number is not finite."""


class Marker:
    """Leaves a trace when it is unpickled."""

    opened = False

    def __reduce__(self) -> tuple:
        return (setattr, (Marker, "opened", True))
