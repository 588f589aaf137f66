"""CutPro's text files, made by hand: labels behind the first row's numbers, exponents of three digits."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from dovetail.errors import MeasurementError
from dovetail.measurement import read_frf

ROWS = (
    "5.000000E-001\t1.234000E-005\t-2.500000E-007\tFreq\tHz\tReal\tm/N\tImag\tm/N\t\r\n"
    "1.000000E+000\t-3.000000E-006\t-4.500000E-006\r\n"
    "1.500000E+000\t2.000000E-109\t0.000000E+000\r\n"
)


def test_every_number_and_the_unit_are_read(tmp_path: Path) -> None:
    (tmp_path / "a.frf").write_text(ROWS, newline="")
    frf = read_frf(tmp_path / "a.frf")
    np.testing.assert_array_equal(frf.frequency, [0.5, 1.0, 1.5])
    np.testing.assert_array_equal(frf.values, [1.234e-5 - 2.5e-7j, -3e-6 - 4.5e-6j, 2e-109])
    assert (frf.quantity, frf.has_phase, frf.coherence) == ("receptance", True, None)


@pytest.mark.parametrize(
    ("labels", "factor", "quantity"),
    [
        ("Freq Hz Real um/N Imag um/N", 1e-6, "receptance"),
        ("Freq [Hz] Real [mm/N] Imag [mm/N]", 1e-3, "receptance"),
        ('"Frequency (Hz)" "Real (g/N)" "Imag (g/N)"', 9.80665, "accelerance"),
        ("Freq, Hz, Real, (m/s^2)/N, Imag, (m/s^2)/N", 1.0, "accelerance"),
    ],
)
def test_other_labels_give_other_units_and_quantities(
    tmp_path: Path, labels: str, factor: float, quantity: str
) -> None:
    (tmp_path / "a.frf").write_text(f"0 1 2 {labels}\n  1.0  3.0E+000  4.0\n2 5 6\n")
    frf = read_frf(tmp_path / "a.frf")
    np.testing.assert_allclose(frf.values, factor * np.array([3 + 4j, 5 + 6j]))
    assert frf.quantity == quantity


def test_without_a_unit_it_has_to_be_given(tmp_path: Path, refused) -> None:
    assert refused("a.frf", "1 2 3\n2 3 4\n").startswith("a.frf\n  the file does not say which quantity it holds.")
    np.testing.assert_allclose(read_frf(tmp_path / "a.frf", unit="um/N").values, [2e-6 + 3e-6j, 3e-6 + 4e-6j])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("1 2 3 m/N\n2 3\n", "a.frf:2\n  the row has 2 columns.\n  Accepted: three numbers"),
        ("1 2 3 m/N\n2 3 4 5\n", "a.frf:2\n  the row has 4 columns.\n  Accepted: three numbers"),
        ("Freq Real Imag\n1 2 3\n", "a.frf:1\n  the row 'Freq Real Imag' does not start with three numbers."),
        ("1 2 3 Freq Hz Magnitude m/N Phase deg\n", "a.frf:1\n  the labels 'Freq Hz Magnitude m/N Phase deg' contain"),
        ("1 2 3 m/N mm/N\n", "a.frf:1\n  the file contradicts itself: 'm/N' and 'mm/N'."),
        ("1 2 3 m/kg\n", "a.frf:1\n  the unit 'm/kg' is not understood."),
        (
            "1 2 3 Freq Hz H1 Real m/N H2 Imag m/N\n2 1 1\n",
            "a.frf:1\n  the labels 'Freq Hz H1 Real m/N H2 Imag m/N' name h1",
        ),
        ("1 2 3 m/N\n3 1 1\n2 1 1\n", "a.frf:3\n  the frequency 2 Hz comes after 3 Hz."),
        ("1 2 3 m/N\n1 1 1\n", "a.frf:2\n  the frequency 1 Hz is repeated."),
        ("1 2 3 m/N\n2 nan 1\n", "a.frf:2\n  the value is (nan+1j), which is not finite."),
        ("\n\n", "a.frf\n  there is no row of numbers."),
        ("", "a.frf\n  the file is empty."),
    ],
)
def test_faulty_input_is_refused_with_its_message(refused, text: str, message: str) -> None:
    assert refused("a.frf", text).startswith(message)


def test_it_is_read_and_not_written(tmp_path: Path, measured) -> None:
    from dovetail.errors import MeasurementError
    from dovetail.measurement import write_frf

    with pytest.raises(MeasurementError, match=r"\.frf files are read, not written\.\n  Accepted: \.uff, \.unv, \.csv"):
        write_frf(measured, tmp_path / "a.frf")


def test_a_last_row_that_does_not_end_in_a_number_is_refused(tmp_path):
    (tmp_path / "a.frf").write_text("0\t2E-005\t3\tFreq\tHz\t3\t4\t5;")
    with pytest.raises(MeasurementError):
        read_frf(tmp_path / "a.frf", quantity="accelerance")
