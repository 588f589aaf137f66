"""HDF5 files as h5py writes them: groups, attributes, names, and what is refused."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest

from dovetail.errors import MeasurementError
from dovetail.measurement import read_frf
from support.measured_files import fault_of

FREQUENCY = 10.0 + 2.5 * np.arange(7)
VALUES = np.array([1 + 2j, -3, 4j, 5.5 - 1j, 1e-9j, 7e5, -8 - 8j])


def saved(path: Path, **datasets: object) -> h5py.File:
    file = h5py.File(path, "w")
    for name, value in datasets.items():
        file[name] = value
    return file


def test_datasets_in_groups_and_units_in_attributes_are_read(tmp_path: Path) -> None:
    with saved(tmp_path / "a.h5", **{"test/freq": FREQUENCY / 1e3, "test/frf": VALUES}) as file:
        file["test/freq"].attrs["unit"] = "kHz"
        file["test/frf"].attrs["units"] = "um/N"
        file["test/coherence"] = np.linspace(0.5, 1, 7)
        file["test/averages"] = 8
        file.attrs["note"] = "shaker"
    frf = read_frf(tmp_path / "a.h5")
    np.testing.assert_allclose(frf.frequency, FREQUENCY)
    np.testing.assert_allclose(frf.values, VALUES * 1e-6)
    assert (frf.quantity, frf.averages, frf.note, frf.coherence[0]) == ("receptance", 8, "shaker", 0.5)


def test_named_and_compressed_datasets_and_radians_per_second_are_read(tmp_path: Path) -> None:
    with saved(tmp_path / "a.hdf5", x=2 * np.pi * FREQUENCY, a=np.eye(3), quantity="mobility") as file:
        file["x"].attrs["unit"] = "rad/s"
        file.create_dataset("y", data=np.stack([VALUES, 2 * VALUES]), compression="gzip", chunks=(1, 3))
    names = {"frequency": "x", "values": "y"}
    frf = read_frf(tmp_path / "a.hdf5", names=names, index=2)
    np.testing.assert_allclose(frf.frequency, FREQUENCY)
    np.testing.assert_array_equal(frf.values, 2 * VALUES)
    message = fault_of(tmp_path / "a.hdf5")
    assert message.startswith(
        "a.hdf5\n  the frequency cannot be found by its name; the file holds:\n    a: (3, 3) float64"
    )


def test_several_groups_are_ambiguous(tmp_path: Path) -> None:
    saved(
        tmp_path / "a.h5", **{f"{g}/{n}": v for g in "ab" for n, v in (("f", FREQUENCY), ("mobility", VALUES))}
    ).close()
    assert "'a/f', 'b/f' may each be the frequency; the file holds:" in fault_of(tmp_path / "a.h5")
    assert read_frf(tmp_path / "a.h5", names={"frequency": "b/f", "values": "b/mobility"}).quantity == "mobility"


def test_nothing_outside_the_file_is_read(tmp_path: Path) -> None:
    (tmp_path / "raw.bin").write_bytes(FREQUENCY.tobytes())
    saved(tmp_path / "other.h5", mobility=VALUES).close()
    with saved(tmp_path / "a.h5", f=FREQUENCY) as file:
        file.create_dataset("freq", (7,), "<f8", external=[("raw.bin", 0, 56)])
        file["mobility"] = h5py.ExternalLink("other.h5", "mobility")
        file["H"] = h5py.SoftLink("/f")
        layout = h5py.VirtualLayout((7,), complex)
        layout[:] = h5py.VirtualSource("other.h5", "mobility", (7,))
        file.create_virtual_dataset("frf", layout)
    assert fault_of(tmp_path / "a.h5").startswith(
        "a.h5\n  the values cannot be found by their names; the file holds:\n    f: (7,) float64\n  Say"
    )


@pytest.mark.parametrize(
    ("datasets", "message"),
    [
        ({"f": FREQUENCY, "mobility": np.array([b"x"] * 7)}, "a.h5\n  'mobility' has the shape (7,) and the type <U1"),
        ({"f": FREQUENCY, "mobility": VALUES.real}, "a.h5\n  'mobility' has the shape (7,) and the type float64."),
        ({"f": FREQUENCY[:0], "mobility": VALUES}, "a.h5\n  'f' has the shape (0,) and the type float64."),
        (
            {"f": FREQUENCY[[0, 0, 1, 2, 3, 4, 5]], "mobility": VALUES},
            "a.h5  line 2 of the arrays\n  the frequency 10 Hz is",
        ),
    ],
)
def test_faulty_input_is_refused_with_its_message(tmp_path: Path, datasets: dict, message: str) -> None:
    saved(tmp_path / "a.h5", **datasets).close()
    assert fault_of(tmp_path / "a.h5").startswith(message)


def test_a_dataset_that_would_fill_the_memory_is_refused(tmp_path: Path) -> None:
    with saved(tmp_path / "a.h5", mobility=VALUES) as file:
        file.create_dataset("f", (10**12,), "<f8", chunks=(1000,), compression="gzip")
    assert (tmp_path / "a.h5").stat().st_size < 20_000
    assert fault_of(tmp_path / "a.h5") == "a.h5\n  'f' unpacks to 8000000 MB.\n  Accepted: at most 40 MB"


def test_groups_without_end_are_refused(tmp_path: Path) -> None:
    with saved(tmp_path / "a.h5") as file:
        file["group/loop"] = file.create_group("other")
        file["other/back"] = file["group"]
    assert "deeper groups than any FRF" in fault_of(tmp_path / "a.h5")


@pytest.mark.usefixtures("unguarded")
def test_every_truncation_is_refused(tmp_path: Path) -> None:
    saved(tmp_path / "a.h5", f=FREQUENCY, mobility=VALUES).close()
    whole = (tmp_path / "a.h5").read_bytes()
    for length in range(1, len(whole), 31):
        (tmp_path / "a.h5").write_bytes(whole[:length])
        assert fault_of(tmp_path / "a.h5").startswith(
            ("a.h5\n  the HDF5 file is damaged", "a.h5\n  this is not an HDF5 file.")
        )


def test_a_unit_that_cannot_be_read_is_not_taken_for_none(tmp_path: Path) -> None:
    with saved(tmp_path / "a.h5", f=FREQUENCY, h1=VALUES) as file:
        file["h1"].attrs["unit"] = "g/N"
    content = (tmp_path / "a.h5").read_bytes()
    assert b"GCOL" in content
    (tmp_path / "a.h5").write_bytes(content.replace(b"GCOL", b"GCOX"))
    with pytest.raises(MeasurementError, match="the HDF5 file is damaged"):
        read_frf(tmp_path / "a.h5", quantity="accelerance")


@pytest.mark.parametrize("name", ["unit", "Unit", "Units", "UNITS"])
@pytest.mark.parametrize("unit", ["um/N", ["um/N"], np.array([b"um/N"])])
def test_a_unit_may_be_a_list_of_one_and_have_a_capital(tmp_path: Path, name: str, unit: object) -> None:
    with saved(tmp_path / "a.h5", frequency=FREQUENCY, values=VALUES) as file:
        file["values"].attrs[name] = unit
    np.testing.assert_allclose(read_frf(tmp_path / "a.h5").values, 1e-6 * VALUES)
