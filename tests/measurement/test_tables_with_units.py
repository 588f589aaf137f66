"""Tables as analysers, spreadsheets and pandas write them: separators, units in the header or below it, other names."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from dovetail.errors import MeasurementError
from dovetail.frf import Frf
from dovetail.measurement import read_frf


def read(tmp_path: Path, name: str, text: str, **arguments: object) -> Frf:
    (tmp_path / name).write_text(text, encoding="utf-8")
    return read_frf(tmp_path / name, **arguments)


def test_tabs_and_units_in_the_header_are_read(tmp_path: Path) -> None:
    text = "Frequency [Hz]\tReal [um/N]\tImag [um/N]\tCoherence [-]\n10\t1\t-2\t0.5\n20\t3\t4E-003\t1\n"
    frf = read(tmp_path, "a.tsv", text)
    np.testing.assert_allclose(frf.values, [1e-6 - 2e-6j, 3e-6 + 4e-9j])
    np.testing.assert_array_equal(frf.coherence, [0.5, 1])
    assert frf.quantity == "receptance"


def test_a_row_of_units_is_read(tmp_path: Path) -> None:
    text = "Freq\tMagnitude\tPhase_deg\nHz\t(g/N)\tdeg\n10\t2\t90\n20\t1\t180\n"
    frf = read(tmp_path, "a.txt", text)
    np.testing.assert_allclose(frf.values, [2j * 9.80665, -9.80665], atol=1e-12)
    assert frf.quantity == "accelerance"


def test_semicolons_and_decimal_commas_are_read(tmp_path: Path) -> None:
    text = 'Frequency (kHz);Magnitude ((mm/s)/N);Phase (rad)\n"1,5";"2,5";"3,141592653589793"\n2;1;0\n'
    frf = read(tmp_path, "a.csv", text)
    np.testing.assert_allclose(frf.frequency, [1500, 2000])
    np.testing.assert_allclose(frf.values, [-2.5e-3, 1e-3], atol=1e-15)
    assert frf.quantity == "mobility"


def test_complex_numbers_as_pandas_writes_them_are_read(tmp_path: Path) -> None:
    text = ",frequency,accelerance\n0,10.0,(1.5-2e-05j)\n1,20.0,(3+4j)\n2,30.0,-5j\n"
    frf = read(tmp_path, "a.csv", text)
    np.testing.assert_array_equal(frf.values, [1.5 - 2e-5j, 3 + 4j, -5j])
    assert frf.quantity == "accelerance"


def test_a_column_of_real_values_is_not_an_frf(tmp_path: Path) -> None:
    text = "frequency,accelerance\n10,1.5\n20,3\n30,5\n"
    with pytest.raises(MeasurementError, match="'accelerance' holds real numbers only"):
        read(tmp_path, "a.csv", text)
    frf = read(tmp_path, "a.csv", text, names={"amplitude": "accelerance"})
    assert not frf.has_phase
    np.testing.assert_array_equal(frf.amplitude, [1.5, 3.0, 5.0])


def test_columns_are_chosen_by_their_names(tmp_path: Path) -> None:
    text = "f;PSD;H1 Re;H1 Im;H2 Re;H2 Im\n1;9;1;2;3;4\n2;9;5;6;7;8\n"
    names = {"real": "H2 Re", "imag": "H2 Im"}
    frf = read(tmp_path, "a.csv", text, names=names, unit="m/s/lbf")
    np.testing.assert_allclose(frf.values, np.array([3 + 4j, 7 + 8j]) / 4.4482216152605)
    assert frf.quantity == "mobility"


def test_units_averages_and_points_in_comments_are_read(tmp_path: Path) -> None:
    text = "% unit: mm/N\n# averages: 12\n# note: hit three\n#response: tool tip\n# force=nut\nf,re,im\n1,2,3\n2,3,4\n"
    frf = read(tmp_path, "a.csv", text)
    np.testing.assert_allclose(frf.values, [2e-3 + 3e-3j, 3e-3 + 4e-3j])
    assert (frf.averages, frf.note, frf.response, frf.force) == (12, "hit three", "tool tip", "nut")


def test_a_unit_that_the_caller_gives_is_used(tmp_path: Path) -> None:
    frf = read(tmp_path, "a.csv", "f,amplitude\n1,2\n2,3\n", unit="in/lbf")
    np.testing.assert_allclose(frf.values, np.array([2, 3]) * 0.0254 / 4.4482216152605)
    assert (frf.quantity, frf.has_phase) == ("receptance", False)
    frf = read(tmp_path, "a.csv", "f,re,im\n1,2,0\n2,3,0\n", unit="rad/(N m)")
    assert frf.rotation
    assert frf.unit == "rad/(N m)"


SAY = "  Say what each column holds: `columns=['frequency', 'real', 'imag', 'skip']`."
HEADERS = f"{SAY}  Accepted: frequency_Hz,real,imag | frequency_Hz,amplitude,phase_deg | frequency_Hz,amplitude, "
FAULTS = [
    (
        "f,H1,H2\n1,2,3\n",
        "a.csv:1\n  'H1', 'H2' may each be the values; the file holds:\n    f\n    H1\n    H2\n"
        "  Say which, for example `names={'values': 'H1'}`.",
    ),
    ("f,re,im,extra\n1,2,3,4\n", "a.csv:1\n  the header 'f,re,im,extra' is not understood.\n" + HEADERS),
    (
        "f,amplitude,phase\n1,2,3\n",
        "a.csv:1\n  'phase' may be in degrees or in radians; the file holds:\n    f\n    amplitude\n    phase\n"
        "  `names={'phase_deg': 'phase'}` or `names={'phase_rad': 'phase'}` says which.",
    ),
    ("f,re,re\n1,2,3\n", "a.csv:1\n  the header 'f,re,re' has a name twice.\n" + HEADERS),
    ("f [rpm],re,im\n1,2,3\n", "a.csv:1\n  the frequency is in 'rpm'.\n  Accepted: Hz, kHz, rad/s"),
    ("f,re [um/N],im [mm/N]\n1,2,3\n", "a.csv:1\n  the values are in different units: mm/N and um/N.\n" + SAY),
    ("f,re [kg],im [kg]\n1,2,3\n", "a.csv:1\n  the unit 'kg' is not understood.\n  Accepted: a motion per force"),
    ("# averages: many\nf,re,im\n1,2,3\n", "a.csv:1\n  'many' is not a number of averages."),
    ("# quantity: mobility\nf,re [um/N],im\n1,2,3\n", "a.csv\n  the file contradicts itself: mobility and receptance."),
    ("f\tre\tim\n1,5,5\t2\t3\n", "a.csv:2\n  '1,5,5' in column f is not a number."),
]


@pytest.mark.parametrize(("text", "message"), FAULTS)
def test_faulty_input_is_refused_with_its_message(refused, text: str, message: str) -> None:
    assert refused("a.csv", text).startswith(message)


def test_an_argument_that_contradicts_the_file_is_refused(refused) -> None:
    text = "f,re [um/N],im [um/N]\n1,2,3\n"
    wrong = "a.csv\n  the file says that it holds {}, the argument says {}.\n"
    assert refused("a.csv", text, unit="mm/N").startswith(wrong.format("unit um/N", "mm/N"))
    assert refused("a.csv", text, quantity="mobility").startswith(wrong.format("receptance", "mobility"))
    content = "# quantity: mobility\nf,re,im\n1,2,3\n"
    assert refused("a.csv", content, unit="mm/N").startswith(wrong.format("mobility", "a unit of receptance"))
    assert refused("a.csv", text, unit="furlong").startswith(
        "the argument unit\n  the unit 'furlong' is not understood."
    )


def test_unknown_names_are_refused(refused) -> None:
    text = "f,Real X,Imag X\n1,2,3\n"
    assert refused("a.csv", text, names={"real": "Real Y", "imag": "Imag X"}) == (
        "a.csv:1\n  there is no 'Real Y' in the file; it holds:\n"
        "    f\n    Real X\n    Imag X\n  Did you mean 'Real X'?"
    )
    assert refused("a.csv", text, names={"reel": "Real X"}).startswith(
        "the argument names\n  'reel' is not a field of an FRF.\n  Did you mean 'real'?"
    )


@pytest.mark.parametrize(
    "header",
    [
        "frequency,amplitude,phase_deg [rad]",
        "frequency,amplitude,phase_rad [deg]",
        "frequency,amplitude,phase_deg\nHz,m/N,rad",
    ],
)
def test_a_phase_whose_name_and_unit_disagree_is_not_guessed(tmp_path: Path, header: str) -> None:
    with pytest.raises(MeasurementError, match="may be in degrees or in radians"):
        read(tmp_path, "a.csv", f"{header}\n10,1,1\n20,1,2\n", quantity="receptance")


@pytest.mark.parametrize("header", ["frequency,amplitude,phase_deg [deg]", "frequency,amplitude,phase [deg]"])
def test_a_phase_whose_name_and_unit_agree_is_read(tmp_path: Path, header: str) -> None:
    frf = read(tmp_path, "a.csv", f"{header}\n10,1,90\n20,1,180\n", quantity="receptance")
    np.testing.assert_allclose(frf.values, [1j, -1], atol=1e-12)


def test_lines_without_a_number_between_header_and_rows_are_skipped(tmp_path: Path) -> None:
    """SignalCalc writes a blank line, a word and a row of units of its own there; it says none that is understood."""
    header = "Units: Ratio\n\nFrequency\t Real\t Imaginary\n\nUnits:\nHz\t(m/s\xb2)(N)\t \n"
    text = header + "0.0\t 1\t 0\n1e1\t 2\t -3\n2e1\t 4\t 5\n"
    frf = read(tmp_path, "a.txt", text, unit="m/s^2/N")
    np.testing.assert_array_equal(frf.frequency, [10.0, 20.0])
    np.testing.assert_array_equal(frf.values, [2 - 3j, 4 + 5j])
    with pytest.raises(MeasurementError, match="the line has 1 column, the header 3"):
        read(tmp_path, "b.txt", text.replace("0.0\t 1\t 0\n", "0.0\t x\t 0\n"), unit="m/s^2/N")
