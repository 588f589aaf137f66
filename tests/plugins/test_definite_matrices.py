"""Imported matrices that no body has: each is refused with the file and the DOF, in every format and size."""

from __future__ import annotations

import json
import time

import numpy as np
import pytest
import scipy.io
import scipy.sparse as sp

import dovetail
from dovetail.errors import DescriptionError
from dovetail.registry import components
from support.beam_matrices import beam, load, table, write

GIVEN = beam().matrices()
FORMS = ["npz", "sparse npz", "mat", "mtx"]


def with_coupling(matrix, factor):
    """All couplings times a factor, as when both halves of a file are stored and mirrored again."""
    return np.diag(np.diag(matrix)) * (1 - factor) + matrix * factor


def with_entry(matrix, row, column, value):
    matrix = matrix.copy()
    matrix[row, column] = matrix[column, row] = value
    return matrix


def without_element(matrix, element):
    """The beam without one of its elements: two bodies."""
    model = components().find("substructure", "timoshenko_beam").component
    section = {"length": 0.02, "outer": 0.02, "elements": 1}
    one = model(model.Config(material={"young": 2.1e11, "density": 7800, "loss_factor": 0.004}, sections=[section]))
    cut, dofs = matrix.copy(), slice(2 * element, 2 * element + 4)
    cut[dofs, dofs] -= one.matrices().K
    cut[np.abs(cut) < 1e-9 * np.abs(matrix).max()] = 0.0
    return cut


IMPOSSIBLE = {
    "doubled couplings of K": ({"K": with_coupling(GIVEN.K, 2.0)}, "the stiffness matrix K is not positive"),
    "opposite sign of a coupling of K": ({"K": with_entry(GIVEN.K, 4, 7, -GIVEN.K[4, 7])}, "K is not positive"),
    "negative diagonal of K": (
        {"K": with_entry(GIVEN.K, 6, 6, -GIVEN.K[6, 6])},
        "diagonal entry of x of node 'n4' (row 7)",
    ),
    "no diagonal in K": ({"K": with_entry(GIVEN.K, 7, 7, 0.0)}, "rz of node 'n4' (row 8)"),
    "all of K negative": ({"K": -GIVEN.K}, "the stiffness matrix K is not positive"),
    "softened K": ({"K": GIVEN.K - 1e-3 * np.diag(np.diag(GIVEN.K))}, "K is not positive"),
    "doubled couplings of M": ({"M": with_coupling(GIVEN.M, 2.5)}, "the mass matrix M is not positive"),
    "opposite sign of a coupling of M": ({"M": with_entry(GIVEN.M, 0, 1, 3 * GIVEN.M[0, 1])}, "M is not positive"),
    "negative mass": ({"M": with_entry(GIVEN.M, 4, 4, -1.0)}, "the mass of row 5 is negative: -1."),
    "coupling to a DOF without mass": ({"M": with_entry(GIVEN.M, 5, 5, 0.0)}, "rz of node 'n3' (row 6)"),
    "negative structural damping": ({"D": -GIVEN.D}, "the structural damping matrix D is not positive"),
    "doubled couplings of D": ({"D": with_coupling(GIVEN.D, 2.0)}, "the structural damping matrix D is not positive"),
    "two bodies": ({"K": without_element(GIVEN.K, 3)}, "K has 4 motions without any stiffness"),
    "no stiffness at all": ({"K": np.zeros((18, 18)), "D": None}, "K has 18 motions without any stiffness"),
}


@pytest.mark.usefixtures("unguarded_matrices")
@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("case", IMPOSSIBLE)
def test_matrices_that_no_body_has_are_refused(case, form, tmp_path):
    matrices, said = IMPOSSIBLE[case]
    with pytest.raises(DescriptionError) as raised:
        load(tmp_path, write(tmp_path, form, matrices=matrices))
    (fault,) = raised.value.faults
    assert said in fault.problem, fault.problem
    assert "row" in fault.problem
    assert ("part." in fault.problem) or ("mtx" in fault.problem)


def test_negative_viscous_damping_is_refused(tmp_path):
    with pytest.raises(DescriptionError, match="the viscous damping matrix C is not positive"):
        load(tmp_path, write(tmp_path, "npz", matrices={"C": -1e-4 * GIVEN.K}))


def fine_beam(elements, used=None):
    """M and K of a beam of many elements or of the first of them, sparse."""
    model = components().find("substructure", "timoshenko_beam").component
    steel = {"young": 2.1e11, "density": 7800}
    used = used or elements
    section = {"length": 0.5 * used / elements, "outer": 0.02, "elements": used}
    part = model(model.Config(material=steel, sections=[section]))
    matrices = part.matrices()
    return part, sp.csc_array(matrices.M), sp.csc_array(matrices.K)


def write_sparse(folder, part, M, K):
    arrays = {}
    for name, matrix in (("M", M), ("K", K)):
        matrix = sp.csc_array(matrix)
        arrays |= {f"{name}_data": matrix.data, f"{name}_indices": matrix.indices, f"{name}_indptr": matrix.indptr}
    nodes = [node.label for node in part.nodes for _ in "xr"]
    positions = [node.position for node in part.nodes for _ in "xr"]
    np.savez(folder / "part.npz", **arrays, nodes=nodes, directions=["x", "rz"] * len(part.nodes), positions=positions)
    return {"model": "matrices", "file": "part.npz", "nodes": [part.nodes[0].label, part.nodes[-1].label]}


@pytest.mark.parametrize("elements", [30, 150, 250, 600])
def test_a_fine_beam_is_accepted_and_its_wrong_ones_refused(elements, tmp_path):
    """Below and above the number of DOFs from which signs of pivots replace eigenvalues."""
    part, M, K = fine_beam(elements)
    middle = elements // 2
    load(tmp_path, write_sparse(tmp_path, part, M, K), at=(0.0, 0.5))
    size = K.shape[0]
    first, second = fine_beam(elements, middle)[2], fine_beam(elements, elements - middle - 1)[2]
    cut = sp.block_diag([first, second]).tocsc()
    assert cut.shape[0] == size
    with pytest.raises(DescriptionError, match="K has 4 motions without any stiffness"):
        load(tmp_path, write_sparse(tmp_path, part, M, cut), at=(0.0, 0.5))
    soft = K - sp.diags_array(1e-4 * K.diagonal())
    with pytest.raises(DescriptionError, match="the stiffness matrix K is not positive"):
        load(tmp_path, write_sparse(tmp_path, part, M, soft), at=(0.0, 0.5))
    light = M - sp.diags_array(0.9 * M.diagonal())
    with pytest.raises(DescriptionError, match="the mass matrix M is not positive"):
        load(tmp_path, write_sparse(tmp_path, part, light, K), at=(0.0, 0.5))


@pytest.mark.parametrize("digits", [6, 8])
def test_printed_matrices_are_accepted(digits, tmp_path):
    rounded = {
        name: np.array([[float(f"{value:.{digits - 1}e}") for value in row] for row in matrix])
        for name, matrix in (("M", GIVEN.M), ("K", GIVEN.K), ("D", GIVEN.D))
    }
    assert load(tmp_path, write(tmp_path, "npz", matrices=rounded)).frf().shape == (300,)


def test_rows_without_mass_and_lumped_masses_are_accepted(tmp_path):
    lumped = np.diag(GIVEN.M.sum(axis=1) * np.tile([1.0, 0.0], 9))
    lumped[lumped < 0] = 0.0
    assert load(tmp_path, write(tmp_path, "npz", matrices={"M": lumped})).frf().shape == (300,)


def test_rounding_errors_in_place_of_zeros_are_accepted(tmp_path):
    """As a transformation of coordinates leaves them, in a DOF without stiffness and mass too."""
    matrices = {name: np.pad(getattr(GIVEN, name), (0, 1)) for name in "MKD"}
    noise = np.random.default_rng(2).standard_normal((19, 19))
    noisy = {name: matrix + 1e-16 * np.abs(matrix).max() * (noise + noise.T) for name, matrix in matrices.items()}
    columns = {
        name: [*values, {"nodes": "n9", "directions": "drilling", "positions": 0.16}[name]]
        for name, values in table().items()
    }
    part = write(tmp_path, "npz", matrices=noisy, columns=columns)
    model = components().find("substructure", "matrices").component
    assert model(model.Config(file=str(tmp_path / "part.npz"))).matrices().size == 19
    assert part["model"] == "matrices"


def test_a_held_part_has_no_zero_mode_and_is_accepted(tmp_path):
    held = GIVEN.K + np.diag([1e7] + [0.0] * 17)
    assert load(tmp_path, write(tmp_path, "npz", matrices={"K": held})).frf().shape == (300,)


def test_bodies_that_nothing_reaches_may_move_freely(tmp_path):
    """A second body and masses without stiffness in another plane, at whose DOFs no joint can attach."""
    M, K = (np.kron(np.eye(2), matrix) for matrix in (GIVEN.M, GIVEN.K))
    columns = table()
    columns = {
        "nodes": columns["nodes"] * 2,
        "directions": columns["directions"] + ["z", "rx"] * 9,
        "positions": columns["positions"] * 2,
    }
    part = write(tmp_path, "npz", matrices={"M": M, "K": K, "D": None}, columns=columns)
    whole = load(tmp_path, write(tmp_path, "npz", matrices={"D": None}))
    found = load(tmp_path, write(tmp_path, "npz", matrices={"M": M, "K": K, "D": None}, columns=columns))
    assert part["model"] == "matrices"
    np.testing.assert_allclose(found.frf(), whole.frf(), rtol=1e-9)


def write_market(folder, name, matrix, kept, *, entries=lambda row, column, value: value):
    """A Matrix Market file that says it is symmetric, with the entries that `kept` chooses."""
    stored = [
        (row + 1, column + 1, entries(row, column, matrix[row, column]))
        for row, column in zip(*np.nonzero(matrix), strict=True)
        if kept(row, column)
    ]
    head = f"%%MatrixMarket matrix coordinate real symmetric\n% a comment\n{len(matrix)} {len(matrix)} {len(stored)}\n"
    text = "".join(f"{row} {column} {value!r}\n" for row, column, value in stored)
    (folder / name).write_text(head + text.replace("np.float64(", "").replace(")", ""))


HALVES = {
    "lower half": lambda row, column: row >= column,
    "upper half": lambda row, column: row <= column,
    "both halves": lambda row, column: True,
    "both for some": lambda row, column: row >= column or row < 4,
    "either": lambda row, column: row >= column if row % 3 else row <= column or column % 3 != 0,
}


@pytest.mark.usefixtures("unguarded_matrices")
@pytest.mark.parametrize("half", HALVES)
def test_a_symmetric_matrix_market_file_is_the_same_whichever_halves_it_stores(half, tmp_path):
    part = write(tmp_path, "mtx")
    expected = load(tmp_path, part).frf()
    for name, matrix in (("M", GIVEN.M), ("K", GIVEN.K), ("D", GIVEN.D)):
        write_market(tmp_path, f"{name}.mtx", matrix, HALVES[half])
    np.testing.assert_allclose(load(tmp_path, part).frf(), expected, rtol=1e-9)


def test_halves_that_differ_are_refused(tmp_path):
    part = write(tmp_path, "mtx")
    write_market(
        tmp_path,
        "K.mtx",
        GIVEN.K,
        HALVES["both halves"],
        entries=lambda row, column, value: value * (1.1 if row < column else 1.0),
    )
    with pytest.raises(DescriptionError, match="stores both halves, which differ"):
        load(tmp_path, part)


def test_a_symmetric_file_in_full_layout_is_read(tmp_path):
    part = write(tmp_path, "mtx")
    expected = load(tmp_path, part).frf()
    scipy.io.mmwrite(tmp_path / "K.mtx", GIVEN.K, symmetry="symmetric")
    assert "array" in (tmp_path / "K.mtx").read_text().splitlines()[0]
    np.testing.assert_allclose(load(tmp_path, part).frf(), expected, rtol=1e-9)


def placed(matrix, start, size):
    """A matrix within one of zeros, from a row on."""
    entries = matrix.tocoo()
    return sp.coo_array((entries.data, (entries.row + start, entries.col + start)), shape=(size, size)).tocsc()


def test_the_check_of_many_dofs_takes_a_moment(tmp_path):
    """Thirty thousand DOFs of a chain."""
    _, M, K = fine_beam(1000)
    count, size = 15, M.shape[0] - 2  # the last two DOFs of a beam are the first two of the next
    starts = size * np.arange(count)
    M, K = (sum(placed(matrix, start, count * size + 2) for start in starts) for matrix in (M, K))
    began = time.process_time()
    load_large(tmp_path, M, K)
    assert time.process_time() - began < 20
    K = K.tolil()
    K[20_000, 20_002] = K[20_002, 20_000] = -K[20_000, 20_002]
    with pytest.raises(DescriptionError, match="the stiffness matrix K is not positive"):
        load_large(tmp_path, M, K.tocsc())


def load_large(folder, M, K):
    """A part with one node at its start."""
    table = {"nodes": ["a", "a"], "directions": ["x", "rz"], "rows": [1, 2], "positions": [0.0, 0.0]}
    arrays = {}
    for name, matrix in (("M", M.tocsc()), ("K", K.tocsc())):
        arrays |= {f"{name}_data": matrix.data, f"{name}_indices": matrix.indices, f"{name}_indptr": matrix.indptr}
    np.savez(folder / "part.npz", **arrays, **table)
    (folder / "assembly.yaml").write_text(
        json.dumps(
            {
                "dovetail": 1,
                "name": "large",
                "frequency": {"start": 1, "stop": 2, "lines": 2},
                "substructures": {"part": {"model": "matrices", "file": "part.npz"}},
                "response": {"at": "part", "position": 0},
            }
        )
    )
    dovetail.load(folder / "assembly.yaml")
