"""MATLAB workspaces: version 5 as scipy writes it, version 7.3 as h5py can; names, structs, several FRFs, faults."""

from __future__ import annotations

import io
import struct
import zlib
from pathlib import Path

import h5py
import numpy as np
import pytest
from scipy.io import savemat
from scipy.io.matlab import MatlabObject
from scipy.sparse import csc_matrix

from dovetail.measurement import read_frf
from support.matlab_files import matlab_7_3
from support.measured_files import fault_of

FREQUENCY = 10.0 + 2.5 * np.arange(7)
VALUES = np.array([1 + 2j, -3, 4j, 5.5 - 1j, 1e-9j, 7e5, -8 - 8j])


def saved(path: Path, **variables: object) -> Path:
    savemat(path, variables, oned_as="column")
    return path


@pytest.mark.parametrize("compressed", [False, True])
@pytest.mark.parametrize("oned", ["row", "column"])
def test_a_workspace_of_version_5_is_read(tmp_path: Path, compressed: bool, oned: str) -> None:
    coherence = np.linspace(0.5, 1, 7)
    variables = {"f": FREQUENCY, "H": VALUES, "coh": coherence, "unit": "mm/s^2/N", "n_avg": 10.0}
    savemat(tmp_path / "a.mat", variables, do_compression=compressed, oned_as=oned)
    frf = read_frf(tmp_path / "a.mat")
    np.testing.assert_array_equal(frf.frequency, FREQUENCY)
    np.testing.assert_allclose(frf.values, VALUES * 1e-3, rtol=1e-15)
    np.testing.assert_array_equal(frf.coherence, coherence)
    assert (frf.quantity, frf.averages) == ("accelerance", 10)


@pytest.mark.parametrize("unit", ["m/N", "m/(N m)", "rad/N", "rad/(N m)"])
def test_units_of_every_motion_and_excitation_are_read(tmp_path: Path, unit: str) -> None:
    path = saved(tmp_path / "frf.mat", frequency=FREQUENCY, values=VALUES, unit=unit)
    frf = read_frf(path)
    assert frf.unit == unit


@pytest.mark.usefixtures("unguarded")
def test_structs_and_integers_are_read(tmp_path: Path) -> None:
    inner = {"freq": FREQUENCY.astype(np.int16) * 4, "compliance": VALUES, "comment": "hit", "axes": [1, 2]}
    frf = read_frf(saved(tmp_path / "a.mat", test={"frf": inner, "date": "today"}))
    np.testing.assert_array_equal(frf.frequency, FREQUENCY.astype(np.int16) * 4)
    np.testing.assert_array_equal(frf.values, VALUES)
    assert frf.quantity == "receptance"


@pytest.mark.usefixtures("unguarded")
def test_named_arrays_of_amplitude_and_phase_are_read(tmp_path: Path) -> None:
    path = saved(tmp_path / "a.mat", X=FREQUENCY, A=np.abs(VALUES), P=np.angle(VALUES, deg=True), other=np.eye(3))
    names = {"frequency": "X", "amplitude": "A", "phase_deg": "P"}
    frf = read_frf(path, names=names, unit="um/N")
    np.testing.assert_allclose(frf.values, VALUES * 1e-6, rtol=1e-14)
    message = fault_of(path)
    assert message.startswith(
        "a.mat\n  the frequency cannot be found by its name; the file holds:\n    X: (7, 1) float64"
    )
    assert "\n    other: (3, 3) float64\n" in message


@pytest.mark.usefixtures("unguarded")
@pytest.mark.parametrize("axes", [(0, 1, 2), (1, 2, 0), (1, 0, 2)])
def test_one_frf_of_a_matrix_is_chosen(tmp_path: Path, axes: tuple) -> None:
    frfs = np.arange(1, 43).reshape(7, 2, 3) * (1 + 1j)
    path = saved(tmp_path / "a.mat", f=FREQUENCY, H=np.transpose(frfs, axes), quantity="mobility")
    np.testing.assert_array_equal(read_frf(path, response="2", force="3").values, frfs[:, 1, 2])
    assert fault_of(path) == (
        "a.mat\n  'H' holds 2 x 3 FRFs; choose one.\n"
        "  Choose it by response and force, counted from 1.  Accepted: numbers of 1 to 2, 1 to 3"
    )
    for wrong in ({"response": "3", "force": "1"}, {"response": "0", "force": "1"}, {"response": "tip", "force": "1"}):
        assert "holds 2 x 3 FRFs; choose one" in fault_of(path, **wrong)


@pytest.mark.usefixtures("unguarded")
def test_one_of_several_columns_is_chosen(tmp_path: Path) -> None:
    frfs = VALUES[:, np.newaxis] * np.array([1, 10, 100])
    path = saved(tmp_path / "a.mat", f=FREQUENCY, H=frfs, coh=np.full((7, 3), [0.1, 0.2, 0.3]), quantity="mobility")
    for options in ({"index": 2}, {"response": "2"}):
        frf = read_frf(path, **options)
        np.testing.assert_array_equal(frf.values, VALUES * 10)
        np.testing.assert_array_equal(frf.coherence, np.full(7, 0.2))
    one = saved(tmp_path / "b.mat", f=FREQUENCY, H=VALUES, quantity="mobility")
    assert fault_of(one, index=1) == "b.mat\n  `index=1` chooses one of several FRFs, and the file holds one."


def test_a_workspace_of_version_7_3_is_read(tmp_path: Path) -> None:
    frfs = np.arange(1, 43).reshape(7, 2, 3) * (1 - 2j)
    path = matlab_7_3(
        tmp_path / "a.mat", **{"data/f": FREQUENCY[:, np.newaxis], "data/H": frfs, "data/unit": "g/N", "data/navg": 5.0}
    )
    frf = read_frf(path, response="2", force="3")
    np.testing.assert_array_equal(frf.frequency, FREQUENCY)
    np.testing.assert_allclose(frf.values, frfs[:, 1, 2] * 9.80665)
    assert (frf.quantity, frf.averages) == ("accelerance", 5)


@pytest.mark.usefixtures("unguarded")
def test_entries_that_cannot_be_read_are_listed(tmp_path: Path) -> None:
    path = saved(tmp_path / "a.mat", f=FREQUENCY, H=csc_matrix(np.eye(7) * 1j))
    assert fault_of(path) == (
        "a.mat\n  'H' is of a class that is not read (sparse, object, function handle).\n"
        "  Accepted: a full matrix of numbers"
    )


@pytest.mark.usefixtures("unguarded")
def test_entries_that_cannot_be_read_are_skipped(tmp_path: Path) -> None:
    others = {
        "K": csc_matrix((100_000, 100_000)),
        "names": np.array(["a", 1], dtype=object),
        "runs": np.array([(1,), (2,)], dtype=[("q", object)]),
    }
    frf = read_frf(saved(tmp_path / "a.mat", f=FREQUENCY, mobility=VALUES, **others))
    np.testing.assert_array_equal(frf.values, VALUES)
    assert ("\n    K: of a class that is not read (sparse,") in fault_of(saved(tmp_path / "b.mat", **others))


@pytest.mark.usefixtures("unguarded")
@pytest.mark.parametrize(
    ("variables", "message"),
    [
        ({"f": FREQUENCY, "H": VALUES.real}, "a.mat\n  'H' has the shape (7, 1) and the type float64.\n"),
        ({"f": FREQUENCY, "H1": VALUES, "H2": VALUES}, "a.mat\n  'H1', 'H2' may each be the values; the file holds:"),
        ({"f": FREQUENCY, "freq": FREQUENCY, "H": VALUES}, "a.mat\n  'f', 'freq' may each be the frequency;"),
        ({"f": FREQUENCY, "H": VALUES[:5]}, "a.mat\n  'H' has 5 lines, the frequency has 7."),
        ({"f": FREQUENCY, "H": VALUES[:5], "x": np.eye(2)}, "a.mat\n  'H' has 5 lines, the frequency has 7."),
        ({"f": FREQUENCY, "H": np.ones((7, 7)) * 1j}, "a.mat\n  'H' has the shape (7, 7), and 2 axes are as long as"),
        (
            {"f": FREQUENCY, "mag": VALUES.real, "phase": VALUES.real},
            "a.mat\n  'phase' may be in degrees or in radians;",
        ),
        ({"f": FREQUENCY, "H": VALUES}, "a.mat\n  the file does not say which quantity it holds.\n"),
        ({"f": FREQUENCY, "H": VALUES, "unit": "kg"}, "a.mat  unit\n  the unit 'kg' is not understood."),
        (
            {"f": FREQUENCY, "mobility": VALUES, "unit": "m/N"},
            "a.mat\n  the file contradicts itself: receptance by its",
        ),
        (
            {"f": FREQUENCY, "mobility": VALUES, "averages": 2.5},
            "a.mat\n  'averages' has the shape (1, 1) and the type float",
        ),
        (
            {"f": FREQUENCY[::-1], "mobility": VALUES},
            "a.mat  line 2 of the arrays\n  the frequency 22.5 Hz comes after 25",
        ),
        (
            {"f": FREQUENCY * np.nan, "mobility": VALUES},
            "a.mat  line 1 of the arrays\n  the frequency is nan, which is",
        ),
        ({"f": FREQUENCY, "mobility": VALUES + np.inf}, "a.mat  line 1 of the arrays\n  the value is "),
        (
            {"X": np.ones((7, 3))},
            "a.mat\n  the only array, 'X', has the shape (7, 3), and its columns have no names.\n",
        ),
        ({}, "a.mat\n  the frequency cannot be found by its name; the file holds: nothing\n"),
    ],
)
def test_faulty_input_is_refused_with_its_message(tmp_path: Path, variables: dict, message: str) -> None:
    assert fault_of(saved(tmp_path / "a.mat", **variables)).startswith(message)


def test_other_versions_are_refused(tmp_path: Path) -> None:
    savemat(tmp_path / "a.mat", {"f": FREQUENCY}, format="4")
    assert fault_of(tmp_path / "a.mat") == (
        "a.mat\n  this is not a MATLAB workspace of a version that can be read.\n"
        "  Accepted: version 5 (save -v6, save -v7) or 7.3 (save -v7.3)"
    )


@pytest.mark.usefixtures("unguarded")
@pytest.mark.parametrize("compressed", [False, True])
def test_every_truncation_is_refused(tmp_path: Path, compressed: bool) -> None:
    stream = io.BytesIO()
    savemat(stream, {"f": FREQUENCY, "mobility": VALUES}, do_compression=compressed)
    whole = stream.getvalue()
    for length in range(1, len(whole)):
        (tmp_path / "a.mat").write_bytes(whole[:length])
        assert "a.mat" in fault_of(tmp_path / "a.mat")


def test_a_file_that_unpacks_to_a_thousand_times_its_size_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.mat"
    savemat(path, {f"x{number}": np.zeros(2_400_000) for number in range(6)}, do_compression=True)
    assert path.stat().st_size < 200_000
    assert fault_of(path) == "a.mat\n  the workspace unpacks to far more than an FRF needs."
    header = b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM"
    bomb = zlib.compress(struct.pack("<2I", 14, 150_000_000) + bytes(150_000_000))
    path.write_bytes(header + struct.pack("<2I", 15, len(bomb)) + bomb)
    assert fault_of(path).startswith("a.mat\n  the workspace is damaged")


def cell(*values: object) -> np.ndarray:
    array = np.empty((1, len(values)), dtype=object)
    array[0, :] = values
    return array


@pytest.mark.usefixtures("unguarded")
def test_arrays_within_cells_are_read(tmp_path: Path) -> None:
    path = saved(tmp_path / "a.mat", data=cell(FREQUENCY, "text", cell(VALUES, np.eye(2))))
    names = {"frequency": "data{1}", "values": "data{3}{1}"}
    np.testing.assert_array_equal(read_frf(path, names=names, quantity="mobility").values, VALUES)
    assert "\n    data{1}: (7, 1) float64\n    data{2}: text\n    data{3}{1}: (7, 1) complex128\n" in fault_of(path)


FRFS = np.arange(1, 43).reshape(2, 3, 7) * (1 + 2j)
PER_UNIT = {"Hz": 1.0, "kHz": 1e-3, "rad/s": 2 * np.pi, "rad/TimeUnit": 2 * np.pi, "cycles/TimeUnit": 1.0}


@pytest.mark.usefixtures("unguarded")
@pytest.mark.parametrize("unit", PER_UNIT)
@pytest.mark.parametrize("key", ["FrequencyUnit", "Units"])
@pytest.mark.parametrize("old_object", [False, True])
def test_frequency_response_data_are_read_in_every_unit_of_frequency(
    tmp_path: Path, unit: str, key: str, old_object: bool
) -> None:
    fields = {"ResponseData": FRFS, "Frequency": FREQUENCY * PER_UNIT[unit], key: unit, "TimeUnit": "seconds"}
    value: object = fields
    if old_object:
        record = np.zeros((1, 1), dtype=[(name, object) for name in fields])
        for name, field in fields.items():
            record[name][0, 0] = np.atleast_2d(field) if not isinstance(field, str) else field
        value = MatlabObject(record, classname="frd")
    path = saved(tmp_path / "a.mat", sys=value)
    frf = read_frf(path, response="2", force="3", unit="um/N")
    np.testing.assert_allclose(frf.frequency, FREQUENCY, rtol=1e-14)
    np.testing.assert_allclose(frf.values, FRFS[1, 2] * 1e-6, rtol=1e-14)
    assert "Choose it by response and force" in fault_of(path, unit="um/N")


@pytest.mark.usefixtures("unguarded")
def test_frequency_response_data_are_read_with_units_and_asked_for_them(tmp_path: Path) -> None:
    fields = {"ResponseData": FRFS[:1, :1], "Frequency": FREQUENCY, "FrequencyUnit": "Hz"}
    units = {"OutputUnit": cell("g"), "InputUnit": cell("N")}
    frf = read_frf(saved(tmp_path / "a.mat", sys=fields | units))
    np.testing.assert_allclose(frf.values, FRFS[0, 0] * 9.80665)
    assert frf.quantity == "accelerance"
    units["OutputUnit"] = cell("g", "m")
    assert "the unit '(g and m)/(N)' is not understood" in fault_of(saved(tmp_path / "b.mat", sys=fields | units))
    for wrong in (
        {"FrequencyUnit": "rpm"},
        {"FrequencyUnit": ""},
        {"FrequencyUnit": "rad/TimeUnit", "TimeUnit": "minutes"},
    ):
        assert fault_of(saved(tmp_path / "c.mat", sys=fields | wrong)).startswith(
            f"c.mat\n  'sys' is frequency response data, and its frequency is in '{wrong['FrequencyUnit']}'.\n"
            "  Set it in MATLAB, for example FrequencyUnit = 'Hz', and save again."
        )


@pytest.mark.usefixtures("unguarded")
@pytest.mark.parametrize(
    ("response", "force", "dofs"), [("1", "1", ("1+z", "1+z")), ("2", "1", ("2+z", "1+z")), ("2", "2", ("2+z", "5+z"))]
)
def test_names_of_inputs_and_outputs_are_those_of_the_chosen_frf(
    tmp_path: Path, response: str, force: str, dofs: tuple[str, str]
) -> None:
    frequency = np.array([10.0, 20.0, 30.0])
    names = {
        key: np.array(one, dtype=object) for key, one in (("OutputName", ["1+z", "2+z"]), ("InputName", ["1+z", "5+z"]))
    }
    values = np.arange(12.0).reshape(2, 2, 3) + 1j
    sys = {"ResponseData": values, "Frequency": frequency, "FrequencyUnit": "Hz", **names}
    savemat(tmp_path / "a.mat", {"sys": sys})
    frf = read_frf(tmp_path / "a.mat", quantity="accelerance", response=response, force=force)
    assert (frf.response, frf.force, frf.note) == (*dofs, "")
    np.testing.assert_array_equal(frf.values, values[int(response) - 1, int(force) - 1])


def test_cells_and_frequency_response_data_of_version_7_3_are_read(tmp_path: Path) -> None:
    fields = {"sys/ResponseData": FRFS, "sys/Frequency": FREQUENCY * 2 * np.pi, "sys/FrequencyUnit": "rad/TimeUnit"}
    path = matlab_7_3(tmp_path / "a.mat", **fields, **{"sys/TimeUnit": "seconds", "x": FREQUENCY, "y": VALUES})
    frf = read_frf(path, response="2", force="3", quantity="mobility")
    np.testing.assert_allclose(frf.frequency, FREQUENCY, rtol=1e-14)
    np.testing.assert_allclose(frf.values, FRFS[1, 2], rtol=1e-14)
    with h5py.File(path, "r+") as file:
        file["data"] = np.array([[file["x"].ref], [file["y"].ref]], dtype=h5py.ref_dtype)
        file["data"].attrs["MATLAB_class"] = np.bytes_("cell")
    frf = read_frf(path, names={"frequency": "data{1}", "values": "data{2}"}, quantity="mobility")
    np.testing.assert_array_equal(frf.values, VALUES)
    with h5py.File(path, "r+") as file:
        del file["sys"]
        file["sys"] = np.array([[0xDD000000, 2, 1, 1, 1, 1]], dtype=np.uint32)
        file["sys"].attrs["MATLAB_class"], file["sys"].attrs["MATLAB_object_decode"] = np.bytes_("frd"), np.int32(3)
    assert fault_of(path).startswith(
        "a.mat\n  'sys' is an object of the class frd, which only MATLAB opens.\n  Type there: sys = chgFreqUnit"
    )


def opaque(name: bytes, label: bytes) -> bytes:
    """An object of a class defined by `classdef`, as MATLAB writes it: flags, name, system, class, reference."""
    flags = element(6, struct.pack("<2I", 17, 0))
    reference = element(6, struct.pack("<2I", 13, 0)) + element(5, struct.pack("<2i", 6, 1)) + element(1, b"")
    reference += element(6, struct.pack("<6I", 0xDD000000, 2, 1, 1, 1, 1))
    return element(14, flags + element(1, name) + element(1, b"MCOS") + element(1, label) + element(14, reference))


@pytest.mark.usefixtures("unguarded")
@pytest.mark.parametrize("compressed", [False, True])
def test_an_object_that_only_matlab_opens_is_refused_with_what_to_save(tmp_path: Path, compressed: bool) -> None:
    def added(label: bytes, **variables: object) -> str:
        path = saved(tmp_path / "a.mat", **variables)
        content = opaque(b"sys", label)
        packed = zlib.compress(content)
        path.write_bytes(path.read_bytes() + (struct.pack("<2I", 15, len(packed)) + packed if compressed else content))
        return fault_of(path)

    assert added(b"frd") == (
        "a.mat\n  'sys' is an object of the class frd, which only MATLAB opens.\n"
        "  Type there: sys = chgFreqUnit(sys,'Hz'); [H,f] = frdata(sys,'v'); save('frf.mat','H','f')"
        "  Accepted: arrays, or a struct with ResponseData, Frequency and FrequencyUnit"
    )
    assert "\n    sys: an object of the class string, which only MATLAB opens" in added(b"string", x=FREQUENCY)
    with pytest.raises(pytest.fail.Exception, match="DID NOT RAISE"):  # next to an FRF it is passed over
        added(b"datetime", f=FREQUENCY, mobility=VALUES)
    np.testing.assert_array_equal(read_frf(tmp_path / "a.mat").values, VALUES)


def element(code: int, data: bytes) -> bytes:
    return struct.pack("<2I", code, len(data)) + data + bytes(-len(data) % 8)


def test_cells_so_deep_that_the_library_would_crash_are_refused(tmp_path: Path) -> None:
    def matrix(kind: int, name: bytes, data: bytes) -> bytes:
        flags, shape = element(6, struct.pack("<2I", kind, 0)), element(5, struct.pack("<2i", 1, 1))
        return element(14, flags + shape + element(1, name) + data)

    cells = matrix(6, b"", element(9, bytes(8)))
    for depth in reversed(range(5000)):
        cells = matrix(1, b"" if depth else b"c", cells)
    (tmp_path / "a.mat").write_bytes(b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM" + cells)
    assert fault_of(tmp_path / "a.mat") == (
        "a.mat\n  the file is damaged: the library that reads it gave up, or wanted more memory than is allowed."
    )


@pytest.mark.parametrize("kind", [6, 14])
def test_dimensions_larger_than_the_data_are_refused(tmp_path: Path, kind: int) -> None:
    flags, shape = element(6, struct.pack("<2I", kind, 0)), element(5, struct.pack("<2i", 60000, 30000))
    matrix = element(14, flags + shape + element(1, b"f") + element(9, bytes(16)))
    (tmp_path / "a.mat").write_bytes(b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM" + matrix)
    assert fault_of(tmp_path / "a.mat").startswith(
        "a.mat: variable 1\n  the workspace is damaged: 'f' has 1,800,000,000 "
    )


def test_a_negative_length_in_a_damaged_file_is_refused(tmp_path: Path) -> None:
    savemat(tmp_path / "a.mat", {"f": FREQUENCY, "mobility": VALUES})
    shape = struct.pack("<2i", 1, FREQUENCY.size)
    content = (tmp_path / "a.mat").read_bytes()
    (tmp_path / "a.mat").write_bytes(content.replace(shape, struct.pack("<2i", 1, -FREQUENCY.size)))
    assert fault_of(tmp_path / "a.mat").startswith("a.mat: variable 1\n  the workspace is damaged: 'f' has -")
