"""Coordinates, directions and units of an imported part that contradict its matrices are found."""

from pathlib import Path

import numpy as np
import pytest

import dovetail
from dovetail.registry import components
from support import beam_matrices, fe_files
from support.fe_files import UNITS, assembly

IN_SI = {"length": "1 m", "mass": "1 kg", "stiffness": "1 N/m"}


@pytest.fixture(autouse=True)
def _in_an_empty_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def frame(change=lambda point: point, *, exchanged=(), **options):
    """The frame as a part, from files whose coordinates are changed."""
    model = fe_files.frame()
    model.points = {node: tuple(change(np.array(point))) for node, point in model.points.items()}
    if exchanged:
        first, second = exchanged
        model.points[first], model.points[second] = model.points[second], model.points[first]
    section = {"model": "matrices", **fe_files.write_op4(Path(), model), "units": UNITS, **options}
    return dovetail.load(assembly(section)).description.substructures["part"]


@pytest.mark.parametrize(
    "change",
    [
        lambda point: point * [1, 1, -1],
        lambda point: point[[1, 0, 2]],
        lambda point: 1e-3 * point,
        lambda point: 25.4 * point,
    ],
    ids=["mirrored", "exchanged axes", "in metres", "in inches"],
)
def test_coordinates_that_contradict_the_stiffness_are_refused(change):
    with pytest.raises(dovetail.DovetailError, match=r"a rotation about \w strains it, most at \w of node"):
        frame(change)


def test_coordinates_of_two_exchanged_nodes_are_refused():
    with pytest.raises(dovetail.DovetailError, match="strains it, most at"):
        frame(exchanged=(7, 33))


@pytest.mark.parametrize("words", ["2 1 3 4 5 6", "1 2 3 4 6 5", "1 -2 3 4 5 6", "1 2 3 4 -5 6"])
def test_axes_that_are_not_those_of_the_coordinates_are_refused(words):
    with pytest.raises(dovetail.DovetailError, match="strains it, most at"):
        frame(axes=dict(zip(dovetail.DIRECTIONS, words.split(), strict=True)))


def test_right_coordinates_are_accepted_without_a_word():
    assert frame().warnings(1e3) == []


def test_inexact_coordinates_are_a_warning():
    (warning,) = frame(lambda point: 1.02 * point).warnings(1e3)
    assert "positions or coordinates are inexact" in warning


@pytest.mark.parametrize("units", [IN_SI, {**UNITS, "length": "1 m"}])
def test_units_of_another_model_are_a_warning(units):
    (warning,) = frame(units=units).warnings(1e3)
    assert "give waves a speed of 3.9e+06 m/s" in warning
    assert "are 'units' those of the file?" in warning


def bar(positions=1.0, sense=1.0, *, matrices=None, **options):
    """A free bar of the plane from an archive; positions are multiplied, and rotations counted in a sense."""
    given, table = beam_matrices.beam().matrices(), beam_matrices.table()
    sign = np.tile([1.0, sense], len(table["nodes"]) // 2)
    turned = {name: np.outer(sign, sign) * matrix for name, matrix in (("M", given.M), ("K", given.K))}
    table["positions"] = np.asarray(positions) * table["positions"]
    np.savez("bar.npz", **turned | (matrices or {}), **table)
    model = components().find("substructure", "matrices").component
    return model(model.Config(file="bar.npz", **options))


@pytest.mark.parametrize("wrong", [{"sense": -1.0}, {"positions": 1e3}, {"positions": -1.0}])
def test_positions_and_senses_of_a_bar_that_contradict_its_stiffness_are_refused(wrong):
    with pytest.raises(dovetail.DovetailError, match="a rotation about z strains it"):
        bar(**wrong)


def test_the_sense_of_rotations_may_be_stated():
    assert bar(sense=-1.0, rotation="-rz").warnings(1e3) == []


@pytest.mark.parametrize("digits", [6, 5])
def test_entries_with_few_digits_are_accepted(digits):
    K = beam_matrices.beam().matrices().K
    rounded = np.array([[float(f"{value:.{digits - 1}e}") for value in row] for row in K])
    assert bar(matrices={"K": rounded}).warnings(1e3) == []


def test_a_part_that_springs_hold_is_accepted():
    K = beam_matrices.beam().matrices().K
    held = K + np.diag(np.where(np.arange(len(K)) == 3, 0.01 * K[3, 3], 0.0) + 1e-6 * np.diag(K))
    assert bar(matrices={"K": held}).warnings(1e3) == []


def test_inner_dofs_follow_the_nodes():
    """Without a row in the table, as the rotations of elements inside."""
    given, table = beam_matrices.beam().matrices(), beam_matrices.table()
    kept = [row for row in range(len(given.K)) if row not in (5, 6, 7)]
    columns = {name: np.array(column)[kept] for name, column in table.items()} | {"rows": np.add(kept, 1)}
    model = components().find("substructure", "matrices").component
    np.savez("bar.npz", M=given.M, K=given.K, **columns)
    assert model(model.Config(file="bar.npz")).warnings(1e3) == []
    np.savez("bar.npz", M=given.M, K=given.K, **columns | {"positions": -columns["positions"]})
    with pytest.raises(dovetail.DovetailError, match="strains it"):
        model(model.Config(file="bar.npz"))


EXCHANGED = {
    "its masses along x, y and z are": [6 * node + axis for node in range(8) for axis in (1, 2, 0, 3, 4, 5)],
    "its mass has no centre": [6 * node + axis for node in (4, 2, 0, 7, 1, 5, 3, 6) for axis in range(6)],
}


@pytest.mark.parametrize("reported", EXCHANGED)
def test_rows_of_the_mass_in_another_order_than_those_of_the_stiffness_are_a_warning(reported):
    model = fe_files.frame().sorted()
    outer = EXCHANGED[reported]
    rows = [*outer, *range(len(outer), len(model.M))]
    model.M = model.M[np.ix_(rows, rows)]
    section = {"model": "matrices", **fe_files.write_op4(Path(), model), "units": UNITS}
    (warning,) = dovetail.load(assembly(section)).description.substructures["part"].warnings(1e3)
    assert reported in warning
    assert warning.endswith("are the rows of M those of K?")
