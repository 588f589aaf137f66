"""Every command that reads measured files refuses FRFs whose DOFs, as given in the files, contradict their use.

The model is two masses on springs. In the files node 1 is the upper mass and node 2 the lower one, unless a test says
otherwise, and the values are always those of the use: only the DOFs are wrong.
"""

from __future__ import annotations

import json
from dataclasses import replace
from itertools import permutations, product

import numpy as np
import pytest

import dovetail
import dovetail_machining
from dovetail.report.explorer import Explorer

FREQUENCY = np.arange(10.0, 200.0, 1.0)
UPPER, LOWER = ("upper", 0.0, "x"), ("lower", 0.0, "x")
PLACES = {"drive": (UPPER, UPPER), "transfer": (LOWER, UPPER), "second": (LOWER, LOWER)}
RIGHT = {"drive": ("1+x", "1+x"), "transfer": ("2+x", "1+x"), "second": ("2+x", "2+x")}
SECTIONS = {
    "drive": {"at": "upper", "position": 0, "quantity": "receptance"},
    "transfer": {"at": "lower", "position": 0, "quantity": "receptance", "force": {"at": "upper", "position": 0}},
    "second": {"at": "lower", "position": 0, "quantity": "receptance"},
}
WRONG = {
    "drive": [
        ("2+x", "1+x"), ("1+x", "2+x"), ("2", "1"), ("1+y", "1+x"), ("1+x", "1+rz"), ("1+rz", "1+rz"), ("1rx", "1x"),
        ("lower:1+x", "lower:1+x"), ("upper:1+x", "lower:1+x"), ("", "lower:7"), ("block:3-z", "block:4-z"),
        ("", "1rz"), ("2 +x ", "1 +x"), ("lower x", ""), ("", "base"), ("node 2", "node 1"), ("upper, 20 mm", ""),
    ],
    "transfer": [
        ("1+x", "1+x"), ("1", "1"), ("7-z", "7+z"), ("2+y", "1+x"), ("2+x", "1+rz"), ("2+rz", "1+x"),
        ("upper:1+x", "lower:2+x"), ("lower:5", "lower:6"), ("upper:1", ""), ("block:3+x", "block:3+x"),
        ("upper", "lower"), ("", "base x"),
    ],
}  # fmt: skip
ALLOWED = {
    "drive": [
        ("1+x", "1+x"), ("11", "11"), ("1-x", "1-x"), ("1-x", "1+x"), ("5+z", "5"), ("upper:7+y", "upper:7+y"),
        ("block:3+z", "3+z"), ("", ""), ("2+x", ""), ("", "5-y"), ("tool tip", "nut"), ("2+x", "nut"),
        ("upper", "upper, x"), ("measured with a laser", "hammer with a steel tip"),
    ],
    "transfer": [
        ("2+x", "1+x"), ("1+x", "2+x"), ("4", "9"), ("3-z", "1+z"), ("lower:1", "upper:1"), ("2", ""), ("", ""),
        ("tip", "tip"), ("lower:3+y", "9+y"), ("base:5+x", "base:6+x"),
    ],
}  # fmt: skip
NO_CAUSES = ("--cause-seconds", "0")
FORMATS = ("csv", "npz", "uff")
SINGLE = [(use, given) for use, wrong in WRONG.items() for given in wrong]
IDS = [f"{use} {'|'.join(given)}" for use, given in SINGLE]
ASSIGNED = [chosen for chosen in product(PLACES, repeat=3) if chosen != tuple(PLACES)]
"""Which FRFs are given for the three uses: in another order, or some twice."""


def description(*uses: str) -> dict:
    spring = {"model": "spring_damper", "direction": "x"}
    joints = {
        "top": {
            **spring,
            "connect": {"a": {"to": "upper", "at": 0}, "b": {"to": "lower", "at": 0}},
            "parameters": {"k": {"range": [1e5, 4e5]}, "c": {"value": 20.0}},
        },
        "foot": {
            **spring,
            "connect": {"a": {"to": "lower", "at": 0}, "b": {"to": "base", "at": 0}},
            "parameters": {"k": {"value": 3e5}, "c": {"value": 30.0}},
        },
    }
    responses = [SECTIONS[use] for use in uses]
    return {
        "dovetail": 1,
        "name": "masses",
        "frequency": {"start": 10.0, "stop": 199.0, "step": 1.0},
        "substructures": {
            "upper": {"model": "lumped", "masses": [{"mass": 1.0}]},
            "lower": {"model": "lumped", "masses": [{"mass": 2.0}]},
            "base": {"model": "ground"},
        },
        "joints": joints,
        **({"response": responses[0]} if len(uses) == 1 else {"responses": responses}),
    }


@pytest.fixture(scope="module")
def frfs():
    """The FRF of each use without DOFs."""
    assembly = dovetail.load(description("drive"))
    values = assembly.receptance([2e5], [UPPER, LOWER], [UPPER, LOWER])
    index = {UPPER: 0, LOWER: 1}
    rng = np.random.default_rng(0)
    return {
        use: dovetail.Frf(
            FREQUENCY,
            values[:, index[out], index[into]] * (1.0 + 1e-3 * rng.standard_normal(FREQUENCY.size)),
            "receptance",
            label=use,
        )
        for use, (out, into) in PLACES.items()
    }


@pytest.fixture
def written(frfs, tmp_path):
    """Write the FRF of a use with DOFs to a file."""

    def write(use, given, suffix="csv", name=None):
        response, force = given
        path = tmp_path / f"{name or use}.{suffix}"
        dovetail.write_frf(replace(frfs[use], response=response, force=force), path, overwrite=True)
        return path

    return write


@pytest.fixture
def described(tmp_path):
    def write(*uses):
        path = tmp_path / "masses.yaml"
        path.write_text(json.dumps(description(*uses)))
        return path

    return write


def cases_file(folder, **measured):
    """Write a file of cases, one for each measurement, that identify their joint from the same."""
    cases = {
        name: {
            "assembly": "masses.yaml",
            "measured": {"file": file.name},
            "joint": {"assembly": "masses.yaml", "measured": {"file": file.name}},
        }
        for name, file in measured.items()
    }
    path = folder / "cases.yaml"
    path.write_text(json.dumps({"dovetail_series": 1, "tests": cases}))
    return path


def refused(result, *found):
    text = " ".join(result.stderr.split())
    assert "Traceback" not in text
    for words in (*found, "--ignore-dofs"):
        assert words in text, text


# -- one FRF ---------------------------------------------------------------------------------------------------------


@pytest.mark.sweep
@pytest.mark.parametrize(("use", "given"), SINGLE, ids=IDS)
@pytest.mark.parametrize("command", ["identify", "explore", "compare", "validate"])
def test_an_frf_whose_dofs_contradict_its_use_is_refused(run, described, written, tmp_path, command, use, given):
    assembly, file = described(use), written(use, given)
    if command in ("compare", "validate"):
        arguments = [command, cases_file(tmp_path, one=file)]
    else:
        arguments = [command, assembly, file, *(["--no-browser"] if command == "explore" else [])]
    done = run(*arguments, code=1)
    refused(done, file.name, ", 0 mm")
    assert any(end in done.stderr for end in given if end)


@pytest.mark.sweep
@pytest.mark.parametrize(("use", "given"), SINGLE, ids=IDS)
@pytest.mark.parametrize("suffix", FORMATS)
def test_it_is_refused_from_every_format_and_in_python(described, written, use, given, suffix):
    if suffix == "uff" and any("r" in end.rpartition(":")[2] for end in given):
        pytest.skip("universal files state a rotation by the unit too, which is refused before")
    assembly, file = dovetail.load(described(use)), written(use, given, suffix)
    for work in (dovetail.identify, lambda *arguments: Explorer(arguments[0], [dovetail.read_frf(arguments[1])])):
        with pytest.raises(dovetail.MeasurementError, match="`ignore_dofs=True`"):
            work(assembly, file)
    (failure,) = dovetail.identify_many(assembly, [file], "refined", processes=1).failures.values()
    assert "`ignore_dofs=True`" in failure


@pytest.mark.parametrize(("use", "given"), [(use, given) for use, allowed in ALLOWED.items() for given in allowed])
def test_dofs_that_do_not_contradict_the_use_are_accepted(described, written, use, given):
    assembly, file = dovetail.load(described(use)), written(use, given)
    Explorer(assembly, [dovetail.read_frf(file)])
    read = dovetail.read_frf(file, ignore_dofs=True)
    assert (read.response, read.force) == ("", "")


def test_wrong_dofs_can_be_ignored_in_every_command(run, described, written, tmp_path):
    assembly, file = described("drive"), written("drive", ("2+x", "1+x"), "uff")
    run("identify", assembly, file, "--method", "refined", "--ignore-dofs")
    cases = cases_file(tmp_path, one=file)
    run("validate", cases, "--ignore-dofs")
    run("compare", cases, "--methods", "refined", "--ignore-dofs")
    options = ["--accelerometer-mass", "1 g", "--quantity", "receptance"]
    run("convert", file, tmp_path / "new.csv", *options[:2], "--ignore-dofs", "--dofs", "4+x,4+x")
    assert dovetail.read_frf(tmp_path / "new.csv").response == "4+x"
    given = json.loads(cases.read_text())
    for measured in (given["tests"]["one"]["measured"], given["tests"]["one"]["joint"]["measured"]):
        measured["ignore_dofs"] = True
    cases.write_text(json.dumps(given))
    run("validate", cases)


@pytest.mark.parametrize(
    ("response", "force", "sign"), [("1-x", "1+x", -1.0), ("1-x", "1-x", 1.0), ("1+x", "1+x", 1.0)]
)
def test_ignored_dofs_do_not_turn_the_sign(frfs, tmp_path, response, force, sign):
    """A universal file holds values along its directions."""
    dovetail.write_frf(replace(frfs["drive"], response=response, force=force), tmp_path / "a.uff")
    read = dovetail.read_frf(tmp_path / "a.uff", ignore_dofs=True)
    np.testing.assert_allclose(read.values, sign * frfs["drive"].values, rtol=1e-10)


# -- several FRFs of one assembly ------------------------------------------------------------------------------------


@pytest.mark.sweep
@pytest.mark.parametrize("chosen", ASSIGNED, ids="-".join)
@pytest.mark.parametrize("command", ["identify", "explore"])
def test_exchanged_or_repeated_files_are_refused(run, described, written, command, chosen):
    assembly = described(*PLACES)
    files = {use: written(use, RIGHT[use]) for use in PLACES}
    arguments = [command, assembly, *(files[use] for use in chosen)]
    refused(run(*arguments, *(["--no-browser"] if command == "explore" else []), code=1), "its file says response")


@pytest.mark.parametrize("chosen", ASSIGNED, ids="-".join)
def test_exchanged_or_repeated_files_are_refused_in_python(described, written, chosen):
    assembly = dovetail.load(described(*PLACES))
    files = {use: written(use, RIGHT[use], "uff") for use in PLACES}
    given = [files[use] for use in chosen]
    with pytest.raises(dovetail.MeasurementError, match="its file says response"):
        dovetail.identify(assembly, given)
    (failure,) = dovetail.identify_many(assembly, [given], "refined", processes=1).failures.values()
    assert "its file says response" in failure


@pytest.mark.parametrize("chosen", [each for each in ASSIGNED if len(set(each)) < 3], ids="-".join)
def test_a_file_without_dofs_cannot_be_used_twice(run, described, written, chosen):
    assembly = described(*PLACES)
    files = {use: written(use, ("", "")) for use in PLACES}
    printed = run("identify", assembly, *(files[use] for use in chosen), code=1).stderr
    assert "it holds the same values as" in " ".join(printed.split())


@pytest.mark.sweep(keep=4)
@pytest.mark.parametrize(
    "given",
    [
        {"drive": ("3+x", "3+x")},
        {"transfer": ("2+x", "3+x")},
        {"transfer": ("1+x", "2+x")},
        {"second": ("1+x", "1+x")},
        {"second": ("2+z", "2+z")},
        {"transfer": ("2+y", "1+y")},
        {"second": ("4", "4")},
    ],
    ids=str,
)
def test_files_that_contradict_each_other_are_refused(run, described, written, given):
    assembly = described(*PLACES)
    files = [written(use, {**RIGHT, **given}[use]) for use in PLACES]
    refused(run("identify", assembly, *files, code=1), "its file says response")
    run("identify", assembly, *files, "--method", "refined", "--ignore-dofs", *NO_CAUSES)


@pytest.mark.parametrize(
    "nodes", [("1+x", "2+x"), ("7-z", "3-z"), ("4", "9"), ("upper:1+y", "lower:1+y"), ("", "2+x"), ("", "")], ids=str
)
def test_consistent_files_in_the_laboratory_s_numbering_are_accepted(described, written, nodes):
    first, second = nodes
    given = {"drive": (first, first), "transfer": (second, first), "second": (second, second)}
    files = [written(use, given[use], "npz") for use in PLACES]
    Explorer(dovetail.load(described(*PLACES)), [dovetail.read_frf(file) for file in files])


# -- batches and cases -----------------------------------------------------------------------------------------------

OTHERS = [("2+x", "2+x"), ("1+z", "1+z"), ("2+x", "1+x"), ("lower:1", "lower:1")]


@pytest.mark.sweep(keep=1)
@pytest.mark.parametrize("given", OTHERS, ids=str)
def test_the_file_of_another_point_fails_in_a_batch(run, described, written, given):
    files = [written("drive", ("1+x", "1+x"), name=f"file{number}") for number in range(3)]
    files[1] = written("drive", given, name="file1")
    done = run("identify", described("drive"), *files, "--method", "refined", "--json", *NO_CAUSES, code=1)
    printed = json.loads(done.stdout)
    assert list(printed["failures"]) == ["file1.csv"]
    assert [row["measurement"] for row in printed["results"]] == ["file0.csv", "file2.csv"]
    many = dovetail.identify_many(described("drive"), files, "refined", processes=1, cause_seconds=0.0)
    assert list(many.failures) == ["file1.csv"]


@pytest.mark.parametrize("command", ["compare", "validate"])
@pytest.mark.parametrize("given", OTHERS[:2], ids=str)
def test_cases_of_other_points_are_refused(run, described, written, tmp_path, command, given):
    described("drive")
    files = [written("drive", ("1+x", "1+x"), name="one"), written("drive", given, name="two")]
    refused(run(command, cases_file(tmp_path, one=files[0], two=files[1]), code=1), "two.csv")


# -- the accelerometer's mass ----------------------------------------------------------------------------------------

NODES = {"frf": ("1+x", "2+x"), "drive": ("3+x", "3+x"), "to_response": ("1+x", "3+x"), "from_force": ("3+x", "2+x")}


def is_right(frf, drive, to_response, from_force):
    (i, j), k = frf, drive[0]
    return drive == (k, k) and to_response == (i, k) and from_force == (k, j)


def test_frfs_at_an_accelerometer_elsewhere_are_refused_in_every_wrong_order(frfs):
    accepted = 0
    for chosen in product(NODES.values(), repeat=4):
        given = [replace(frfs["drive"], response=response, force=force) for response, force in chosen]
        others = dict(zip(("drive", "to_response", "from_force"), given[1:], strict=True))
        if is_right(*chosen):
            dovetail.remove_accelerometer_mass(given[0], 1e-3, **others)
            accepted += 1
            continue
        for work in (dovetail.remove_accelerometer_mass, dovetail.add_accelerometer_mass):
            with pytest.raises(dovetail.MeasurementError, match="`ignore_dofs=True`"):
                work(given[0], 1e-3, **others)
    assert accepted > 1  # the accelerometer may be at the response or at the force as well


@pytest.mark.parametrize(
    ("source", "drive", "works"),
    [
        (("2+x", "1+x"), ("2+x", "2+x"), True),
        (("2+x", "1+x"), ("1+x", "1+x"), True),
        (("2+x", "1+x"), ("3+x", "3+x"), False),
        (("2+x", "1+x"), ("2+x", "1+x"), False),
        (("2+x", "2+x"), ("2+x", "1+x"), False),
        (("2+x", "1+x"), ("2+y", "2+y"), False),
        (("", ""), ("2+x", "2+x"), True),
        (("2+x", "1+x"), None, False),
        (("2+x", "2+x"), None, True),
        (("2+rz", "2+rz"), None, False),
    ],
    ids=str,
)
def test_convert_compares_source_and_drive_point(run, written, tmp_path, source, drive, works):
    options = ["--accelerometer-mass", "1 g"]
    if drive is not None:
        options += ["--drive-point", written("second", drive)]
    arguments = ["convert", written("transfer" if drive else "drive", source), tmp_path / "new.csv", *options]
    done = run(*arguments, code=0 if works else 1)
    if not works:
        refused(done)
        assert not (tmp_path / "new.csv").exists()


def test_a_drive_point_with_a_reversed_sign_is_refused(run, frfs, tmp_path):
    dovetail.write_frf(replace(frfs["drive"], values=-frfs["drive"].values), tmp_path / "a.csv")
    done = run("convert", tmp_path / "a.csv", tmp_path / "b.csv", "--accelerometer-mass", "1 g", code=1)
    assert "it delivers 100 % of the power" in " ".join(done.stderr.split())


def test_a_drive_point_with_half_a_wrong_phase_is_reported(run, frfs, written, tmp_path):
    values = np.where(FREQUENCY < 60.0, 1.0, -1.0) * frfs["second"].values
    for name, others in (("alone", []), ("with its drive point", ["--drive-point", tmp_path / "a.csv"])):
        dovetail.write_frf(replace(frfs["second"], values=values), tmp_path / "a.csv", overwrite=True)
        source = written("transfer", ("", "")) if others else tmp_path / "a.csv"
        arguments = ["convert", source, tmp_path / f"{name}.csv", "--accelerometer-mass", "1 g", *others]
        printed = " ".join(run(*arguments).stderr.split())
        assert "Note: a.csv: as the drive point at the accelerometer, it delivers" in printed
        assert "UserWarning" not in printed


# -- the spindle's flange --------------------------------------------------------------------------------------------

HOLDER = ("aa", "ab", "bb")


@pytest.fixture(scope="module")
def spindle_tests(assemblies):
    folder = assemblies / "campaign"
    tests = [dovetail.read_frf(folder / "measurements" / f"sf_h1_{name}.uff") for name in HOLDER]
    holder = dovetail.load(folder / "h1.yaml")
    return holder, [dovetail.measurement.on_grid(frf, holder.frequency) for frf in tests]


@pytest.mark.parametrize("chosen", [c for c in product(range(3), repeat=3) if c != (0, 1, 2)], ids=str)
def test_tests_of_a_spindle_in_another_order_are_refused(spindle_tests, chosen):
    holder, tests = spindle_tests
    with pytest.raises(dovetail.MeasurementError, match="its file says response"):
        dovetail_machining.spindle_flange(holder, tuple(tests[index] for index in chosen), (0.0, 0.02), 0.072)
    unknown = [replace(frf, response="", force="") for frf in tests]
    if len(set(chosen)) < 3:
        with pytest.raises(dovetail.MeasurementError, match="it holds the same values as"):
            dovetail_machining.spindle_flange(holder, tuple(unknown[index] for index in chosen), (0.0, 0.02), 0.072)


@pytest.mark.parametrize(
    "given",
    [
        {0: ("1+x", "21+x")},
        {1: ("21+x", "1+x")},
        {1: ("1+x", "22+x")},
        {2: ("21+y", "21+y")},
        {2: ("21+rz", "21+rz")},
        {0: ("holder:1+x", "holder:21+x")},
    ],
    ids=str,
)
def test_tests_of_a_spindle_at_other_dofs_are_refused(spindle_tests, given):
    holder, tests = spindle_tests
    changed = [
        replace(frf, response=given[index][0], force=given[index][1]) if index in given else frf
        for index, frf in enumerate(tests)
    ]
    with pytest.raises(dovetail.MeasurementError, match="`ignore_dofs=True`"):
        dovetail_machining.spindle_flange(holder, tuple(changed), (0.0, 0.02), 0.072)


def test_a_test_of_a_spindle_with_a_reversed_sign_is_refused(spindle_tests):
    holder, (aa, ab, bb) = spindle_tests
    for changed in ((replace(aa, values=-aa.values), ab, bb), (aa, ab, replace(bb, values=-bb.values))):
        with pytest.raises(dovetail.MeasurementError, match="it delivers 100 % of the power"):
            dovetail_machining.spindle_flange(holder, changed, (0.0, 0.02), 0.072)


def test_the_command_refuses_exchanged_and_repeated_tests(run, assemblies, tmp_path):
    folder = assemblies / "campaign"
    files = [folder / "measurements" / f"sf_h1_{name}.uff" for name in HOLDER]
    output = tmp_path / "flange.npz"
    for chosen in ((2, 1, 0), (0, 2, 1), (0, 0, 2), (1, 1, 2)):
        arguments = ["spindle", folder / "h1.yaml", *(files[index] for index in chosen), "--at", "20 mm"]
        refused(run(*arguments, "--flange", "72 mm", "-o", output, code=1), "sf_h1_")
        assert not output.exists()
    run(*arguments, "--flange", "72 mm", "-o", output, "--ignore-dofs", code=1)  # twice the same values


# -- measured parts --------------------------------------------------------------------------------------------------


def measured_part(folder, frfs, chosen, labels=("left", "right"), **options):
    """Describe a part by three sets of a universal file, used in another order, with a mass on its right node."""
    file = folder / "sets.uff"
    file.unlink(missing_ok=True)
    content = b""
    for use in PLACES:
        dovetail.write_frf(
            replace(frfs[use], response=RIGHT[use][0], force=RIGHT[use][1]), folder / "one.uff", overwrite=True
        )
        content += (folder / "one.uff").read_bytes()
    file.write_bytes(content)
    left, right = labels
    ends = ((left, left), (right, left), (right, right))
    numbers = {use: number for number, use in enumerate(PLACES, start=1)}
    sets = [
        {"set": numbers[use], "response": response, "force": force}
        for use, (response, force) in zip(chosen, ends, strict=True)
    ]
    part = {"model": "measured", "file": str(file), "nodes": {left: 0.0, right: 0.4}, "frfs": sets, **options}
    whole = {
        "dovetail": 1,
        "name": "measured-part",
        "frequency": {"start": 10.0, "stop": 199.0, "step": 1.0},
        "substructures": {"frame": part, "tip": {"model": "lumped", "masses": [{"mass": 0.3}]}},
        "joints": {
            "j": {
                "model": "spring_damper",
                "direction": "x",
                "connect": {"a": {"to": "tip", "at": 0}, "b": {"to": "frame", "at": f"node {right}"}},
                "parameters": {"k": {"range": [1e4, 1e7], "scale": "log"}, "c": {"value": 10.0}},
            }
        },
        "response": {"at": "frame", "position": f"node {left}", "quantity": "receptance"},
    }
    path = folder / "part.yaml"
    path.write_text(json.dumps(whole))
    return path


@pytest.mark.parametrize("chosen", ASSIGNED, ids="-".join)
def test_sets_of_a_measured_part_in_another_order_are_refused(frfs, tmp_path, chosen):
    with pytest.raises(dovetail.DescriptionError, match=r"(?s)its file says response .* add 'ignore_dofs: true'"):
        dovetail.load(measured_part(tmp_path, frfs, chosen))


def test_sets_in_order_are_accepted_and_wrong_dofs_can_be_ignored(frfs, tmp_path):
    right = dovetail.load(measured_part(tmp_path, frfs, tuple(PLACES)))
    exchanged = tuple(PLACES)[::-1]
    ignored = dovetail.load(measured_part(tmp_path, frfs, exchanged, ignore_dofs=True))
    assert np.abs(ignored.frf([1e5]) / right.frf([1e5]) - 1.0).max() > 0.1
    dovetail.load(measured_part(tmp_path, frfs, tuple(PLACES), labels=("1", "2")))
    with pytest.raises(dovetail.DescriptionError, match="its response is at node 1, and it is used at node 2"):
        dovetail.load(measured_part(tmp_path, frfs, tuple(PLACES), labels=("2", "1")))


COMMANDS = [
    "check",
    "simulate",
    "generate",
    "train",
    "plan",
    "identify",
    "explore",
    "predict",
    "calibrate",
    "robustness",
]


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_refuses_a_measured_part_with_exchanged_sets(run, frfs, written, tmp_path, command):
    assembly = measured_part(tmp_path, frfs, tuple(PLACES)[::-1])
    more = {
        "generate": ["-o", tmp_path / "data.zarr"],
        "train": ["-o", tmp_path / "model"],
        "identify": [written("drive", ("1+x", "1+x"))],
        "predict": [tmp_path / "no_result"],
        "explore": ["--no-browser"],
    }
    printed = run(command, assembly, *more.get(command, []), code=1).stderr
    assert "its file says response 2+x, force 1+x: node 2 is used as 'right'" in " ".join(printed.split())


def test_the_orders_that_are_refused_are_all_orders(frfs):
    assert len(ASSIGNED) == 26
    assert set(permutations(PLACES)) - {tuple(PLACES)} < set(ASSIGNED)
