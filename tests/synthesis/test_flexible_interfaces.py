"""Measured parts whose interfaces deform, joined at contacts, against dense solutions and coupling by receptances."""

from __future__ import annotations

import numpy as np
import pytest
import scipy

import dovetail
from dovetail import DIRECTIONS, FLEXIBLE_MODES, MeasuredDofs, VirtualPoint, VirtualPoints, couple, interface_modes
from dovetail.assembly import find_warnings

FREQUENCY = np.arange(40.0, 1200.0, 10.0)
DEFORMATIONS = ("ex", "sxy", "bzx")
HEAD = np.array([0.0, -0.4, 0.0])
CONTACTS = {
    "bolt_1": (0.03, 0.01, 0.02),
    "bolt_2": (-0.03, 0.02, 0.02),
    "bolt_3": (-0.02, -0.01, -0.03),
    "bolt_4": (0.02, -0.03, -0.02),
}
TURN = [{"about": [1, 2, 3], "angle": "40 deg"}]
ORIGIN = np.array([0.1, 0.2, 0.3])
BODY = {"mass": 3.0, "inertia": [4e-3, 5e-3, 6e-3]}
STIFFNESS, DAMPING = (2e6, 3e6, 4e6), (20.0, 30.0, 40.0)
ROTARY, ROTARY_DAMPING = (2e3, 3e3, 5e3), (0.02, 0.03, 0.05)
TURNS = {
    "ex": lambda x, y, z: (0.0, 0.0, 0.0),
    "sxy": lambda x, y, z: (0.0, 0.0, -x / 2.0),
    "bzx": lambda x, y, z: (0.0, z, 0.0),
}
"""Rotations of the material by the deformations (x, 0, 0), (x y, 0, 0) and (z^2 / 2, 0, -x z), written out."""


class Part:
    """A structure with the motion of two points and the deformations of the first one as its DOFs."""

    def __init__(self, seed, deformations=DEFORMATIONS, contacts=None, turn=TURN):
        random = np.random.default_rng(seed)
        self.deformations, self.contacts, self.turn = deformations, contacts or CONTACTS, turn
        self.modes = (*DIRECTIONS, *deformations)
        self.channels, self.impacts = self._around(random, "s"), self._around(random, "h")
        foot = [number < 15 for number in range(27)]
        self.foot = tuple(np.flatnonzero(foot).tolist()), tuple(np.flatnonzero(np.logical_not(foot)).tolist())
        lengths = np.linalg.norm(self._motion(self.channels), axis=0) / np.sqrt(15.0)
        mass, both = np.diag(random.uniform(0.5, 2.0, len(lengths))), np.diag(lengths)
        shape = random.standard_normal((len(lengths), len(lengths)))
        stiffness = both @ (3e6 * shape @ shape.T) @ both
        self.matrices = both @ mass @ both, stiffness, 1e-5 * stiffness
        self.receptance = np.stack([np.linalg.inv(Z) for Z in self.stiffness()])
        self.frfs = self._motion(self.channels) @ self.receptance @ self._motion(self.impacts).T

    def stiffness(self):
        """Return the dynamic stiffness (n_freq, d, d)."""
        M, K, C = self.matrices
        return [K + 2j * np.pi * f * C - (2 * np.pi * f) ** 2 * M for f in FREQUENCY]

    def _around(self, random, prefix):
        places = np.concatenate([random.uniform(-0.04, 0.04, (15, 3)), HEAD + random.uniform(-0.04, 0.04, (12, 3))])
        ways = random.standard_normal((27, 3))
        return MeasuredDofs(
            tuple(f"{prefix}{n}" for n in range(27)), places, ways / np.linalg.norm(ways, axis=1)[:, None]
        )

    def _motion(self, dofs):
        foot, head = interface_modes(dofs, np.zeros(3), self.modes), interface_modes(dofs, HEAD, DIRECTIONS)
        at_foot = (np.arange(27) < 15)[:, None]
        return np.hstack([np.where(at_foot, foot, 0.0), np.where(at_foot, 0.0, head)])

    def points(self):
        """Return its virtual points, the deformations among the motions of the first one."""
        foot = VirtualPoint((0.0, 0.0, 0.0), self.foot[0], self.foot[0], DIRECTIONS, self.deformations)
        head = VirtualPoint(tuple(HEAD.tolist()), self.foot[1], self.foot[1])
        return VirtualPoints(self.channels, self.impacts, {"foot": foot, "head": head})

    def section(self, folder, name, **foot):
        """Write the FRFs and tables, and return the section that reads them."""
        np.savez(folder / f"{name}.npz", frequency=FREQUENCY, frfs=self.frfs)
        for table, dofs, quantity in (("channels", self.channels, "Displacement"), ("impacts", self.impacts, "Force")):
            rows = ["Name,Quantity,Grouping,Position_1,Position_2,Position_3,Direction_1,Direction_2,Direction_3"]
            for number, label in enumerate(dofs.names):
                numbers = map(repr, [*dofs.positions[number].tolist(), *dofs.directions[number].tolist()])
                rows.append(",".join([label, quantity, "foot" if number < 15 else "head", *numbers]))
            (folder / f"{name}_{table}.csv").write_text("\n".join(rows), encoding="utf-8")
        files = {key: str(folder / f"{name}_{key}.csv") for key in ("channels", "impacts")}
        at_foot = {"at": [0.0, 0.0, 0.0], "flexible": [*self.deformations], "contacts": self.contacts, **foot}
        points = {"foot": at_foot, "head": {"at": HEAD.tolist()}}
        return {"model": "measured", "file": str(folder / f"{name}.npz"), **files, "points": points}

    def alone(self, section):
        """Return the description of the part, turned."""
        return alone({**section, "place": {"origin": ORIGIN.tolist(), "rotate": self.turn}})

    def at_contacts(self, names):
        """Return the displacements (3 n, d) of contacts by its own DOFs."""
        places = np.array([self.contacts[name] for name in names])
        moved = interface_modes(displacements(places), np.zeros(3), self.modes)
        return np.hstack([moved, np.zeros((len(moved), 6))])

    def turns_at_contacts(self, names):
        """Return the rotations (3 n, d) of contacts by its own DOFs."""
        rows = []
        for name in names:
            flexible = np.array([TURNS[mode](*self.contacts[name]) for mode in self.deformations]).T
            rows.append(np.hstack([np.zeros((3, 3)), np.eye(3), flexible, np.zeros((3, 6))]))
        return np.vstack(rows)


def displacements(places):
    """Return three displacements at each of some places."""
    names = tuple(f"{each}{number}" for number in range(len(places)) for each in "xyz")
    return MeasuredDofs(names, np.repeat(places, 3, axis=0), np.tile(np.eye(3), (len(places), 1)))


def on_a_body(part, section, joint, names=None, response=None):
    """Return the part, turned, on a rigid body by a joint at each of some contacts."""
    names = names or tuple(part.contacts)
    placed = dovetail.load(part.alone(section)).description.placements["part"]
    where = {name: (ORIGIN + placed.rotation @ np.array(part.contacts[name])).tolist() for name in names}
    joints = {
        name: {**joint, "connect": {"a": {"to": "part", "at": name}, "b": {"to": "body", "at": f"node {name}"}}}
        for name in names
    }
    description = {
        **part.alone(section),
        "substructures": {
            **part.alone(section)["substructures"],
            "body": {"model": "rigid_body", "center": ORIGIN.tolist(), "nodes": where, **BODY},
        },
        "joints": joints,
    }
    description["response"] = {**description["response"], **(response or {})}
    return dovetail.load(description), placed.rotation


def alone(section):
    """Return the description of a part."""
    return {
        "dovetail": 1,
        "name": "part on a body",
        "frequency": {"start": 40.0, "stop": 1190.0, "step": 10.0},
        "substructures": {"part": section},
        "response": {"at": "part", "position": "head", "quantity": "receptance", "direction": "x"},
    }


def dense(part, rotation, names=None, rigid=False, point="head", turning=False):
    """Return the receptance along the assembly's x at the head, or at a contact; joints hold rotations if `turning`."""
    names = names or tuple(part.contacts)
    there = np.kron(np.eye(len(names)), rotation) @ part.at_contacts(names)
    places = np.array([rotation @ np.array(part.contacts[name]) for name in names])
    gap = np.hstack([there, -interface_modes(displacements(places), np.zeros(3), DIRECTIONS)])
    stiffness, damping = np.tile(STIFFNESS, len(names)), np.tile(DAMPING, len(names))
    if turning:
        turned = np.kron(np.eye(len(names)), rotation) @ part.turns_at_contacts(names)
        body = np.tile(np.hstack([np.zeros((3, 3)), np.eye(3)]), (len(names), 1))
        gap = np.vstack([gap, np.hstack([turned, -body])])
        stiffness = np.append(stiffness, np.tile(ROTARY, len(names)))
        damping = np.append(damping, np.tile(ROTARY_DAMPING, len(names)))
    mass, head = np.diag([BODY["mass"]] * 3 + BODY["inertia"]), len(part.modes)
    load = np.zeros(gap.shape[1])
    load[head : head + 3] = rotation[0]
    if point != "head":
        load[:-6], load[-6:] = there[3 * list(names).index(point)], 0.0
    free = scipy.linalg.null_space(gap, rcond=1e-9) if rigid else np.eye(len(load))
    found = []
    for f, own in zip(FREQUENCY, part.stiffness(), strict=True):
        omega = 2 * np.pi * f
        Z = scipy.linalg.block_diag(own, -(omega**2) * mass).astype(complex)
        if not rigid:
            Z += gap.T @ ((stiffness + 1j * omega * damping)[:, None] * gap)
        found.append(load @ free @ np.linalg.solve(free.T @ Z @ free, free.T @ load))
    return np.array(found)


BUSHING = {
    "model": "bushing",
    "directions": ["x", "y", "z"],
    "parameters": {
        **{f"k_{each}": {"value": value} for each, value in zip("xyz", STIFFNESS, strict=True)},
        **{f"c_{each}": {"value": value} for each, value in zip("xyz", DAMPING, strict=True)},
    },
}
WELD = {"model": "rigid", "direction": ["x", "y", "z"]}
TURNING_BUSHING = {
    "model": "bushing",
    "parameters": {
        **BUSHING["parameters"],
        **{f"k_r{each}": {"value": value} for each, value in zip("xyz", ROTARY, strict=True)},
        **{f"c_r{each}": {"value": value} for each, value in zip("xyz", ROTARY_DAMPING, strict=True)},
    },
}
TURNING_WELD = {"model": "rigid", "direction": [*DIRECTIONS]}


def difference(found, expected):
    return float(np.abs(found - expected).max() / np.abs(expected).max())


@pytest.fixture(scope="module")
def part():
    return Part(0)


@pytest.mark.parametrize("names", [("bolt_1", "bolt_2", "bolt_3", "bolt_4"), ("bolt_3",), ("bolt_2", "bolt_4")])
@pytest.mark.parametrize("joint", ["bushings", "welds"])
@pytest.mark.parametrize("point", ["head", "contact"])
def test_a_part_whose_interface_deforms_has_the_frfs_of_a_dense_solution(part, names, joint, point, tmp_path):
    response = None if point == "head" else {"position": names[-1]}
    rigid = joint == "welds"
    found, rotation = on_a_body(part, part.section(tmp_path, "part"), WELD if rigid else BUSHING, names, response)
    expected = dense(part, rotation, names, rigid, point if point == "head" else names[-1])
    assert difference(found.frf(), expected) < 1e-7


@pytest.mark.parametrize("names", [("bolt_1", "bolt_2", "bolt_3", "bolt_4"), ("bolt_3",), ("bolt_2", "bolt_4")])
@pytest.mark.parametrize("rigid", [False, True], ids=["bushings", "welds"])
def test_contacts_that_turn_have_the_frfs_of_a_dense_solution(part, names, rigid, tmp_path):
    section = part.section(tmp_path, "part", contact_directions=[*DIRECTIONS])
    found, rotation = on_a_body(part, section, TURNING_WELD if rigid else TURNING_BUSHING, names)
    expected = dense(part, rotation, names, rigid, turning=True)
    assert difference(found.frf(), expected) < 1e-7
    if not rigid or len(names) < 4:  # the displacements of four contacts hold all nine motions
        assert difference(dense(part, rotation, names, rigid), expected) > 1e-2


def test_joints_that_hold_displacements_are_the_same_at_contacts_that_turn(part, tmp_path):
    """With one contact of fewer DOFs than motions, and with four."""
    for names in (("bolt_1",), tuple(CONTACTS)):
        section = part.section(tmp_path, "part", contact_directions=[*DIRECTIONS])
        found, rotation = on_a_body(part, section, BUSHING, names)
        assert difference(found.frf(), dense(part, rotation, names)) < 1e-7


def test_an_interface_turns_by_half_the_curl_of_its_deformations():
    """A small cross of points around a place turns as the rotations there say, by every deformation."""
    place, size = np.array([0.02, -0.03, 0.01]), 1e-3
    turns = MeasuredDofs(tuple("xyz"), np.tile(place, (3, 1)), np.eye(3), np.ones(3, dtype=bool))
    arms = size * np.vstack([np.eye(3), -np.eye(3)])
    moved = interface_modes(displacements(place + arms), np.zeros(3), FLEXIBLE_MODES).reshape(6, 3, -1)
    mean = sum(np.cross(arm, each, axisa=0, axisb=0) for arm, each in zip(arms, moved, strict=True)).T / (4 * size**2)
    assert interface_modes(turns, np.zeros(3), FLEXIBLE_MODES, turning=True) == pytest.approx(mean, abs=1e-12)
    assert not interface_modes(turns, np.zeros(3), FLEXIBLE_MODES).any()


def check_random_interface(seed, folder):
    """Compare an interface with random deformations, contacts and place, held by bushings or welds."""
    random = np.random.default_rng(seed)
    deformations = tuple(random.choice(FLEXIBLE_MODES, random.integers(0, 6), replace=False).tolist())
    places = random.uniform(-0.04, 0.04, (random.integers(1, 7), 3)) * [1.0, 1.0, seed % 5 != 0]  # some in one plane
    contacts = {f"bolt_{number}": place for number, place in enumerate(places.tolist())}
    turn = [{"about": random.standard_normal(3).tolist(), "angle": random.uniform(0.0, 3.0)}]
    part = Part(seed, deformations, contacts, turn)
    rigid, point = random.integers(2) == 1, random.choice(["head", *contacts])
    response = None if point == "head" else {"position": str(point)}
    joint = WELD if rigid else BUSHING
    found, rotation = on_a_body(part, part.section(folder, "part"), joint, response=response)
    assert difference(found.frf(), dense(part, rotation, None, rigid, point)) < 1e-7


@pytest.mark.parametrize("seed", range(5))
def test_random_interfaces_have_the_frfs_of_a_dense_solution(seed, tmp_path):
    check_random_interface(seed, tmp_path)


@pytest.mark.slow
def test_100_random_interfaces_have_the_frfs_of_a_dense_solution(tmp_path):
    for seed in range(5, 105):
        check_random_interface(seed, tmp_path)


def test_an_interface_that_deforms_has_other_frfs_than_a_rigid_one(part, tmp_path):
    """A rigid interface at the same four bolts has other FRFs."""
    found, rotation = on_a_body(part, part.section(tmp_path, "part"), BUSHING)
    expected = dense(part, rotation)
    stiff, _ = on_a_body(part, part.section(tmp_path, "part", flexible=[]), BUSHING)
    assert difference(found.frf(), expected) < 1e-7 < 1e-2 < difference(stiff.frf(), expected)


def test_an_interface_that_does_not_deform_may_have_contacts(part, tmp_path):
    """Four welds hold six motions; the constraints that follow from each other count once."""
    section = part.section(tmp_path, "part", flexible=[])
    found, _ = on_a_body(part, section, WELD)
    three, _ = on_a_body(part, section, WELD, ("bolt_1", "bolt_2", "bolt_3"))
    assert difference(found.frf(), three.frf()) < 1e-9


def test_contacts_at_the_ground_hold_the_interface(part, tmp_path):
    section = part.section(tmp_path, "part")
    found = part.alone(section)
    found["substructures"]["floor"] = {"model": "ground"}
    ends = {name: {"a": {"to": "part", "at": name}, "b": {"to": "floor", "at": 0.0}} for name in CONTACTS}
    found["joints"] = {name: {**WELD, "connect": connect} for name, connect in ends.items()}
    loaded = dovetail.load(found)
    rotation = loaded.description.placements["part"].rotation
    free = slice(9, 15)
    held = [np.linalg.inv(Z[free, free])[:3, :3] for Z in part.stiffness()]
    assert difference(loaded.frf(), np.array([rotation[0] @ H @ rotation[0] for H in held])) < 1e-7


def joined_by_receptances(one, two):
    """Return the receptance of two parts, equal in all modes of their feet, at the head of the first."""
    A, B = (part.points().transformed(part.frfs, deformations=True) for part in (one, two))
    at, tip = slice(0, 9), slice(9, 15)
    return couple(A[:, tip, tip], A[:, tip, at], A[:, at, tip], A[:, at, at], B[:, at, at])


def test_two_parts_are_coupled_by_motions_and_deformations(part, tmp_path):
    """By receptances, as in pyFBS, by the dense solution, and by welds at contacts in an assembly."""
    other = Part(1)
    by_receptances = joined_by_receptances(part, other)
    select = np.zeros((30, 21))
    select[:15, :15] = np.eye(15)
    select[15:24, :9], select[24:, 15:] = np.eye(9), np.eye(6)
    whole = [
        np.linalg.inv(select.T @ scipy.linalg.block_diag(*pair) @ select)[9:15, 9:15]
        for pair in zip(part.stiffness(), other.stiffness(), strict=True)
    ]
    assert difference(by_receptances, np.array(whole)) < 1e-8
    place = {"origin": ORIGIN.tolist()}
    parts = {"one": part.section(tmp_path, "one"), "two": other.section(tmp_path, "two")}
    ends = {name: {"a": {"to": "one", "at": name}, "b": {"to": "two", "at": name}} for name in CONTACTS}
    description = {
        **alone({}),
        "substructures": {name: {**section, "place": place} for name, section in parts.items()},
        "joints": {name: {**WELD, "connect": connect} for name, connect in ends.items()},
    }
    description["response"]["at"] = "one"
    assert difference(dovetail.load(description).frf(), by_receptances[:, 0, 0]) < 1e-7


def test_a_bolt_at_an_interface_that_deforms_is_identified(part, tmp_path):
    free = {**BUSHING, "parameters": {**BUSHING["parameters"], "k_x": {"range": [1e5, 1e8]}}}
    assembly, rotation = on_a_body(part, part.section(tmp_path, "part"), free, ("bolt_1",))
    measured = dovetail.Frf(FREQUENCY, dense(part, rotation, ("bolt_1",)), "receptance")
    result = dovetail.identify(assembly, dovetail.noisy_frf(measured, 1e-3, 0), "refined", cause_seconds=0.0)
    assert result.parameters["k_x"].value == pytest.approx(STIFFNESS[0], rel=1e-2)


WRONG = {
    "a point without rotations": ({"directions": ["x", "y", "z"]}, "a point with 'contacts' has all six directions"),
    "a name that a point has": ({"contacts": {"head": [0.0, 0.0, 0.0]}}, "two nodes have the name 'head'"),
    "directions of contacts in another order": (
        {"contact_directions": ["y", "x"]},
        "'contact_directions' are different ones in their order; write ['x', 'y']",
    ),
    "two coordinates": ({"contacts": {"bolt": [0.0, 0.0]}}, "contacts.bolt"),
    "more deformations than channels": (
        {"flexible": ["ex", "ey", "ez", "tx", "ty", "tz", "sxy", "sxz", "syz", "syx"]},
        "do not determine its deformation",
    ),
}


@pytest.mark.parametrize("case", WRONG)
def test_a_wrong_section_is_one_clear_error(case, part, tmp_path):
    change, said = WRONG[case]
    with pytest.raises(dovetail.DescriptionError) as caught:
        dovetail.load(part.alone(part.section(tmp_path, "part", **change)))
    assert len(caught.value.faults) == 1, caught.value
    assert said in str(caught.value)


def test_nodes_without_positions_are_named_by_their_labels(part, tmp_path):
    loaded = dovetail.load(part.alone(part.section(tmp_path, "part")))
    labels = [loaded.graph.substructures["part"].dof_label(dof) for dof in (0, 6, 12)]
    assert labels == ["node 'foot' x", "node 'head' x", "node 'bolt_1' x"]


def test_a_contact_far_from_the_channels_is_reported(part, tmp_path):
    there = {"bolt_1": (0.03, 0.01, 0.02), "bolt_2": (0.3, 0.0, 0.0)}
    loaded = dovetail.load(part.alone(part.section(tmp_path, "part", contacts=there)))
    (said,) = [warning for warning in find_warnings(loaded) if "extrapolated" in warning]
    assert "the contact 'bolt_2' is 300 mm from the point 'foot'" in said


def test_options_of_contacts_that_follow_others_are_refused_with_the_reason(part, tmp_path):
    section = {**part.section(tmp_path, "part"), "unit_of_length": {"range": ["0.99 m", "1.01 m"]}}
    with pytest.raises(dovetail.DovetailError, match="what they cannot do changes with its options") as caught:
        dovetail.load(part.alone(section))
    assert "Give each of its options a value" in str(caught.value)


def test_an_option_is_unknown_where_contacts_have_no_more_dofs_than_motions(tmp_path):
    """Two displacements of one bolt show two of the deformations, and nothing follows from anything."""
    part = Part(0, turn=[])
    foot = {"contacts": {"bolt_1": CONTACTS["bolt_1"]}, "contact_directions": ["x", "z"]}
    section = part.section(tmp_path, "part", **foot)
    joint = {"model": "bushing", "directions": ["x", "z"], "parameters": {}}
    joint["parameters"] = {name: each for name, each in BUSHING["parameters"].items() if name[-1] in "xz"}
    known, _ = on_a_body(part, section, joint, ("bolt_1",))
    unknown, _ = on_a_body(part, {**section, "unit_of_length": {"range": ["0.9 m", "1.1 m"]}}, joint, ("bolt_1",))
    assert [parameter.name for parameter in unknown.parameters] == ["part.unit_of_length"]
    assert difference(unknown.frf([1.0]), known.frf()) < 1e-9
    _, jacobian = unknown.frf_jacobian([1.0])
    ahead, behind = unknown.frf([1.0 + 1e-5]), unknown.frf([1.0 - 1e-5])
    assert difference(jacobian[:, 0], (ahead - behind) / 2e-5) < 1e-5
