"""The substructure `matrices`: a beam exported to each file format is the beam; every bad file gives one error."""

from __future__ import annotations

import numpy as np
import pytest

from dovetail.errors import DescriptionError
from support.beam_matrices import MATERIAL, SECTIONS, beam, load, table, write


def truth(folder):
    return load(folder, {"model": "timoshenko_beam", "material": MATERIAL, "sections": SECTIONS})


@pytest.mark.parametrize("form", ["npz", "sparse npz", "mat", "mtx"])
def test_an_exported_beam_is_the_beam_in_every_format(form, tmp_path):
    whole, found = truth(tmp_path), load(tmp_path, write(tmp_path, form))
    np.testing.assert_allclose(found.frf(), whole.frf(), rtol=1e-7)
    np.testing.assert_allclose(found.natural_frequencies(), whole.natural_frequencies(), rtol=1e-7)


def test_inner_dofs_may_be_tied_by_a_multiplier_without_stiffness_of_its_own(tmp_path):
    """Two stars of four masses; a Lagrange multiplier ties a tip of one to a tip of the other."""
    star = 1e6 * (4.0 * np.eye(4) - np.ones((4, 4)))
    springs = np.kron(np.eye(2), star)
    tie = 1e6 * (np.eye(8)[1] - np.eye(8)[6])
    K = np.block([[springs, tie[:, None]], [tie[None], np.zeros((1, 1))]])
    M, D = np.diag([0.2] * 8 + [0.0]), np.pad(0.01 * springs, (0, 1))
    nodes = [*map(str, range(1, 9)), "L"]
    columns = {"nodes": nodes, "directions": ["x"] * 8 + ["force"], "positions": [*(0.1 * np.arange(8)), 0.0]}
    tied = write(tmp_path, "npz", matrices={"M": M, "K": K, "D": D}, columns=columns) | {"nodes": ["1", "8"]}
    found = load(tmp_path, tied, at=("node 1", "node 8")).frf()
    one = np.delete(np.eye(8), 6, axis=1)
    one[6, 1] = 1.0
    merged = {name: one.T @ matrix[:8, :8] @ one for name, matrix in (("M", M), ("K", springs), ("D", D))}
    columns = {
        "nodes": [n for n in nodes[:8] if n != "7"],
        "directions": ["x"] * 7,
        "positions": [0.1 * i for i in range(7)],
    }
    whole = write(tmp_path, "npz", matrices=merged, columns=columns) | {"nodes": ["1", "8"]}
    np.testing.assert_allclose(found, load(tmp_path, whole, at=("node 1", "node 8")).frf(), rtol=1e-9)


def test_nodes_without_positions_are_addressed_by_name_and_the_others_are_inner(tmp_path):
    """Without positions, nodes are addressed by name; DOFs of all others are inner ones."""
    columns = {name: values for name, values in table().items() if name != "positions"}
    part = write(tmp_path, "npz", columns=columns) | {"nodes": ["n9", "n1"]}
    found = load(tmp_path, part, at=("n1", "node n9"))
    model = found.description.substructures["part"]
    assert [node.label for node in model.nodes] == ["n9", "n1"]
    assert model.matrices().size == 18
    assert model.dof_label(3) == "node 'n1' rz"
    np.testing.assert_allclose(found.frf(), truth(tmp_path).frf(), rtol=1e-7)


def test_an_option_of_a_part_without_rotations_can_be_identified(tmp_path):
    springs = 1e6 * np.array([[1.0, -1.0], [-1.0, 1.0]])
    columns = {"nodes": ["1", "2"], "directions": ["x", "x"], "positions": [0.0, 0.1]}
    part = write(tmp_path, "npz", matrices={"M": np.diag([0.2, 0.4]), "K": springs, "D": None}, columns=columns)
    unknown = load(tmp_path, part | {"loss_factor": {"range": [0.0, 0.1]}}, at=(0.0, 0.1))
    known = load(tmp_path, part | {"loss_factor": 0.03}, at=(0.0, 0.1))
    found = unknown.frf({"part.loss_factor": 0.03})
    np.testing.assert_allclose(found, known.frf(), rtol=1e-9)


def test_files_in_other_units_and_of_another_plane_are_converted(tmp_path):
    """Millimetres, tonnes and N/mm; bending in the plane where the rotation has the opposite sense."""
    turn = np.tile([1.0, -1e3], 9)  # 1 rad at 1 m is 1000 mm; the file's rotation is the negative one
    given = beam().matrices()
    scaled = {
        "K": given.K * np.outer(turn, turn) / 1e3,
        "M": given.M * np.outer(turn, turn) / 1e3,
        "D": given.D * np.outer(turn, turn) / 1e3,
    }
    columns = table()
    columns["directions"] = [{"x": "uz", "rz": "ry"}[axis] for axis in columns["directions"]]
    columns["positions"] = [1e3 * place for place in columns["positions"]]
    part = write(tmp_path, "mat", matrices=scaled, columns=columns)
    part |= {"displacement": "uz", "rotation": "-ry", "units": {"length": "1 mm", "mass": "1 t", "stiffness": "1 N/mm"}}
    points = [("part", 0.0, "x"), ("part", 0.06, "rz")]
    found, expected = (
        assembly.receptance(None, points, points) for assembly in (load(tmp_path, part), truth(tmp_path))
    )
    np.testing.assert_allclose(found, expected, rtol=1e-7)


def test_a_loss_factor_takes_the_place_of_a_damping_matrix(tmp_path):
    part = write(tmp_path, "npz", matrices={"C": np.zeros((18, 18)), "D": None})
    found = load(tmp_path, part | {"loss_factor": 0.004})
    np.testing.assert_allclose(found.frf(), truth(tmp_path).frf(), rtol=1e-7)


def test_a_table_may_name_some_rows_of_a_large_matrix(tmp_path):
    """A table of the few DOFs that matter, with their rows counted from 1."""
    part = write(tmp_path, "mtx")
    (tmp_path / "dofs.csv").write_text("row,node,direction,position\n1,a,x,0\n2,a,rz,0\n17,b,x,0.16\n18,b,rz,0.16\n")
    np.testing.assert_allclose(load(tmp_path, part, at=("a", 0.16)).frf(), truth(tmp_path).frf(), rtol=1e-7)


def skew(matrix):
    matrix = matrix.copy()
    matrix[2, 5] += 1e9
    return matrix


def spoilt(matrix, value):
    matrix = matrix.copy()
    matrix[3, 3] = value
    return matrix


def changed(**columns):
    def change():
        found = table()
        for name, value in columns.items():
            found[name] = value(found[name]) if callable(value) else value
        return found

    return change


K, M = beam().matrices().K, beam().matrices().M
FAULTS = {
    "no stiffness": ("npz", {"matrices": {"K": None}}, {}, "part.npz: there is no matrix 'K'; there is: D, M, "),
    "not square": ("npz", {"matrices": {"K": K[:, :17]}}, {}, "the matrix K has the shape (18, 17)."),
    "sizes": ("npz", {"matrices": {"M": M[:16, :16]}}, {}, "M has 16 rows, K has 18."),
    "not symmetric": ("mat", {"matrices": {"K": skew(K)}}, {}, "the matrix K is not symmetric: its entry ("),
    "nan": ("sparse npz", {"matrices": {"K": spoilt(K, np.nan)}}, {}, "the entry (4, 4) of K is nan."),
    "infinite": ("mat", {"matrices": {"M": spoilt(M, np.inf)}}, {}, "the entry (4, 4) of M is inf."),
    "complex": ("npz", {"matrices": {"K": K + 0j}}, {}, "the matrix K has complex128 entries."),
    "negative mass": ("npz", {"matrices": {"M": spoilt(M, -1.0)}}, {}, "the mass of row 4 is negative: -1."),
    "unknown node": ("npz", {}, {"nodes": ["n1", "n99"]}, "there is no node 'n99' with these directions."),
    "unknown direction": ("npz", {}, {"displacement": "uy"}, "no DOF has the direction 'uy', which is used as x"),
    "unknown rotation": ("npz", {}, {"rotation": "ry"}, "no DOF has the direction 'ry', which is used as rz"),
    "no table": ("npz", {"columns": lambda: {}}, {}, "there is no table of DOFs: no 'nodes', no 'directions'."),
    "no directions": ("npz", {"columns": lambda: {"nodes": table()["nodes"]}}, {}, "there is no 'directions', which"),
    "short table": ("npz", {"columns": changed(nodes=table()["nodes"][1:])}, {}, "nodes 17, directions 18, positions"),
    "double DOF": ("npz", {"columns": changed(directions=["x"] * 18)}, {}, "DOF 2: x of node 'n1' is already DOF 1."),
    "two places": (
        "npz", {"columns": changed(positions=lambda c: [*c[:-1], 1.0])}, {}, "node 'n9' is at 0.16 and at 1.",
    ),
    "row": ("npz", {"columns": changed(rows=[*range(1, 18), 99])}, {}, "row 99 is not in the matrices, which have 18 "),
    "two dampings": ("npz", {}, {"loss_factor": 0.01}, "both a matrix D and 'loss_factor' are given."),
    "missing file": ("npz", {}, {"file": "other.npz"}, "other.npz: there is no such file."),
    "folder": ("npz", {}, {"file": "."}, ": this is a directory."),
    "ending": ("npz", {}, {"file": "part.bin"}, "'.bin' is not the suffix of a file of matrices that is read."),
    "no source": ("npz", {}, {"file": None}, "give either 'file', or 'mass' and 'stiffness'"),
    "no table file": ("mtx", {}, {"dofs": None}, "there is no table of DOFs: no 'nodes', no 'directions'."),
}  # fmt: skip


@pytest.mark.parametrize("case", FAULTS)
def test_every_bad_file_is_one_clear_error(case, tmp_path):
    form, made, options, said = FAULTS[case]
    made = {name: value() if callable(value) else value for name, value in made.items()}
    part = write(tmp_path, form, **made)
    (tmp_path / "part.bin").write_text("1\n")
    section = {key: value for key, value in (part | options).items() if value is not None}
    with pytest.raises(DescriptionError) as caught:
        load(tmp_path, section)
    assert len(caught.value.faults) == 1
    assert said in str(caught.value)
    assert "substructures.part\n" in str(caught.value)


DAMAGED = {
    "part.npz": [b"", b"PK\x03\x04 no archive", b"MATLAB"],
    "part.mat": [b"", b"PK\x03\x04", b"MATLAB 5.0 MAT-file" + 200 * b"\0"],
    "K.mtx": [
        b"",
        b"%%MatrixMarket matrix coordinate real general\n18 18 999999999\n1 1 1.0\n",
        b"%%MatrixMarket matrix coordinate complex general\n1 1 1\n1 1 1.0 2.0\n",
        b"%%MatrixMarket matrix array real general\n99999 99999\n1.0\n",
        b"%%MatrixMarket matrix coordinate real general\n2 2 1\n7 7 1.0\n",
    ],
}
DAMAGED_TABLES = [
    b"", b"\xff\xfe\x00", b"node;direction\nn1;x\n", b"node,direction\nn1\n", b"node,direction,row\nn1,x,z\n",
]  # fmt: skip


@pytest.mark.parametrize(("name", "content"), [(name, content) for name in DAMAGED for content in DAMAGED[name]])
def test_damaged_files_are_refused(name, content, tmp_path):
    form = {"part.npz": "npz", "part.mat": "mat"}.get(name, "mtx")
    part = write(tmp_path, form)
    (tmp_path / name).write_bytes(content)
    with pytest.raises(DescriptionError) as caught:
        load(tmp_path, part)
    assert len(caught.value.faults) == 1
    assert name in str(caught.value)


@pytest.mark.usefixtures("unguarded_matrices")
@pytest.mark.parametrize("content", DAMAGED_TABLES)
def test_damaged_tables_of_dofs_are_refused(content, tmp_path):
    test_damaged_files_are_refused("dofs.csv", content, tmp_path)


def test_a_file_that_announces_more_than_it_holds_is_not_begun(tmp_path):
    part = write(tmp_path, "mtx")
    (tmp_path / "K.mtx").write_bytes(DAMAGED["K.mtx"][1])
    with pytest.raises(DescriptionError, match="announces 999999999 entries of a 18 x 18 matrix, which is too many"):
        load(tmp_path, part)


def test_python_objects_are_never_loaded(tmp_path):
    part = write(tmp_path, "npz")
    np.savez(tmp_path / "part.npz", K=np.array([{}], dtype=object), M=M)
    with pytest.raises(DescriptionError, match="cannot be read"):
        load(tmp_path, part)


def test_parts_of_a_sparse_matrix_that_do_not_fit_are_refused(tmp_path):
    part = write(tmp_path, "sparse npz")
    archive = dict(np.load(tmp_path / "part.npz"))
    archive["K_indices"] = archive["K_indices"] + 9
    np.savez(tmp_path / "part.npz", **archive)
    with pytest.raises(DescriptionError, match="the parts of the sparse matrix K are inconsistent"):
        load(tmp_path, part)
    del archive["K_indptr"]
    np.savez(tmp_path / "part.npz", **archive)
    with pytest.raises(DescriptionError, match="the sparse matrix K lacks 'K_indptr'"):
        load(tmp_path, part)


def test_an_unknown_node_is_reported_with_the_nearest_spelling(tmp_path):
    part = write(tmp_path, "npz")
    with pytest.raises(DescriptionError) as caught:
        load(tmp_path, part, at=("n1", "nn9"))
    assert "substructure 'part' has no node 'nn9'." in str(caught.value)
    assert "Did you mean 'n9'?" in str(caught.value)
