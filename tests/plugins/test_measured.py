"""The substructure `measured`: valid receptances represent the part, hostile ones give one clear error."""

from __future__ import annotations

import json

import numpy as np
import pytest

import dovetail
from dovetail.errors import DescriptionError
from dovetail.registry import components

STEEL = {"young": 2.05e11, "density": 7850.0, "loss_factor": 0.01}
FREQUENCY = np.arange(50.0, 3001.0, 10.0)
POINT = [("beam", 0.0, "x"), ("beam", 0.0, "rz")]


def beam(length=0.2, outer=0.04, elements=20):
    sections = [{"length": length, "outer": outer, "elements": elements}]
    return {"model": "timoshenko_beam", "material": STEEL, "sections": sections}


def lines():
    return {"start": FREQUENCY[0], "stop": FREQUENCY[-1], "step": 10.0}


def receptance(points=POINT):
    """Of points of a free beam, by default of its end, (n_freq, n, n)."""
    alone = dovetail.load(
        {
            "dovetail": 1,
            "name": "beam",
            "frequency": lines(),
            "substructures": {"beam": beam()},
            "response": {"at": "beam", "position": 0.0},
        }
    )
    return alone.receptance(None, points, points)


def coupled(part):
    """A rod on springs at the point."""
    return dovetail.load(
        {
            "dovetail": 1,
            "name": "rod",
            "frequency": lines(),
            "substructures": {"rod": beam(0.1, 0.02, 10), "part": part},
            "joints": {
                "springs": {
                    "model": "spring_damper",
                    "connect": {"a": {"to": "rod", "at": 0.1}, "b": {"to": "part", "at": 0.0}},
                }
            },
            "response": {"at": "rod", "position": 0.0},
        }
    )


def written(folder, values, frequency=FREQUENCY):
    file = folder / "end.npz"
    dovetail.write_receptance(dovetail.ReceptanceMatrix(frequency, values), file)
    return {"model": "measured", "file": str(file)}


def test_a_measured_part_replaces_the_modelled_part(tmp_path):
    found, whole = coupled(written(tmp_path, receptance())), coupled(beam())
    np.testing.assert_allclose(found.frf(), whole.frf(), rtol=1e-6)


def test_it_is_not_seen_through_an_exponential_window(tmp_path):
    description = json.loads(coupled(written(tmp_path, receptance())).description.text)
    description["response"]["calibration"] = {"window": "5 1/s"}
    with pytest.raises(dovetail.DovetailError, match=r"^response.window\n  'part' has no matrices, so that the effect"):
        dovetail.load(description)


def test_a_measured_part_is_reciprocal_and_passive_and_exact_at_its_lines(tmp_path):
    model = components().find("substructure", "measured").component
    section = written(tmp_path, receptance())
    part = model(model.Config(file=section["file"]))
    H = part.receptance(FREQUENCY, [0, 1])
    written_down = receptance()
    mean = (written_down + np.swapaxes(written_down, 1, 2)) / 2.0  # they differ by rounding
    np.testing.assert_allclose(H, mean, rtol=1e-14)
    assert np.max(np.abs(H - np.swapaxes(H, 1, 2)) / np.sqrt(np.abs(H[:, :1, :1] * H[:, 1:, 1:]))) < 1e-8
    assert np.linalg.eigvalsh((np.swapaxes(H.conj(), 1, 2) - H) / 2j).min() > 0
    np.testing.assert_array_equal(part.receptance(FREQUENCY, [1])[:, 0, 0], H[:, 1, 1])
    assert part.matrices() is None
    assert [(node.label, node.position) for node in part.nodes] == [("m1", 0.0)]


def test_sharp_resonances_between_coarse_lines_are_met(tmp_path):
    """A loss factor of 0.003 and lines as far apart as the resonances are wide: a spline missed them by 80 %."""

    def beam_receptance(step):
        description = {"dovetail": 1, "name": "beam", "frequency": {"start": 50.0, "stop": 2998.0, "step": step}}
        part = {**beam(0.5), "material": {**STEEL, "loss_factor": 0.003}}
        response = {"at": "beam", "position": 0.0}
        alone = dovetail.load({**description, "substructures": {"beam": part}, "response": response})
        return alone.frequency, alone.receptance(None, POINT, POINT)

    (coarse, known), (fine, exact) = beam_receptance(4.0), beam_receptance(0.5)
    model = components().find("substructure", "measured").component
    part = model(model.Config(file=written(tmp_path, known, coarse)["file"]))
    error = np.abs(part.receptance(fine, [0, 1]) - exact)
    assert np.all(error.max(axis=0) < 0.01 * np.abs(exact).max(axis=0))


def test_receptances_of_opposite_signs_in_both_directions_are_refused(tmp_path):
    """The rotation with the other sign in one of the two: their mean is nothing."""
    values = receptance()
    values[:, 1, 0] *= -1.0
    with pytest.raises(dovetail.DovetailError, match="of x by a load in rz has the opposite sign"):
        coupled(written(tmp_path, values))
    noise = np.random.default_rng(0).standard_normal((len(FREQUENCY), 2, 2))
    values[:, 0, 1], values[:, 1, 0] = 1e-9 * noise[:, 0, 1], 1e-9 * noise[:, 1, 0]  # not coupled, but for noise
    coupled(written(tmp_path, values))


@pytest.mark.parametrize("line", [0, 100])
def test_a_singular_receptance_is_one_clear_error(line, tmp_path):
    """Rotations drawn from the displacements: the rows depend on each other."""
    values = receptance()
    values[line] = values[line, 0, 0] * np.array([[1.0, 2.0], [2.0, 4.0]])
    with pytest.raises(dovetail.DovetailError) as caught:
        coupled(written(tmp_path, values)).frf()
    message = str(caught.value)
    assert message.startswith(
        "substructure model 'measured'\n  its receptance between 0 mm x, 0 mm rz cannot be inverted at "
        f"{FREQUENCY[line]:g} Hz: rows depend on each other (condition "
    )
    assert "Displacement and rotation must come from independent measurements" in message


def test_a_part_without_rotation_is_one_clear_error(tmp_path):
    values = receptance()
    values[:, 1, :] = values[:, :, 1] = 0.0
    with pytest.raises(dovetail.DovetailError) as caught:
        coupled(written(tmp_path, values)).frf()
    assert str(caught.value) == (
        "substructure model 'measured'\n  its receptance at 0 mm rz is zero at 50 Hz, as if it were fixed.\n"
        "  Replace this DOF by a joint to 'ground'."
    )


def test_displacements_and_rotations_of_very_different_size_are_accepted(tmp_path):
    """In other units the same receptance has a condition of 1e16; only what rows share counts."""
    values = receptance() * np.array([[1.0, 1e8], [1e8, 1e16]])
    assert np.linalg.cond(values).min() > 1e12
    assert np.isfinite(coupled(written(tmp_path, values)).frf()).all()


def archive(**arrays):
    return {"frequency": FREQUENCY, "receptance": np.ones((len(FREQUENCY), 2, 2), complex)} | arrays


HOSTILE = {
    "no frequency": (archive(frequency=None), "this is not a receptance matrix"),
    "no receptance": (archive(receptance=None), "this is not a receptance matrix"),
    "words": (archive(frequency=np.array(["a"] * len(FREQUENCY))), "this is not a receptance matrix"),
    "complex axis": (archive(frequency=FREQUENCY + 0j), "this is not a receptance matrix"),
    "objects": (archive(receptance=np.array([{}], dtype=object)), "this is not a receptance matrix"),
    "shape": (archive(receptance=np.ones((3, 2, 2), complex)), "does not fit"),
    "one FRF": (archive(receptance=np.ones(len(FREQUENCY), complex)), "does not fit"),
    "nan": (archive(receptance=np.full((len(FREQUENCY), 2, 2), np.nan)), "not finite"),
    "backwards": (archive(frequency=FREQUENCY[::-1]), "must be positive and increase"),
    "twice": (archive(frequency=np.repeat(FREQUENCY[:148], 2)), "must be positive and increase"),
    "from zero": (archive(frequency=FREQUENCY - 50), "must be positive and increase"),
}


@pytest.mark.parametrize("case", HOSTILE)
def test_hostile_files_are_refused_with_their_name(case, tmp_path):
    arrays, said = HOSTILE[case]
    file = tmp_path / "end.npz"
    np.savez(file, **{name: array for name, array in arrays.items() if array is not None})
    with pytest.raises(DescriptionError) as caught:
        coupled({"model": "measured", "file": str(file)})
    assert len(caught.value.faults) == 1
    assert said in str(caught.value)
    assert str(file) in str(caught.value)


@pytest.mark.parametrize("content", [b"", b"PK\x03\x04", b"\x93NUMPY", b"frequency_Hz,real,imag\n1,2,3\n"])
def test_damaged_files_are_refused_with_their_name(content, tmp_path):
    file = tmp_path / "end.npz"
    file.write_bytes(content)
    problem = "this is not a receptance matrix" if content else "the file is empty"
    with pytest.raises(DescriptionError, match=problem) as caught:
        coupled({"model": "measured", "file": str(file)})
    assert str(file) in str(caught.value)


def test_lines_beyond_the_measured_ones_are_refused_in_one_error(tmp_path):
    part = written(tmp_path, receptance()[20:], FREQUENCY[20:])
    with pytest.raises(
        dovetail.DovetailError, match="the measurement covers 250 to 3000 Hz, and 50 to 3000 Hz are wanted"
    ):
        coupled(part).frf()


TIP, MIDDLE, END = 0.0, 0.06, 0.2
PLACES = {"tip": TIP, "middle": MIDDLE, "end": END}


def translations():
    """Of the beam at three places, (n_freq, 3, 3)."""
    return receptance([("beam", place, "x") for place in PLACES.values()])


def on_pins(part, places):
    """The part on two springs that act on displacements alone, struck at its tip."""
    springs = {
        f"spring{index}": {
            "model": "spring_damper",
            "direction": "x",
            "connect": {"a": {"to": "part", "at": place}, "b": {"to": "base", "at": 0}},
            "parameters": {"k": 1e7, "c": 20},
        }
        for index, place in enumerate(places[1:])
    }
    return dovetail.load(
        {
            "dovetail": 1,
            "name": "pins",
            "frequency": lines(),
            "substructures": {"part": part, "base": {"model": "ground"}},
            "joints": springs,
            "response": {"at": "part", "position": places[0]},
        }
    )


def sets(folder, pairs):
    """Write FRFs between places of the beam into one UFF file, and return the section that reads them."""
    file, H, frfs = folder / "tests.uff", translations(), []
    content = b""
    for number, (out, into) in enumerate(pairs, start=1):
        values = H[:, list(PLACES).index(out), list(PLACES).index(into)]
        one = folder / "one.uff"
        frf = dovetail.Frf(FREQUENCY, values, "receptance").to("accelerance")
        dovetail.write_frf(frf, one, overwrite=True)
        content += one.read_bytes()
        frfs.append({"set": number, "response": out, "force": into})
    file.write_bytes(content)
    return {"model": "measured", "file": str(file), "nodes": PLACES, "frfs": frfs}


PAIRS = [("tip", "tip"), ("tip", "middle"), ("tip", "end"), ("middle", "middle"), ("end", "middle"), ("end", "end")]


def test_displacements_between_several_points_from_uff_sets(tmp_path):
    found = on_pins(sets(tmp_path, PAIRS), list(PLACES))
    np.testing.assert_allclose(found.frf(), on_pins(beam(), list(PLACES.values())).frf(), rtol=1e-3)
    model = found.description.substructures["part"]
    assert model.absent_dofs == {1, 3, 5}


def test_displacements_between_several_points_from_an_archive(tmp_path):
    """In another order than the table's."""
    order = [2, 0, 1]
    file = tmp_path / "part.npz"
    np.savez(
        file,
        frequency=FREQUENCY,
        receptance=translations()[:, order][:, :, order],
        nodes=list(PLACES),
        directions=["x"] * 3,
        positions=list(PLACES.values()),
        rows=[2, 3, 1],
    )
    found = on_pins({"model": "measured", "file": str(file)}, [TIP, "middle", END])
    np.testing.assert_allclose(found.frf(), on_pins(beam(), list(PLACES.values())).frf(), rtol=1e-5)


def test_a_table_may_name_some_rows_of_a_receptance(tmp_path):
    """Two of three points, the third of which is neither struck nor held."""
    file, places = tmp_path / "part.npz", ["tip", "end"]
    table = {"nodes": places, "directions": ["x"] * 2, "rows": [1, 3]}
    np.savez(file, frequency=FREQUENCY, receptance=translations(), **table)
    found = on_pins({"model": "measured", "file": str(file)}, places)
    np.testing.assert_allclose(found.frf(), on_pins(beam(), [TIP, END]).frf(), rtol=1e-5)


def test_a_response_that_was_not_measured_is_one_clear_error(tmp_path):
    description = json.loads(on_pins(sets(tmp_path, PAIRS), list(PLACES)).description.text)
    description["response"]["direction"] = "rz"
    with pytest.raises(dovetail.DovetailError, match="0 mm rz of 'part' does not move"):
        dovetail.load(description).frf()


def without(key):
    return {"frequency": FREQUENCY, "receptance": translations(), "nodes": list(PLACES), "directions": ["x"] * 3} | key


@pytest.mark.parametrize(
    ("key", "said"),
    [
        ({"directions": ["x", "q", "x"]}, "'q' is not a direction"),
        ({"nodes": ["a", "a", "b"]}, "x of node 'a' is already DOF 1"),
        ({"nodes": ["a", "b"], "directions": ["x", "x"]}, "the table has 2 DOFs, the matrices have 3 rows"),
        ({"receptance": np.ones((len(FREQUENCY), 3), complex)}, "'receptance' has the shape (296, 3)"),
        ({"receptance": np.ones((len(FREQUENCY), 3, 2), complex)}, "does not fit"),
        ({"frequency": FREQUENCY[::-1]}, "must be positive and increase"),
        ({"frequency": FREQUENCY.astype(str)}, "'frequency' has the shape (296,) and the type"),
    ],
)
def test_hostile_tables_are_refused_with_their_file(key, said, tmp_path):
    file = tmp_path / "part.npz"
    np.savez(file, **without(key))
    with pytest.raises(DescriptionError) as caught:
        on_pins({"model": "measured", "file": str(file)}, list(PLACES))
    assert said in str(caught.value)
    assert str(file) in str(caught.value)


def test_hostile_sets_are_refused(tmp_path):
    section = sets(tmp_path, PAIRS)
    cases = {
        "no set is between 'middle' and 'end'": {"frfs": [frf for frf in section["frfs"] if frf["set"] != 5]},
        "set 7": {"frfs": [*section["frfs"], {"set": 7, "response": "tip", "force": "tip"}]},
        "set 1 is at 'back', which is not among the nodes": {"frfs": [{"set": 1, "response": "back", "force": "tip"}]},
        "give both 'nodes' and 'frfs'": {"nodes": {}},
    }
    for said, change in cases.items():
        with pytest.raises(DescriptionError) as caught:
            on_pins(section | change, list(PLACES))
        assert said in str(caught.value)
    no_sets = {"model": "measured", "file": section["file"]}
    with pytest.raises(DescriptionError, match="For a UFF file, give 'nodes' and 'frfs'"):
        on_pins(no_sets, list(PLACES))


def test_a_matrix_of_three_dofs_needs_a_table(tmp_path):
    file = tmp_path / "part.npz"
    np.savez(file, frequency=FREQUENCY, receptance=translations())
    with pytest.raises(DescriptionError, match="it is between 3 DOFs, and no table names them"):
        on_pins({"model": "measured", "file": str(file)}, list(PLACES))


def test_a_part_that_was_not_measured_reciprocal_is_the_mean_of_both_directions(tmp_path):
    """Against a mass on a spring and damper that is coupled to it by hand."""
    frequency = np.arange(20.0, 200.0)
    omega = 2.0 * np.pi * frequency
    stiffness = np.array([[5e6, -2e6], [-2e6, 4e6]]) * (1.0 + 0.01j)
    exact = np.linalg.inv(stiffness - omega[:, None, None] ** 2 * np.diag([2.0, 1.5]))
    names = {"nodes": ["l", "r"], "directions": ["x", "x"], "positions": [0.0, 0.4]}
    measured = exact * np.array([[1.0, 0.9], [1.1, 1.0]])
    np.savez(tmp_path / "frame.npz", frequency=frequency, receptance=measured, **names)
    mount = {"a": {"to": "mass", "at": 0.0}, "b": {"to": "frame", "at": 0.4}}
    parameters = {"k": {"range": [1e5, 1e7]}, "c": {"value": 30.0}}
    assembly = dovetail.load(
        {
            "dovetail": 1,
            "name": "frame",
            "frequency": {"start": 20.0, "stop": 199.0, "step": 1.0},
            "substructures": {
                "frame": {"model": "measured", "file": str(tmp_path / "frame.npz")},
                "mass": {"model": "lumped", "masses": [{"mass": 0.7}]},
            },
            "joints": {"j": {"model": "spring_damper", "direction": "x", "connect": mount, "parameters": parameters}},
            "response": {"at": "frame", "position": 0.0, "quantity": "receptance"},
        }
    )
    attached = 1.0 / (1e6 + 30j * omega) - 1.0 / (0.7 * omega**2)  # receptance of mass and spring, at the spring
    expected = exact[:, 0, 0] - exact[:, 0, 1] ** 2 / (exact[:, 1, 1] + attached)
    np.testing.assert_allclose(assembly.frf({"k": 1e6}), expected, rtol=1e-8)


def test_the_table_of_a_single_point_is_no_number_that_acts_on_the_values(tmp_path):
    """Neither its position nor its row is a setting of the measurement."""
    file = tmp_path / "part.npz"
    table = {"nodes": ["end"], "directions": ["x"], "positions": [0.03], "rows": [3]}
    np.savez(file, frequency=FREQUENCY, receptance=translations(), **table)
    found = dovetail.load(
        {
            "dovetail": 1,
            "name": "one point",
            "frequency": lines(),
            "substructures": {"part": {"model": "measured", "file": str(file)}},
            "response": {"at": "part", "position": "end", "quantity": "receptance"},
        }
    )
    expected = dovetail.load(
        {
            "dovetail": 1,
            "name": "the beam",
            "frequency": lines(),
            "substructures": {"part": beam()},
            "response": {"at": "part", "position": END, "quantity": "receptance"},
        }
    )
    np.testing.assert_allclose(found.frf(), expected.frf(), rtol=1e-5)
