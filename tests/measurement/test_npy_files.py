"""Single numpy arrays: which hold an FRF with its frequencies, and how the others are refused."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest

from dovetail.measurement import read_frf
from support.measured_files import Marker

FREQUENCY = np.array([10.0, 12.5, 15.0])
VALUES = np.array([1.5 - 2j, 3 + 0.25j, -4.125j])


def saved(array: np.ndarray) -> bytes:
    stream = io.BytesIO()
    np.save(stream, array)
    return stream.getvalue()


@pytest.mark.parametrize("transposed", [False, True])
def test_two_complex_columns_are_read(tmp_path: Path, transposed: bool) -> None:
    array = np.column_stack([FREQUENCY, VALUES])
    np.save(tmp_path / "a.npy", array.T if transposed else array)
    frf = read_frf(tmp_path / "a.npy", unit="um/N")
    np.testing.assert_array_equal(frf.frequency, FREQUENCY)
    np.testing.assert_allclose(frf.values, VALUES * 1e-6)
    assert frf.quantity == "receptance"


def test_columns_are_found_by_their_names(tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", np.column_stack([[0, 1, 2], FREQUENCY / 1e3, VALUES.real, VALUES.imag]))
    columns = ("skip", "frequency [kHz]", "real", "imag")
    frf = read_frf(tmp_path / "a.npy", quantity="mobility", columns=columns)
    np.testing.assert_allclose(frf.frequency, FREQUENCY)
    np.testing.assert_array_equal(frf.values, VALUES)


def test_a_structured_array_is_read(tmp_path: Path) -> None:
    array = np.zeros(3, dtype=[("f", "f8"), ("accelerance", "c16"), ("coh", "f4")])
    array["f"], array["accelerance"], array["coh"] = FREQUENCY, VALUES, [0.5, 0.75, 1]
    np.save(tmp_path / "a.npy", array)
    frf = read_frf(tmp_path / "a.npy")
    np.testing.assert_array_equal(frf.values, VALUES)
    np.testing.assert_array_equal(frf.coherence, [0.5, 0.75, 1])
    assert frf.quantity == "accelerance"


REAL = np.column_stack([FREQUENCY, VALUES.real, VALUES.imag])
FAULTS = [
    (
        saved(VALUES),
        {},
        "a.npy\n  the array has the shape (3,) and the type complex128, and no frequencies.\n"
        "  Save them too: np.savez('frf.npz', frequency=frequency, values=values).",
    ),
    (
        saved(REAL),
        {},
        "a.npy\n  the array has the shape (3, 3), and its columns have no names.\n  Say what each column",
    ),
    (
        saved(REAL[:, :2]),
        {"columns": ("frequency", "real", "imag", "skip")},
        "a.npy\n  the array has the shape (3, 2),",
    ),
    (saved(np.column_stack([VALUES, FREQUENCY])), {}, "a.npy\n  the column frequency is complex."),
    (saved(np.zeros((0, 2), dtype=complex)), {}, "a.npy\n  the array is empty."),
    (saved(np.array(["a", "b"])), {}, "a.npy\n  the array has the shape (2,) and the type <U1, and no freq"),
    (saved(np.array([Marker()], dtype=object)), {}, "a.npy\n  'a.npy' holds Python objects (pickle), which are never"),
    (saved(REAL), {"index": 1}, "a.npy\n  `index=1` is not for an array without names"),
    (saved(REAL), {"names": {"real": "x"}}, "a.npy\n  names={'real': 'x'} is not for an array"),
    (saved(REAL)[:-9], {}, "a.npy\n  the archive is damaged: EOF: reading array data, expected 72 bytes got 63."),
    (saved(REAL)[:30], {}, "a.npy\n  the archive is damaged: "),
    (b"no array", {}, "a.npy\n  the archive is damaged: "),
    (
        saved(np.column_stack([[1, np.nan], [1j, 2]])),
        {"quantity": "mobility"},
        "a.npy  line 2 of the array\n  the frequency is nan",
    ),
]


@pytest.mark.parametrize(("content", "arguments", "message"), FAULTS)
def test_faulty_input_is_refused_with_its_message(refused, content: bytes, arguments: dict, message: str) -> None:
    assert refused("a.npy", content, **arguments).startswith(message)
    assert not Marker.opened


def test_a_shape_larger_than_the_data_is_refused(refused) -> None:
    stream = io.BytesIO()
    np.lib.format.write_array_header_1_0(stream, {"descr": "<c16", "fortran_order": False, "shape": (900_000, 900_000)})
    assert refused("a.npy", stream.getvalue() + bytes(100)).startswith("a.npy\n  the array is truncated: ")
