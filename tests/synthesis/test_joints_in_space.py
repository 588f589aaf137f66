"""Joints in space: bearing, ball joint, hinge, strut and fit, against a dense solution or a solid shaft."""

import numpy as np
import pytest

import dovetail
from support.dense_space import DenseStructure

DIRECTIONS = dovetail.DIRECTIONS
STEEL = {"young": 210e9, "density": 7850.0, "poisson": 0.3, "loss_factor": 0.01}
MATERIAL = tuple(STEEL[name] for name in ("young", "density", "poisson", "loss_factor"))
SIDES = (0.03, 0.02)


def bar(place=None, length=0.3, elements=3):
    section = {"length": length, "height": SIDES[0], "width": SIDES[1], "elements": elements}
    return {"model": "spatial_beam", "material": STEEL, "sections": [section], "place": place or {}}


def described(joint, at=("0 mm", "300 mm"), **more):
    """Return two bars one behind the other, the second one clamped, and a joint between them."""
    clamp = {"a": {"to": "second", "at": "300 mm"}, "b": {"to": "wall", "at": 0.0}}
    connect = joint.pop("ports", {"a": {"to": "first", "at": at[1]}, "b": {"to": "second", "at": at[0]}})
    return {
        "dovetail": 1,
        "name": "two bars",
        "frequency": {"start": 20.0, "stop": 3000.0, "lines": 60},
        "substructures": {"first": bar(), "second": bar({"origin": [0.0, -0.3, 0.0]}), "wall": {"model": "ground"}},
        "joints": {
            "joint": {**joint, "connect": connect},
            "clamp": {"model": "rigid", "direction": "all", "connect": clamp},
        },
        "response": {"at": "first", "position": 0.0, "direction": [1, 2, 3], "quantity": "receptance"},
        **more,
    }


def dense(joint):
    """Return the receptance of the free end along (1, 2, 3), with a joint's stiffness (12, 12) between the bars."""
    whole = DenseStructure(8, 6)
    whole.add_beam(0, 3, 0.3, (0, -1, 0), (1, 0, 0), MATERIAL, SIDES)
    whole.add_beam(4, 3, 0.3, (0, -1, 0), (1, 0, 0), MATERIAL, SIDES)
    between = [*range(18, 24), *range(24, 30)]
    free = np.setdiff1d(np.arange(len(whole.K)), np.arange(42, 48))
    way, values = np.zeros(len(whole.K)), []
    way[:3] = np.array([1.0, 2.0, 3.0]) / np.sqrt(14.0)
    for f in np.linspace(20.0, 3000.0, 60):
        omega = 2 * np.pi * f
        Z = whole.K + 1j * omega * whole.C - omega**2 * whole.M
        Z[np.ix_(between, between)] += joint(omega)
        values.append(way[free] @ np.linalg.solve(Z[np.ix_(free, free)], way[free]))
    return np.array(values)


def difference(found, expected):
    return float(np.abs(found - expected).max() / np.abs(expected).max())


def constrained(held):
    """Return a penalty: much stiffness in the held directions, and none in the others."""

    def joint(omega):
        k = np.array([1e13 if each in held else 0.0 for each in DIRECTIONS])
        return np.block([[np.diag(k), -np.diag(k)], [-np.diag(k), np.diag(k)]])

    return joint


BEARING = {"k": 3e7, "kr": 2e3, "c": 40.0, "cr": 0.3, "m": 0.2, "J": 3e-5, "ka": 2e7, "ca": 30.0}


@pytest.mark.parametrize("ratio", [None, 0.6])
def test_a_bearing_in_space_has_the_frfs_of_a_dense_solution(ratio):
    values = {**BEARING, **({} if ratio is None else {"r": ratio})}
    joint = {
        "model": "bearing",
        "motion": "space",
        "inclined": ratio is not None,
        "parameters": {name: {"value": value} for name, value in values.items()},
        "ports": {"shaft": {"to": "first", "at": "300 mm"}, "housing": {"to": "second", "at": "0 mm"}},
    }

    def stiffness(omega):
        b = BEARING
        k = np.diag([b["k"], b["ka"], b["k"], b["kr"], 0.0, b["kr"]]).astype(complex)
        k += 1j * omega * np.diag([b["c"], b["ca"], b["c"], b["cr"], 0.0, b["cr"]])
        q = (ratio or 0.0) * np.sqrt(b["k"] * b["kr"])
        k[0, 5] += q
        k[5, 0] += q
        k[2, 3] -= q
        k[3, 2] -= q
        ring = omega**2 * np.diag([b["m"]] * 3 + [b["J"], 0.0, b["J"]])
        return np.block([[k - ring, -k], [-k, k]])

    assert difference(dovetail.load(described(joint)).frf(), dense(stiffness)) < 1e-8


def test_a_bearing_turned_about_its_axis_is_the_same():
    """Radial motion along x and z, coupled with tilting, must not prefer a direction."""
    frfs = []
    for angle in ("0 deg", "37 deg", "90 deg"):
        joint = {
            "model": "bearing",
            "motion": "space",
            "inclined": True,
            "axes": {"rotate": [{"about": "y", "angle": angle}]},
            "parameters": {name: {"value": value} for name, value in {**BEARING, "r": 0.5}.items()},
            "ports": {"shaft": {"to": "first", "at": "300 mm"}, "housing": {"to": "second", "at": "0 mm"}},
        }
        frfs.append(dovetail.load(described(joint)).frf())
    assert difference(frfs[1], frfs[0]) < 1e-9
    assert difference(frfs[2], frfs[0]) < 1e-9


@pytest.mark.parametrize(
    ("joint", "held"),
    [
        ({"model": "ball_joint"}, ("x", "y", "z")),
        ({"model": "hinge"}, ("x", "y", "z", "rx", "ry")),
        ({"model": "hinge", "axis": "x"}, ("x", "y", "z", "ry", "rz")),
        ({"model": "hinge", "axis": "x", "axes": {"x": "z", "y": "x"}}, ("x", "y", "z", "rx", "ry")),
    ],
)
def test_a_ball_joint_and_a_hinge_hold_their_directions(joint, held):
    """A joint with six very stiff springs in the held directions."""
    assert difference(dovetail.load(described(joint)).frf(), dense(constrained(held))) < 1e-4


@pytest.mark.parametrize(
    ("short", "long"),
    [
        ({"model": "ball_joint"}, {"model": "rigid", "direction": ["x", "y", "z"]}),
        ({"model": "hinge", "axis": "y"}, {"model": "rigid", "direction": ["x", "y", "z", "rx", "rz"]}),
    ],
)
def test_a_short_name_is_the_rigid_joint_of_its_directions(short, long):
    found, expected = (dovetail.load(described(joint)).frf() for joint in (short, long))
    np.testing.assert_array_equal(found, expected)


def test_a_strut_acts_along_the_line_between_its_nodes():
    """Against a bushing whose x is that line, at nodes of rigid bodies that reach to one point."""
    ends = np.array([[0.0, -0.3, 0.0], [0.2, -0.1, 0.4]])
    line = ends[1] - ends[0]
    whole = {
        "dovetail": 1,
        "name": "strut",
        "frequency": {"start": 20.0, "stop": 3000.0, "lines": 60},
        "substructures": {"first": bar(), "wall": {"model": "ground", "points": [[0.0, 0.0, 0.0], ends[1].tolist()]}},
        "joints": {
            "clamp": {
                "model": "rigid",
                "direction": "all",
                "connect": {"a": {"to": "first", "at": 0.0}, "b": {"to": "wall", "at": "g1"}},
            },
            "strut": {
                "model": "strut",
                "parameters": {"k": {"value": 5e6}, "c": {"value": 100.0}},
                "connect": {"a": {"to": "first", "at": "300 mm"}, "b": {"to": "wall", "at": "g2"}},
            },
        },
        "response": {"at": "first", "position": 0.3, "direction": [1, 2, 3], "quantity": "receptance"},
    }
    beam = DenseStructure(4, 3)
    beam.add_beam(0, 3, 0.3, (0, -1, 0), (1, 0, 0), MATERIAL, SIDES)
    unit, way, expected = line / np.linalg.norm(line), np.array([1.0, 2.0, 3.0]) / np.sqrt(14.0), []
    for f in np.linspace(20.0, 3000.0, 60):
        omega = 2 * np.pi * f
        Z = (beam.K + 1j * omega * beam.C - omega**2 * beam.M)[6:, 6:]
        Z[12:15, 12:15] += (5e6 + 100j * omega) * np.outer(unit, unit)
        load = np.zeros(len(Z))
        load[12:15] = way
        expected.append(load @ np.linalg.solve(Z, load))
    assert difference(dovetail.load(whole).frf(), np.array(expected)) < 1e-9


def fitted(nodes, length=0.06, **values):
    """Return a shaft of 20 mm in a hub of 40 mm, along 60 mm of both."""
    stiff = {"k": 1e17, "ks": 1e17, "c": 0.0, "cs": 0.0, **values}
    shaft = [{"length": 0.14, "outer": 0.02, "elements": 14}, {"length": length, "outer": 0.02, "elements": nodes - 1}]
    hub = [{"length": length, "outer": 0.04, "inner": 0.02, "elements": nodes - 1}]
    at = np.linspace(0.0, length, nodes)
    parts = {
        "shaft": {"model": "spatial_beam", "material": STEEL, "sections": shaft, "place": {}},
        "hub": {"model": "spatial_beam", "material": STEEL, "sections": hub, "place": {"origin": [0.0, -0.14, 0.0]}},
    }
    fit = {
        "model": "interference_fit",
        "length": length,
        "nodes": nodes,
        "motion": "space",
        "diameter": 0.02,
        "connect": {"shaft": {"to": "shaft", "at": (0.14 + at).tolist()}, "hub": {"to": "hub", "at": at.tolist()}},
        "parameters": {name: {"value": value} for name, value in stiff.items()},
    }
    return whole_shaft(parts, {"fit": fit})


def solid_shaft(elements):
    sections = [{"length": 0.14, "outer": 0.02, "elements": 14}, {"length": 0.06, "outer": 0.04, "elements": elements}]
    return whole_shaft({"shaft": {"model": "spatial_beam", "material": STEEL, "sections": sections}}, {})


def whole_shaft(parts, joints):
    return dovetail.load(
        {
            "dovetail": 1,
            "name": "shaft",
            "frequency": {"start": 100.0, "stop": 20000.0, "lines": 20},
            "substructures": parts,
            "joints": joints,
            "response": {"at": "shaft", "position": 0.0, "quantity": "receptance"},
        }
    )


def test_a_stiff_interference_fit_converges_to_the_solid_shaft():
    """Twist and extension exactly; in bending, the shear of two beams is not that of one, see `test_sliding_faces`."""
    exact = solid_shaft(24).natural_frequencies(count=9)
    found = np.array([fitted(nodes).natural_frequencies(count=9) for nodes in (3, 5, 9)])
    errors, straight, bent = np.abs(found / exact - 1.0), [4, 5, 8], [0, 2, 6]
    print(f"twist and extension: {errors[:, straight].max(axis=1)}, bending: {errors[:, bent].max(axis=1)}")
    assert errors[0, straight].max() > errors[2, straight].max()
    assert errors[2, straight].max() < 1e-5
    steps = np.abs(np.diff(found[:, bent], axis=0))
    assert (steps[1] < 0.6 * steps[0] + 3e-5 * exact[bent]).all()
    assert errors[:, bent].max() < 2e-3


def test_an_interference_fit_that_slides_is_softer():
    stiff, sliding = fitted(7), fitted(7, ks=1e3)
    assert sliding.natural_frequencies(count=2)[0] < 0.995 * stiff.natural_frequencies(count=2)[0]


PLACED = {
    "a strut with axes": ({"model": "strut", "axes": {"x": "z"}}, "Leave out 'axes'"),
    "a strut of no length": ({"model": "strut"}, "both are at (0, -300, 0) mm"),
    "a ball joint apart": ({"model": "ball_joint", "at": ("100 mm", "300 mm")}, "it is 100 mm away"),
    "a hinge apart": ({"model": "hinge", "at": ("100 mm", "300 mm")}, "it is 100 mm away"),
    "a bearing apart": (
        {"model": "bearing", "motion": "space", "at": ("100 mm", "300 mm"), "names": ("shaft", "housing")},
        "it is 100 mm away",
    ),
    "a fit in space without a diameter": (
        {"model": "interference_fit", "length": 0.2, "motion": "space"},
        "'diameter'",
    ),
    "a diameter in a plane": ({"model": "interference_fit", "length": 0.2, "diameter": 0.01}, "'diameter'"),
    "inclined in a plane": ({"model": "bearing", "inclined": True}, "'inclined' is for"),
    "a planar bearing": ({"model": "bearing", "motion": "sphere"}, "motion"),
}


@pytest.mark.parametrize("case", PLACED)
def test_a_joint_placed_wrongly_is_one_clear_error(case):
    joint, said = PLACED[case]
    joint = dict(joint)
    at, names = joint.pop("at", ("0 mm", "300 mm")), joint.pop("names", ("a", "b"))
    ports = {names[0]: {"to": "first", "at": at[1]}, names[1]: {"to": "second", "at": at[0]}}
    with pytest.raises(dovetail.DescriptionError) as caught:
        dovetail.load(described({**joint, "ports": ports}))
    assert len(caught.value.faults) == 1, caught.value
    assert said in str(caught.value)
