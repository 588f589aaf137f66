"""Rigid joints at points of rigid bodies, rigid links and skew hinges, against a dense solution with constraints.

The dense side has beams from published shape functions and bodies about their centre of mass. What a joint holds is
written as B u = 0, from u = u0 + theta x r, and solved with Lagrange multipliers.
"""

import numpy as np
import pytest
import scipy.linalg

import dovetail
from dovetail.assembly.constraints import ConstrainedGraph, constrained
from dovetail.synthesis import Engine, Graph
from support import unusual_joints
from support.dense_space import DenseStructure

STEEL = {"young": 210e9, "density": 7850.0, "poisson": 0.3, "loss_factor": 0.01}
MATERIAL = tuple(STEEL[name] for name in ("young", "density", "poisson", "loss_factor"))
SIDES = (0.03, 0.02)
LINES = np.linspace(20.0, 3000.0, 40)


def random_rotation(rng):
    rotation, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    return rotation * np.sign(np.linalg.det(rotation))


class Scene:
    """Beams, bodies and a wall, described for Dovetail and as dense matrices, all turned by one rotation."""

    def __init__(self, rotation=None):
        self.rotation = np.eye(3) if rotation is None else rotation
        self.parts, self.joints, self.firsts = {}, {}, {}
        self.dense, self.used = DenseStructure(40, 30), 0
        self.rows, self.points = [], {}

    def turned(self, vector):
        return self.rotation @ np.asarray(vector, dtype=float)

    def beam(self, name, start, along, across, length=0.3, elements=2):
        e, v = (self.turned(one) / np.linalg.norm(one) for one in (along, across))
        place = {"origin": self.turned(start).tolist(), "along": e.tolist(), "across": v.tolist()}
        section = {"length": length, "height": SIDES[0], "width": SIDES[1], "elements": elements}
        self.parts[name] = {"model": "spatial_beam", "material": STEEL, "sections": [section], "place": place}
        self.dense.add_beam(self.used, elements, length, e, v, MATERIAL, SIDES)
        for number in range(elements + 1):
            at = round(number * length / elements, 9)
            self.points[name, at] = self.turned(start) + at * e, self.used + number
        self.used += elements + 1
        return self

    def body(self, name, origin, nodes, rng):
        """The first DOFs of the dense side are those of the body's centre of mass."""
        center, lengths, mass = rng.uniform(-0.02, 0.02, 3), rng.uniform(0.02, 0.1, 3), 2.5
        axes = random_rotation(rng)
        tensor = mass * axes @ np.diag(lengths @ lengths - lengths**2) @ axes.T
        there = {node: self.turned(np.add(origin, point)) for node, point in nodes.items()}
        self.parts[name] = {
            "model": "rigid_body",
            "mass": mass,
            "inertia": np.diag(tensor).tolist(),
            "products": [tensor[0, 1], tensor[0, 2], tensor[1, 2]],
            "center": center.tolist(),
            "nodes": {node: list(point) for node, point in nodes.items()},
            "place": {
                "origin": self.turned(origin).tolist(),
                "along": (-self.rotation[:, 1]).tolist(),
                "across": self.rotation[:, 0].tolist(),
            },
        }
        middle = self.turned(np.add(origin, center))
        self.dense.add_body(self.used, mass, self.rotation @ tensor @ self.rotation.T, np.zeros(3))
        for node, point in there.items():
            self.points[name, node] = point, self.used, point - middle
        self.used += 1
        return self

    def wall(self, *points):
        self.parts["wall"] = {"model": "ground", "points": [self.turned(point).tolist() for point in points]}
        for number, point in enumerate(points, 1):
            self.points["wall", f"g{number}"] = self.turned(point), None
        return self

    def motion(self, part, at, way=(0.0, 0.0, 0.0)):
        """Return the displacement and rotation (3, d) of a point, a way from a node, by all dense DOFs."""
        _, number, *arm = self.points[part, at]
        u, theta = np.zeros((3, len(self.dense.K))), np.zeros((3, len(self.dense.K)))
        if number is not None:
            arm = np.asarray(way) + (arm[0] if arm else 0.0)
            u[:, 6 * number : 6 * number + 3] = theta[:, 6 * number + 3 : 6 * number + 6] = np.eye(3)
            for axis in range(3):
                u[:, 6 * number + 3 + axis] = np.cross(np.eye(3)[axis], arm)
        return u, theta

    def join(self, name, joint, a, b, displacements=(), rotations=()):
        """Add a joint, which holds motions along some directions and about some."""
        ends = {port: {"to": part, "at": at} for port, (part, at) in {"a": a, "b": b}.items()}
        self.joints[name] = {**joint, "connect": ends}
        way = self.points[b[0], b[1]][0] - self.points[a[0], a[1]][0]
        (u_a, theta_a), (u_b, theta_b) = self.motion(*a, way), self.motion(*b)
        self.rows += [self.turned(direction) @ (u_b - u_a) for direction in displacements]
        self.rows += [self.turned(direction) @ (theta_b - theta_a) for direction in rotations]
        return self

    def described(self, at, direction, force_at, force_direction):
        ends = {"at": at[0], "position": at[1], "direction": self.turned(direction).tolist()}
        force = {"at": force_at[0], "position": force_at[1], "direction": self.turned(force_direction).tolist()}
        return {
            "dovetail": 1,
            "name": "rigid connections",
            "frequency": {"start": LINES[0], "stop": LINES[-1], "lines": len(LINES)},
            "substructures": self.parts,
            "joints": self.joints,
            "response": {**ends, "force": force, "quantity": "receptance"},
        }

    def system(self):
        """Return the dense matrices of the DOFs in use, and the constraints, scaled to one unit."""
        whole = self.dense
        used = np.array([*range(6 * self.used), *range(240, whole.inner)])
        matrices = [matrix[np.ix_(used, used)] for matrix in (whole.M, whole.K, whole.C)]
        return used, matrices, np.array(self.rows)[:, used]

    def receptance(self, at, direction, force_at, force_direction):
        used, (M, K, C), B = self.system()
        (moved, _), (pushed, _) = self.motion(*at), self.motion(*force_at)
        out, load = (
            (self.turned(one) / np.linalg.norm(one)) @ matrix[:, used]
            for one, matrix in ((direction, moved), (force_direction, pushed))
        )
        N = scipy.linalg.null_space(B, rcond=1e-9)
        values = []
        for omega in 2 * np.pi * LINES:
            Z = N.T @ (K + 1j * omega * C - omega**2 * M) @ N
            scale = 1.0 / np.sqrt(np.abs(np.diag(Z)))
            solution = np.linalg.solve(scale[:, None] * Z * scale, scale * (N.T @ load))
            values.append(out @ N @ (scale * solution))
        return np.array(values)


def difference(found, expected):
    return float(np.abs(found - expected).max() / np.abs(expected).max())


EYE = tuple(np.eye(3))
FOOT = {"k": 1e5, "c": 2.0}
ALL = {"displacements": EYE, "rotations": EYE}


def clamped(scene):
    return scene.join("clamp", {"model": "rigid", "direction": "all"}, ("arm", 0.0), ("wall", "g1"), **ALL)


def weld_at_a_carried_node(rng, rotation):
    nodes = {"first": (0.01, 0.02, 0.0), "held": (0.0, 0.0, 0.0), "tip": (0.03, 0.1, -0.02)}
    scene = Scene(rotation).wall((0, 0, 0)).beam("arm", (0, 0, 0), (1, 2, 0.5), (2, -1, 0))
    end = 0.3 * np.array([1, 2, 0.5]) / np.linalg.norm([1, 2, 0.5])
    scene.body("body", end, nodes, rng)
    clamped(scene).join("weld", {"model": "rigid", "direction": "all"}, ("arm", 0.3), ("body", "held"), **ALL)
    return scene, ("body", "tip"), ("arm", 0.15)


def two_welds_to_one_body(rng, rotation):
    """A body that closes a loop of two beams, welded at two points, of which none is its first node."""
    nodes = {"first": (0.02, -0.03, 0.05), "left": (-0.1, 0.0, 0.0), "right": (0.1, 0.0, 0.0)}
    scene = Scene(rotation).wall((-0.1, 0, 0), (0.1, 0, 0)).body("body", (0, 0.3, 0), nodes, rng)
    scene.beam("arm", (-0.1, 0, 0), (0, 1, 0), (1, 0, 0)).beam("other", (0.1, 0, 0), (0, 1, 0), (0, 0, 1))
    clamped(scene)
    weld = {"model": "rigid", "direction": "all"}
    scene.join("clamp_2", weld, ("other", 0.0), ("wall", "g2"), **ALL)
    scene.join("left", weld, ("arm", 0.3), ("body", "left"), **ALL)
    scene.join("right", weld, ("other", 0.3), ("body", "right"), **ALL)
    return scene, ("body", "first"), ("other", 0.15)


def ball_joint_at_a_carried_node(rng, rotation):
    nodes = {"first": (0.05, 0.0, 0.0), "ball": (0.0, 0.0, 0.0), "hook": (0.1, 0.1, 0.0)}
    scene = Scene(rotation).wall((0, 0, 0), (0.1, 0.4, 0.0)).beam("arm", (0, 0, 0), (0, 1, 0), (1, 0, 0))
    scene.body("body", (0, 0.3, 0), nodes, rng)
    clamped(scene).join("ball", {"model": "ball_joint"}, ("arm", 0.3), ("body", "ball"), displacements=EYE)
    scene.join("support", {"model": "ball_joint"}, ("body", "hook"), ("wall", "g2"), displacements=EYE)
    return scene, ("body", "first"), ("arm", 0.15)


def rigid_link(rng, rotation):
    scene = Scene(rotation).wall((0, 0, 0)).beam("arm", (0, 0, 0), (0, 1, 0), (1, 0, 0))
    scene.beam("other", rng.uniform(0.1, 0.3, 3), (1, 1, 0), (1, -1, 0))
    clamped(scene).join("link", {"model": "rigid_link"}, ("arm", 0.3), ("other", 0.0), **ALL)
    return scene, ("other", 0.3), ("arm", 0.15)


def rigid_link_with_a_ball_joint(rng, rotation):
    scene = Scene(rotation).wall((0, 0, 0), (0.4, 0.5, 0.1)).beam("arm", (0, 0, 0), (0, 1, 0), (1, 0, 0))
    scene.beam("other", rng.uniform(0.1, 0.2, 3), (1, 1, 0), (1, -1, 0))
    link = {"model": "rigid_link", "direction": ["x", "y", "z"]}
    clamped(scene).join("link", link, ("arm", 0.3), ("other", 0.15), displacements=EYE)
    scene.join("link_2", {"model": "rigid_link"}, ("wall", "g2"), ("other", 0.3), **ALL)
    return scene, ("other", 0.0), ("arm", 0.15)


def link_between_nodes_of_one_part(rng, rotation):
    """A stiffener: two nodes of one beam keep their distance and do not turn against each other."""
    scene = Scene(rotation).wall((0, 0, 0)).beam("arm", (0, 0, 0), (0, 1, 0), (1, 0, 0), elements=3, length=0.6)
    scene.body("body", (0, 0.2, 0.05), {"first": (0, 0, 0)}, rng)
    clamped(scene).join("link", {"model": "rigid_link"}, ("arm", 0.2), ("arm", 0.4), **ALL)
    scene.join("mass", {"model": "rigid_link"}, ("arm", 0.2), ("body", "first"), **ALL)
    return scene, ("arm", 0.6), ("arm", 0.4)


def hinge_about_a_skew_axis(rng, rotation):
    """The hinge's own axes are described along the turned ones, so that it turns with the scene."""
    frame = random_rotation(rng)
    scene = Scene(rotation).wall((0, 0, 0), (0, 0.6, 0)).beam("arm", (0, 0, 0), (0, 1, 0), (1, 0, 0))
    scene.beam("other", (0, 0.3, 0), (0, 1, 0), (0, 0, 1))
    axes = {"x": scene.turned(frame[:, 0]).tolist(), "z": scene.turned(frame[:, 2]).tolist()}
    clamped(scene).join("hinge", {"model": "hinge", "axes": axes}, ("arm", 0.3), ("other", 0.0), EYE, frame.T[:2])
    return scene, ("other", 0.3), ("arm", 0.15)


def slider_along_a_skew_axis(rng, rotation):
    """A body held at a carried node in all but one direction of a skew frame, at the end of a link."""
    frame = random_rotation(rng)
    scene = Scene(rotation).wall((0, 0, 0)).beam("arm", (0, 0, 0), (0, 1, 0), (1, 0, 0))
    nodes = {"first": (0.0, 0.02, 0.01), "held": (0.0, 0.0, 0.0), "free": (-0.02, 0.0, 0.05)}
    scene.body("body", (0, 0.3, 0), nodes, rng).beam("other", (0.3, 0.4, 0), (1, 0, 0), (0, 0, 1))
    axes = {"x": scene.turned(frame[:, 0]).tolist(), "y": scene.turned(frame[:, 1]).tolist()}
    joint = {"model": "rigid", "direction": ["y", "z", "rx", "ry", "rz"], "axes": axes}
    clamped(scene).join("slider", joint, ("arm", 0.3), ("body", "held"), frame.T[1:], frame.T)
    scene.join("link", {"model": "rigid_link"}, ("body", "free"), ("other", 0.0), **ALL)
    scene.wall((0, 0, 0), (0.3, 0.4, 0))
    scene.joints["foot"] = {
        "model": "bushing",
        "parameters": {f"{letter}_{each}": {"value": v} for each in dovetail.DIRECTIONS for letter, v in FOOT.items()},
        "connect": {"a": {"to": "other", "at": 0.0}, "b": {"to": "wall", "at": "g2"}},
    }
    _, number = scene.points["other", 0.0]
    scene.dense.add_bushing(number, None, np.full(6, FOOT["k"]), np.full(6, FOOT["c"]))
    return scene, ("other", 0.3), ("body", "first")


def random_connections(rng, rotation):
    """Beams and bodies anywhere, and links that hold some directions of skew axes, as a tree and with loops."""
    scene = Scene(rotation).wall((0, 0, 0)).beam("arm", (0, 0, 0), (0, 1, 0), (1, 0, 0))
    ends = {"arm": [0.15, 0.3]}
    for number in range(rng.integers(2, 5)):
        name, frame = f"part_{number}", random_rotation(rng)
        if rng.random() < 0.5:
            scene.beam(name, rng.uniform(-0.3, 0.3, 3), frame[:, 1], frame[:, 0])
            ends[name] = [0.0, 0.15, 0.3]
        else:
            nodes = {node: rng.uniform(-0.1, 0.1, 3).tolist() for node in ("one", "two", "three")}
            scene.body(name, rng.uniform(-0.3, 0.3, 3), nodes, rng)
            ends[name] = list(nodes)
    names = list(ends)
    pairs = [(str(rng.choice(names[:place])), name) for place, name in enumerate(names) if place]
    pairs += [tuple(rng.choice(names, 2, replace=False).tolist()) for _ in range(rng.integers(0, 3))]
    for number, pair in enumerate(pairs):
        frame, held = random_rotation(rng), sorted(rng.choice(6, rng.integers(3, 7), replace=False).tolist())
        axes = {"x": scene.turned(frame[:, 0]).tolist(), "y": scene.turned(frame[:, 1]).tolist()}
        joint = {"model": "rigid_link", "axes": axes, "direction": [dovetail.DIRECTIONS[each] for each in held]}
        a, b = ((part, ends[part][rng.integers(len(ends[part]))]) for part in pair)
        moves, turns = ([frame[:, each % 3] for each in held if each // 3 == kind] for kind in (0, 1))
        scene.join(f"link_{number}", joint, a, b, moves, turns)
    clamped(scene)
    return scene, (names[-1], ends[names[-1]][-1]), ("arm", 0.15)


SCENES = [
    weld_at_a_carried_node,
    two_welds_to_one_body,
    ball_joint_at_a_carried_node,
    rigid_link,
    rigid_link_with_a_ball_joint,
    link_between_nodes_of_one_part,
    hinge_about_a_skew_axis,
    slider_along_a_skew_axis,
    random_connections,
]
OUT, INTO = (1.0, 2.0, 3.0), (2.0, -1.0, 1.0)


def compared(make, seed, rotation=None):
    scene, at, force_at = make(np.random.default_rng(seed), rotation)
    assembly = dovetail.load(scene.described(at, OUT, force_at, INTO))
    return assembly, scene.receptance(at, OUT, force_at, INTO)


@pytest.mark.parametrize("make", SCENES, ids=lambda make: make.__name__)
@pytest.mark.parametrize("seed", range(2))
def test_a_rigid_connection_has_the_frf_of_a_dense_solution_with_constraints(make, seed):
    assembly, expected = compared(make, seed)
    assert isinstance(assembly.graph, ConstrainedGraph)
    assert difference(assembly.frf(), expected) < 1e-8


@pytest.mark.parametrize("make", SCENES, ids=lambda make: make.__name__)
def test_a_turned_structure_has_the_same_frf(make):
    plain, _ = compared(make, 5)
    for seed in range(2):
        turned, _ = compared(make, 5, random_rotation(np.random.default_rng(seed)))
        assert difference(turned.frf(), plain.frf()) < 1e-9


@pytest.mark.slow
@pytest.mark.parametrize("make", SCENES, ids=lambda make: make.__name__)
def test_many_rigid_connections_have_the_frfs_of_dense_solutions(make):
    for seed in range(100, 130):
        assembly, expected = compared(make, seed)
        assert difference(assembly.frf(), expected) < 1e-8, seed


def poles(M, K, C):
    """Return the lowest six natural frequencies [Hz] of dense matrices with structural damping in K."""
    size, inverse = len(K), np.linalg.inv(M)
    companion = np.block([[np.zeros((size, size)), np.eye(size)], [-inverse @ K, -inverse @ C]])
    found = np.linalg.eigvals(companion)
    return np.sort(np.abs(found[found.imag > 1.0]))[:6] / (2 * np.pi)


@pytest.mark.parametrize("make", SCENES, ids=lambda make: make.__name__)
def test_the_natural_frequencies_are_those_of_the_dense_matrices(make):
    scene, at, force_at = make(np.random.default_rng(2), None)
    _, matrices, B = scene.system()
    N = scipy.linalg.null_space(B, rcond=1e-9)
    expected = poles(*(N.T @ matrix @ N for matrix in matrices))
    found = dovetail.load(scene.described(at, OUT, force_at, INTO)).natural_frequencies(count=6)
    np.testing.assert_allclose(found, expected, rtol=1e-6)


def test_the_shape_of_a_mode_moves_both_sides_of_a_rigid_link_as_one_body():
    scene, at, force_at = rigid_link(np.random.default_rng(0), None)
    assembly = dovetail.load(scene.described(at, OUT, force_at, INTO))
    way = scene.points["other", 0.0][0] - scene.points["arm", 0.3][0]
    for mode in assembly.modes(count=4):
        a, b = mode.shapes["arm"][-1], mode.shapes["other"][0]
        np.testing.assert_allclose(b[:3], a[:3] + np.cross(a[3:], way), atol=1e-12 * np.abs(a).max())
        np.testing.assert_allclose(b[3:], a[3:], atol=1e-12 * np.abs(a).max())


def test_derivatives_pass_through_rigid_connections():
    scene, at, force_at = slider_along_a_skew_axis(np.random.default_rng(3), None)
    described = scene.described(at, OUT, force_at, INTO)
    described["substructures"]["body"]["mass"] = {"range": [2.0, 4.0]}
    described["joints"]["foot"]["parameters"]["k_y"] = {"range": [1e4, 1e6], "scale": "log"}
    assembly = dovetail.load(described)
    theta = assembly.vector(None)
    _, jacobian = assembly.frf_jacobian(theta)
    for column in range(2):
        step = np.eye(2)[column] * 1e-5 * theta[column]
        slope = (assembly.frf(theta + step) - assembly.frf(theta - step)) / (2.0 * step[column])
        assert np.abs(jacobian[:, column] - slope).max() < 1e-6 * np.abs(slope).max()


def test_receptances_between_points_are_those_of_responses():
    scene, _, _ = rigid_link(np.random.default_rng(4), None)
    described = scene.described(("other", 0.0), (1, 0, 0), ("arm", 0.3), (0, 0, 1))
    assembly = dovetail.load(described)
    found = assembly.receptance(None, [("other", 0.0, "x")], [("arm", 0.3, "z"), ("other", 0.0, "rx")])
    assert difference(found[:, 0, 0], assembly.frf()) < 1e-12


def test_two_bodies_welded_at_two_points_given_with_seven_digits_are_held_once():
    """The second weld follows from the first but for rounding of the points, and does not hold the bodies."""
    frfs = []
    for shift in (0.0, 4e-9):
        rng = np.random.default_rng(6)
        scene = Scene().wall((0, 0, 0)).beam("arm", (0, 0, 0), (0, 1, 0), (1, 0, 0))
        scene.body("one", (0, 0.3, 0), {"foot": (0, 0, 0), "left": (0.1, 0.05, 0), "right": (-0.1, 0.05, 0)}, rng)
        scene.body("two", (0, 0.3, 0), {"left": (0.1, 0.05, shift), "right": (-0.1, 0.05, 0), "top": (0, 0.2, 0)}, rng)
        weld = {"model": "rigid", "direction": "all"}
        clamped(scene).join("foot", weld, ("arm", 0.3), ("one", "foot"), **ALL)
        scene.join("left", weld, ("one", "left"), ("two", "left"), **ALL)
        scene.join("right", weld, ("one", "right"), ("two", "right"), **ALL)
        frfs.append(dovetail.load(scene.described(("two", "top"), OUT, ("arm", 0.15), INTO)).frf())
        if not shift:
            assert difference(frfs[0], scene.receptance(("two", "top"), OUT, ("arm", 0.15), INTO)) < 1e-8
    assert difference(frfs[1], frfs[0]) < 1e-6


def test_contacts_at_points_of_a_body_and_along_skew_axes_can_be_taken_as_rigid():
    scene, at, force_at = weld_at_a_carried_node(np.random.default_rng(7), None)
    ranges = {"k": (1e4, 1e8, "log"), "c": (1.0, 10.0, "log")}
    axes = {"x": [1.0, 1.0, 0.0], "z": [0.0, 0.0, 1.0]}
    parameters = {
        f"{letter}_{each}": {"range": list(ends[:2]), "scale": ends[2]}
        for each in dovetail.DIRECTIONS
        for letter, ends in ranges.items()
    }
    connect = scene.joints["weld"]["connect"]
    scene.joints["weld"] = {"model": "bushing", "axes": axes, "parameters": parameters, "connect": connect}
    rigid = dovetail.load(scene.described(at, OUT, force_at, INTO)).rigid()
    assert difference(rigid.frf(), scene.receptance(at, OUT, force_at, INTO)) < 1e-8


def test_a_point_that_rigid_connections_hold_is_one_clear_error():
    scene, _, force_at = ball_joint_at_a_carried_node(np.random.default_rng(0), None)
    with pytest.raises(dovetail.DovetailError, match="it measures where rigid connections hold the structure"):
        dovetail.load(scene.described(("body", "hook"), OUT, force_at, INTO)).frf()
    with pytest.raises(dovetail.DovetailError, match="the force acts where rigid connections hold"):
        dovetail.load(scene.described(force_at, OUT, ("body", "hook"), INTO)).frf()


def linked(**parts):
    """Return two beams without places and a link between them, with other parts."""
    section = {"length": 0.3, "height": SIDES[0], "width": SIDES[1], "elements": 2}
    beam = {"model": "spatial_beam", "material": STEEL, "sections": [section]}
    ends = {"a": {"to": "arm", "at": 0.3}, "b": {"to": "other", "at": 0.0}}
    return {
        "dovetail": 1,
        "name": "link",
        "frequency": {"start": 20.0, "stop": 100.0, "lines": 3},
        "substructures": {"arm": dict(beam), "other": dict(beam), **parts},
        "joints": {"link": {"model": "rigid_link", "connect": ends}},
        "response": {"at": "arm", "position": 0.0, "direction": "x"},
    }


PLANAR = {
    "model": "timoshenko_beam",
    "material": STEEL,
    "sections": [{"length": 0.3, "outer": 0.02, "elements": 2}],
}
IMPOSSIBLE = {
    "parts without places": ({}, {}, "nothing says how 'arm' and 'other' lie in space", "Give the parts a 'place'"),
    "a ground without points": ({"other": {"model": "ground"}}, {}, "'other' is everywhere", "points: [[0 mm"),
    "a planar part": ({"arm": PLANAR}, {}, "does not move in y, z, rx, ry", "a node with x, y, z"),
    "no direction": ({}, {"direction": []}, "direction", ""),
    "a direction twice": ({}, {"direction": ["x", "x"]}, "direction", ""),
    "nodes listed twice": ({}, {"nodes": 2}, "'nodes'", ""),
}


@pytest.mark.parametrize("case", IMPOSSIBLE)
def test_a_link_that_is_impossible_is_one_clear_error(case):
    parts, options, problem, remedy = IMPOSSIBLE[case]
    described = linked(**parts)
    described["joints"]["link"] |= options
    with pytest.raises(dovetail.DovetailError) as caught:
        dovetail.load(described)
    assert len(caught.value.faults) == 1
    assert problem in str(caught.value)
    assert remedy in str(caught.value)


def test_a_strut_between_parts_without_places_is_refused_too():
    described = linked()
    described["joints"]["link"] = {**described["joints"]["link"], "model": "strut"}
    with pytest.raises(dovetail.DovetailError, match="nothing says how 'arm' and 'other' lie in space"):
        dovetail.load(described)


class KnownByFrfs(dovetail.SubstructureModel):
    """A part without matrices, with the receptances of another one."""

    name = "known_by_frfs"
    summary = "A part known by its FRFs only"

    def __init__(self, part):
        super().__init__()
        self.part = part

    @property
    def nodes(self):
        return self.part.nodes

    def matrices(self):
        return None

    def receptance(self, frequency, dofs):
        return self.part.receptance(frequency, dofs)


@pytest.mark.parametrize("make", [rigid_link, hinge_about_a_skew_axis], ids=lambda make: make.__name__)
def test_a_part_known_by_its_frfs_is_held_like_one_with_matrices(make):
    scene, at, force_at = make(np.random.default_rng(8), None)
    assembly = dovetail.load(scene.described(at, OUT, force_at, INTO))
    plain, engine = assembly.graph.plain, assembly.engine
    parts = {**plain.substructures, "other": KnownByFrfs(plain.substructures["other"])}
    graph = constrained(Graph(parts, plain.connections))
    theta = {name: np.empty((1, 0)) for name in plain.connections}
    measured = Engine(graph, LINES, engine.system.points, theta, pairs=engine.pairs)
    assert difference(measured.frfs(theta), engine.frfs(theta)) < 1e-6


@pytest.mark.parametrize(
    "chain", [{"mass": {"value": 0.02}}, {"window": {"value": 3.0}}], ids=lambda one: next(iter(one))
)
def test_a_sensor_and_a_window_act_at_a_node_that_follows_others(chain):
    """The same at the other side of the weld, whose DOFs the elimination keeps or solves for in its place."""
    scene, _, force_at = weld_at_a_carried_node(np.random.default_rng(9), None)
    frfs = []
    for at in (("arm", 0.3), ("body", "held")):
        described = scene.described(at, OUT, force_at, INTO)
        described["response"]["calibration"] = chain
        frfs.append(dovetail.load(described).frf())
    assert difference(frfs[1], frfs[0]) < 1e-9
    plain = dovetail.load(scene.described(("arm", 0.3), OUT, force_at, INTO)).frf()
    assert difference(frfs[0], plain) > 1e-4


def test_a_joint_that_merges_an_inner_dof_may_hold_a_carried_node():
    """As with the node listed first, which the body's DOFs are then."""
    frfs = []
    nodes = {"first": (0.03, 0.1, -0.02), "top": (0.0, 0.0, 0.0)}
    for order in (("first", "top"), ("top", "first")):
        scene = Scene().wall((0, 0, 0)).beam("arm", (0, 0, 0), (0, 1, 0), (1, 0, 0), elements=4)
        scene.body("body", (0, 0.3, 0), {name: nodes[name] for name in order}, np.random.default_rng(1))
        clamped(scene)
        values = {"k": 1e6, "phi": 0.5, "eta": 0.05, "c": 20.0, "m": 0.05}
        scene.joints["tripod"] = {
            "model": "tripod",
            "parameters": {name: {"value": value} for name, value in values.items()},
            "connect": {
                "top": {"to": "body", "at": "top"},
                "feet": {"to": "arm", "at": [0.075, 0.225]},
                "absorber": {"to": "arm", "at": 0.3},
            },
        }
        described = scene.described(("body", "top"), OUT, ("arm", 0.15), INTO)
        frfs.append(dovetail.load(described, plugins=[unusual_joints.__file__]).frf())
    assert difference(frfs[0], frfs[1]) < 1e-9


def test_constraints_of_what_the_ground_holds_already_change_nothing():
    """A slider at a clamped node: all that it could hold is held."""
    frfs = []
    for slides in (False, True):
        scene = Scene().wall((0, 0, 0)).beam("arm", (0, 0, 0), (0, 1, 0), (1, 0, 0))
        clamped(scene)
        if slides:
            joint = {"model": "rigid", "direction": ["x"], "axes": {"x": [1, 2, 3]}}
            scene.join("slider", joint, ("arm", 0.0), ("wall", "g1"))
        frfs.append(dovetail.load(scene.described(("arm", 0.3), OUT, ("arm", 0.15), INTO)).frf())
    np.testing.assert_array_equal(frfs[1], frfs[0])
