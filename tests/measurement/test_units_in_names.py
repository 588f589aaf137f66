"""Units in the names of arrays and columns, units that only look like those of an FRF, and marks of thousands."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import dovetail
from dovetail.measurement import frf_units

FREQUENCY = np.arange(10.0, 60.0)
VALUES = np.linspace(1.0, 2.0, 50) + 1j
TURN = 2.0 * np.pi


@pytest.mark.parametrize(
    ("name", "factor"),
    [
        ("f_kHz", 1e-3),
        ("freq_rad_s", TURN),
        ("freq_rad_per_s", TURN),
        ("omega", TURN),
        ("omega_rad_s", TURN),
        ("f_Hz", 1),
    ],
)
@pytest.mark.parametrize("suffix", [".npz", ".csv"])
def test_the_unit_in_the_name_of_a_chosen_frequency_is_used(tmp_path: Path, suffix: str, name: str, factor: float):
    file = written(tmp_path / f"frf{suffix}", {name: FREQUENCY * factor, "real": VALUES.real, "imag": VALUES.imag})
    frf = dovetail.read_frf(file, quantity="receptance", names={"frequency": name})
    np.testing.assert_allclose(frf.frequency, FREQUENCY, rtol=1e-9)


@pytest.mark.parametrize(("name", "unit"), [("H_g_per_N", 9.80665), ("H_g_N", 9.80665), ("H_mm_s2_N", 1e-3)])
def test_the_unit_in_the_name_of_chosen_values_is_used(tmp_path: Path, name: str, unit: float):
    file = written(tmp_path / "frf.npz", {"frequency": FREQUENCY, name: VALUES / unit})
    frf = dovetail.read_frf(file, quantity="accelerance", names={"values": name})
    np.testing.assert_allclose(frf.values, VALUES, rtol=1e-9)


def test_a_unit_in_a_name_that_contradicts_the_given_unit_is_refused(tmp_path: Path):
    file = written(tmp_path / "frf.npz", {"frequency": FREQUENCY, "H_um_N": VALUES, "unit": np.array("m/N")})
    with pytest.raises(dovetail.MeasurementError, match="contradicts itself"):
        dovetail.read_frf(file, names={"values": "H_um_N"})


@pytest.mark.parametrize("unit", ["ms^-2/N", "ms-2/N", "mms^-1/N", "ms^-1/N", "1/kg"])
def test_units_that_look_like_a_motion_by_a_moment_are_refused(tmp_path: Path, unit: str):
    columns = {"frequency_Hz": FREQUENCY, f"real [{unit}]": VALUES.real, f"imag [{unit}]": VALUES.imag}
    with pytest.raises(dovetail.MeasurementError, match="not understood"):
        dovetail.read_frf(written(tmp_path / "frf.csv", columns))


def test_a_number_whose_comma_may_mark_thousands_is_refused(tmp_path: Path):
    rows = [f"{n:,};5;1".replace("0.5", "5") for n in range(998, 1010)]
    (tmp_path / "frf.csv").write_text("frequency_Hz;real;imag\n" + "\n".join(rows) + "\n")
    with pytest.raises(dovetail.MeasurementError, match=r"frf\.csv:4\n.*may be decimal or mark thousands"):
        dovetail.read_frf(tmp_path / "frf.csv", quantity="receptance")


def test_decimal_commas_with_three_digits_are_read_next_to_others(tmp_path: Path):
    rows = [f"{n},250;0,5;1,0" for n in range(10, 22)]
    (tmp_path / "frf.csv").write_text("frequency_Hz;real;imag\n" + "\n".join(rows) + "\n")
    assert dovetail.read_frf(tmp_path / "frf.csv", quantity="receptance").frequency[0] == 10.25


def written(path: Path, columns: dict[str, np.ndarray]) -> Path:
    """Write arrays by their names, or real columns as a table."""
    if path.suffix == ".npz":
        np.savez(path, **columns)
    else:
        table = np.column_stack(list(columns.values()))
        np.savetxt(path, table, delimiter=",", header=",".join(columns), comments="", fmt="%.12g")
    return path


@pytest.mark.parametrize("version", ["80.4.0", "1.2.3.4", "7,5,1", "1e400"])
def test_a_version_in_a_line_of_text_is_not_an_acting_number(tmp_path: Path, version: str):
    file = written(tmp_path / "frf.csv", {"frequency_Hz": FREQUENCY, "real": VALUES.real, "imag": VALUES.imag})
    file.write_text(f"Software: {version}\n# gauge {version}\n{file.read_text()}")
    assert dovetail.read_frf(file, quantity="receptance").values[0] == VALUES[0]


@pytest.mark.parametrize("unit", sorted(frf_units._PLAIN))
def test_a_unit_of_files_that_is_known_without_pint_is_read_as_by_pint(unit: str):
    assert frf_units.read_unit(unit) == frf_units._reading_by_pint(unit)
