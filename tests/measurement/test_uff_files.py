"""Universal files: every form of set 58, several sets, units, the traps of pyuff, and each fault with its message."""

from __future__ import annotations

import re
import struct
import warnings
from pathlib import Path

import numpy as np
import pytest
import pyuff

from dovetail.errors import MeasurementError
from dovetail.frf import Frf
from dovetail.measurement import read_frf, write_frf
from support.measured_files import REMOVE, fault_of, set_58, write_sets

FREQUENCY = 10.0 + 2.5 * np.arange(7)
VALUES = np.array([1 + 2j, -3, 4j, 5.5 - 1j, 1e-9j, 7e5, -8 - 8j])

ROTATIONS = "  Accepted: directions of both, 1 to 3 or 4 to 6; or 'Force' or 'Moment' on the axis of the denominator"
UNITS = (
    "  Correct the file, or export it in SI units.  "
    "Accepted: a motion per force or moment, such as um/N, mm/s/N, m/s^2/N, g/N, in/lbf, rad/(N m)"
)


def file_of(tmp_path: Path, *sets: dict, **options: bool) -> Path:
    return write_sets(tmp_path / "a.uff", *(sets or [set_58(FREQUENCY, VALUES)]), **options)


@pytest.mark.parametrize("spacing", [0, 1], ids=["uneven", "even"])
@pytest.mark.parametrize("binary", [0, 1], ids=["ascii", "binary"])
@pytest.mark.parametrize("is_complex", [True, False], ids=["complex", "real"])
def test_double_precision_is_read_exactly(tmp_path: Path, is_complex: bool, binary: int, spacing: int) -> None:
    values = VALUES if is_complex else np.abs(VALUES)
    frf = read_frf(file_of(tmp_path, set_58(FREQUENCY, values, binary=binary, abscissa_spacing=spacing)))
    np.testing.assert_array_equal(frf.frequency, FREQUENCY)
    np.testing.assert_allclose(frf.values, values, rtol=0 if binary else 1e-11, atol=0)
    assert (frf.quantity, frf.has_phase, frf.label) == ("accelerance", is_complex, "a.uff")


@pytest.mark.parametrize("spacing", [0, 1], ids=["uneven", "even"])
@pytest.mark.parametrize("is_complex", [True, False], ids=["complex", "real"])
def test_single_precision_ascii_is_read(tmp_path: Path, is_complex: bool, spacing: int) -> None:
    values = VALUES if is_complex else np.abs(VALUES)
    one = set_58(FREQUENCY, values, abscissa_spacing=spacing, ord_data_type=5 if is_complex else 2)
    frf = read_frf(file_of(tmp_path, one, force_double=False))
    np.testing.assert_array_equal(frf.frequency, FREQUENCY)
    np.testing.assert_allclose(frf.values, values, rtol=1e-5, atol=0)


@pytest.mark.parametrize("order", ["<", ">"], ids=["little", "big"])
def test_single_precision_binary_as_an_analyser_writes_it_is_read(tmp_path: Path, order: str) -> None:
    path = file_of(tmp_path, set_58(FREQUENCY, VALUES, binary=1, abscissa_spacing=1))
    header = path.read_bytes()[: -(16 * VALUES.size + len("    -1\n"))].replace(b"\n", b"\r\n")
    header = header.replace(b"         6         7", b"         5         7")
    header = header.replace(b"58b     1", b"58b     %d" % "<>".index(order).__add__(1))
    numbers = np.column_stack([VALUES.real, VALUES.imag]).ravel()
    path.write_bytes(header + struct.pack(f"{order}14f", *numbers) + b"\r\n    -1\r\n")
    np.testing.assert_allclose(read_frf(path).values, VALUES, rtol=1e-7)


@pytest.mark.parametrize("binary", [0, 1], ids=["ascii", "binary"])
def test_a_universal_file_may_be_called_txt(tmp_path: Path, binary: int) -> None:
    path = file_of(tmp_path, set_58(FREQUENCY, VALUES, binary=binary)).rename(tmp_path / "a.TXT")
    np.testing.assert_allclose(read_frf(path).values, VALUES, rtol=1e-11)


def test_a_table_that_begins_with_minus_one_is_not_read_as_uff(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    path.write_text("-1\n10 1 2\n12 3 4\n14 5 6\n")
    frf = read_frf(path, columns=["frequency", "real", "imag"], quantity="accelerance")
    np.testing.assert_array_equal(frf.values, [1 + 2j, 3 + 4j, 5 + 6j])


def test_carriage_returns_padding_blank_lines_and_latin_labels_are_read(tmp_path: Path) -> None:
    one = set_58(FREQUENCY, VALUES, abscissa_spacing=1, id1="K~rper_", ordinate_axis_units_lab="m/s~")
    path = file_of(tmp_path, one)
    lines = path.read_bytes().replace(b"K~rper_", b"K\xf6rper\x85").replace(b"m/s~", b"m/s\xb2").split(b"\n")
    lines = [line.ljust(80) for line in lines[:-2]] + [b" " * 80] + lines[-2:]
    path.write_bytes(b"\r\n".join(lines))
    np.testing.assert_allclose(read_frf(path).values, VALUES, rtol=1e-11)


def test_the_line_at_zero_is_left_out(tmp_path: Path) -> None:
    frf = read_frf(file_of(tmp_path, set_58(FREQUENCY - 10, VALUES, abscissa_spacing=1)))
    np.testing.assert_array_equal(frf.frequency, FREQUENCY[1:] - 10)
    np.testing.assert_allclose(frf.values, VALUES[1:], rtol=1e-11)


@pytest.mark.parametrize(("number", "quantity"), [(8, "receptance"), (11, "mobility"), (12, "accelerance")])
def test_the_quantity_is_the_data_type_over_force(tmp_path: Path, number: int, quantity: str) -> None:
    assert read_frf(file_of(tmp_path, set_58(FREQUENCY, VALUES, ordinate_spec_data_type=number))).quantity == quantity


def test_an_unknown_quantity_must_be_given(tmp_path: Path) -> None:
    path = file_of(tmp_path, set_58(FREQUENCY, VALUES, ordinate_spec_data_type=0))
    accepted = "receptance, mobility, accelerance, or data types 8, 11 or 12 over 13 in the set's header"
    assert fault_of(path) == (
        "a.uff: set 1\n  the file does not say which quantity it holds.\n"
        "  Give it: `quantity='accelerance'` or `unit='g/N'`.  "
        f"Accepted: a quantity of {accepted}"
    )
    assert read_frf(path, quantity="mobility").quantity == "mobility"


def test_a_quantity_over_something_unknown_must_be_confirmed(tmp_path: Path) -> None:
    path = file_of(tmp_path, set_58(FREQUENCY, VALUES, orddenom_spec_data_type=0))
    hint = "which quantity it holds (perhaps accelerance: it does not say over what)."
    assert fault_of(path).startswith(f"a.uff: set 1\n  the file does not say {hint}\n")
    assert read_frf(path, quantity="accelerance").quantity == "accelerance"
    assert "the file says that it holds accelerance, the argument says mobility" in fault_of(path, quantity="mobility")


AN_ANALYSER = """\
    -1
    58
hammer
NONE
01-Jan-20 12:00:00
NONE
H1
    4         0    0         0 NONE               0   0 NONE               0   0
         5         3         1 0.00000e+00  2.50000e-01  0.00000e+00
        18    0    0    0 NONE                 Hz
         1    0    0    0 Response per force   (1/N)*(m/s²)
         0    0    0    0 NONE                 NONE
         0    0    0    0 NONE                 NONE
 4.00000e-01  0.00000e+00 -5.00000e-02 -6.00000e-02  2.50000e-02 -2.00000e-04
    -1
"""


@pytest.mark.parametrize("encoding", ["utf-8", "latin-1"])
def test_general_data_with_the_unit_of_an_frf_are_read(tmp_path: Path, encoding: str) -> None:
    """The header of an analyser whose only word on the quantity is its unit."""
    path = tmp_path / "a.uff"
    path.write_bytes(AN_ANALYSER.encode(encoding))
    frf = read_frf(path)
    np.testing.assert_allclose(frf.frequency, [0.25, 0.5])
    np.testing.assert_allclose(frf.values, [-0.05 - 0.06j, 0.025 - 0.0002j])
    assert frf.quantity == "accelerance"


@pytest.mark.parametrize(
    ("labels", "factor"),
    [
        ({}, 1.0),
        ({"ordinate_axis_units_lab": "m/s^2", "orddenom_axis_units_lab": "N"}, 1.0),
        ({"ordinate_axis_units_lab": "(m/s2)/N", "orddenom_axis_units_lab": "NONE"}, 1.0),
        ({"ordinate_axis_units_lab": "m/s**2/N", "orddenom_axis_units_lab": "N"}, 1.0),
        ({"ordinate_axis_units_lab": "mm/s^2", "orddenom_axis_units_lab": "N"}, 1e-3),
        ({"ordinate_axis_units_lab": "g", "orddenom_axis_units_lab": "N"}, 9.80665),
        ({"ordinate_axis_units_lab": "g/N"}, 9.80665),
        ({"ordinate_axis_units_lab": "g", "orddenom_axis_units_lab": "lbf"}, 9.80665 / 4.4482216152605),
        ({"ordinate_axis_units_lab": "um/s^2", "orddenom_axis_units_lab": "kN"}, 1e-9),
    ],
)
def test_values_are_converted_from_the_unit_of_the_label(tmp_path: Path, labels: dict, factor: float) -> None:
    frf = read_frf(file_of(tmp_path, set_58(FREQUENCY, VALUES, **labels)))
    np.testing.assert_allclose(frf.values, factor * VALUES, rtol=1e-11)


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        (
            {"ordinate_axis_units_lab": "mm"},
            "data type 12\n  the file contradicts itself: accelerance ('Acceleration') here, and receptance (the unit "
            "'mm') at a.uff: set 1, unit of the ordinate.\n  Correct the file, or export it again.",
        ),
        (
            {"ordinate_axis_units_lab": "9**9**9**9"},
            "unit of the ordinate\n  the unit '9**9**9**9' is not understood.\n" + UNITS,
        ),
        (
            {"orddenom_axis_units_lab": "V"},
            "unit of the denominator\n  the unit 'V' is not understood.\n"
            "  Correct the file, or export it in SI units.  Accepted: N, lbf, N m",
        ),
        (
            {"ordinate_spec_data_type": 1, "ordinate_axis_units_lab": "V"},
            "unit of the ordinate\n  the unit 'V' is not understood.\n" + UNITS,
        ),
        ({"abscissa_axis_units_lab": "rad/s"}, "the frequencies are in 'rad/s'.\n  Accepted: Hz"),
        (
            {"abscissa_spec_data_type": 17},
            "the abscissa has the data type 17.\n  Accepted: 18 (frequency)",
        ),
        (
            {"ordinate_spec_data_type": 13, "orddenom_spec_data_type": 12},
            "the data are of type 13 over type 12.\n"
            "  Accepted: displacement (8), velocity (11) or acceleration (12) over excitation force (13)",
        ),
        ({"rsp_dir": 4, "ref_dir": 0}, "either the response or the reference is a rotation.\n" + ROTATIONS),
        ({"ref_dir": -5, "rsp_dir": 0}, "either the response or the reference is a rotation.\n" + ROTATIONS),
        (
            {"x": FREQUENCY[::-1]},
            "line 2 of its data\n  the frequency 22.5 Hz comes after 25 Hz.\n"
            "  Accepted: frequencies that increase from line to line",
        ),
        (
            {"x": np.array([1, 2, 3, 3, 5, 6, 7.0])},
            "line 4 of its data\n  the frequency 3 Hz is repeated.\n"
            "  Accepted: frequencies that increase from line to line",
        ),
        (
            {"data": -np.abs(VALUES)},
            "line 1 of its data\n  the amplitude -2.23607 is negative.\n"
            "  Accepted: an amplitude of zero or more, or real and imaginary part",
        ),
    ],
)
def test_a_faulty_set_is_refused(tmp_path: Path, fields: dict, message: str) -> None:
    path = file_of(tmp_path, {**set_58(FREQUENCY, VALUES), **fields})
    separator = ", " if message.startswith(("line", "unit", "data type")) else "\n  "
    assert fault_of(path) == f"a.uff: set 1{separator}{message}"


def test_directions_of_opposite_sense_turn_the_sign(tmp_path: Path) -> None:
    np.testing.assert_allclose(
        read_frf(file_of(tmp_path, set_58(FREQUENCY, VALUES, rsp_dir=-3, ref_dir=3))).values, -VALUES
    )
    both = set_58(FREQUENCY, VALUES, rsp_dir=-3, ref_dir=-3)
    np.testing.assert_allclose(read_frf(file_of(tmp_path, both)).values, VALUES)
    amplitude = set_58(FREQUENCY, np.abs(VALUES), rsp_dir=-3, ref_dir=3)
    np.testing.assert_allclose(read_frf(file_of(tmp_path, amplitude)).values, np.abs(VALUES))


SEVERAL = (
    {"type": 151, "model_name": "bench", "description": "", "db_app": "", "program": "", "model_id": 0},
    set_58(FREQUENCY, VALUES, id1="first"),
    set_58(FREQUENCY, 2 * VALUES, id1="second", rsp_node=2, rsp_dir=-3, binary=1, ordinate_spec_data_type=11),
    set_58(FREQUENCY, np.ones(7), id1="trust", func_type=6, ordinate_spec_data_type=0, orddenom_spec_data_type=0),
)


def test_several_frfs_are_listed_and_chosen_by_number(tmp_path: Path) -> None:
    path = file_of(tmp_path, *SEVERAL)
    table = (
        "\n    set 1: type 151"
        "\n    set 2: FRF, response 1 +x, reference 1 +x, 'first'"
        "\n    set 3: FRF, response 2 -z, reference 1 +x, 'second'"
        "\n    set 4: coherence, response 1 +x, reference 1 +x, 'trust'"
    )
    assert fault_of(path) == (
        f"a.uff\n  the file holds 2 FRFs; choose one:{table}\n"
        "  Choose one by its DOFs (response, force) or its number, for example index=2."
    )
    first, second = read_frf(path, index=2), read_frf(path, index=3)
    np.testing.assert_allclose(first.values, VALUES, rtol=1e-11)
    np.testing.assert_array_equal(first.coherence, np.ones(7))
    np.testing.assert_array_equal(second.values, -2 * VALUES)
    assert (second.quantity, second.coherence) == ("mobility", None)
    assert fault_of(path, index=4) == f"a.uff\n  set 4 is not an FRF; it holds:{table}"
    for absent in (0, -1, 5):
        assert fault_of(path, index=absent) == f"a.uff\n  set {absent} is not in the file; it holds:{table}"


def test_one_frf_among_other_sets_is_taken(tmp_path: Path) -> None:
    frf = read_frf(file_of(tmp_path, SEVERAL[0], SEVERAL[2], SEVERAL[3]))
    np.testing.assert_array_equal(frf.values, -2 * VALUES)
    assert frf.coherence is None


def test_a_coherence_of_the_same_points_that_is_not_used_is_reported(tmp_path: Path) -> None:
    other = {**SEVERAL[3], "x": FREQUENCY + 1}
    with pytest.warns(UserWarning, match="set 2: this coherence is not used: its frequencies are not those of set 1"):
        assert read_frf(file_of(tmp_path, SEVERAL[1], other)).coherence is None
    with pytest.warns(UserWarning, match="this coherence is not used: 2 sets are of the points of set 1"):
        assert read_frf(file_of(tmp_path, SEVERAL[1], SEVERAL[3], SEVERAL[3])).coherence is None
    shorter = {**SEVERAL[3], "x": FREQUENCY[:-1], "data": SEVERAL[3]["data"][:-1]}
    with pytest.warns(UserWarning, match="its frequencies are not those of set 1"):
        assert read_frf(file_of(tmp_path, SEVERAL[1], shorter)).coherence is None


def test_a_coherence_does_not_depend_on_the_senses_of_the_directions(tmp_path: Path) -> None:
    opposite = {**SEVERAL[3], "rsp_dir": -SEVERAL[3]["rsp_dir"]}
    assert read_frf(file_of(tmp_path, SEVERAL[1], opposite)).coherence is not None
    other = {**opposite, "data": 0.5 * SEVERAL[3]["data"]}
    frf = read_frf(file_of(tmp_path, SEVERAL[1], other, SEVERAL[3]))
    np.testing.assert_array_equal(frf.coherence, SEVERAL[3]["data"])


def test_a_long_listing_is_cut(tmp_path: Path) -> None:
    message = fault_of(file_of(tmp_path, *[set_58(FREQUENCY, VALUES)] * 23))
    assert message.startswith("a.uff\n  the file holds 23 FRFs; choose one:\n    set 1: FRF")
    assert "\n    set 20: FRF, response 1 +x, reference 1 +x, 'hammer'\n    and 3 more\n" in message


def test_a_file_without_an_frf_is_refused_with_what_it_holds(tmp_path: Path) -> None:
    assert fault_of(file_of(tmp_path, SEVERAL[0], SEVERAL[3])) == (
        "a.uff\n  the file holds no FRF; it holds:"
        "\n    set 1: type 151\n    set 2: coherence, response 1 +x, reference 1 +x, 'trust'"
    )


def test_values_are_converted_from_the_units_of_set_164(tmp_path: Path) -> None:
    def units(code: int) -> dict:
        return {"type": 164, "units_code": code, "length": 1.0, "force": 1.0, "temp": 1.0, "temp_offset": 0.0}

    one = set_58(FREQUENCY, VALUES)
    np.testing.assert_allclose(read_frf(file_of(tmp_path, units(1), one)).values, VALUES, rtol=1e-11)
    assert fault_of(file_of(tmp_path, units(5), one)) == (
        "a.uff: set 1\n  the file is in the system of units '5'.\n  Export it in SI units.  Accepted: 1 (m, N)"
    )


def test_a_text_of_set_164_that_contradicts_its_code_is_reported(tmp_path: Path) -> None:
    units = b"    -1\n   164\n%10d%-20s%10d\n%25.17e%25.17e%25.17e\n%25.17e\n    -1\n"
    path = file_of(tmp_path, set_58(FREQUENCY, VALUES))
    content = path.read_bytes()
    path.write_bytes(units % (1, b"BG: Inch (pound f)", 2, 1.0, 1.0, 1.0, 0.0) + content)
    with pytest.warns(UserWarning, match=r"set 1: the units code is 1 \(m, N\), and its text is 'BG: Inch"):
        read_frf(path)
    for text in (b"SI: Meter (newton)", b"User unit system"):  # the latter is what pyuff writes with any code
        path.write_bytes(units % (1, text, 2, 1.0, 1.0, 1.0, 0.0) + content)
        with warnings.catch_warnings():
            warnings.simplefilter("error", UserWarning)
            read_frf(path)


def edited(path: Path, pattern: bytes, replacement: bytes) -> Path:
    content, count = re.subn(pattern, replacement, path.read_bytes(), count=1)
    assert count == 1
    path.write_bytes(content)
    return path


def test_damaged_data_are_refused(tmp_path: Path) -> None:
    nan = edited(file_of(tmp_path), rb" 4.00000000000e\+00", b" " * 15 + b"nan")
    assert fault_of(nan) == "a.uff: set 1, line 16 of the file\n  'nan' is not a number."
    letters = edited(file_of(tmp_path), rb"-8.00000000000e\+00", b"-8.0000000000?e+00")
    assert fault_of(letters) == "a.uff: set 1, line 20 of the file\n  '?e+00' is not a number."
    columns = edited(file_of(tmp_path), rb"  4.00000000000e\+00", b"  4.0 00000000e+00")
    assert fault_of(columns) == (
        "a.uff: set 1\n  the data are damaged: they do not stand in the columns of their form."
    )


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_binary_data_that_are_not_finite_are_refused(tmp_path: Path, value: float) -> None:
    path = file_of(tmp_path, set_58(FREQUENCY, VALUES, binary=1, abscissa_spacing=1))
    content = path.read_bytes()
    path.write_bytes(content.replace(struct.pack("<d", 5.5), struct.pack("<d", value)))
    assert fault_of(path).startswith("a.uff: set 1, line 4 of its data\n  the value is ")
    assert fault_of(path).endswith("which is not finite." + REMOVE)


def test_the_announced_number_of_lines_must_be_there(tmp_path: Path) -> None:
    one = rb"( 6 {9})7( {9}\d)"
    again = "The file is truncated or damaged: export it again."
    more = edited(file_of(tmp_path), one, rb"\g<1>8\2")
    assert fault_of(more) == f"a.uff: set 1\n  the header announces 8 lines, and there are 7.\n  {again}"
    less = edited(file_of(tmp_path), one, rb"\g<1>6\2")
    assert fault_of(less) == f"a.uff: set 1\n  the header announces 6 lines, and there are 7.\n  {again}"
    far_less = edited(file_of(tmp_path), one, rb"\g<1>1\2")
    assert fault_of(far_less) == "a.uff: set 1\n  there are more data than the 1 lines that the header announces."
    none = edited(file_of(tmp_path), one, rb"\g<1>0\2")
    assert fault_of(none) == "a.uff: set 1\n  the header announces 0 lines.\n  Accepted: 1 to 1,000,000 lines"
    binary = edited(file_of(tmp_path, set_58(FREQUENCY, VALUES, binary=1)), one, rb"\g<1>8\2")
    assert fault_of(binary) == (
        f"a.uff: set 1\n  the header announces 8 lines, which take 192 bytes, and there are 168.\n  {again}"
    )


def test_one_endless_line_of_data_is_refused(tmp_path: Path) -> None:
    path = edited(file_of(tmp_path), rb"( 6 {9})7( {9}\d)", rb"\g<1>1\2")
    lines = path.read_bytes().split(b"\n")
    path.write_bytes(b"\n".join([*lines[:13], b"".join(lines[13:-2]), *lines[-2:]]))
    assert fault_of(path) == "a.uff: set 1\n  there are more data than the 1 lines that the header announces."


def test_other_forms_of_data_are_refused(tmp_path: Path) -> None:
    form = edited(file_of(tmp_path), rb" 6( {9}7)", rb" 3\1")
    assert fault_of(form) == (
        "a.uff: set 1\n  the data form 3 with spacing 0 is not known.\n  Accepted: forms 2, 4, 5, 6 with spacing 0 or 1"
    )
    vax = edited(file_of(tmp_path, set_58(FREQUENCY, VALUES, binary=1)), rb"(58b {5}1 {5})2", rb"\g<1>1")
    assert fault_of(vax) == "a.uff: set 1\n  the floating-point format 1 is not read.\n  Accepted: 2 (IEEE 754)"


def test_every_truncation_is_refused(tmp_path: Path) -> None:
    for binary in (0, 1):
        whole = file_of(tmp_path, set_58(FREQUENCY, VALUES, binary=binary)).read_bytes()
        for length in (*range(1, len(whole) - 1, 23), len(whole) - 2):
            (tmp_path / "a.uff").write_bytes(whole[:length])
            with pytest.raises(MeasurementError, match=r"universal file|truncated"):
                read_frf(tmp_path / "a.uff")


def test_a_truncated_last_set_is_reported(tmp_path: Path) -> None:
    path = file_of(tmp_path, SEVERAL[0], SEVERAL[1])
    path.write_bytes(path.read_bytes()[:-200])
    assert fault_of(path) == "a.uff: set 2\n  the set has no end line '    -1': the file is truncated."


def test_a_damaged_header_is_listed(tmp_path: Path) -> None:
    path = edited(file_of(tmp_path), rb" {4}4 {9}0", b"    x         0")
    assert fault_of(path) == "a.uff\n  the file holds no FRF; it holds:\n    set 1: type 58 with a damaged header"


def test_pyuff_empties_a_binary_file_that_it_overwrites_and_dovetail_does_not(tmp_path: Path) -> None:
    path = tmp_path / "a.uff"
    pyuff.UFF(str(path)).write_sets(set_58(FREQUENCY, VALUES, binary=1), mode="overwrite")
    assert path.read_bytes() == b"    -1\n"
    assert fault_of(path) == "a.uff: set 1\n  the set has no end line '    -1': the file is truncated."
    frf = Frf(FREQUENCY, VALUES, "accelerance")
    for _ in range(2):
        write_frf(frf, path, binary=True, overwrite=True)
        np.testing.assert_array_equal(read_frf(path).values, VALUES)


def test_pyuff_reads_what_dovetail_writes(tmp_path: Path, measured: Frf) -> None:
    for binary in (False, True):
        write_frf(measured, tmp_path / "a.uff", binary=binary, overwrite=True)
        response, coherence = pyuff.UFF(str(tmp_path / "a.uff")).read_sets()
        np.testing.assert_allclose(response["x"], measured.frequency, rtol=1e-12)
        np.testing.assert_allclose(response["data"], measured.values, rtol=1e-11)
        np.testing.assert_allclose(coherence["data"], measured.coherence, rtol=1e-11)
        assert (response["func_type"], coherence["func_type"]) == (4, 6)
        assert (response["ordinate_spec_data_type"], response["orddenom_spec_data_type"]) == (12, 13)
        assert (response["ordinate_axis_units_lab"], response["orddenom_axis_units_lab"]) == ("m/s^2", "N")
        assert (response["id1"], response["rsp_node"], response["ref_dir"]) == ("bench", 0, 0)
        if binary:
            counted = [response["n_bytes"], coherence["n_bytes"]]
            assert counted == [16 * measured.frequency.size, 8 * measured.frequency.size]


def test_labels_that_a_universal_file_cannot_hold(tmp_path: Path) -> None:
    for number, label in enumerate(["", "Körper\n    -1\n" * 20]):
        path = tmp_path / f"{number}.uff"
        write_frf(Frf(FREQUENCY, VALUES, "mobility", label=label), path)
        np.testing.assert_allclose(read_frf(path).values, VALUES, rtol=1e-11)
