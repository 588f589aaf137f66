"""Tables as laboratories have them: no header, lines above it, decimal commas, decibels, names of signals."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from dovetail.frf import Frf
from dovetail.measurement import read_frf

FREQUENCY = [10.0, 12.5, 15.0]
VALUES = np.array([1.5 - 2j, 3 + 0.25j, -4.125j])
PROTOCOL = (
    "Analyser 7\nDate: 25.03.2026 10:15\nOperator; N. N.\n\nFrequency range 0 to 1600 Hz, 801 lines\n1601\n0 1600\n"
)
"""Lines above a table, one of them of numbers."""


def read(tmp_path: Path, text: str | bytes, name: str = "a.txt", **arguments: object) -> Frf:
    (tmp_path / name).write_bytes(text.encode() if isinstance(text, str) else text)
    return read_frf(tmp_path / name, **{"quantity": "accelerance", **arguments})


def rows(separator: str, mark: str = ".", polar: bool = False) -> str:
    """The rows of the table, written by hand."""
    lines = {
        False: ["10 1.5 -2", "12.5 3 0.25", "15 0 -4.125"],
        True: ["10 2.5 -53.13010235415598", "12.5 3.010398644698074 4.763641690726178", "15 4.125 -90"],
    }[polar]
    return "".join(line.replace(".", mark).replace(" ", separator) + "\n" for line in lines)


def check(frf: Frf) -> None:
    np.testing.assert_array_equal(frf.frequency, FREQUENCY)
    np.testing.assert_allclose(frf.values, VALUES, rtol=1e-14, atol=1e-15)


DIALECTS = [
    (",", "."),
    (";", "."),
    (";", ","),
    ("\t", "."),
    ("\t", ","),
    (" ", "."),
    (" ", ","),
    ("   ", ","),
    (", ", "."),
]


@pytest.mark.parametrize(("separator", "mark"), DIALECTS)
@pytest.mark.parametrize("above", ["", PROTOCOL, "% made by hand\n"])
def test_a_table_without_a_header_is_read_by_its_columns(tmp_path: Path, separator: str, mark: str, above: str) -> None:
    check(read(tmp_path, above + rows(separator, mark), columns=("frequency", "real", "imag")))
    polar = rows(separator, mark, polar=True)
    check(read(tmp_path, above + polar, columns=("frequency", "amplitude", "phase_deg")))


@pytest.mark.parametrize(("separator", "mark"), DIALECTS)
@pytest.mark.parametrize("above", ["", PROTOCOL, "# quantity: accelerance\n"])
@pytest.mark.parametrize("units", [False, True])
def test_lines_above_a_header_are_skipped(tmp_path: Path, separator: str, mark: str, above: str, units: bool) -> None:
    header = separator.join(("Frequency", "Real", "Imag.")) + "\n"
    below = separator.join(("Hz", "m/s^2/N", "m/s^2/N")) + "\n" if units else ""
    check(read(tmp_path, above + header + below + rows(separator, mark)))


@pytest.mark.parametrize("encoding", ["utf-8", "latin-1", "utf-16", "utf-8-sig"])
@pytest.mark.parametrize(
    "header",
    [
        "Frequency;Amplitude;Phase [°]",
        "Frequency (Hz);Magnitude;Phase (deg)",
        "Frequency / Hz;Magnitude / (m/s²/N);Phase / °",
        "Freq [Hz];Signal 2 (Magnitude);Signal 2 (Phase [deg])",
        "F;FRF Mag [m/s^2/N];FRF Phase (Degrees)",
        "Frequency_Hz;H1 Amplitude;H1 phase_deg",
    ],
)
def test_amplitude_and_phase_are_found_by_their_names(tmp_path: Path, header: str, encoding: str) -> None:
    check(read(tmp_path, (header + "\n" + rows(";", ",", polar=True)).encode(encoding)))


@pytest.mark.parametrize(
    "header",
    [
        "Frequency (Hz)\tSignal 2 (Real)\tSignal 2 (Imag.)",
        "Freq.\tReal Part\tImag. Part",
        "# frequency\tFRF - Re\tFRF - Im",
        "Frequency [Hz]\tReal [(m/s^2)/N]\tImaginary [(m/s^2)/N]",
    ],
)
def test_real_and_imaginary_part_are_found_by_their_names(tmp_path: Path, header: str) -> None:
    header = header.replace("Freq.", "Freq")
    check(read(tmp_path, f"{header}\n{rows(chr(9))}"))


def test_a_phase_in_radians_and_an_amplitude_in_decibels_are_converted(tmp_path: Path) -> None:
    text = "f;Magnitude [dB];Phase [rad]\n10;20;1,5707963267948966\n20;-6,020599913279624;0\n"
    np.testing.assert_allclose(read(tmp_path, text).values, [10j, 0.5], atol=1e-15)
    text = "f;Magnitude [dB re 1 um/N]\n10;20\n20;0\n"
    frf = read(tmp_path, text, quantity=None)
    np.testing.assert_allclose(frf.values, [1e-5, 1e-6])
    assert (frf.quantity, frf.has_phase) == ("receptance", False)
    frf = read(tmp_path, "10 20 180\n20 40 0\n", columns=("frequency", "db", "phase_deg"), quantity=None, unit="g/N")
    np.testing.assert_allclose(frf.values, [-98.0665, 980.665])


def test_columns_may_be_skipped_and_others_given_units(tmp_path: Path) -> None:
    text = "Nr;Status;f;H;H;coh\n1;OK;0,01;1;2;0,5\n2;overload, bad;0,02;3;4;1\n"
    columns = ("skip", "skip", "frequency [kHz]", "real [um/N]", "imag [um/N]", "coherence")
    frf = read(tmp_path, text, columns=columns, quantity=None)
    np.testing.assert_array_equal(frf.frequency, [10, 20])
    np.testing.assert_allclose(frf.values, [1e-6 + 2e-6j, 3e-6 + 4e-6j])
    np.testing.assert_array_equal(frf.coherence, [0.5, 1])


def test_quoted_cells_are_read(tmp_path: Path) -> None:
    text = '"Frequency","Real","Imag"\n"10,0","1,5","-2"\n"12,5","3","0,25"\n"15","0","-4,125"\n'
    check(read(tmp_path, text))


SAY = "Say what each column holds: `columns=['frequency', 'real', 'imag', 'skip']`."
FAULTS = {
    "1 2 3\n2 3 4\n": "a.txt:1\n  the table has no header.\n  Say what each column holds: `columns=['freq",
    f"{PROTOCOL}1,5;2;3\n2;3;4\n": "a.txt:8\n  the table has no header.\n",
    "f;re;im\n1,5;2;3\n1.234;2;3\n": "a.txt:3\n  numbers have a comma (line 2) and a point (line 3): which is decimal",
    "f;re;im\n1.234,5;2;3\n": "a.txt:2\n  numbers have a comma (line 2) and a point (line 2): which is decimal",
    "f;re;im\n1.234.567;2;3\n": "a.txt:2\n  '1.234.567' in column f is not a number.",
    "f;Signal 1 (Real);Signal 1 (Imag);Signal 2 (Real)\n1;2;3;4\n": (
        "a.txt:1\n  'Signal 1 (Real)', 'Signal 2 (Real)' may each be the real; the file holds:\n"
    ),
    "f;Magnitude;Phase\n1;2;3\n": "a.txt:1\n  'Phase' may be in degrees or in radians; the file holds:\n",
    "f;dB;Phase\n1;2;3\n": "a.txt:1\n  'Phase' may be in degrees or in radians; the file holds:\n",
    "f;Force Real;Force Imag\n1;2;3\n": "a.txt:1\n  the header 'f,Force Real,Force Imag' is not understood.\n",
    "f;Accelerance amplitude;Receptance phase [deg]\n1;2;3\n": (
        f"a.txt\n  the file contradicts itself: accelerance and receptance.\n  {SAY} And what they are: `quantity=`"
    ),
    "f;Acceleration amplitude;Displacement phase [deg]\n1;2;3\n": (
        "a.txt\n  the file contradicts itself: accelerance and receptance.\n"
    ),
    "f;amplitude [g/N];phase [deg];coherence\nHz;um/N;deg;-\n1;2;3;1\n": (
        f"a.txt:1\n  'amplitude [g/N]' has the unit 'um/N' in the row below.\n  {SAY} And their unit: `unit=`."
    ),
    "no table at all": "a.txt\n  there is no header.\n",
}


@pytest.mark.parametrize("text", FAULTS)
def test_a_missing_quantity_or_unit_is_asked_for(refused, text: str) -> None:
    assert refused("a.txt", text).startswith(FAULTS[text])


def test_a_motion_without_its_excitation_has_to_be_confirmed(tmp_path: Path, refused) -> None:
    text = "f;Acceleration Re;Acceleration Im\n1;2;3\n"
    assert "perhaps accelerance: it does not say over what" in refused("a.txt", text)
    assert read(tmp_path, text).quantity == "accelerance"
    assert "the file says that it holds accelerance" in refused("a.txt", text, quantity="mobility")


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        (("frequency", "real"), "the argument columns\n  the values cannot be found by their names"),
        (
            ("frequency", "reel", "imag"),
            "the argument columns\n  'reel' is not a field of an FRF.\n  Did you mean 'real'?",
        ),
        (
            ("frequency", "amplitude", "phase"),
            "the argument columns\n  'phase' is not a field of an FRF.\n  Did you mean",
        ),
        (("frequency", "real", "real"), "the argument columns\n  the header 'frequency,real,real' has a name twice."),
        (
            ("frequency", "real", "imag", "skip"),
            "a.txt:2\n  the line has 3 columns, and 4 are named.\n  Name each column; 'skip' leaves one out.",
        ),
        (("real", "imag", "skip"), "the argument columns\n  the header 'real,imag,skip' is not understood."),
    ],
)
def test_columns_that_do_not_fit_are_refused(refused, columns: tuple[str, ...], message: str) -> None:
    assert refused("a.txt", "by hand\n1,2,3\n2,3,4\n", columns=columns, quantity="mobility").startswith(message)


def test_columns_are_refused_for_other_files_and_if_named_twice(refused) -> None:
    assert "columns=frequency,real is for tables" in refused("a.frf", b"1 2 3\n2 3 4\n", columns=("frequency", "real"))
    message = "the argument names\n  the argument columns names the columns already."
    assert refused("a.csv", "1,2\n", columns=("frequency", "real"), names={"real": "x"}) == message
    assert refused("a.csv", "text\nmore\n", columns=("frequency", "amplitude")).startswith(
        "a.csv\n  there is no row of 2 numbers."
    )
