"""FRFs in numpy archives: what is read, and each fault with its message."""

from __future__ import annotations

import io
import zipfile
from pathlib import Path

import numpy as np
import pytest

from dovetail.measurement import read_frf
from support.measured_files import REMOVE, Marker

AXIS = np.array([1.0, 2.0, 3.0])


def saved(**arrays: object) -> bytes:
    stream = io.BytesIO()
    np.savez_compressed(stream, **arrays)
    return stream.getvalue()


def zipped(**members: bytes) -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in members.items():
            archive.writestr(f"{name}.npy", content)
    return stream.getvalue()


def test_arrays_of_other_types_are_read(tmp_path: Path) -> None:
    content = saved(
        frequency=np.array([0, 1, 2], dtype=np.int32),
        values=np.array([9, 1 + 2j, 3j], dtype=np.complex64),
        quantity=np.array([b"receptance"]),
        notes=np.array("not read"),
    )
    (tmp_path / "a.npz").write_bytes(content)
    frf = read_frf(tmp_path / "a.npz")
    np.testing.assert_array_equal(frf.values, [1 + 2j, 3j])
    assert frf.quantity == "receptance"


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (
            b"PK\x03\x04 no archive",
            "a.npz\n  the archive is damaged: File is not a zip file.\n  Accepted: a file of np.savez",
        ),
        (
            saved(times=AXIS),
            "a.npz\n  the frequency cannot be found by its name; the file holds:\n    times\n"
            "  Say which it is: `names={'frequency': 'NAME'}`.  "
            "Accepted: frequency, frequency_hz, frequencies, freq, freq_hz, f, f_hz",
        ),
        (
            zipped(),
            "a.npz\n  the frequency cannot be found by its name; the file holds: nothing\n"
            "  Say which it is: `names={'frequency': 'NAME'}`.  "
            "Accepted: frequency, frequency_hz, frequencies, freq, freq_hz, f, f_hz",
        ),
        (
            saved(frequency=AXIS),
            "a.npz\n  the values cannot be found by their names; the file holds:\n    frequency\n"
            "  Say which they are, for example `names={'values': 'NAME'}`.  "
            "Accepted: values (complex) | real, imag | amplitude (or db), phase_deg (or phase_rad) | amplitude",
        ),
        (
            saved(frequency=AXIS, values=1j * AXIS, amplitude=AXIS),
            "a.npz\n  the file gives the values in two ways; the file holds:\n"
            "    frequency\n    values\n    amplitude\n"
            "  Say which they are, for example `names={'values': 'NAME'}`.  "
            "Accepted: values (complex) | real, imag | amplitude (or db), phase_deg (or phase_rad) | amplitude",
        ),
        (
            saved(frequency=AXIS, values=AXIS),
            "a.npz\n  'values' has the shape (3,) and the type float64.\n"
            "  Accepted: (n_freq,) complex numbers; an amplitude alone is called amplitude",
        ),
        (
            saved(frequency=AXIS, amplitude=1j * AXIS),
            "a.npz\n  'amplitude' has the shape (3,) and the type complex128.\n  Accepted: (n_freq,) real numbers",
        ),
        (
            saved(frequency=np.array(["1", "2", "3"]), amplitude=AXIS),
            "a.npz\n  'frequency' has the shape (3,) and the type <U1.\n  Accepted: (n_freq,) real numbers",
        ),
        (
            saved(frequency=AXIS[:0], amplitude=AXIS[:0]),
            "a.npz\n  'frequency' has the shape (0,) and the type float64.\n  Accepted: (n_freq,) real numbers",
        ),
        (
            saved(frequency=AXIS, amplitude=AXIS[:2]),
            "a.npz\n  'amplitude' has 2 lines, the frequency has 3.",
        ),
        (
            saved(frequency=AXIS, amplitude=AXIS, coherence=AXIS[:1]),
            "a.npz\n  'coherence' has 1 lines, the frequency has 3.",
        ),
        (
            saved(frequency=AXIS, amplitude=np.ones((3, 2))),
            "a.npz\n  'amplitude' holds 2 FRFs; choose one.\n"
            "  Choose it by one of index, response, force, counted from 1.  Accepted: numbers of 1 to 2",
        ),
        (
            saved(frequency=AXIS, amplitude=AXIS, quantity="inertance"),
            "a.npz  quantity\n  'inertance' is not a quantity.\n"
            "  Did you mean 'accelerance'?  Accepted: receptance, mobility, accelerance",
        ),
        (saved(frequency=AXIS, amplitude=AXIS, quantity=3), "a.npz  quantity\n  the array is not one word."),
        (
            saved(frequency=AXIS, amplitude=np.array([1, np.nan, 3]), quantity="mobility"),
            "a.npz  line 2 of the arrays\n  the value is nan, which is not finite." + REMOVE,
        ),
        (
            saved(frequency=AXIS[::-1], amplitude=AXIS, quantity="mobility"),
            "a.npz  line 2 of the arrays\n  the frequency 2 Hz comes after 3 Hz.\n"
            "  Accepted: frequencies that increase from line to line",
        ),
        (
            saved(frequency=AXIS, amplitude=-AXIS, quantity="mobility"),
            "a.npz  line 1 of the arrays\n  the amplitude -1 is negative (decibels are called db).\n"
            "  Accepted: an amplitude of zero or more",
        ),
        (
            saved(frequency=AXIS, amplitude=np.array([Marker()], dtype=object)),
            "a.npz\n  'amplitude' holds Python objects (pickle), which are never loaded.\n"
            "  Accepted: an array of numbers",
        ),
        (
            zipped(frequency=bytes(60_000_000), amplitude=b""),
            "a.npz\n  'frequency' unpacks to 60 MB.\n  Accepted: at most 40 MB",
        ),
        (
            saved(frequency=AXIS).replace(b"PK\x01\x02", b"PK\x01\x03"),
            "a.npz\n  the archive is damaged: Bad magic number for central directory.\n  Accepted: a file of np.savez",
        ),
    ],
)
def test_faulty_input_is_refused_with_its_message(refused, content: bytes, message: str) -> None:
    assert refused("a.npz", content) == message
    assert not Marker.opened


def test_a_shape_larger_than_the_data_is_refused(refused) -> None:
    stream = io.BytesIO()
    header = {"descr": "<f8", "fortran_order": False, "shape": (900_000_000_000,)}
    np.lib.format.write_array_header_1_0(stream, header)
    assert refused("a.npz", zipped(frequency=stream.getvalue(), amplitude=b"")) == (
        "a.npz\n  'frequency' has the shape (900000000000,) of 8 bytes each.\n"
        "  Accepted: the shape (n_freq,) or with axes of DOFs, at most 1,000,000 lines"
    )


def test_a_truncated_array_is_refused(refused) -> None:
    stream = io.BytesIO()
    np.save(stream, AXIS)
    message = refused("a.npz", zipped(frequency=stream.getvalue()[:-8], amplitude=b""))
    assert message.startswith("a.npz\n  the archive is damaged: EOF: reading array data, expected 24 bytes got 16.")


def test_millions_of_members_are_not_listed(refused) -> None:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        for number in range(2000):
            archive.writestr(f"array{number}.npy", b"")
    assert refused("a.npz", stream.getvalue()) == "a.npz\n  the archive has more than 1000 entries."


def test_amplitudes_in_decibels_are_converted(tmp_path: Path) -> None:
    content = saved(frequency=AXIS, db=np.full(3, -20.0), phase_deg=np.array([0.0, 90.0, 180.0]), quantity="receptance")
    (tmp_path / "a.npz").write_bytes(content)
    np.testing.assert_allclose(read_frf(tmp_path / "a.npz").values, [0.1, 0.1j, -0.1], atol=1e-12)
