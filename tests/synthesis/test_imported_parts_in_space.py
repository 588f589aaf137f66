"""Imported matrices of a part in space: the same beam as rows of a file in any order, with words of its own."""

import numpy as np
import pytest

import dovetail
from dovetail.registry import components

STEEL = {"young": 210e9, "density": 7850.0, "poisson": 0.3, "loss_factor": 0.01}
DIRECTIONS = ("x", "y", "z", "rx", "ry", "rz")
WORDS = {"x": "UX", "y": "UY", "z": "UZ", "rx": "ROTX", "ry": "ROTY", "rz": "ROTZ"}
PLACE = {"origin": [0.1, 0.2, 0.3], "along": [1, 2, 2], "across": [0, 1, -1]}
BEAM = {"model": "spatial_beam", "material": STEEL}
BEAM["sections"] = [{"length": 0.3, "width": 0.03, "height": 0.02, "elements": 3}]


def assembly(part, at):
    return {
        "dovetail": 1,
        "name": "part",
        "frequency": {"start": 20.0, "stop": 2000.0, "lines": 50},
        "substructures": {"part": part, "ground": {"model": "ground"}},
        "joints": {
            "foot": {
                "model": "bushing",
                "connect": {"a": {"to": "part", "at": at[0]}, "b": {"to": "ground", "at": 0.0}},
            }
        },
        "response": {"at": "part", "position": at[1], "direction": [1, 1, 2], "quantity": "receptance"},
    }


def export(file, *, opposite=(), unit=1.0, **changes):
    """Write the matrices of the beam with shuffled rows, in another unit of length, some directions turned."""
    found = components().find("substructure", "spatial_beam").component
    beam = found(found.Config.model_validate({key: value for key, value in BEAM.items() if key != "model"}))
    matrices, dofs = beam.matrices(), list(beam.node_dofs)
    size, outer = matrices.size, len(dofs)
    scale = np.ones(size)
    for row, (_, direction) in enumerate(dofs):
        scale[row] = (-1.0 if direction in opposite else 1.0) / (unit if direction.startswith("r") else 1.0)
    order = np.random.default_rng(0).permutation(size)
    arrays = {name: (np.outer(scale, scale) * getattr(matrices, name))[np.ix_(order, order)] for name in "MKD"}
    row_of = np.argsort(order)
    table = {
        "nodes": [f"p{node}" for node, _ in dofs],
        "directions": [WORDS[direction] for _, direction in dofs],
        "rows": row_of[:outer] + 1,
    }
    coordinates = np.array([beam.nodes[node].coordinates for node, _ in dofs]) / unit
    table |= {f"point_{axis}": coordinates[:, number] for number, axis in enumerate("xyz")}
    np.savez(file, **{**arrays, **table, **changes})
    return str(file)


def test_an_imported_part_in_space_has_the_frf_of_the_beam(tmp_path):
    expected = dovetail.load(assembly({**BEAM, "place": PLACE}, ("n1", "n4"))).frf()
    part = {"model": "matrices", "file": export(tmp_path / "beam.npz"), "axes": WORDS, "place": PLACE}
    by_label = dovetail.load(assembly(part, ("p0", "p3"))).frf()
    np.testing.assert_allclose(by_label, expected, rtol=0.0, atol=1e-9 * np.abs(expected).max())
    tip = np.array(PLACE["origin"]) + 0.3 * np.array(PLACE["along"]) / 3.0
    by_point = dovetail.load(assembly(part, ("p0", tip.tolist()))).frf()
    np.testing.assert_array_equal(by_point, by_label)


def test_opposite_senses_and_other_units_are_those_of_the_file(tmp_path):
    expected = dovetail.load(assembly({**BEAM, "place": PLACE}, ("n1", "n4"))).frf()
    file = export(tmp_path / "beam.npz", opposite=("y", "rz"), unit=1e-3)
    axes = {**WORDS, "y": "-UY", "rz": "-ROTZ"}
    part = {"model": "matrices", "file": file, "axes": axes, "units": {"length": "1 mm"}, "place": PLACE}
    frf = dovetail.load(assembly(part, ("p0", "p3"))).frf()
    np.testing.assert_allclose(frf, expected, rtol=0.0, atol=1e-9 * np.abs(expected).max())


@pytest.mark.parametrize(
    ("changes", "options", "said"),
    [
        ({}, {"axes": {**WORDS, "z": "UW"}}, "no DOF has the direction 'UW', see 'axes.z'"),
        ({}, {"axes": {**WORDS, "z": "UY"}}, "two of 'axes' are the same direction"),
        ({}, {"axes": WORDS, "displacement": "UX"}, "give either 'axes', or 'displacement' and 'rotation'"),
        ({"point_z": np.arange(24.0)}, {"axes": WORDS}, "node 'p0' is at 0 and at 1"),
        ({}, {"axes": {"w": "UX"}}, ""),
    ],
)
def test_a_table_that_says_something_else_is_refused(tmp_path, changes, options, said):
    part = {"model": "matrices", "file": export(tmp_path / "beam.npz", **changes), **options}
    with pytest.raises(dovetail.DovetailError) as error:
        dovetail.load(assembly({**part, "place": PLACE}, ("p0", "p3")))
    assert said in str(error.value)


def test_nodes_at_other_points_than_those_that_they_face_are_refused(tmp_path):
    part = {"model": "matrices", "file": export(tmp_path / "beam.npz"), "axes": WORDS, "place": PLACE}
    description = assembly(part, ("p0", "p3"))
    description["substructures"]["ground"] = {"model": "ground", "points": [[0.0, 0.0, 0.0]]}
    description["joints"]["foot"]["connect"]["b"]["at"] = "g1"
    with pytest.raises(dovetail.DovetailError, match=r"at \(0, 0, 0\) mm faces that of 'part' at \(100, 200, 300\) mm"):
        dovetail.load(description)
