"""What files of NASTRAN, Abaqus and Ansys can have wrong: each gives one error with the file, the DOF and a remedy."""

import numpy as np
import pytest

import dovetail
from dovetail_plugins.matrix_readers.abaqus import AbaqusMatrixReader
from support import fe_files
from support.fe_files import UNITS, WRITERS, assembly, frame


def load(part):
    return dovetail.load(assembly({"model": "matrices", "units": UNITS, "loss_factor": 0.01, **part}))


def spoilt(change):
    """The frame with changed matrices."""
    model = frame()
    change(model)
    return model


def negative_mass(model):
    model.M[9, 9] *= -1.0


def doubled_coupling(model):
    row, column = 8, int(np.argmax(np.abs(model.K[8] - np.diag(np.diag(model.K))[8])))
    model.K[row, column] = model.K[column, row] = 3.0 * model.K[row, row]


def hinged(model):
    """A seventh motion without stiffness, of one DOF and those that it couples with."""
    row = model.K[:, 8].copy()
    model.K -= np.outer(row, row) / row[8]


def opposite(model):
    model.K *= -1.0


SPOILT = {
    "negative mass": (negative_mass, "negative"),
    "coupling too large": (doubled_coupling, "K is not positive semidefinite"),
    "mechanism": (hinged, "motions without any stiffness"),
    "opposite sign": (opposite, "K is not positive semidefinite"),
}


@pytest.mark.parametrize(("form", "fault"), [
    (form, fault) for form in WRITERS for fault in SPOILT if (form, fault) != ("dmig", "mechanism")
])  # fmt: skip  # the ten digits of DMIG do not show that a motion has no stiffness
def test_matrices_that_are_not_of_a_body_are_refused_in_every_format(form, fault, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    change, said = SPOILT[fault]
    part = WRITERS[form](tmp_path, spoilt(change))
    with pytest.raises(dovetail.DovetailError) as caught:
        load(part)
    assert len(caught.value.faults) == 1
    assert said in str(caught.value)


@pytest.mark.parametrize("form", WRITERS)
def test_files_without_units_need_those_of_the_description(form, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    part = {"model": "matrices", **WRITERS[form](tmp_path)}
    with pytest.raises(dovetail.DovetailError, match="finite element models have no units of their own"):
        dovetail.load(assembly(part))
    odd = {"length": "1 mm", "mass": "1 kg", "stiffness": "1 N/mm"}
    with pytest.raises(dovetail.DovetailError, match=r"the unit of time would be 0\.03162 s"):
        dovetail.load(assembly({**part, "units": odd}))


def edited(name, old, new, count=1):
    def edit(folder):
        text = (folder / name).read_text()
        assert old in text
        (folder / name).write_text(text.replace(old, new, count))

    return edit


def repeated(name, start):
    """Append a line of a file once more."""

    def edit(folder):
        text = (folder / name).read_text()
        line = next(line for line in text.splitlines() if line.startswith(start))
        (folder / name).write_text(f"{text}{line}\n")

    return edit


def without(name):
    return lambda folder: (folder / name).unlink()


def exchanged(first, second):
    def edit(folder):
        one, other = (folder / first).read_bytes(), (folder / second).read_bytes()
        (folder / first).write_bytes(other)
        (folder / second).write_bytes(one)

    return edit


def appended(name, text):
    def edit(folder):
        with (folder / name).open("a") as stream:
            stream.write(text)

    return edit


def cut(name, size):
    return lambda folder: (folder / name).write_bytes((folder / name).read_bytes()[:size])


def nothing(folder):
    """Leave the files as they are."""


def table(text):
    return lambda folder: (folder / "t.csv").write_text(text)


def twice_dmig(folder):
    (folder / "frame.pch").write_text(2 * (folder / "frame.pch").read_text())


def held(folder):
    file = folder / "frame_STIF2.mtx"
    lines = file.read_text().splitlines()
    at = next(number for number, line in enumerate(lines) if line.startswith("101,1, 101,1,"))
    file.write_text("\n".join([*lines[:at], "101,1, 101,1, 1.0e36", *lines[at + 1 :]]) + "\n")


OTHER_PLACE = "row,node,direction,point_x,point_y,point_z\n1,101,1,5,5,5\n"
FAULTS = {
    "dmig twice": ("dmig", twice_dmig, {}, "begins a second time"),
    "dmig complex": ("dmig", edited("frame.pch", "0       6       2", "0       6       4"), {}, "KAAX is complex"),
    "no header": (
        "dmig",
        edited("frame.pch", "DMIG    KAAX           0", "$"),
        {},
        "a column of KAAX comes before its",
    ),
    "dmig number": ("dmig", edited("frame.pch", "D+", "X+"), {}, "is not a number"),
    "moved node": (
        "dmig",
        appended("frame.pch", "GRID,101,,1.,2.,3.\n"),
        {},
        "point 101 is given twice, with different",
    ),
    "missing node": ("dmig", edited("frame.pch", "             101", "             999"), {}, ""),
    "missing system": (
        "dmig",
        appended("frame.pch", "GRID,999,9,1.,2.,3.\n"),
        {},
        "coordinate system 9, which is missing",
    ),
    "other numbers": ("dmig", appended("frame.pch", "SEQGP,1,2\n"), {}, "SEQGP is not read"),
    "other name": ("dmig", nothing, {"names": {"mass": "MYY"}}, "there is no matrix 'MYY', see 'names.mass'"),
    "no name": ("dmig", edited("frame.pch", "MAAX", "ZORR", -1), {}, "no matrix of the file is known as 'mass'"),
    "op4 cut": ("op4", cut("frame.op4", -40), {}, "ends within a matrix"),
    "op4 of another model": ("op4", edited("frame.bdf", "SPOINT", "$"), {}, "DOFs, the matrices have"),
    "op4 without table": ("op4", nothing, {"dofs": None}, "there is no table of DOFs"),
    "entry twice": ("abaqus", repeated("frame_STIF2.mtx", "101,1,"), {}, "is given twice"),
    "held": ("abaqus", held, {}, "is held by a boundary condition"),
    "exchanged": ("abaqus", nothing, {"stiffness": "frame_MASS2.mtx", "mass": "frame_STIF2.mtx"}, "says that it is"),
    "halves differ": ("abaqus", appended("frame_STIF2.mtx", "104,1, 33,1, 7.\n33,1, 104,1, 9.\n"), {}, "given twice"),
    "four numbers": ("abaqus", lambda f: (f / "frame_STIF2.mtx").write_text("1 2 3 4\n"), {}, "cannot be read"),
    "no nodes": ("abaqus", edited("frame.inp", "*NODE", "*ELEMENT"), {}, "the file has no *NODE"),
    "no coordinates": ("abaqus", nothing, {"coordinates": None}, "there are no coordinates of the nodes"),
    "instance": ("abaqus", appended("frame.inp", "*INSTANCE, NAME=a\n1.,2.,3.\n"), {}, "an instance is moved"),
    "two parts": ("abaqus", appended("frame.inp", "*NODE\n101, 1., 2., 3.\n"), {}, "node 101 is given twice"),
    "include": ("abaqus", appended("frame.inp", "*INCLUDE, INPUT=b.inp\n"), {}, "parts of the model in other files"),
    "ansys exchanged": ("ansys", exchanged("K.matrix", "M.matrix"), {}, "says that it is"),
    "ansys cut": ("ansys", cut("K.matrix", 6000), {}, "numbers where"),
    "ansys complex": ("ansys", edited("K.matrix", "RSA", "CSA"), {}, "of the type 'CSA'"),
    "row twice": ("ansys", edited("K.mapping", "             2  ", "             1  "), {}, "already belongs to DOF"),
    "turned node": ("ansys", edited("frame.node", "\n", " 30.0 0.0 0.0\n"), {}, "are turned"),
    "node twice": ("ansys", repeated("frame.node", "      101"), {}, "is given twice"),
    "two tables": ("abaqus", table("row,node,direction\n1,101,2\n"), {"dofs": "t.csv"}, "row 1 is"),
    "two places": ("abaqus rows", table(OTHER_PLACE), {"dofs": "t.csv"}, "in one file, and at"),
    "many points": ("op4", edited("frame.bdf", "$ nodes", "ASET1,123,1,THRU,900000000"), {}, "ASET1 names"),
    "many scalars": ("op4", edited("frame.bdf", "$ nodes", "SPOINT,1,THRU,900000000"), {}, "SPOINT names"),
    "many rows": ("abaqus rows", appended("K.mtx", "900000000 1 1.0\n"), {}, "matrices of up to 2000000 rows"),
    "suffix": ("ansys", lambda f: (f / "K.xyz").write_text("1"), {"stiffness": "K.xyz"}, "'.xyz' is not the suffix"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_every_fault_of_a_file_is_one_clear_error(fault, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    form, edit, options, said = FAULTS[fault]
    part = WRITERS[form](tmp_path)
    edit(tmp_path)
    with pytest.raises(dovetail.DovetailError) as caught:
        load({key: value for key, value in {**part, **options}.items() if value is not None})
    assert len(caught.value.faults) == 1
    assert said in str(caught.value)


def test_a_planar_part_may_be_taken_from_a_model_in_space(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    part = {"model": "matrices", **fe_files.write_op4(tmp_path), "units": UNITS, "displacement": "2", "rotation": "-6"}
    part |= {"nodes": [101, 33]}
    foot = {"a": {"to": "part", "at": "node 101"}, "b": {"to": "base", "at": 0.0}}
    model = dovetail.load({
        "dovetail": 1, "name": "plane", "frequency": {"start": 10.0, "stop": 100.0, "lines": 10},
        "substructures": {"part": part, "base": {"model": "ground"}},
        "joints": {"foot": {"model": "spring_damper", "connect": foot}},
        "response": {"at": "part", "position": "node 33", "quantity": "receptance"},
    })  # fmt: skip
    assert {node.directions for node in model.description.substructures["part"].nodes} == {("x", "rz")}


def test_lines_as_abaqus_writes_them_are_read(tmp_path):
    """Of a square element of plane stress, as users print them: labels and entries in columns, one half."""
    entries = {(101, 101): 9.890109890109926e01, (102, 101): -6.043956043956079e01, (102, 102): 9.890109890109926e01}
    lines = [f"{row:6d},{1:5d},{column:6d},{1:5d}, {value: .15e}" for (row, column), value in entries.items()]
    file = tmp_path / "job_STIF1.mtx"
    file.write_text("\n".join(lines) + "\n")
    reader = AbaqusMatrixReader()
    assert reader.sniff(file.read_bytes())
    model = reader.read(file, file.read_bytes())
    (matrix,) = model.matrices.values()
    assert model.table.nodes == ("101", "102")
    assert matrix.values.toarray()[1, 0] == entries[102, 101]
