"""A bent frame from files of NASTRAN, Abaqus and Ansys has the FRF of the same frame made of beams."""

from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import eigh

import dovetail
from support import fe_files
from support.fe_files import UNITS, WRITERS, assembly, imported

PRINTED = {"dmig": 3e-6}
"""Error of the FRF due to the ten digits of DMIG; the other formats have fifteen or more."""


@pytest.fixture(scope="module")
def expected():
    return dovetail.load(fe_files.beams()).frf()


@pytest.fixture(autouse=True)
def _in_the_folder_of_the_files(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def largest_difference(values, expected):
    return float(np.abs(values - expected).max() / np.abs(expected).max())


@pytest.mark.parametrize("form", WRITERS)
def test_a_frame_of_each_format_has_the_frf_of_beams(form, tmp_path, expected):
    found = dovetail.load(assembly(imported(tmp_path, form))).frf()
    assert largest_difference(found, expected) < PRINTED.get(form, 1e-8)


@pytest.mark.parametrize("form", WRITERS)
def test_nodes_have_the_positions_and_directions_of_their_file(form, tmp_path):
    part = dovetail.load(assembly(imported(tmp_path, form))).description.substructures["part"]
    points = {node.label: node.coordinates for node in part.nodes}
    wanted = {str(label): tuple(1e-3 * np.array(point)) for label, point in fe_files.frame().points.items()}
    assert points.keys() == wanted.keys()
    assert all(np.allclose(points[label], wanted[label], atol=1e-9) for label in wanted)
    assert {node.directions for node in part.nodes} == {("x", "y", "z", "rx", "ry", "rz")}


@pytest.mark.parametrize("form", ["op4", "ansys"])
def test_a_joint_at_another_point_than_the_file_gives_is_refused(form, tmp_path):
    """Places of nodes are compared, so that a wrong unit of length or a wrong node is found."""
    description = assembly(imported(tmp_path, form))
    section = {"length": 0.1, "width": 0.01, "height": 0.01, "elements": 2}
    place = {"origin": [0.2, 0.0, 0.0], "along": "y", "across": "x"}
    arm = {"model": "spatial_beam", "material": fe_files.STEEL, "sections": [section], "place": place}
    description["substructures"]["arm"] = arm
    weld = {"a": {"to": "part", "at": "node 33"}, "b": {"to": "arm", "at": 0.0}}
    description["joints"]["weld"] = {"model": "rigid", "direction": "all", "connect": weld}
    dovetail.load(description)
    weld["a"]["at"] = "node 106"
    with pytest.raises(dovetail.DovetailError, match="it is 50 mm away"):
        dovetail.load(description)


def test_a_number_that_is_a_label_is_refused_with_how_to_write_it(tmp_path):
    with pytest.raises(dovetail.DovetailError, match="for the node with this label write 'node 33'"):
        dovetail.load(assembly(imported(tmp_path, "op4"), tip=("part", 33)))


def test_a_part_in_metres_and_one_in_millimetres_have_the_same_frf(tmp_path, expected):
    """With other units of the model (m, kg, s) the same files of numbers are another part."""
    model = fe_files.frame()
    scale = np.array([1e3 if one in (0, 1, 2, 3) else 1.0 for _, one in model.dofs])
    model.K, model.M = (1e-3 * np.outer(scale, scale) * matrix for matrix in (model.K, model.M))
    model.points = {node: tuple(1e-3 * np.array(point)) for node, point in model.points.items()}
    si = {"length": "1 m", "mass": "1 kg", "stiffness": "1 N/m"}
    part = {"model": "matrices", **fe_files.write_abaqus(tmp_path, model), "units": si, "loss_factor": 0.01}
    assert largest_difference(dovetail.load(assembly(part)).frf(), expected) < 1e-8
    other = dovetail.load(assembly({**part, "units": UNITS})).frf()
    assert largest_difference(other, expected) > 0.1


@pytest.mark.parametrize(
    ("layout", "binary", "order", "wide", "double"),
    [
        (layout, binary, order, wide, True)
        for layout in ("dense", "bigmat", "nonbigmat")
        for binary, order, wide in ((False, "<", False), (True, "<", False), (True, ">", True))
    ]
    + [("dense", True, ">", False, False), ("bigmat", True, "<", False, False)],
)
def test_every_layout_of_output4_gives_the_same_matrix(layout, binary, order, wide, double, tmp_path):
    model = fe_files.frame().sorted()
    options = {"layout": layout, "binary": binary, "order": order, "wide": wide, "double": double}
    mixed = [("PX", np.ones((4, 2))), ("KGG", model.K), ("MGG", model.M)]
    (tmp_path / "frame.op4").write_bytes(fe_files.op4(mixed, **options))
    found = dovetail.read_matrices("frame.op4").matrices
    assert {name: matrix.meaning for name, matrix in found.items()} == {"KGG": "K", "MGG": "M"}
    for name, matrix in (("KGG", model.K), ("MGG", model.M)):
        difference = np.abs(found[name].values.toarray() - matrix).max()
        assert difference <= (1e-16 if double else 1e-7) * np.abs(matrix).max()


@pytest.mark.parametrize("half", ["lower", "upper", "both"])
@pytest.mark.parametrize("form", ["dmig", "abaqus"])
def test_either_half_or_both_are_the_same_part(form, half, tmp_path, expected):
    part = {"model": "matrices", **WRITERS[form](tmp_path, half=half), "units": UNITS, "loss_factor": 0.01}
    assert largest_difference(dovetail.load(assembly(part)).frf(), expected) < PRINTED.get(form, 1e-8)


def test_directions_of_nodes_along_a_coordinate_system_are_turned(tmp_path, expected):
    """One node in a turned system, another one in a cylindrical one; coordinates in the turned system."""
    model = fe_files.frame().sorted()
    axes = np.linalg.qr(np.random.default_rng(5).normal(size=(3, 3)))[0]
    axes *= np.sign(np.linalg.det(axes))
    origin = np.array([30.0, -20.0, 5.0])
    angle = np.arctan2(*(axes @ (np.array(model.points[33]) - origin))[1::-1])
    turn = np.array([[np.cos(angle), np.sin(angle), 0.0], [-np.sin(angle), np.cos(angle), 0.0], [0.0, 0.0, 1.0]])
    change = np.eye(len(model.dofs))
    for node, system in ((7, axes), (33, turn @ axes)):
        for first in (1, 4):
            rows = [model.dofs.index((node, first + axis)) for axis in range(3)]
            change[np.ix_(rows, rows)] = system.T
    model.K, model.M = (change.T @ matrix @ change for matrix in (model.K, model.M))
    points = [origin, origin + axes[2], origin + axes[0]]
    first, second = (",".join(f"{v:.9f}" for v in chosen) for chosen in ([*points[0], *points[1]], points[2]))
    lines = [f"CORD2{kind},{number},0,{first}\n,{second}" for kind, number in (("R", 5), ("C", 6))]
    for node, point in model.points.items():
        given = axes @ (np.array(point) - origin) if node == 12 else np.array(point)
        systems = {12: (5, 0), 7: (0, 5), 33: (0, 6)}.get(node, ("", ""))
        lines.append(f"GRID,{node},{systems[0]},{','.join(f'{v:.9f}' for v in given)},{systems[1]}")
    lines += [f"SPOINT,{node}" for node, one in model.dofs if not one]
    (tmp_path / "frame.bdf").write_text("\n".join(lines) + "\n")
    (tmp_path / "frame.op4").write_bytes(fe_files.op4([("KAA", model.K), ("MAA", model.M)]))
    part = {"model": "matrices", "file": "frame.op4", "dofs": "frame.bdf", "units": UNITS, "loss_factor": 0.01}
    assert largest_difference(dovetail.load(assembly(part)).frf(), expected) < 1e-8


def test_a_full_file_of_ansys_has_the_natural_frequencies_that_its_library_documents():
    """The clamped beam that ansys-mapdl-reader ships; only where this large package is installed."""
    package = pytest.importorskip("ansys.mapdl.reader", reason="ansys-mapdl-reader is not installed")
    model = dovetail.read_matrices(Path(package.__file__).parent / "examples" / "file.full")
    K, M = (model.matrices[name].values.tocsc() for name in "KM")
    filled = np.flatnonzero(abs(K).sum(axis=0))
    squares = eigh(*(matrix[filled][:, filled].toarray() for matrix in (K, M)), eigvals_only=True)
    expected = [1283.20036921, 1283.20036921, 5781.97486169, 6919.39887714]
    np.testing.assert_allclose(np.sqrt(squares[:4]) / (2.0 * np.pi), expected, rtol=1e-8)
    assert len(model.table.nodes) == len(model.table.rows) == K.shape[0]
    assert set(model.table.directions) == {"UX", "UY", "UZ"}
