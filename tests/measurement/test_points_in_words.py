"""Points that files give in words are compared with the points of the model, in every format and spelling.

The model has the parts *upper* and *lower*, which move, and *floor*, which does not. Its response is the drive point at
*upper*, so each file that names another part is refused.
"""

from __future__ import annotations

import json
import warnings
from dataclasses import replace

import h5py
import numpy as np
import pytest
import scipy.io

import dovetail
from dovetail.identification.measured_lines import check_measured
from dovetail.measurement import ModelDof, Role, check_roles
from dovetail.measurement.impact_test.signal_files import read_signals
from dovetail.measurement.named_points import read_dof
from dovetail.measurement.point_statements import points_of_label
from support.measured_files import set_58, write_sets

pytestmark = pytest.mark.usefixtures("unguarded")

FREQUENCY = np.arange(10.0, 40.0)
UPPER = ("upper", 0.0, "x")
KEYS = ["response", "force", "reference", "point", "node", "response_dof", "excitation_point", "measured_at",
        "location", "input", "output_name", "rsp_ent_name", "sensor", "hammer_location", "dof", "position",
        "substructure", "Antwort", "Anregung", "outputname", "channel", "sensor_position", "driving point",
        "test point", "measuring point", "fixed point", "Messstelle"]  # fmt: skip
NAMES = ["lower", "floor", "lower x", "LOWER-X", "lower:7+x", "lower_x", "node 5 of lower", "lower (x)", "at the floor"]
LINES = [
    "# response lower", "# force at floor", "# measured at lower", "# excited at the floor", "# point lower",
    "# hammer on floor", "# accelerometer at lower, hammer at upper", "# response at upper and force at lower",
    "# measurement point lower", "# FRF lower/upper", "# H(lower,upper)", "# FRF between lower and upper",
    "Response,lower", "Response\tlower", "% Reference DOF = lower:1x", "# Response: upper, Force: lower",
    "# response: upper:1, force: upper:2", "# response: node 3, force: node 4",
]  # fmt: skip
HEADERS = [
    "X(lower/floor) real,X(lower/floor) imag", "lower x (Real),lower x (Imag)", "H21 real,H21 imag",
    "FRF(lower:1+x/upper:1+x) Real,FRF(lower:1+x/upper:1+x) Imag", "X_lower/F_lower real,X_lower/F_lower imag",
    "response lower real,response lower imag",
]  # fmt: skip
PROSE = [
    "response measured with a laser", "response: measured with a laser", "force: hammer with a steel tip",
    "reference: ISO 7626", "note: measured by Joe", "sensor: PCB 352C33", "point: 3", "node 7", "response: tool tip",
    "force: impact", "title: bench 4", "response: upper", "force: upper, x", "response: upper and lower",
    "input: Force", "output: displacement", "direction: x", "response at the upper mass", "channel: 2",
    "exported to /data/lower/run.csv", "position: 20 mm", "reference: none", "response: upper 0 mm",
]  # fmt: skip


def description(**response) -> dict:
    spring = {"model": "spring_damper", "direction": "x"}
    return {
        "dovetail": 1,
        "name": "masses",
        "frequency": {"start": 10.0, "stop": 39.0, "step": 1.0},
        "substructures": {
            "upper": {"model": "lumped", "masses": [{"mass": 1.0}]},
            "lower": {"model": "lumped", "masses": [{"mass": 2.0}]},
            "floor": {"model": "ground"},
        },
        "joints": {
            name: {
                **spring,
                "connect": {"a": {"to": a, "at": 0}, "b": {"to": b, "at": 0}},
                "parameters": {"k": {"range": [1e4, 4e5]}, "c": {"value": 20.0}},
            }
            for name, a, b in (("top", "upper", "lower"), ("foot", "lower", "floor"))
        },
        "response": {"at": "upper", "position": 0, "quantity": "receptance", **response},
    }


@pytest.fixture(scope="module")
def model():
    return dovetail.load(description())


@pytest.fixture(scope="module")
def values(model):
    return np.ravel(model.receptance([5e4, 6e4], [UPPER], [UPPER]))


def arrays(values):
    return {"frequency": FREQUENCY, "values": values, "quantity": "receptance"}


def write_csv(path, values, lines=(), header="real,imag"):
    rows = [f"{f},{h.real!r},{h.imag!r}" for f, h in zip(FREQUENCY.tolist(), values.tolist(), strict=True)]
    path.write_text("\n".join(["# quantity: receptance", *lines, f"frequency_Hz,{header}", *rows]) + "\n")
    return path


def write_with(folder, suffix, values, key, text):
    """Write the FRF with a text under a key."""
    path = folder / f"a.{suffix}"
    if suffix == "csv":
        return write_csv(path, values, [f"# {key.replace('_', ' ')}: {text}"])
    if suffix == "npz":
        np.savez(path, **arrays(values), **{key: np.array(text)})
    elif suffix == "mat":
        scipy.io.savemat(path, {**arrays(values), key.replace(" ", "_"): text})
    elif suffix == "uff":
        write_sets(path, set_58(FREQUENCY, values, id1=f"{key.replace('_', ' ')}: {text}", ordinate_spec_data_type=8))
    else:
        with h5py.File(path, "w") as file:
            file["frequency"], file["values"] = FREQUENCY, values
            file.attrs["quantity"] = "receptance"
            (file if suffix == "h5" else file["values"]).attrs[key] = text
    return path


FORMATS = ["csv", "npz", "mat", "h5", "hdf5", "uff"]
CASES = [(key, name) for key in KEYS for name in NAMES]


def compare(model, path, **options):
    check_measured(model.description, dovetail.read_frf(path, **options))


def refused(model, path, *words, **options):
    with pytest.raises(dovetail.MeasurementError) as caught:
        compare(model, path, **options)
    assert all(word in str(caught.value) for word in (*words, "it is used")), caught.value
    compare(model, path, **options, ignore_dofs=True)


@pytest.mark.sweep
@pytest.mark.parametrize("suffix", FORMATS)
@pytest.mark.parametrize(("key", "text"), CASES)
def test_another_part_under_any_key_of_any_format_is_refused(model, values, tmp_path, suffix, key, text):
    if key == "channel" and text == "lower:7+x":
        pytest.skip("the same as dof")
    refused(model, write_with(tmp_path, suffix, values, key, text), text)


@pytest.mark.parametrize("key", KEYS)
def test_another_part_in_a_comment_is_refused(model, values, tmp_path, key):
    refused(model, write_with(tmp_path, "csv", values, key, "floor x"), "on 'floor', and it is used at upper, 0 mm")


@pytest.mark.parametrize("suffix", FORMATS)
def test_another_part_in_an_entry_is_refused(model, values, tmp_path, suffix):
    refused(model, write_with(tmp_path, suffix, values, "response", "floor x"), "its response, floor x, is on 'floor'")


@pytest.mark.parametrize("line", LINES)
def test_another_part_in_a_line_of_text_is_refused(model, values, tmp_path, line):
    refused(model, write_csv(tmp_path / "a.csv", values, [line]))


@pytest.mark.parametrize("header", HEADERS)
def test_another_part_in_the_name_of_a_column_is_refused(model, values, tmp_path, header):
    refused(model, write_csv(tmp_path / "a.csv", values, header=header))


@pytest.mark.parametrize("line", PROSE)
def test_prose_and_names_that_the_model_does_not_have_are_read(model, values, tmp_path, line):
    path = write_csv(tmp_path / "a.csv", values, [f"# {line}"])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        compare(model, path)


@pytest.mark.parametrize(
    "line", ["# response: laser spot near lower", "# measured on the lower mass", "# lower x", "# title: lower"]
)
def test_prose_or_a_title_that_names_only_another_part_gives_a_warning(model, values, tmp_path, line):
    with pytest.warns(UserWarning, match="its (response|point) is '.*lower.*', and it is used at upper, 0 mm"):
        compare(model, write_csv(tmp_path / "a.csv", values, [line]))


TITLES = [
    "H_lower_lower", "FRF_lower_floor", "test of lower", "impact test of the lower mass", "lower mass alone",
    "FRF of the lower", "lower only",
]  # fmt: skip
PLACES = ["# {}", "{}", "# title: {}", "# comment: {}", "# note: {}"]


@pytest.mark.sweep
@pytest.mark.parametrize("place", [*PLACES, "npz title", "npz comment", "mat description", "h5 note", "uff note"])
@pytest.mark.parametrize("text", TITLES)
def test_a_title_of_a_measurement_of_another_part_gives_a_warning(model, values, tmp_path, text, place):
    if "{}" in place:
        path = write_csv(tmp_path / "a.csv", values, [place.format(text)])
    else:
        path = write_with(tmp_path, *place.split()[:1], values, place.split()[1], text)
    with pytest.warns(UserWarning, match=r"its (response|force|point) is '.*(lower|floor).*', and it is used at upper"):
        compare(model, path)


@pytest.mark.parametrize("place", [*PLACES, "npz title", "npz comment", "uff note"])
def test_a_point_over_itself_that_is_another_one_is_refused(model, values, tmp_path, place):
    if "{}" in place:
        path = write_csv(tmp_path / "a.csv", values, [place.format("lower/lower")])
    else:
        path = write_with(tmp_path, *place.split()[:1], values, place.split()[1], "lower/lower")
    refused(model, path, "lower")


QUIET = [
    "H_upper_upper", "test of upper", "upper mass alone", "upper/upper", "test of the bench", "H_1_1", "FRF_left_right",
    "lower limit 10 Hz", "hung from lower by a wire", "test of everything alone", "m/m", "mass alone", "run 3",
    "Bench test, lower and upper", "test of lower on upper", "lower mass of 2 kg",
]  # fmt: skip


@pytest.mark.sweep
@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("text", QUIET)
def test_titles_that_name_the_point_or_no_other_one_give_no_warning(model, values, tmp_path, text, place):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        compare(model, write_csv(tmp_path / "a.csv", values, [place.format(text)]))


def test_another_axis_of_a_planar_model_gives_a_warning(model, values, tmp_path):
    with pytest.warns(UserWarning, match="'upper y', and it is used at upper, 0 mm, in a model in one plane"):
        compare(model, write_csv(tmp_path / "a.csv", values, ["# response: upper y"]))


@pytest.mark.parametrize("text", ["upper rz", "rotation of upper", "upper:1rz"])
def test_a_rotation_in_words_is_not_a_displacement(model, values, tmp_path, text):
    refused(model, write_csv(tmp_path / "a.csv", values, [f"# response: {text}"]), "is a rotation or moment")


def test_another_position_along_the_part_is_refused(model, values, tmp_path):
    refused(model, write_csv(tmp_path / "a.csv", values, ["# response: upper, 20 mm"]), "is not at upper, 0 mm, where")


@pytest.mark.parametrize("suffix", ["csv", "npz", "uff"])
def test_points_in_words_stay_with_the_frf_when_it_is_converted(model, values, tmp_path, suffix):
    frf = dovetail.read_frf(write_csv(tmp_path / "a.csv", values, ["# note: bench", "# Hammer location: floor"]))
    assert frf.note == "bench; Hammer location: floor"
    dovetail.write_frf(frf, tmp_path / f"b.{suffix}")
    refused(model, tmp_path / f"b.{suffix}", "its force, floor, is on 'floor'")


@pytest.mark.parametrize(
    "lists",
    [
        {"outputs": ["upper", "lower"], "inputs": ["upper", "lower"]},
        {"response_node": [1, 2], "force_node": [1, 2]},
        {"names": ["upper", "lower"]},
        {"nodes": [1, 2]},
    ],
    ids=str,
)
def test_lists_of_names_give_the_points_of_the_chosen_column(model, values, tmp_path, lists):
    matrix = np.repeat(np.repeat(values[:, np.newaxis, np.newaxis], 2, 1), 2, 2)
    np.savez(tmp_path / "a.npz", **{**arrays(values), "values": matrix}, **lists)
    compare(model, tmp_path / "a.npz", response="1", force="1")
    for chosen in ("12", "21"):
        refused(model, tmp_path / "a.npz", response=chosen[0], force=chosen[1])


@pytest.mark.parametrize(
    "text", ["FRF [g/N]", "real/imag", "on/off", "m/N", "12/2024", "10 mV/g", "Acceleration/Force"]
)
def test_words_with_a_slash_are_not_always_points(text):
    assert points_of_label(text) == ()


def test_numbers_of_nodes_in_arrays_are_compared(model, values, tmp_path):
    np.savez(tmp_path / "a.npz", **arrays(values), rsp_node=2, ref_node=1)
    refused(model, tmp_path / "a.npz", "response 2, force 1, a transfer FRF")


def test_a_point_of_a_transfer_frf_has_to_be_one_of_its_two(values, tmp_path):
    model = dovetail.load(description(force={"at": "lower", "position": 0}))
    for text in ("lower", "upper"):
        compare(model, write_csv(tmp_path / "a.csv", values, [f"# point: {text}"]))
    refused(model, write_csv(tmp_path / "a.csv", values, ["# point: floor"]), "its point, floor")


@pytest.mark.parametrize("key", ["response", "force", "unit", "quantity", "averages"])
def test_two_comments_with_one_key_are_refused(values, tmp_path, key):
    first, second = {"unit": ("m/N", "um/N"), "quantity": ("receptance", "mobility")}.get(key, ("3", "4"))
    path = write_csv(tmp_path / "a.csv", values, [f"# {key}: {first}", f"# {key}: {second}"])
    with pytest.raises(dovetail.MeasurementError, match="the file contradicts itself"):
        dovetail.read_frf(path)


def test_two_points_for_one_response_are_refused(model, values, tmp_path):
    path = write_csv(tmp_path / "a.csv", values, ["# response: 1+x", "# response dof: 2+x"])
    with pytest.raises(dovetail.MeasurementError, match=r"gives two points for its response: 1\+x and 2\+x"):
        compare(model, path)


FAR, NEAR = (ModelDof(f"plate, {p}", part="plate", label=p, labels=("1", "2"), direction="x") for p in "12")


@pytest.mark.parametrize(
    ("used", "dofs", "right"),
    [
        (("x", "y"), ("1+x", "1+y"), True),
        (("x", "y"), ("4+z", "4-x"), True),
        (("x", "y"), ("1+x", "1+x"), False),
        (("x", "x"), ("1+x", "1+y"), False),
        (("x", "x"), ("1+z", "1+z"), True),
        (("x", "x"), ("plate:1+z", "plate:1+z"), False),
        (("z", "z"), ("plate z", "plate z"), True),
        (("z", "z"), ("plate z", "plate x"), False),
    ],
)
def test_directions_of_a_model_in_space_are_those_of_the_file_one_to_one(values, used, dofs, right):
    frf = dovetail.Frf(FREQUENCY, values, "receptance", label="a", response=dofs[0], force=dofs[1])
    role = Role(frf, *(replace(FAR, direction=each) for each in used))
    if right:
        check_roles([role], substructures=["plate"], passive=False)
    else:
        with pytest.raises(dovetail.MeasurementError):
            check_roles([role], substructures=["plate"], passive=False)


@pytest.mark.parametrize(
    ("text", "part", "node", "axis", "position", "is_certain"),
    [
        ("3+x", "", "3", "x", None, True),
        ("tool_holder:5-y", "tool_holde", "5", "y", None, True),
        ("tool holder, x", "tool_holde", "", "x", None, True),
        ("tool 20 mm", "tool", "", "", 0.02, True),
        ("tool 2,5 cm", "tool", "", "", 0.025, True),
        ("tool 0.5 in", "tool", "", "", 0.0127, True),
        ("node 7 of the tool", "tool", "7", "", None, True),
        ("tool:1:+X", "tool", "1", "x", None, True),
        ("clamp above the tool", "tool", "", "", None, False),
        ("tool and tool_holder", "", "", "", None, False),
        ("laser", None, None, None, None, None),
        ("", None, None, None, None, None),
    ],
)
def test_a_text_names_part_node_axis_and_position(text, part, node, axis, position, is_certain):
    dof = read_dof(text, {"tool": True, "tool_holder": True, "floor": False})
    if part is None:
        assert dof is None
    else:
        assert (dof.part, dof.node, dof.axis, dof.is_certain) == (part, node, axis, is_certain)
        assert dof.position == pytest.approx(position)


def test_files_of_one_assembly_that_name_each_other_s_points_are_refused(values, tmp_path):
    whole = description()
    whole["responses"] = [whole.pop("response"), {"at": "lower", "position": 0, "quantity": "receptance"}]
    (tmp_path / "masses.yaml").write_text(json.dumps(whole))
    files = [write_csv(tmp_path / f"{name}.csv", values, [f"# point: {name}"]) for name in ("lower", "upper")]
    with pytest.raises(dovetail.MeasurementError, match="its point, lower, is on 'lower'"):
        dovetail.identify(dovetail.load(tmp_path / "masses.yaml"), files)


@pytest.mark.parametrize(
    ("response", "force", "is_drive"),
    [("tool x", "holder x", False), ("tip +x", "tip -x", True), ("laser x", "hammer x", True), ("floor x", "", True)],
)
def test_an_accelerometer_is_not_taken_off_a_transfer_frf_between_named_points(values, response, force, is_drive):
    frf = dovetail.Frf(FREQUENCY, values, "receptance", response=response, force=force)
    if is_drive:
        dovetail.remove_accelerometer_mass(frf, 1e-3)
    else:
        with pytest.raises(dovetail.MeasurementError, match="the mass is taken off a drive point"):
            dovetail.remove_accelerometer_mass(frf, 1e-3)


@pytest.mark.parametrize("line", ["# response: lower", "# hammer at floor", "Reference point,lower"])
def test_points_above_a_table_of_signals_are_read(tmp_path, line):
    (tmp_path / "a.csv").write_text(f"{line}\ntime [s],force [N],response [m/s^2]\n0,0,0\n1,1,1\n2,0,1\n")
    (statement,) = read_signals(tmp_path / "a.csv").named_points
    assert statement.end == ("response" if "response" in line else "force")
    assert statement.text in ("lower", "floor")
