"""Numbers that Python or a hasty reader takes for others: refused, or read right."""

from __future__ import annotations

from pathlib import Path

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
def test_numbers_that_no_analyser_writes(tmp_path: Path, name: str, odd: str) -> None:
    for row in (1, 3):
        rows = [[str(number), "0.5", "2"] for number in range(1, 6)]
        rows[row][1] = odd
        with pytest.raises(MeasurementError) as caught:
            read_frf(write(tmp_path, name, rows), quantity="receptance")
        assert len(caught.value.faults) == 1


@pytest.mark.parametrize("odd", ["1_0 mm", "1_0", "\uff11\uff12 mm", "1_0mm"])
def test_quantities(odd: str) -> None:
    with pytest.raises(UnitError):
        to_si(odd, "m")


@pytest.mark.parametrize("name", HEADER)
def test_a_last_number_cut_off(tmp_path: Path, name: str) -> None:
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


def test_cutpro_with_decimal_commas(tmp_path: Path) -> None:
    (tmp_path / "a.frf").write_text("100,5 1,25 2,75 Freq Hz Real m/N Imag m/N\n101 1,5 3\n102,5\t-1,5E-3\t3\n")
    frf = read_frf(tmp_path / "a.frf")
    np.testing.assert_array_equal(frf.frequency, [100.5, 101, 102.5])
    np.testing.assert_array_equal(frf.values, [1.25 + 2.75j, 1.5 + 3j, -1.5e-3 + 3j])
    (tmp_path / "a.frf").write_text("100,1,2\n101,3,4\n")
    np.testing.assert_array_equal(read_frf(tmp_path / "a.frf", quantity="receptance").values, [1 + 2j, 3 + 4j])
