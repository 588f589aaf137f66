"""Units in texts and comments of files with matrices, against those of the description."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.io import mmwrite, savemat
from scipy.sparse import coo_array

from dovetail import DovetailError
from dovetail_plugins.substructures.matrices import Matrices
from dovetail_plugins.substructures.matrix_files import matrix_market_parts
from dovetail_plugins.substructures.matrix_remarks import comments_in
from dovetail_plugins.substructures.timoshenko_beam import TimoshenkoBeam

SPRING = 1e6 * np.array([[1.0, -1.0], [-1.0, 1.0]])
ARRAYS = {"M": np.diag([0.2, 0.2]), "K": SPRING, "nodes": ["1", "2"], "directions": ["x", "x"]}
OTHER = ["mm, t, s", "mm-t-s", "mm N s", "in-lbf-s", "mm", "N/mm"]
SI = ["SI", "m, kg, s", "m-kg-s", "N/m", "SI (m, kg, s)"]
BEAM = {
    "material": {"young": 2e11, "density": 7850.0},
    "sections": [{"length": 0.2, "outer": 0.02, "elements": 4}],
}
NAMES = ["units", "unit_system", "Einheiten"]


def part(path: Path, **options: object) -> Matrices:
    return Matrices(Matrices.Config(file=str(path), **options))


def write(path: Path, **texts: str) -> Path:
    arrays = {**ARRAYS, **texts}
    (np.savez(path, **arrays) if path.suffix == ".npz" else savemat(path, arrays))
    return path


@pytest.mark.parametrize("unit", OTHER)
@pytest.mark.parametrize("name", NAMES)
def test_an_archive_in_other_units_needs_them_in_the_description(tmp_path: Path, name: str, unit: str) -> None:
    path = write(tmp_path / "a.npz", **{name: unit})
    with pytest.raises(DovetailError, match="the file says"):
        part(path)
    assert part(path, units={"length": 1e-3, "mass": 1e3, "stiffness": 1e3}).matrices().K[0, 0] == 1e9


@pytest.mark.parametrize("unit", SI)
@pytest.mark.parametrize("name", [*NAMES, "title"])
def test_an_archive_in_si_units_is_read(tmp_path: Path, name: str, unit: str) -> None:
    assert part(write(tmp_path / "a.npz", **{name: unit})).matrices().K[0, 0] == 1e6


@pytest.mark.parametrize("unit", ["mm, t, s", "in-lbf-s"])
def test_a_comment_of_a_matrix_market_file_is_read(tmp_path: Path, unit: str) -> None:
    for name in ("M", "K"):
        comment = f" exported by a solver\n units: {unit}"
        mmwrite(tmp_path / f"{name}.mtx", coo_array(ARRAYS[name]), comment=comment)
        assert matrix_market_parts(tmp_path / f"{name}.mtx", (tmp_path / f"{name}.mtx").read_bytes())
    (tmp_path / "dofs.csv").write_text("node,direction\n1,x\n2,x\n")
    assert any(unit in text for text, _ in comments_in((tmp_path / "K.mtx").read_bytes(), "K.mtx"))
    files = {"mass": str(tmp_path / "M.mtx"), "stiffness": str(tmp_path / "K.mtx"), "dofs": str(tmp_path / "dofs.csv")}
    with pytest.raises(DovetailError, match=r"[MK]\.mtx:\d"):
        Matrices(Matrices.Config(**files))


@pytest.mark.parametrize("text", ["mm", "mm, t, s", "m and t"])
def test_a_text_about_another_unit_than_the_description_has_is_refused(tmp_path: Path, text: str) -> None:
    with pytest.raises(DovetailError, match="the description has"):
        part(write(tmp_path / "a.npz", units=text), units={"length": 1.0, "mass": 1.0, "stiffness": 1.0})
    part(write(tmp_path / "a.npz", units="m, kg, N/mm"), units={"length": 1.0, "mass": 1.0, "stiffness": 1e3})


@pytest.mark.parametrize("name", ["loss_factor", "eta", "rayleigh_beta"])
def test_a_number_for_damping_that_is_not_read_is_reported(tmp_path: Path, name: str) -> None:
    path = tmp_path / "a.npz"
    np.savez(path, **ARRAYS, **{name: 0.01})
    with pytest.warns(UserWarning, match=f"'{name}' = 0.01 is not used"):
        part(path)


def test_a_second_matrix_of_the_same_size_is_reported(tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", **ARRAYS, KAA=2 * SPRING)
    with pytest.warns(UserWarning, match="the matrix 'KAA' is not used"):
        part(tmp_path / "a.npz")


def test_directions_of_a_plane_part_that_are_exchanged_are_refused(tmp_path: Path) -> None:
    beam = TimoshenkoBeam(TimoshenkoBeam.Config.model_validate(BEAM))
    matrices, places = beam.matrices(), np.repeat([node.position for node in beam.nodes], 2)
    table = {"nodes": np.repeat([f"p{n}" for n in range(len(beam.nodes))], 2), "positions": places}
    for first, second in (("x", "rz"), ("rz", "x")):
        words = np.tile([first, second], len(beam.nodes))
        np.savez(tmp_path / f"{first}.npz", M=matrices.M, K=matrices.K, directions=words, **table)
    part(tmp_path / "x.npz")
    with pytest.raises(DovetailError, match="Are rotations and displacements exchanged"):
        part(tmp_path / "rz.npz")


def test_one_matrix_given_as_two_is_refused(tmp_path: Path) -> None:
    mmwrite(tmp_path / "K.mtx", coo_array(SPRING))
    mmwrite(tmp_path / "M.mtx", coo_array(np.diag([0.2, 0.2])))
    (tmp_path / "dofs.csv").write_text("node,direction\n1,x\n2,x\n")
    files = {"mass": "M.mtx", "stiffness": "K.mtx", "damping": "K.mtx", "dofs": "dofs.csv"}
    with pytest.raises(DovetailError, match="the same matrix is given as 'stiffness' and as 'damping'"):
        Matrices(Matrices.Config(**{name: str(tmp_path / file) for name, file in files.items()}))
