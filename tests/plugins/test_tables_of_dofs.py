"""Tables of DOFs and matrices in files: what is read, cell by cell, and what is refused, with its line."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.io
import scipy.sparse as sp

import dovetail
from dovetail import DovetailError
from dovetail.registry import components
from dovetail_plugins.substructures.dof_table import read_dof_table, table_in
from dovetail_plugins.substructures.matrix_files import matrix_in, matrix_market, read_archive, sound_matrix


def csv_table(folder, text, size=2):
    file = folder / "dofs.csv"
    file.write_bytes(text.encode("utf-8"))
    return read_dof_table(file, size)


def test_a_table_is_read_cell_by_cell(tmp_path):
    """With a byte order mark, capitals, spaces, blank lines and Windows line ends, as spreadsheets write them."""
    text = "\ufeffRow , NODE,Direction,Position\r\n\r\n3, tip ,x, 0.25\r\n , , , \r\n1,root,rz,-1e-3\r\n"
    table = csv_table(tmp_path, text, size=3)
    assert table.nodes == ("tip", "root")
    assert table.directions == ("x", "rz")
    assert table.rows.tolist() == [2, 0]
    assert table.positions.tolist() == [0.25, -1e-3]


def test_without_rows_and_positions_the_order_is_that_of_the_matrix(tmp_path):
    table = csv_table(tmp_path, "node,direction\nn1,x\nn1,rz\n")
    assert table.rows.tolist() == [0, 1]
    assert table.positions is None


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("node,direction\nn1,x\n", "the table has 1 DOFs, the matrices have 2 rows"),
        ("node,direction\nn1,x\nn1,rz\nn2,x\n", "the table has 3 DOFs, the matrices have 2 rows"),
        ("node,direction,row\nn1,x,0\n", "DOF 1 row 0 is not in the matrices, which have 2 rows"),
        ("node,direction,row\nn1,x,1\nn1,rz,3\n", "DOF 2 row 3 is not in the matrices, which have 2 rows"),
        ("node,direction,row\nn1,x,2\nn1,rz,2\n", "DOF 2 row 2 already belongs to DOF 1"),
        ("node,direction,row\nn1,x,1\nn1,x,2\n", "DOF 2 x of node 'n1' is already DOF 1"),
        ("node,direction,row\nn1,x,1.5\n", "a row number in the table of DOFs is not a whole number"),
        ("node,direction,position\nn1,x,0\nn1,rz,nan\n", "DOF 2 the position of node 'n1' is not finite"),
        ("node,direction,position\nn1,x,0\nn1,rz,0.1\n", "DOF 2 node 'n1' is at 0 and at 0.1"),
        ("node,direction,position\nn1,x,0\nn1,rz,0.1 m\n", "DOF 2 the position '0.1 m' is not a number"),
        ("node,direction\nn1,x\nn1\n", "dofs.csv:3 the line has 1 cells, not 2"),
        ("node,direction,size\nn1,x,1\nn1,rz,1\n", "the first line is 'node,direction,size'"),
        ("node,axis\nn1,x\nn1,rz\n", "the first line is 'node,axis'"),
        ("node,direction\n", "the table has no DOFs"),
        ("node,direction,row,row\nn1,x,1,2\nn1,rz,2,1\n", "the first line has 'row' twice"),
        (
            "node,direction,position,point_x,point_y,point_z\nn1,x,0,1,0,0\nn1,rz,0,1,0,0\n",
            "the table has positions along a line, and points in space",
        ),
    ],
)
def test_a_table_that_does_not_fit_is_refused_at_its_dof(tmp_path, text, fault):
    with pytest.raises(dovetail.DovetailError) as caught:
        csv_table(tmp_path, text)
    assert fault in " ".join(str(caught.value).split())


def test_the_table_in_an_archive_may_hold_numbers_and_matlabs_cells():
    nodes = np.empty((2, 1), dtype=object)
    nodes[0, 0], nodes[1, 0] = np.array([[np.array([" tip "])]]), np.array([[12.0]])
    archive = {"nodes": nodes, "directions": np.array(["x", "x "]), "rows": [[2.0, 1.0]], "positions": [0.5, 0.25]}
    table = table_in(archive, "part.mat", 2)
    assert table.nodes == ("tip", "12")
    assert table.directions == ("x", "x")
    assert table.rows.tolist() == [1, 0]
    assert table.positions.tolist() == [0.5, 0.25]
    assert table_in({"M": np.eye(2), "rows": [1, 2]}, "part.mat", 2) is None
    for lacking, name in (({"nodes": ["1"]}, "directions"), ({"directions": ["x"]}, "nodes")):
        with pytest.raises(dovetail.DovetailError, match=f"there is no '{name}', which the table of DOFs needs"):
            table_in(lacking, "part.mat", 1)


def test_fractions_and_empty_cells_are_kept():
    cells = np.empty(2, dtype=object)
    cells[0], cells[1] = np.array([]), 1.5
    assert table_in({"nodes": cells, "directions": ["x", "x"]}, "part.mat", 2).nodes == ("", "1.5")


@pytest.mark.parametrize("form", [np.array, sp.csr_array, sp.coo_array])
def test_a_printed_matrix_is_made_exactly_symmetric(form):
    """The mean of the two triangles, where they differ by less than a millionth of the largest entry."""
    K = np.array([[1e6, -1e3, 0.0], [-1e3 - 0.5, 2e6, 4.0], [0.0, 4.0, 0.0]])
    matrix = sound_matrix("K", form(K), "part.npz").toarray()
    np.testing.assert_allclose(matrix, [[1e6, -1000.25, 0.0], [-1000.25, 2e6, 4.0], [0.0, 4.0, 0.0]], rtol=1e-15)
    np.testing.assert_array_equal(matrix, matrix.T)
    K[1, 0] -= 2.0
    with pytest.raises(dovetail.DovetailError) as caught:
        sound_matrix("K", form(K), "part.npz")
    assert "its entry (2, 1) is -1002.5, (1, 2) is -1000" in str(caught.value)


def test_whole_numbers_are_real_numbers_and_repeated_entries_add_up():
    repeated = sp.coo_array((np.array([1, 2, 4]), ([0, 0, 1], [0, 0, 1])), shape=(2, 2))
    matrix = sound_matrix("M", repeated, "part.mtx")
    np.testing.assert_array_equal(matrix.toarray(), [[3.0, 0.0], [0.0, 4.0]])
    assert matrix.dtype == np.float64


@pytest.mark.parametrize(
    ("values", "fault"),
    [
        (np.ones(4), r"the matrix M has the shape (4,)"),
        (np.ones((2, 3)), r"the matrix M has the shape (2, 3)"),
        (np.ones((0, 0)), r"the matrix M has the shape (0, 0)"),
        (np.array([["1"]]), "the matrix M has <U1 entries"),
        (np.array([[True]]), "the matrix M has bool entries"),
        (np.array([[1.0, np.nan], [np.nan, 1.0]]), "the entry (2, 1) of M is nan"),
        (sp.csc_array(np.array([[1.0, 0.0], [0.0, -np.inf]])), "the entry (2, 2) of M is -inf"),
    ],
)
def test_an_invalid_matrix_is_refused_with_the_entry_at_fault(values, fault):
    with pytest.raises(dovetail.DovetailError) as caught:
        sound_matrix("M", values, "part.npz")
    assert fault in str(caught.value)


def test_matrices_of_compressed_rows_or_columns_are_read_from_an_archive():
    K = sp.csc_array(np.array([[2.0, -1.0, 0.0], [-1.0, 2.0, 0.0], [0.0, 0.0, 5.0]]))
    archive = {"K_data": K.data, "K_indices": K.indices, "K_indptr": K.indptr, "M": np.eye(3)}
    np.testing.assert_array_equal(matrix_in(archive, "K", "part.npz").toarray(), K.toarray())
    np.testing.assert_array_equal(matrix_in(archive, "M", "part.npz"), np.eye(3))
    assert matrix_in(archive, "C", "part.npz") is None


def test_matlabs_own_entries_are_passed_over_and_capital_endings_are_read(tmp_path):
    scipy.io.savemat(tmp_path / "part.MAT", {"M": np.eye(2)}, appendmat=False)
    archive = read_archive(tmp_path / "part.MAT")
    assert list(archive) == ["M"]


@pytest.mark.parametrize("field", ["integer", "real"])
def test_a_full_matrix_market_file_of_either_kind_of_number(field, tmp_path):
    file = tmp_path / "K.mtx"
    scipy.io.mmwrite(file, np.array([[4, -2], [-2, 3]]), field=field)
    np.testing.assert_array_equal(matrix_market(file, file.read_bytes()), [[4.0, -2.0], [-2.0, 3.0]])


def test_the_shortest_file_of_its_entries_is_not_taken_for_a_damaged_one(tmp_path):
    """Two bytes an entry: a digit and the end of the line."""
    entries = "".join("1\n" if row == column else "0\n" for row in range(30) for column in range(30))
    file = tmp_path / "M.mtx"
    file.write_text(f"%%MatrixMarket matrix array integer general\n30 30\n{entries}")
    np.testing.assert_array_equal(matrix_market(file, file.read_bytes()), np.eye(30))


def part(folder, config, **arrays):
    np.savez(folder / "part.npz", **arrays)
    model = components().find("substructure", "matrices").component
    return model(model.Config(file=str(folder / "part.npz"), **config))


def test_every_unit_and_the_order_of_the_dofs_by_hand(tmp_path):
    """Rotation before displacement in the file, its sense reversed; mm, g and N/mm; a node inside and a DOF 'rx'."""
    K = np.array([[50.0, -3.0, 0.0, 1.0], [-3.0, 7.0, -2.0, 0.0], [0.0, -2.0, 9.0, 0.0], [1.0, 0.0, 0.0, 6.0]])
    M, C, D = np.diag([4.0, 5.0, 6.0, 7.0]), 0.5 * K, 0.25 * K
    made = part(
        tmp_path,
        {"displacement": "uy", "rotation": "-rot", "units": {"length": "1 mm", "mass": "1 g", "stiffness": "1 N/mm"}},
        M=M, K=K, C=C, D=D,
        nodes=["a", "a", "b", "a"], directions=["rot", "uy", "uy", "rx"], positions=[10.0, 10.0, 30.0, 10.0],
    )  # fmt: skip
    assert [node.label for node in made.nodes] == ["a", "b"]
    assert [node.position for node in made.nodes] == pytest.approx([0.01, 0.03])
    assert [made.dof_label(dof) for dof in range(4)] == ["node 'a' x", "node 'a' rz", "node 'b' x", "node 'b' rz"]
    stiffness = 1e3 * np.array(
        [
            [7.0, 3e-3, -2.0, 0.0, 0.0],
            [3e-3, 50e-6, 0.0, 0.0, -1e-3],
            [-2.0, 0.0, 9.0, 0.0, 0.0],
            [0.0, 0.0, 0.0, 0.0, 0.0],
            [0.0, -1e-3, 0.0, 0.0, 6.0],
        ]
    )
    matrices = made.matrices()
    np.testing.assert_allclose(matrices.K, stiffness, rtol=1e-14)
    np.testing.assert_allclose(matrices.C, 0.5 * stiffness, rtol=1e-14)
    np.testing.assert_allclose(matrices.D, 0.25 * stiffness, rtol=1e-14)
    np.testing.assert_allclose(matrices.M, np.diag([5e-3, 4e-9, 6e-3, 0.0, 7e-3]), rtol=1e-14)
    with pytest.raises(ValueError, match="read-only"):
        matrices.K[0, 0] = 1.0


def test_options_reach_the_part(tmp_path):
    table = {"nodes": [1, 2, 3], "directions": ["x"] * 3}
    K = np.array([[1.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 1.0]])
    made = part(tmp_path, {"nodes": [3, "1", 3], "loss_factor": 0.1, "tolerance": 1e-5}, M=np.eye(3), K=K, **table)
    assert [(node.label, node.position) for node in made.nodes] == [("3", 0.0), ("1", 0.0)]
    assert made.condensation_tolerance == 1e-5
    order = [2, 0, 1]
    shown = made.matrices().K[np.ix_([0, 2, 4], [0, 2, 4])]
    np.testing.assert_array_equal(shown, K[np.ix_(order, order)])
    np.testing.assert_allclose(made.matrices().D, 0.1 * made.matrices().K)
    assert not made.matrices().K[[1, 3]].any()


@pytest.mark.parametrize(("rows", "kind"), [(59, dovetail.StructuralMatrices), (60, dovetail.SparseMatrices)])
def test_only_small_matrices_are_given_in_full(rows, kind, tmp_path):
    """x and rz of the one node that is reached, and the inner DOFs: one more than the file has rows, 60 at most."""
    chain = 2.0 * np.eye(rows) - np.eye(rows, k=1) - np.eye(rows, k=-1)
    table = {"nodes": np.arange(rows), "directions": ["x"] * rows}
    matrices = part(tmp_path, {"nodes": [rows - 1]}, M=np.eye(rows), K=chain, **table).matrices()
    assert isinstance(matrices, kind)
    assert matrices.size == rows + 1


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("row", ["9223372036854775807", "-9223372036854775807", "9" * 30])
def test_a_row_that_no_whole_number_holds(tmp_path, row):
    (tmp_path / "dofs.csv").write_text(f"node,direction,row\n1,x,{row}\n2,x,1\n")
    with pytest.raises(DovetailError, match="a row number in the table of DOFs is not a whole number"):
        read_dof_table(tmp_path / "dofs.csv", 3)
