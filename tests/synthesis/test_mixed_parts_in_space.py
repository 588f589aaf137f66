"""Beams, imported matrices, measured parts and bodies in random places, joined in any way, against a dense solution."""

from dataclasses import dataclass, field

import numpy as np
import pytest
from scipy.linalg import null_space

import dovetail
from dovetail import DIRECTIONS
from support.dense_space import DenseStructure

STEEL = {"young": 210e9, "density": 7850.0, "poisson": 0.3, "loss_factor": 0.02}
BAND = {"start": 20.0, "stop": 1500.0, "lines": 25}
HALF_TURN = np.diag([1.0, -1.0, -1.0])
"""What `reversed` does to a part before it is placed."""
HELD = {"rigid": (0, 1, 2, 3, 4, 5), "ball_joint": (0, 1, 2), "hinge": (0, 1, 2, 3, 4)}


@dataclass
class Part:
    """A part in its own axes: its section, its dense matrices, its nodes, and where it lies in the assembly."""

    section: dict
    dense: DenseStructure
    labels: list
    points: np.ndarray
    constraints: list = field(default_factory=list)
    reached: list = field(default_factory=list)
    turn: np.ndarray = field(default_factory=lambda: np.eye(3))
    origin: np.ndarray = field(default_factory=lambda: np.zeros(3))

    def point(self, node):
        return self.origin + self.turn @ self.points[node]

    def rotation(self):
        """The matrix that turns the DOFs of the nodes from the part's axes to the assembly's."""
        T = np.eye(len(self.dense.K))
        for first in range(0, 6 * len(self.labels), 3):
            T[first : first + 3, first : first + 3] = self.turn
        return T


def unit(vector):
    return np.asarray(vector) / np.linalg.norm(vector)


def frame(rng):
    """Return two random perpendicular directions."""
    first = unit(rng.normal(size=3))
    return first, unit(np.cross(first, rng.normal(size=3)))


def about(axis, degrees):
    """Return the rotation about an axis (Rodrigues)."""
    x, y, z = unit(axis)
    cross, angle = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]), np.deg2rad(degrees)
    return np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross


def random_place(rng):
    """Return a place without its origin, and its rotation: by two directions, or by one to three rotations."""
    if rng.random() < 0.4:
        along, across = frame(rng)
        return {"along": along.tolist(), "across": across.tolist()}, np.column_stack(
            [across, -along, np.cross(across, -along)]
        )
    turns, rotation = [], np.eye(3)
    for _ in range(rng.integers(1, 4)):
        axis, degrees = rng.normal(size=3), float(rng.uniform(-180.0, 180.0))
        turns.append({"about": axis.tolist(), "angle": f"{degrees!r} deg"})
        rotation = about(axis, degrees) @ rotation
    return {"rotate": turns}, rotation


def body(rng):
    mass, center, points = rng.uniform(0.1, 3.0), rng.uniform(-0.05, 0.05, 3), rng.uniform(-0.1, 0.1, (3, 3))
    moments = mass * 1e-3 * (1.0 + rng.random(3))
    dense = DenseStructure(3, 0)
    dense.add_body(0, mass, np.diag(moments), center - points[0])
    constraints = []
    for node in (1, 2):
        rows = np.zeros((6, 18))
        rows[:, :6], rows[:, 6 * node : 6 * node + 6] = np.eye(6), -np.eye(6)
        rows[:3, 3:6] = np.cross(np.eye(3), points[node] - points[0]).T
        constraints.append(rows)
    labels = [f"q{node}" for node in range(3)]
    nodes = dict(zip(labels, points.tolist(), strict=True))
    section = {"model": "rigid_body", "mass": mass, "inertia": moments.tolist(), "center": center.tolist()}
    return Part(section | {"nodes": nodes}, dense, labels, points, constraints)


def bar(rng, along, across, origin):
    """Return the dense matrices and the points of a bar, and the section of the beam that it is."""
    elements, length, sides = int(rng.integers(2, 5)), rng.uniform(0.1, 0.4), rng.uniform(0.01, 0.03, 2)
    dense = DenseStructure(elements + 1, elements)
    dense.add_beam(0, elements, length, along, across, tuple(STEEL.values()), sides)
    points = origin + np.outer(np.linspace(0.0, length, elements + 1), along)
    section = {"length": length, "height": sides[0], "width": sides[1], "elements": elements}
    return dense, points, {"model": "spatial_beam", "material": STEEL, "sections": [section]}


def table(points, nodes):
    columns = {f"point_{axis}": np.repeat(points[:, number], 6) for number, axis in enumerate("xyz")}
    return {"nodes": np.repeat(nodes, 6), "directions": list(DIRECTIONS) * len(nodes), **columns}


def beam(rng):
    dense, points, section = bar(rng, np.array([0.0, -1.0, 0.0]), np.array([1.0, 0.0, 0.0]), np.zeros(3))
    return Part(section, dense, [f"n{node + 1}" for node in range(len(points))], points)


def imported(rng, file):
    """Return a bar from a file in m or mm, with shuffled rows and directions of either sense."""
    dense, points, _ = bar(rng, *frame(rng), rng.uniform(-0.2, 0.2, 3))
    labels, outer, length = [f"k{node}" for node in range(len(points))], 6 * len(points), rng.choice([1.0, 1e-3])
    sense = rng.choice([-1.0, 1.0], 6)
    scale = np.ones(len(dense.K))
    scale[:outer] = np.tile(sense * np.repeat([1.0, 1.0 / length], 3), len(points))
    order = rng.permutation(len(scale))
    arrays = {name: (np.outer(scale, scale) * getattr(dense, name).real)[np.ix_(order, order)] for name in ("K", "M")}
    np.savez(file, **arrays, **table(points / length, labels), rows=np.argsort(order)[:outer] + 1)
    axes = {one: f"{'-' if sign < 0 else ''}{one}" for one, sign in zip(DIRECTIONS, sense, strict=True)}
    section = {"model": "matrices", "file": str(file), "axes": axes, "units": {"length": length}}
    return Part(section | {"loss_factor": STEEL["loss_factor"]}, dense, labels, points)


def measured(rng, file):
    """Return a bar of which two nodes were measured, on the assembly's lines among others."""
    dense, points, _ = bar(rng, *frame(rng), rng.uniform(-0.2, 0.2, 3))
    labels = [f"m{node}" for node in range(len(points))]
    frequency = np.unique([*np.linspace(BAND["start"], BAND["stop"], BAND["lines"]), *np.linspace(15.0, 1600.0, 300)])
    omega = 2.0 * np.pi * frequency[:, np.newaxis, np.newaxis]
    receptance = np.linalg.inv(dense.K - omega**2 * dense.M)
    chosen = np.sort(rng.choice(len(points), 2, replace=False))
    rows = (6 * chosen[:, np.newaxis] + np.arange(6)).ravel()
    known = table(points[chosen], [labels[node] for node in chosen])
    np.savez(file, frequency=frequency, receptance=receptance[:, rows[:, np.newaxis], rows], **known)
    return Part({"model": "measured", "file": str(file)}, dense, labels, points, reached=chosen.tolist())


class Mixed:
    """Two or three random parts in a row, the first one on a wall, and their dense solution."""

    def __init__(self, seed, folder):
        self.rng = np.random.default_rng(seed)
        makers = [
            beam,
            body,
            *(lambda rng, make=make: make(rng, folder / f"{len(self.parts)}.npz") for make in (imported, measured)),
        ]
        self.parts, self.joints, self.meets = [], {}, []
        for _ in range(int(self.rng.integers(2, 4))):
            part = makers[int(self.rng.integers(len(makers)))](self.rng)
            part.reached = part.reached or list(range(len(part.labels)))
            self._place(part)
        self.firsts = np.cumsum([0, *(len(part.dense.K) for part in self.parts)])
        size = int(self.firsts[-1])
        self.K, self.M, self.C = (np.zeros((size, size), dtype=complex) for _ in range(3))
        self.constraints = []
        for part, first in zip(self.parts, self.firsts, strict=False):
            T, dofs = part.rotation(), slice(first, first + len(part.dense.K))
            self.K[dofs, dofs], self.M[dofs, dofs] = T @ part.dense.K @ T.T, T @ part.dense.M @ T.T
            for rows in part.constraints:
                self.constraints.append(np.zeros((6, size)))
                self.constraints[-1][:, dofs] = rows @ T.T
        for number in range(len(self.parts)):
            self._join(number)

    def _place(self, part):
        """Turn the part, and bring one of its nodes to one of the part before it."""
        place, part.turn = random_place(self.rng)
        if self.rng.random() < 0.4:
            part.section["reversed"], part.turn = True, part.turn @ HALF_TURN
        meeting, node = self.rng.uniform(-1.0, 1.0, 3), int(self.rng.choice(part.reached))
        if self.parts:
            other = int(self.rng.choice(self.parts[-1].reached))
            meeting = self.parts[-1].point(other)
        self.meets.append((node, other if self.parts else None))
        part.origin = meeting - part.turn @ part.points[node]
        part.section["place"] = {**place, "origin": part.origin.tolist()}
        self.parts.append(part)

    def _motion(self, number, node):
        """The rows (6, d) of the motion of a node."""
        first = self.firsts[number] + 6 * node
        return np.eye(len(self.K))[first : first + 6]

    def _join(self, number):
        """Join a part to the one before it, or the first one to the wall, about skew axes."""
        node, other = self.meets[number]
        x, y = frame(self.rng)
        axes, relative = np.column_stack([x, y, np.cross(x, y)]), self._motion(number, node)
        ends = {"a": {"to": f"p{number}", "at": self.parts[number].labels[node]}, "b": {"to": "wall", "at": 0.0}}
        model = "bushing"
        if number:
            relative = relative - self._motion(number - 1, other)
            ends["b"] = {"to": f"p{number - 1}", "at": self.parts[number - 1].labels[other]}
            model = str(self.rng.choice(["bushing", *HELD]))
        along = np.kron(np.eye(2), axes.T) @ relative
        joint = {"model": model, "connect": ends, "axes": {"x": x.tolist(), "z": axes[:, 2].tolist()}}
        if model == "bushing":
            stiffness = 10.0 ** self.rng.uniform([6.0] * 3 + [3.0] * 3, [9.0] * 3 + [6.0] * 3)
            damping = 10.0 ** self.rng.uniform([0.0] * 3 + [-2.0] * 3, [3.0] * 3 + [1.0] * 3)
            self.K += along.T @ np.diag(stiffness) @ along
            self.C += along.T @ np.diag(damping) @ along
            both = (("k", stiffness), ("c", damping))
            joint["parameters"] = {
                f"{name}_{one}": {"value": float(value)}
                for name, values in both
                for one, value in zip(DIRECTIONS, values, strict=True)
            }
        else:
            self.constraints.append(along[list(HELD[model])])
            joint |= {"direction": "all"} if model == "rigid" else {}
        self.joints[f"j{number}"] = joint

    def difference(self):
        """Return the difference of an FRF between skew directions from the dense one, over its largest value."""
        ends, rows = [], []
        for _ in range(2):
            number, direction = int(self.rng.integers(len(self.parts))), unit(self.rng.normal(size=3))
            node = int(self.rng.choice(self.parts[number].reached))
            place = {"at": f"p{number}", "position": self.parts[number].labels[node], "direction": direction.tolist()}
            ends.append(place)
            rows.append(direction @ self._motion(number, node)[:3])
        assembly = dovetail.load({
            "dovetail": 1, "name": "mixed", "frequency": BAND, "joints": self.joints,
            "substructures": {"wall": {"model": "ground"}, **{f"p{n}": p.section for n, p in enumerate(self.parts)}},
            "response": {**ends[0], "quantity": "receptance", "force": ends[1]},
        })  # fmt: skip
        free = null_space(np.vstack(self.constraints)) if self.constraints else np.eye(len(self.K))
        K, M, C = (free.T @ matrix @ free for matrix in (self.K, self.M, self.C))
        output, force = (free.T @ row for row in rows)
        omega = 2.0 * np.pi * assembly.frequency
        expected = np.array([output @ np.linalg.solve(K + 1j * w * C - w**2 * M, force) for w in omega])
        return float(np.abs(assembly.frf() - expected).max() / np.abs(expected).max())


@pytest.mark.parametrize("seed", range(8))
def test_mixed_parts_have_the_frfs_of_a_dense_solution(seed, tmp_path):
    assert Mixed(seed, tmp_path).difference() < 1e-7


@pytest.mark.slow
def test_200_mixtures_of_parts_have_the_frfs_of_a_dense_solution(tmp_path):
    assert max(Mixed(seed, tmp_path).difference() for seed in range(100, 300)) < 1e-7
