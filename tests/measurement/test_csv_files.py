"""Comma-separated FRFs: what is read, and each fault with its message."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pytest

import dovetail
from dovetail.measurement import read_frf
from dovetail.measurement.recording import MOST_LINES
from support.measured_files import REMOVE

HEADERS = (
    "Accepted: frequency_Hz,real,imag | frequency_Hz,amplitude,phase_deg | frequency_Hz,amplitude, "
    "each with or without a last column coherence"
)
SAY = "Say what each column holds: `columns=['frequency', 'real', 'imag', 'skip']`."
RECTANGULAR = "# quantity: mobility\nfrequency_Hz,real,imag\n"


def read(tmp_path: Path, text: str | bytes, **arguments: str):
    path = tmp_path / "a.csv"
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return read_frf(path, **arguments)


def test_real_and_imaginary_part_are_read(tmp_path: Path) -> None:
    frf = read(tmp_path, RECTANGULAR + "10,1,-2\n20,3,4e-3\n")
    np.testing.assert_array_equal(frf.frequency, [10, 20])
    np.testing.assert_array_equal(frf.values, [1 - 2j, 3 + 0.004j])
    assert (frf.quantity, frf.has_phase, frf.coherence) == ("mobility", True, None)


def test_amplitude_and_phase_are_read(tmp_path: Path) -> None:
    frf = read(tmp_path, "frequency_Hz,amplitude,phase_deg\n10,2,90\n20,3,-180\n", quantity="receptance")
    np.testing.assert_allclose(frf.values, [2j, -3], atol=1e-15)
    assert frf.has_phase


def test_an_amplitude_alone_with_coherence_is_read(tmp_path: Path) -> None:
    frf = read(tmp_path, "frequency_Hz,amplitude,coherence\n10,2,0.5\n20,3,1.00001\n", quantity="receptance")
    np.testing.assert_array_equal(frf.values, [2, 3])
    np.testing.assert_array_equal(frf.coherence, [0.5, 1.0])
    assert not frf.has_phase


def test_quotes_spaces_and_comments_of_other_programs_are_read(tmp_path: Path) -> None:
    text = (
        '\ufeff# from the bench\n#quantity = Mobility\n\n"Frequency_Hz", Real ,imag\r\n 10 , 1,-2\r\n\r\n20,3,4\r\n\r\n'
    )
    frf = read(tmp_path, text)
    np.testing.assert_array_equal(frf.values, [1 - 2j, 3 + 4j])
    assert frf.quantity == "mobility"


def test_the_line_at_zero_is_left_out(tmp_path: Path) -> None:
    frf = read(tmp_path, RECTANGULAR + "0,nan,nan\n10,1,2\n")
    np.testing.assert_array_equal(frf.frequency, [10])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "a.csv\n  the file is empty."),
        ("\n\n# quantity: mobility\n", f"a.csv\n  there is no header.\n  {HEADERS}"),
        ("g,re,im\n1,2,3\n", f"a.csv:1\n  the header 'g,re,im' is not understood.\n  {SAY}  {HEADERS}"),
        ("frequency_Hz real imag\n", "a.csv\n  there is no line after the header."),
        (
            "1,2,3\n4,5,6\n",
            f"a.csv:1\n  the table has no header.\n  {SAY}  {HEADERS}",
        ),
        (RECTANGULAR, "a.csv\n  there is no line after the header."),
        (
            "# quantity: acceleration\nfrequency_Hz,real,imag\n1,2,3\n",
            "a.csv:1\n  'acceleration' is not a quantity.\n"
            "  Did you mean 'accelerance'?  Accepted: receptance, mobility, accelerance",
        ),
        (
            RECTANGULAR + "1,2,3\n2,3\n",
            "a.csv:4\n  the line has 2 columns, the header 3.\n  Accepted: frequency_Hz,real,imag",
        ),
        (
            RECTANGULAR + "1,2,3,4\n",
            "a.csv:3\n  the line has 4 columns, the header 3.\n  Accepted: frequency_Hz,real,imag",
        ),
        (RECTANGULAR + "1,2,3\n\n2,x y,3\n", "a.csv:5\n  'x y' in column real is not a number."),
        (RECTANGULAR + "1,2,3\n2,,3\n", "a.csv:4\n  '' in column real is not a number."),
        (
            RECTANGULAR + "1,2,3\n2,3,nan\n3,1,inf\n",
            "a.csv:4\n  the value is (3+nanj), which is not finite (2 such lines)." + REMOVE,
        ),
        (RECTANGULAR + "1,2,3\n2,inf,3\n", "a.csv:4\n  the value is (inf+3j), which is not finite." + REMOVE),
        (RECTANGULAR + "1,2,3\nnan,2,3\n", "a.csv:4\n  the frequency is nan, which is not finite." + REMOVE),
        (RECTANGULAR + "-1,2,3\n2,2,3\n", "a.csv:3\n  the frequency -1 Hz is negative."),
        (
            RECTANGULAR + "1,2,3\n2,2,3\n2,2,3\n",
            "a.csv:5\n  the frequency 2 Hz is repeated.\n  Accepted: frequencies that increase from line to line",
        ),
        (
            RECTANGULAR + "1,2,3\n5,2,3\n\n4,2,3\n",
            "a.csv:6\n  the frequency 4 Hz comes after 5 Hz.\n  Accepted: frequencies that increase from line to line",
        ),
        (RECTANGULAR + "0,2,3\n", "a.csv\n  there is no line but the one at 0 Hz."),
        (
            "# quantity: mobility\nfrequency_Hz,amplitude\n1,2\n2,-3\n",
            "a.csv:4\n  the amplitude -3 is negative (decibels are called db).\n"
            "  Accepted: an amplitude of zero or more",
        ),
        (
            "# quantity: mobility\nfrequency_Hz,amplitude,phase_deg\n1,2,0\n2,-3,0\n",
            "a.csv:4\n  the amplitude -3 is negative (decibels are called db).\n"
            "  Accepted: an amplitude of zero or more",
        ),
        (
            "# quantity: mobility\nfrequency_Hz,amplitude,phase_deg\n1,2,inf\n",
            "a.csv:3\n  the value is (nan+nanj), which is not finite." + REMOVE,
        ),
        (
            "# quantity: mobility\nfrequency_Hz,amplitude,coherence\n1,2,0\n2,3,1.5\n",
            "a.csv:4\n  the coherence 1.5 is not between 0 and 1.",
        ),
        (
            "# quantity: mobility\nfrequency_Hz,amplitude,coherence\n1,2,0\n2,3,nan\n",
            "a.csv:4\n  the coherence is nan, which is not finite." + REMOVE,
        ),
    ],
)
def test_faulty_input_is_refused_with_its_message(refused, text: str, message: str) -> None:
    assert refused("a.csv", text) == message


def test_a_coherence_a_little_above_one_is_taken_as_one_with_a_warning(tmp_path: Path, refused) -> None:
    text = "# quantity: mobility\nf,amplitude,coherence\n0,1,9\n1,1,1.00005\n2,1,1.04\n3,1,0.5\n4,1,1.05\n"
    message = r"a\.csv: the coherence is above 1 at 2 of 4 lines, by up to 0\.05; it is taken as 1 there\.$"
    with pytest.warns(UserWarning, match=message) as caught:
        frf = read(tmp_path, text)
    assert caught[0].filename == __file__
    np.testing.assert_array_equal(frf.coherence, [1, 1, 0.5, 1])
    for wrong in ("1.0501", "-0.01"):
        assert refused("a.csv", text.replace("0.5", wrong)) == (
            f"a.csv:6\n  the coherence {wrong} is not between 0 and 1."
        )


def test_a_file_that_is_not_text_is_refused(refused) -> None:
    expected = "a.csv\n  the file is not text: byte 3 is not UTF-8.\n  Accepted: comma-separated text"
    assert refused("a.csv", b"ab\xff\x00" * 1000) == expected


def test_a_file_that_ends_within_a_line_is_refused(refused) -> None:
    message = "a.csv:4\n  the line has 2 columns, the header 3.\n  Accepted: frequency_Hz,real,imag"
    assert refused("a.csv", RECTANGULAR + "1,2.5,3.5\n2,2.") == message


def test_a_file_of_too_many_lines_is_refused(refused) -> None:
    assert refused("a.csv", "\n" * (MOST_LINES + 20_000)) == (
        "a.csv\n  the file has too many lines.\n  Accepted: at most 1,000,000 lines"
    )


def test_an_index_is_refused_for_a_csv_file(refused) -> None:
    message = "a.csv\n  `index=1` chooses one of several FRFs; a .csv file holds one FRF."
    assert refused("a.csv", RECTANGULAR, index=1) == message


def phase_table(lines: int, phase: np.ndarray) -> str:
    rows = "".join(f"{10 + line},1.0,{value:.6f}\n" for line, value in zip(range(lines), phase, strict=True))
    return "# quantity: mobility\nfrequency_Hz,amplitude,phase_deg\n" + rows


def test_a_phase_in_degrees_that_looks_like_radians_is_reported(tmp_path: Path) -> None:
    wrapped = np.angle(np.exp(1j * np.linspace(0.0, 20.0, 100)))
    message = r"a\.csv: the phase in degrees never leaves \+-3\.15 and jumps by nearly 2 pi: .* call it phase_rad"
    with pytest.warns(UserWarning, match=message):
        read(tmp_path, phase_table(100, wrapped))


def test_a_phase_in_degrees_that_is_small_is_not_reported(tmp_path: Path) -> None:
    small, wrapped = 3.0 * np.sin(np.linspace(0.0, 20.0, 100)), np.angle(np.exp(1j * np.linspace(0.0, 20.0, 99)))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        read(tmp_path, phase_table(100, small))
        read(tmp_path, phase_table(99, wrapped))
        read(tmp_path, phase_table(100, np.rad2deg(np.resize(wrapped, 100))))


@pytest.mark.parametrize("unit", [None, "m/s/N", "mm/s/N"])
def test_an_option_that_contradicts_the_unit_of_a_written_file_is_refused(tmp_path: Path, unit: str | None) -> None:
    frf = dovetail.Frf([1.0, 2.0, 3.0], [1.0, 2.0, 3.0], "mobility")
    dovetail.write_frf(frf, tmp_path / "a.csv", unit=unit)
    np.testing.assert_allclose(dovetail.read_frf(tmp_path / "a.csv", unit=unit or "m/s/N").values, frf.values)
    with pytest.raises(dovetail.MeasurementError, match=r"the argument says um/s/N"):
        dovetail.read_frf(tmp_path / "a.csv", unit="um/s/N")


def test_a_phase_in_radians_that_looks_like_degrees_is_reported(tmp_path: Path) -> None:
    unwrapped = np.linspace(0.0, -40.0, 100)
    wrapped = np.angle(np.exp(1j * unwrapped))
    message = r"a\.csv: the phase in radians reaches 179.* and jumps by more than pi: .* call it phase_deg"
    with pytest.warns(UserWarning, match=message):
        read(tmp_path, phase_table(100, np.rad2deg(wrapped)).replace("_deg", "_rad"))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for phase in (unwrapped, wrapped, wrapped % (2 * np.pi)):
            read(tmp_path, phase_table(100, phase).replace("_deg", "_rad"))


@pytest.mark.parametrize(("repeated", "is_reported"), [(60, True), (10, False), (0, False), (200, False)])
def test_many_lines_in_a_row_with_one_value_are_reported(tmp_path: Path, repeated: int, is_reported: bool) -> None:
    frequency = 10.0 + np.arange(200)
    values = 1.0 / (1.0 + 0.01j * frequency)
    values[200 - repeated :] = values[199 - repeated]
    rows = "".join(f"{f},{v.real!r},{v.imag!r}\n" for f, v in zip(frequency, values.tolist(), strict=True))
    (tmp_path / "a.csv").write_text(f"# unit: g/N\nfrequency_Hz,real,imag\n{rows}")
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", UserWarning)
        read_frf(tmp_path / "a.csv")
    assert [" lines in a row have the same value" in str(one.message) for one in caught] == [True] * is_reported
    assert all(f"a.csv:{202 - repeated}: {repeated + 1} lines" in str(one.message) for one in caught)
