"""Number formats that Python or a careless reader misreads: refused, or read correctly."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest

from dovetail.errors import MeasurementError, UnitError
from dovetail.measurement import read_frf
from dovetail.units import to_si

HEADER = {"a.csv": "frequency_Hz,real,imag\n", "a.txt": "frequency real imag\n", "a.frf": ""}
GAP = {"a.csv": ",", "a.txt": " ", "a.frf": "\t"}


def write(folder: Path, name: str, rows: list[list[str]], end: str = "\n") -> Path:
    (folder / name).write_text(HEADER[name] + "\n".join(GAP[name].join(row) for row in rows) + end, encoding="utf-8")
    return folder / name


@pytest.mark.parametrize("name", HEADER)
@pytest.mark.parametrize("odd", ["1_0", "\uff11\uff12", "\u0663", "1\u00a02"])
def test_numbers_that_no_analyser_writes_are_refused(tmp_path: Path, name: str, odd: str) -> None:
    for row in (1, 3):
        rows = [[str(number), "0.5", "2"] for number in range(1, 6)]
        rows[row][1] = odd
        with pytest.raises(MeasurementError) as caught:
            read_frf(write(tmp_path, name, rows), quantity="receptance")
        assert len(caught.value.faults) == 1


@pytest.mark.parametrize("odd", ["1_0 mm", "1_0", "\uff11\uff12 mm", "1_0mm"])
def test_odd_quantities_are_refused(odd: str) -> None:
    with pytest.raises(UnitError):
        to_si(odd, "m")


@pytest.mark.parametrize(
    ("text", "unit", "expected"),
    [
        ("600 rpm", "Hz", 10.0),
        ("6283.185307179586 rad/s", "Hz", 1000.0),
        ("2 kHz", "Hz", 2000.0),
        ("120 1/min", "Hz", 2.0),
        ("5 Nm/rad", "N m/rad", 5.0),
        ("5 kNm/rad", "N m/rad", 5000.0),
        ("5 Nmm/rad", "N m/rad", 0.005),
        ("5 Nms/rad", "N m s/rad", 5.0),
        ("5 Ns/m", "N s/m", 5.0),
        ("5 kNs/m", "N s/m", 5000.0),
        ("7850 kg/m3", "kg/m^3", 7850.0),
        ("210e3 N/mm2", "Pa", 210e9),
    ],
)
def test_units_are_read_as_laboratories_write_them(text: str, unit: str, expected: float) -> None:
    assert to_si(text, unit) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize(
    ("text", "unit", "said"),
    [
        ("2,5e3", "N/m", "',5e3' in '2,5e3' is not a unit; a unit of N/m was expected. The decimal mark is a point."),
        (
            "1,5 mm",
            "m",
            "'1,5 mm' is not a quantity: write a number, a space and a unit of m. The decimal mark is a point.",
        ),
        ("5 kgm2", "kg m^2", "'kgm2' in '5 kgm2' is not a unit; a unit of kg m^2 was expected."),
        ("0.5 dB", "1", "'dB' in '0.5 dB' is not a unit; a unit of 1 was expected."),
        ("1 octave", "1", "'octave' in '1 octave' is not a unit; a unit of 1 was expected."),
        ("1 gr", "kg", "in '1 gr', 'gr' has more than one meaning: write 'g' or 'grain'."),
    ],
)
def test_a_refused_value_is_quoted_as_written(text: str, unit: str, said: str) -> None:
    with pytest.raises(UnitError) as raised:
        to_si(text, unit)
    assert raised.value.faults[0].problem == said


@pytest.mark.parametrize("name", HEADER)
def test_a_last_number_that_may_be_cut_off_is_refused(tmp_path: Path, name: str) -> None:
    values = np.random.default_rng(0).random((9, 2))
    rows = [[str(number + 1), repr(re), repr(im)] for number, (re, im) in enumerate(values.tolist())]
    whole = read_frf(write(tmp_path, name, rows, end=""), quantity="receptance")
    np.testing.assert_array_equal(whole.values.imag, values[:, 1])
    for kept in (4, 9):
        cut = [*rows[:-1], [*rows[-1][:2], rows[-1][2][:kept]]]
        with pytest.raises(MeasurementError, match="the file ends within the row, or its last number"):
            read_frf(write(tmp_path, name, cut, end=""), quantity="receptance")
        assert read_frf(write(tmp_path, name, cut), quantity="receptance").values.size == 9


def test_cutpro_rows_are_not_cut(tmp_path: Path) -> None:
    (tmp_path / "a.frf").write_text(f"1 2{' ' * 600}3\n2 3 4\n")
    with pytest.raises(MeasurementError, match="the line has 604 characters"):
        read_frf(tmp_path / "a.frf", quantity="receptance")


def test_cutpro_files_with_decimal_commas_are_read(tmp_path: Path) -> None:
    (tmp_path / "a.frf").write_text("100,5 1,25 2,75 Freq Hz Real m/N Imag m/N\n101 1,5 3\n102,5\t-1,5E-3\t3\n")
    frf = read_frf(tmp_path / "a.frf")
    np.testing.assert_array_equal(frf.frequency, [100.5, 101, 102.5])
    np.testing.assert_array_equal(frf.values, [1.25 + 2.75j, 1.5 + 3j, -1.5e-3 + 3j])
    (tmp_path / "a.frf").write_text("100,1,2\n101,3,4\n")
    np.testing.assert_array_equal(read_frf(tmp_path / "a.frf", quantity="receptance").values, [1 + 2j, 3 + 4j])


def test_reading_a_table_reports_its_rows_and_the_meaning_of_its_columns(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("Freq,Re,Im,Coh\nHz,g/N,g/N,\n0,1,2,1\n1,2,5,1\n2,3,4,1\n")
    taken = "'Freq' [Hz] is frequency, 'Re' [g/N] is real, 'Im' [g/N] is imag, 'Coh' is coherence."
    assert read_frf(tmp_path / "a.csv").origin == f"3 rows, of which that at 0 Hz is left out; {taken}"
    (tmp_path / "b.txt").write_text("1 2 5 1\n2 3 4 1\n")
    frf = read_frf(tmp_path / "b.txt", columns=("frequency", "skip", "imag [g/N]", "real [g/N]"))
    taken = "'frequency' is frequency, 'imag' [g/N] is imag, 'real' [g/N] is real, 'skip' is not read."
    assert frf.origin == f"2 rows; {taken}"
    (tmp_path / "c.frf").write_text("1 2 3 Freq Hz Real m/N Imag m/N\n2 3 4\n")
    assert "2 rows; column 1 is the frequency in Hz, 2 and 3 are real and imaginary part in m/N" in (
        read_frf(tmp_path / "c.frf").origin
    )


@pytest.mark.parametrize("name", ["a.npz", "a.h5"])
def test_reading_an_archive_reports_the_meaning_of_its_arrays(tmp_path: Path, name: str) -> None:
    arrays = {"junk": np.eye(3), "f": [1.0, 2.0], "h1": [1j, 2j]}
    if name == "a.npz":
        np.savez(tmp_path / name, **arrays)
    else:
        with h5py.File(tmp_path / name, "w") as file:
            file.update(arrays)
    origin = read_frf(tmp_path / name, quantity="receptance").origin
    assert origin == "2 rows; 'f' is frequency, 'h1' is values, 'junk' is not read."


@pytest.mark.parametrize("row", ["1,5\t2E-005", "1,5 2", "1,5;2"])
def test_cutpro_takes_no_decimal_comma_for_a_gap(tmp_path: Path, row: str) -> None:
    """The second number is the last before the file was cut off."""
    (tmp_path / "a.frf").write_text(row)
    with pytest.raises(MeasurementError, match="the row has 2 columns"):
        read_frf(tmp_path / "a.frf", quantity="receptance")


def test_cutpro_frequencies_are_in_hertz(tmp_path: Path) -> None:
    (tmp_path / "a.frf").write_text("1 2 3 Freq kHz Real m/N Imag m/N\n2 3 4\n")
    with pytest.raises(MeasurementError, match="contain 'kHz'"):
        read_frf(tmp_path / "a.frf")


@pytest.mark.parametrize("row", ["1,,5\t2E-005\t3", "1,5,5\t2E-005\t3", "1,-5\t2\t3", "1 2 3 4"])
def test_labels_of_cutpro_are_not_read_as_numbers(tmp_path: Path, row: str) -> None:
    """Such a row has other gaps than it seems, and its first three numbers are not those that were meant."""
    (tmp_path / "a.frf").write_text(f"{row}\tFreq\tHz\tReal\tm/N\n2\t3\t4\n")
    with pytest.raises(MeasurementError, match="the row has"):
        read_frf(tmp_path / "a.frf")
