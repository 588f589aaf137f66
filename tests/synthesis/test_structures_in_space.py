"""FRFs of structures in space against dense solutions from published shape functions, and analytic rods."""

import numpy as np
import pytest

import dovetail
from support.dense_space import DenseStructure

DIRECTIONS = ("x", "y", "z", "rx", "ry", "rz")
STEEL = {"young": 210e9, "density": 7850.0, "poisson": 0.3, "loss_factor": 0.01}


def unit(vector):
    return np.asarray(vector) / np.linalg.norm(vector)


def random_frame(rng):
    """Return a random pair of perpendicular directions."""
    along = unit(rng.normal(size=3))
    return along, unit(np.cross(along, rng.normal(size=3)))


def beam(length, sides, elements, origin, along, across, **others):
    section = {"length": length, "height": sides[0], "width": sides[1], "elements": elements}
    place = {"origin": [float(c) for c in origin], "along": along.tolist(), "across": across.tolist()}
    return {"model": "spatial_beam", "material": STEEL, "sections": [section], "place": place, **others}


def values(prefix, numbers):
    return {f"{prefix}_{each}": {"value": float(v)} for each, v in zip(DIRECTIONS, numbers, strict=True)}


def random_structure(seed):
    """Return the description of two or three beams and their bushings at random places, and its dense solution."""
    rng = np.random.default_rng(seed)
    parts, joints, count = {}, {}, int(rng.integers(2, 4))
    elements = rng.integers(2, 5, count)
    first = np.concatenate([[0], np.cumsum(elements + 1)])
    dense = DenseStructure(int(first[-1]), int(elements.sum()))
    frames, origins, lengths = [], [], rng.uniform(0.1, 0.5, count)
    material = tuple(STEEL[name] for name in ("young", "density", "poisson", "loss_factor"))
    for number in range(count):
        along, across = random_frame(rng)
        node = int(rng.integers(0, elements[number] + 1))
        on_own = lengths[number] * node / elements[number]
        if number == 0:
            meets = rng.uniform(-1.0, 1.0, 3)
        else:
            other = int(rng.integers(0, elements[number - 1] + 1))
            meets = origins[-1] + frames[-1][0] * lengths[number - 1] * other / elements[number - 1]
        origins.append(meets - along * on_own)
        frames.append((along, across))
        sides = rng.uniform(0.01, 0.04, 2)
        parts[f"p{number}"] = beam(lengths[number], sides, int(elements[number]), origins[-1], along, across)
        dense.add_beam(first[number], int(elements[number]), lengths[number], along, across, material, sides)
        stiffness = 10.0 ** np.concatenate([rng.uniform(6, 9, 3), rng.uniform(3, 6, 3)])
        damping = 10.0 ** np.concatenate([rng.uniform(0, 3, 3), rng.uniform(-2, 1, 3)])
        joint = {"model": "bushing", "parameters": {**values("k", stiffness), **values("c", damping)}}
        if number == 0:
            parts["wall"] = {"model": "ground"}
            joint["connect"] = {"a": {"to": "p0", "at": f"n{node + 1}"}, "b": {"to": "wall", "at": 0.0}}
            dense.add_bushing(first[0] + node, None, stiffness, damping)
        else:
            joint["connect"] = {
                "a": {"to": f"p{number}", "at": f"n{node + 1}"},
                "b": {"to": f"p{number - 1}", "at": f"n{other + 1}"},
            }
            dense.add_bushing(first[number] + node, first[number - 1] + other, stiffness, damping)
        joints[f"j{number}"] = joint
    ends = [
        (part, int(rng.integers(0, elements[part] + 1)), int(rng.integers(0, 6))) for part in rng.integers(0, count, 2)
    ]
    (at, out, moved), (by, into, pushed) = ends
    description = {
        "dovetail": 1,
        "name": f"space {seed}",
        "frequency": {"start": 20.0, "stop": 4000.0, "lines": 40},
        "substructures": parts,
        "joints": joints,
        "response": {
            "at": f"p{at}",
            "position": f"n{out + 1}",
            "direction": DIRECTIONS[moved],
            "quantity": "receptance",
            "force": {"at": f"p{by}", "position": f"n{into + 1}", "direction": DIRECTIONS[pushed]},
        },
    }
    dofs = 6 * (first[at] + out) + moved, 6 * (first[by] + into) + pushed
    return description, dense, dofs


def largest_difference(values, expected):
    return float(np.abs(values - expected).max() / np.abs(expected).max())


def check_random_structures(seeds):
    worst = 0.0
    for seed in seeds:
        description, dense, dofs = random_structure(seed)
        assembly = dovetail.load(description)
        worst = max(worst, largest_difference(assembly.frf(), dense.receptance(assembly.frequency, *dofs)))
    return worst


def test_random_structures_with_random_places_have_the_frfs_of_a_dense_solution():
    assert check_random_structures(range(4)) < 1e-8


@pytest.mark.slow
def test_500_random_structures_with_random_places_have_the_frfs_of_a_dense_solution():
    worst = check_random_structures(range(1000, 1500))
    print(f"largest difference over the largest value: {worst:.1e}")
    assert worst < 1e-8


def joined_at_random_axes(seed):
    """Return two beams, one upon the other, with a bushing along axes of its own, and the dense solution."""
    rng = np.random.default_rng(seed)
    (along, across), (other_along, other_across) = random_frame(rng), random_frame(rng)
    x, z = random_frame(rng)
    axes = np.column_stack([x, np.cross(z, x), z])
    stiffness = 10.0 ** np.concatenate([rng.uniform(6, 8, 3), rng.uniform(3, 5, 3)])
    damping = 10.0 ** np.concatenate([rng.uniform(0, 3, 3), rng.uniform(-2, 1, 3)])
    tip = 0.3 * along
    description = {
        "dovetail": 1,
        "name": "axes",
        "frequency": {"start": 20.0, "stop": 4000.0, "lines": 30},
        "substructures": {
            "lower": beam(0.3, (0.03, 0.02), 3, np.zeros(3), along, across),
            "upper": beam(0.2, (0.01, 0.02), 2, tip, other_along, other_across),
            "wall": {"model": "ground", "points": [[0.0, 0.0, 0.0]]},
        },
        "joints": {
            "foot": {
                "model": "rigid",
                "direction": "all",
                "connect": {"a": {"to": "lower", "at": 0.0}, "b": {"to": "wall", "at": [[0.0, 0.0, 0.0]]}},
            },
            "middle": {
                "model": "bushing",
                "axes": {"x": x.tolist(), "z": z.tolist()},
                "connect": {"a": {"to": "lower", "at": 0.3}, "b": {"to": "upper", "at": [tip.tolist()]}},
                "parameters": {**values("k", stiffness), **values("c", damping)},
            },
        },
        "response": {"at": "upper", "position": "n3", "direction": "y", "quantity": "receptance"},
    }
    material = tuple(STEEL[name] for name in ("young", "density", "poisson", "loss_factor"))
    dense = DenseStructure(7, 5)
    dense.add_beam(0, 3, 0.3, along, across, material, (0.03, 0.02))
    dense.add_beam(4, 2, 0.2, other_along, other_across, material, (0.01, 0.02))
    dense.add_bushing(3, 4, stiffness, damping, axes)
    held = np.arange(6, 52)
    for name in ("M", "K", "C"):
        setattr(dense, name, getattr(dense, name)[np.ix_(held, held)])
    return description, dense, 5 * 6 + 1


@pytest.mark.parametrize("seed", range(6))
def test_a_joint_acts_along_axes_of_its_own(seed):
    description, dense, dof = joined_at_random_axes(seed)
    assembly = dovetail.load(description)
    assert largest_difference(assembly.frf(), dense.receptance(assembly.frequency, dof, dof)) < 1e-9


def test_the_derivatives_of_a_joint_with_axes_of_its_own_are_those_of_its_frf():
    description, _, _ = joined_at_random_axes(1)
    parameters = description["joints"]["middle"]["parameters"]
    for name in ("k_x", "k_rz", "c_y"):
        value = parameters[name]["value"]
        parameters[name] = {"range": [0.5 * value, 2.0 * value]}
    assembly = dovetail.load(description)
    theta = assembly.vector(None)
    _, jacobian = assembly.frf_jacobian(theta)
    for column, value in enumerate(theta):
        step = np.zeros(len(theta))
        step[column] = 1e-4 * value
        ahead, back, further, rear = (assembly.frf(theta + k * step) for k in (1, -1, 2, -2))
        slope = (8.0 * (ahead - back) - (further - rear)) / (12.0 * step[column])
        assert largest_difference(jacobian[:, column], slope) < 1e-7


def rod(elements, direction, length=0.5):
    """Return a free round rod, loaded at its end along or about its axis."""
    section = {"length": length, "outer": 0.02, "elements": elements}
    material = {**STEEL, "loss_factor": 0.0}
    return {
        "dovetail": 1,
        "name": "rod",
        "frequency": {"start": 500.0, "stop": 9000.0, "lines": 60},
        "substructures": {
            "rod": {
                "model": "spatial_beam",
                "material": material,
                "sections": [section],
                "place": {"along": "x", "across": "z"},
            }
        },
        "response": {"at": "rod", "position": length, "direction": direction, "quantity": "receptance"},
    }


@pytest.mark.parametrize(("direction", "about"), [("x", False), ("rx", True)])
def test_rods_in_extension_and_torsion_converge_to_the_analytic_solution_with_the_fourth_order(direction, about):
    """A free rod: H = -cot(k L) / (E A k), with k = omega / c; for torsion G and the polar moment."""
    area, polar, length = np.pi / 4 * 0.02**2, np.pi / 32 * 0.02**4, 0.5
    modulus = STEEL["young"] / (2 * (1 + STEEL["poisson"])) if about else STEEL["young"]
    stiffness = modulus * (polar if about else area)
    errors = []
    for elements in (8, 16, 32, 64):
        assembly = dovetail.load(rod(elements, direction))
        wave = 2 * np.pi * assembly.frequency / np.sqrt(modulus / STEEL["density"])
        exact = -1.0 / (stiffness * wave * np.tan(wave * length))
        values = assembly.frf()
        errors.append(np.median(np.abs(values - exact) / np.abs(exact)))
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert errors[-1] < 1e-6
    np.testing.assert_allclose(orders, 4.0, atol=0.3)


def test_natural_frequencies_of_free_rods_are_those_of_the_analytic_solution():
    """n c / 2 L in extension and torsion, among them those in bending in two planes, which come in pairs."""
    assembly = dovetail.load(rod(64, "x"))
    found = assembly.natural_frequencies(count=14)
    for modulus in (STEEL["young"], STEEL["young"] / (2 * (1 + STEEL["poisson"]))):
        first = np.sqrt(modulus / STEEL["density"]) / (2 * 0.5)
        assert np.abs(found / first - 1.0).min() < 1e-6


def test_a_structure_that_is_turned_as_a_whole_keeps_its_frfs():
    """Half a turn and right angles about the three axes, and the directions of the response with them."""
    description, _, _ = random_structure(3)
    expected = dovetail.load(description).frf()
    for turn, names in (
        ((0, 1, 2), ("x", "y", "z")),
        ((1, 2, 0), ("y", "z", "x")),
        ((2, 0, 1), ("z", "x", "y")),
    ):
        turned, _, _ = random_structure(3)
        for part in turned["substructures"].values():
            place = part.get("place", {})
            for key in place:
                place[key] = [place[key][turn.index(axis)] for axis in range(3)]
        for joint in turned["joints"].values():
            moved = {}
            for name, entry in joint["parameters"].items():
                letter, direction = name.split("_")
                moved[f"{letter}_{direction.replace(direction[-1], names['xyz'.index(direction[-1])])}"] = entry
            joint["parameters"] = moved
        for place in (turned["response"], turned["response"]["force"]):
            last = place["direction"][-1]
            place["direction"] = place["direction"].replace(last, names["xyz".index(last)])
        assert largest_difference(dovetail.load(turned).frf(), expected) < 1e-9


def test_a_beam_described_from_either_end_has_the_same_frf():
    description, _, _ = random_structure(5)
    expected = dovetail.load(description).frf()
    part = description["substructures"]["p0"]
    place, section = part["place"], part["sections"][0]
    tip = np.asarray(place["origin"]) + section["length"] * np.asarray(place["along"])
    place |= {"origin": tip.tolist(), "along": (-np.asarray(place["along"])).tolist()}

    def renamed(entry):
        if entry.get("to", entry.get("at")) == "p0":
            key = "at" if "to" in entry else "position"
            entry[key] = f"n{section['elements'] + 2 - int(entry[key][1:])}"

    for joint in description["joints"].values():
        for end in joint["connect"].values():
            renamed(end)
    response = description["response"]
    renamed(response)
    renamed(response["force"])
    assert largest_difference(dovetail.load(description).frf(), expected) < 1e-9
    place |= {"along": (-np.asarray(place["along"])).tolist()}
    part["reversed"] = True
    assert largest_difference(dovetail.load(description).frf(), expected) < 1e-9


def test_an_unknown_dimension_of_a_placed_beam_has_the_derivative_of_its_frf():
    description, _, _ = random_structure(7)
    description["substructures"]["p0"]["sections"][0]["height"] = {"range": [0.015, 0.03]}
    assembly = dovetail.load(description)
    theta = assembly.vector(None)
    frf, jacobian = assembly.frf_jacobian(theta)
    known, _, _ = random_structure(7)
    known["substructures"]["p0"]["sections"][0]["height"] = float(theta[0])
    assert largest_difference(frf, dovetail.load(known).frf()) < 1e-9
    step = 1e-5 * theta[0]
    slope = (assembly.frf(theta + step) - assembly.frf(theta - step)) / (2 * step)
    assert largest_difference(jacobian[:, 0], slope) < 1e-5


@pytest.mark.parametrize("seed", range(4))
def test_skew_directions_of_sensor_and_force_are_sums_of_those_along_the_axes(seed):
    description, dense, _ = random_structure(seed)
    rng = np.random.default_rng(seed)
    out, into = unit(rng.normal(size=3)), unit(rng.normal(size=3))
    response = {"at": "p0", "position": "n1", "direction": (3.0 * out).tolist(), "quantity": "receptance"}
    response["force"] = {"at": "p1", "position": "n2", "direction": into.tolist()}
    first = 6 * (description["substructures"]["p0"]["sections"][0]["elements"] + 1)
    moved, pushed = np.zeros(len(dense.K)), np.zeros(len(dense.K))
    moved[:3], pushed[first + 6 : first + 9] = out, into
    assembly = dovetail.load({**description, "response": response})
    assert largest_difference(assembly.frf(), dense.receptance(assembly.frequency, moved, pushed)) < 1e-8
    amplitude = np.abs(assembly.frf() * -((2 * np.pi * assembly.frequency) ** 2))
    np.testing.assert_allclose(assembly.accelerance_amplitude(), amplitude, rtol=1e-5)


def test_derivatives_and_interpolation_of_a_skew_direction_are_those_of_its_frf():
    description, _, _ = random_structure(2)
    description["joints"]["j0"]["parameters"]["k_x"] = {"range": [1e6, 1e9], "scale": "log"}
    description["response"] = {"at": "p0", "position": "n1", "direction": [1, 2, -1]}
    assembly = dovetail.load(description)
    theta = assembly.vector(None)
    frf, jacobian = assembly.frf_jacobian(theta)
    assert largest_difference(frf, assembly.frf(theta)) < 1e-12
    step = 1e-5 * theta
    slope = (assembly.frf(theta + step) - assembly.frf(theta - step)) / (2 * step)
    assert largest_difference(jacobian[:, 0], slope) < 1e-6
    batch = assembly.from_unit(np.linspace(0.1, 0.9, 64)[:, None])
    assert largest_difference(assembly.interpolated().frf(batch), assembly.frf(batch)) < 1e-6


def test_a_direction_with_a_minus_is_the_opposite_one():
    description, _, _ = random_structure(2)
    response = {"at": "p0", "position": "n1", "force": {"position": "n2", "direction": "y"}}
    ahead, back = (
        dovetail.load({**description, "response": {**response, "direction": direction}}).frf()
        for direction in ("x", "-x")
    )
    np.testing.assert_allclose(back, -ahead, rtol=1e-12)


def test_a_structure_that_is_turned_by_any_rotation_keeps_its_frfs():
    """Places, axes of joints, and the directions of sensor and force turn together."""
    description, _, _ = joined_at_random_axes(4)
    description["response"] |= {"direction": [0.2, 0.5, -0.8], "force": {"position": "n2", "direction": "x"}}
    expected = dovetail.load(description).frf()
    rotation, _ = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))
    rotation *= np.sign(np.linalg.det(rotation))

    def turned(vector):
        return (rotation @ np.asarray({"x": [1.0, 0.0, 0.0]}.get(vector, vector) if vector == "x" else vector)).tolist()

    for part in description["substructures"].values():
        for key in part.get("place", {}):
            part["place"][key] = turned(part["place"][key])
    middle = description["joints"]["middle"]
    middle["axes"] = {key: turned(vector) for key, vector in middle["axes"].items()}
    middle["connect"]["b"]["at"] = "n1"
    response = description["response"]
    response["direction"] = turned(response["direction"])
    response["force"]["direction"] = turned("x")
    assert largest_difference(dovetail.load(description).frf(), expected) < 1e-9
