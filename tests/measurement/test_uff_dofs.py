"""Universal files by the names of their DOFs; rotations, averages and variance in sets."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import pyuff

from dovetail.frf import Frf
from dovetail.measurement import read_frf, write_frf
from support.measured_files import fault_of, set_58, write_sets

FREQUENCY = 10.0 + 2.5 * np.arange(7)
VALUES = np.array([1 + 2j, -3, 4j, 5.5 - 1j, 1e-9j, 7e5, -8 - 8j])
POINTS = [(1, 1, 1, 1), (2, 1, 1, 1), (2, -2, 1, 1), (2, 1, 2, 1)]


@pytest.fixture
def several(tmp_path: Path) -> Path:
    """One FRF for each of `POINTS`, its values times its number; set 5 names a part."""
    names = ("rsp_node", "rsp_dir", "ref_node", "ref_dir")
    sets = [
        set_58(FREQUENCY, number * VALUES, **dict(zip(names, point, strict=True)))
        for number, point in enumerate(POINTS, start=1)
    ]
    tool = set_58(FREQUENCY, 5 * VALUES, rsp_node=7, rsp_dir=3, rsp_ent_name="Tool", ref_node=1, ref_dir=3)
    return write_sets(tmp_path / "a.uff", *sets, tool)


@pytest.mark.parametrize(
    ("response", "force", "number"),
    [
        ("1", None, 1),
        ("1+x", "1:+X", 1),
        ("2x", "1x", 2),
        ("2 -y", None, -3),
        ("2", "2", 4),
        (None, "2", 4),
        ("tool:7+z", None, 5),
        ("7", "1+z", 5),
    ],
)
def test_an_frf_is_chosen_by_its_dofs(several: Path, response: str | None, force: str | None, number: int) -> None:
    frf = read_frf(several, response=response, force=force)
    np.testing.assert_allclose(frf.values, number * VALUES, rtol=1e-11)


def test_the_dofs_come_along(several: Path) -> None:
    frf = read_frf(several, index=5)
    assert (frf.response, frf.force) == ("Tool:7+z", "1+z")


def test_ambiguous_or_missing_dofs_are_listed(several: Path) -> None:
    message = fault_of(several, response="2", force="1")
    assert message.startswith("a.uff\n  the file holds 2 FRFs that fit; choose one:\n    set 1: FRF, response 1 +x")
    assert message.endswith("for example index=2.")
    for wrong in ({"response": "3"}, {"response": "2+z"}, {"response": "1-x"}, {"force": "nut"}):
        assert fault_of(several, **wrong).startswith("a.uff\n  no FRF from ")
    assert fault_of(several, names={"values": "H"}).startswith("a.uff\n  names are for files of named arrays")


def test_a_mass_is_not_taken_off_a_transfer_function(several: Path) -> None:
    assert read_frf(several, response="2", force="2", accelerometer_mass=1e-3).quantity == "accelerance"
    assert fault_of(several, response="2x", force="1", accelerometer_mass=1e-3).startswith(
        "a.uff\n  the FRF is from 1+x to 2+x, and the mass is taken off a drive point."
    )


@pytest.mark.parametrize("binary", [False, True])
def test_averages_variance_and_dofs_come_back(tmp_path: Path, measured: Frf, binary: bool) -> None:
    variance = np.linspace(1, 2, measured.frequency.size)
    written = replace(measured, averages=10, variance=variance, response="tool:5-y", force="7+z", note="bench")
    write_frf(written, tmp_path / "a.uff", binary=binary)
    frf = read_frf(tmp_path / "a.uff")
    np.testing.assert_allclose(frf.values, measured.values, rtol=1e-11)
    raw = pyuff.UFF(str(tmp_path / "a.uff")).read_sets(0)["data"]  # along -y and +z
    np.testing.assert_allclose(raw, -measured.values, rtol=1e-11)
    np.testing.assert_allclose(frf.variance, variance, rtol=1e-11)
    np.testing.assert_allclose(frf.coherence, measured.coherence, rtol=1e-11)
    assert (frf.averages, frf.response, frf.force) == (10, "tool:5-y", "7+z")


def test_averages_are_read_as_other_programs_write_them(tmp_path: Path) -> None:
    for line, averages in (("No. of Averages : 012", 12), ("averages=0", None), ("averaged 5", None)):
        path = write_sets(tmp_path / "a.uff", set_58(FREQUENCY, VALUES, id4=line))
        assert read_frf(path).averages == averages


def test_a_rotation_per_moment_is_read(tmp_path: Path) -> None:
    labels = {"ordinate_axis_units_lab": "mrad/s^2", "orddenom_axis_units_lab": "N m"}
    path = write_sets(tmp_path / "a.uff", set_58(FREQUENCY, VALUES, rsp_dir=6, ref_dir=6, **labels))
    frf = read_frf(path)
    np.testing.assert_allclose(frf.values, VALUES * 1e-3, rtol=1e-11)
    assert (frf.rotation, frf.unit, frf.response) == (True, "rad/(N m s^2)", "1+rz")
    labels["orddenom_axis_units_lab"] = "N"
    path = write_sets(tmp_path / "a.uff", set_58(FREQUENCY, VALUES, rsp_dir=6, ref_dir=6, **labels))
    assert "the excitation is a force by its label or unit, and a moment by its direction" in fault_of(path)


def test_dofs_that_are_not_known_are_not_invented(tmp_path: Path, measured: Frf) -> None:
    for response, force, points in (
        ("", "", (0, 0, 0, 0)),
        ("5+x", "", (5, 1, 0, 0)),
        ("", "tool:7-rz", (0, 0, 7, -6)),
        ("5", "7", (5, 0, 7, 0)),
        ("tool tip", "nut", (0, 0, 0, 0)),
    ):
        for rotation in {False, "r" in force}:
            frf = replace(measured, response=response, force=force, rotation=rotation)
            if "r" in force and not rotation:
                continue
            write_frf(frf, tmp_path / "a.uff", overwrite=True)
            fields = pyuff.UFF(str(tmp_path / "a.uff")).read_sets(0)
            assert tuple(fields[name] for name in ("rsp_node", "rsp_dir", "ref_node", "ref_dir")) == points
            back = read_frf(tmp_path / "a.uff")
            assert (back.response, back.force, back.rotation) == (response, force, rotation)
            np.testing.assert_allclose(back.values, measured.values, rtol=1e-11)


def test_a_rotation_per_force_is_read(tmp_path: Path) -> None:
    labels = {"ordinate_axis_units_lab": "mrad/s^2", "orddenom_axis_units_lab": "N"}
    frf = read_frf(write_sets(tmp_path / "a.uff", set_58(FREQUENCY, VALUES, rsp_dir=6, ref_dir=1, **labels)))
    np.testing.assert_allclose(frf.values, VALUES * 1e-3, rtol=1e-11)
    assert (frf.kind, frf.unit, frf.response, frf.force) == ("rotation per force", "rad/(N s^2)", "1+rz", "1+x")


def test_a_rotation_with_an_unknown_direction_of_the_force_is_refused(tmp_path: Path) -> None:
    for directions in ((4, 0), (0, -5)):
        path = write_sets(tmp_path / "a.uff", set_58(FREQUENCY, VALUES, rsp_dir=directions[0], ref_dir=directions[1]))
        assert "either the response or the reference is a rotation" in fault_of(path)


@pytest.mark.parametrize("suffix", ["csv", "npz", "uff"])
def test_dofs_that_the_caller_gives_are_used(tmp_path: Path, measured: Frf, suffix: str) -> None:
    write_frf(measured, tmp_path / f"a.{suffix}")
    for dofs, sign in ((("3+x", "1-x"), -1), (("3-y", "1-x"), 1), (("tool:3z", "1"), 1)):
        frf = read_frf(tmp_path / f"a.{suffix}", dofs=dofs)
        assert (frf.response, frf.force) == dofs
        np.testing.assert_allclose(frf.values, sign * measured.values, rtol=1e-11)
        write_frf(frf, tmp_path / f"b.{suffix}", overwrite=True)
        for again in ({}, {"dofs": dofs}):
            frf = read_frf(tmp_path / f"b.{suffix}", **again)
            np.testing.assert_allclose(frf.values, sign * measured.values, rtol=1e-11)


def test_dofs_that_are_invalid_or_contradict_the_file_are_refused(several: Path) -> None:
    assert read_frf(several, index=3, dofs=("2-y", "1+x")).response == "2-y"
    assert fault_of(several, index=3, dofs=("2+y", "1+x")).endswith(
        "the file says that it holds the DOF 2-y, the argument says 2+y.\n"
        "  Leave the argument out, or correct the file."
    )
    assert fault_of(several, index=3, dofs=("2+q", "1+x")).startswith("the argument dofs\n  '2+q' is not a DOF.\n")


@pytest.mark.parametrize(("response", "force"), [("5x", "5+x"), ("5X", "5x"), ("5-x", "5+x")])
def test_the_mass_is_taken_off_a_drive_point_in_every_spelling_of_its_dof(tmp_path, response, force):
    frf = Frf(FREQUENCY, VALUES, "accelerance", response=response, force=force)
    write_frf(frf, tmp_path / "a.npz")
    compensated = read_frf(tmp_path / "a.npz", accelerometer_mass=0.01)
    np.testing.assert_allclose(compensated.values, VALUES / (1.0 - 0.01 * VALUES))
