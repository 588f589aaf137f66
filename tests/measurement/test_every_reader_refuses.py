"""The same faults in a file of every format: one error, which names the file, at once."""

from __future__ import annotations

import io
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from scipy.io import savemat

from dovetail.errors import FileError, MeasurementError
from dovetail.measurement import read_frf
from support.labview_files import HEADER, SEGMENT
from support.matlab_files import matlab_7_3
from support.measured_files import set_58, write_sets
from support.waiting import processor_time

FREQUENCY = 10.0 + 2.5 * np.arange(60)
VALUES = (1 + 2j) / FREQUENCY
UNIT = "um/N"
Arrays = tuple[np.ndarray, np.ndarray, str]


def table(path: Path, frequency: np.ndarray, values: np.ndarray, unit: str) -> None:
    rows = [f"{f:g}\t{v.real:.17g}\t{v.imag:.17g}" for f, v in zip(frequency, values, strict=True)]
    path.write_text("\n".join([f"Frequency [Hz]\tReal [{unit}]\tImag [{unit}]", *rows]) + "\n")


def comma(path: Path, frequency: np.ndarray, values: np.ndarray, unit: str) -> None:
    table(path, frequency, values, unit)
    path.write_text(path.read_text().replace("\t", ","))


def cutpro(path: Path, frequency: np.ndarray, values: np.ndarray, unit: str) -> None:
    rows = [f"{f:.6E}\t{v.real:.17E}\t{v.imag:.17E}" for f, v in zip(frequency, values, strict=True)]
    rows[:1] = [f"{row}\tFreq\tHz\tReal\t{unit}\tImag\t{unit}" for row in rows[:1]]
    path.write_text("\n".join(rows) + "\n" * bool(rows))


def npz(path: Path, frequency: np.ndarray, values: np.ndarray, unit: str) -> None:
    np.savez(path, frequency=frequency, values=values, unit=unit)


def mat_5(path: Path, frequency: np.ndarray, values: np.ndarray, unit: str) -> None:
    savemat(path, {"f": frequency, "H": values, "unit": unit}, do_compression=True)


def mat_7_3(path: Path, frequency: np.ndarray, values: np.ndarray, unit: str) -> None:
    matlab_7_3(path, f=frequency, H=values, unit=unit)


def hdf5(path: Path, frequency: np.ndarray, values: np.ndarray, unit: str) -> None:
    with h5py.File(path, "w") as file:
        file["f"], file["H"], file["H"].attrs["unit"] = frequency, values, unit


def uff(path: Path, frequency: np.ndarray, values: np.ndarray, unit: str, binary: int = 0) -> None:
    labels = {"ordinate_axis_units_lab": unit.removesuffix("/N"), "orddenom_axis_units_lab": "N"}
    if frequency.size == 0:  # what an analyser writes when it was stopped at once
        frequency, values = np.ones(2), np.ones(2) + 0j
        write_sets(path, set_58(frequency, values, ordinate_spec_data_type=8, **labels))
        lines = path.read_bytes().split(b"\n")
        lines[8] = lines[8].replace(b"         2", b"         0", 1)
        path.write_bytes(b"\n".join([*lines[:13], lines[-2], b""]))
        return
    finite = np.where(np.isfinite(values), values, 4e77)
    axis = np.where(np.isfinite(frequency), frequency, 4e77)
    write_sets(path, set_58(axis, finite, ordinate_spec_data_type=8, binary=binary, **labels))
    content = path.read_bytes()
    missing = (b"%20.11e" % 4e77, b" 4.00000000000e+77", np.float64(4e77).tobytes())
    for number in missing:
        content = content.replace(number, np.float64(np.nan).tobytes() if binary else b"nan".rjust(len(number)))
    path.write_bytes(content.replace(b" 4.00000e+77", b"nan".rjust(12)))


def binary_uff(path: Path, frequency: np.ndarray, values: np.ndarray, unit: str) -> None:
    uff(path, frequency, values, unit, binary=1)


def lvm(path: Path, frequency: np.ndarray, values: np.ndarray, unit: str) -> None:
    rows = [f"{f:g}\t{v.real:.17g}\t{v.imag:.17g}" for f, v in zip(frequency, values, strict=True)]
    text = (HEADER + SEGMENT).partition("10.0\t1.5")[0].replace("m/s^2/N", unit)
    path.write_text(text + "".join(f"{row}\n" for row in rows))


WRITERS: dict[str, tuple[str, Callable[..., None]]] = {
    "csv": ("a.csv", comma),
    "tsv": ("a.tsv", table),
    "labview": ("a.lvm", lvm),
    "cutpro": ("a.frf", cutpro),
    "npz": ("a.npz", npz),
    "mat 5": ("a.mat", mat_5),
    "mat 7.3": ("a.mat", mat_7_3),
    "hdf5": ("a.h5", hdf5),
    "uff": ("a.uff", uff),
    "binary uff": ("b.uff", binary_uff),
}


def changed(array: np.ndarray, index: int, value: Any) -> np.ndarray:
    other = array.copy()
    other[index] = value
    return other


FAULTS: dict[str, Callable[[], Arrays]] = {
    "value not finite": lambda: (FREQUENCY, changed(VALUES, 7, np.nan), UNIT),
    "frequency not finite": lambda: (changed(FREQUENCY, 7, np.nan), VALUES, UNIT),
    "unsorted": lambda: (changed(FREQUENCY, 7, 11.0), VALUES, UNIT),
    "duplicate": lambda: (changed(FREQUENCY, 7, FREQUENCY[6]), VALUES, UNIT),
    "no line": lambda: (FREQUENCY[:0], VALUES[:0], UNIT),
    "wrong unit": lambda: (FREQUENCY, VALUES, "kg/N"),
}
WORDS = {
    "value not finite": ("not finite", "not a number", "nan"),
    "frequency not finite": ("not finite", "not a number", "nan"),
    "unsorted": ("comes after",),
    "duplicate": ("is repeated",),
    "no line": ("no line", "is empty", "no row", "(0,)", "(0, 1)", "(1, 0)", "(0, 0)", "0 lines"),
    "wrong unit": ("is not understood",),
}


def refusal(path: Path) -> str:
    start = processor_time()
    with pytest.raises((FileError, MeasurementError)) as caught:
        read_frf(path)
    assert processor_time() - start < 10
    assert len(caught.value.faults) == 1
    assert str(path) in caught.value.faults[0].where
    return str(caught.value)


@pytest.mark.parametrize("form", WRITERS)
def test_the_intact_file_is_read(form: str, tmp_path: Path) -> None:
    name, write = WRITERS[form]
    write(tmp_path / name, FREQUENCY, VALUES, UNIT)
    frf = read_frf(tmp_path / name)
    np.testing.assert_allclose(frf.values, VALUES * 1e-6, rtol=1e-11)
    assert frf.quantity == "receptance"


@pytest.mark.usefixtures("unguarded")
@pytest.mark.parametrize("fault", FAULTS)
@pytest.mark.parametrize("form", WRITERS)
def test_faulty_numbers_are_refused_by_every_reader(form: str, fault: str, tmp_path: Path) -> None:
    name, write = WRITERS[form]
    write(tmp_path / name, *FAULTS[fault]())
    message = refusal(tmp_path / name)
    assert any(word in message for word in WORDS[fault]), message


@pytest.mark.parametrize("form", WRITERS)
def test_damaged_files_are_refused_by_every_reader(form: str, tmp_path: Path) -> None:
    name, write = WRITERS[form]
    path = tmp_path / name
    write(path, FREQUENCY, VALUES, UNIT)
    whole = path.read_bytes()
    picture = b"\x89PNG\r\n\x1a\n" + np.random.default_rng(0).bytes(5000)
    stream = io.BytesIO()
    np.save(stream, VALUES)
    cut = whole[: len(whole) // 2 - 3]
    for content in (
        b"",
        picture,
        stream.getvalue(),
        b"hello\n",
        cut if form not in ("tsv", "cutpro", "csv", "labview") else b"1",
    ):
        path.write_bytes(content)
        refusal(path)
    with path.open("wb") as sparse:
        sparse.write(whole)
        sparse.truncate(200_000_000)
    assert "the file has 200 MB" in refusal(path)


@pytest.mark.parametrize("form", ["csv", "tsv", "cutpro"])
def test_a_text_that_ends_within_a_row_is_refused(form: str, tmp_path: Path) -> None:
    name, write = WRITERS[form]
    write(tmp_path / name, FREQUENCY, VALUES, UNIT)
    last = tmp_path.joinpath(name).read_text().rstrip("\n")
    (tmp_path / name).write_text(last[: max(last.rfind(","), last.rfind("\t"))])
    assert "columns" in refusal(tmp_path / name)
