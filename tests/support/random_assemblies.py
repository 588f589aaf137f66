"""Whole assemblies at random: descriptions, the files they name, parameter vectors and points, drawn by Hypothesis."""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from hypothesis import strategies as st

from support.joint_formulas import PARAMETERS, joint_parameters

_MOST_PARTS = 6
_MOST_UNKNOWN = 14
_THOUSANDTHS = 1000
_FEWEST_NODES = {"collet": 3, "tripod": 2, "interference_fit": 2}
_PORTS = {
    "spring_damper": ("a", "b"),
    "bearing": ("shaft", "housing"),
    "bolted": ("a", "b"),
    "interference_fit": ("shaft", "hub"),
    "collet": ("tool", "holder"),
    "rigid": ("a", "b"),
    "tripod": ("top", "feet", "absorber"),
    "rubber": ("a", "b"),
}
_MAY_VANISH = {"k", "c", "kr", "cr", "kt", "ct", "m", "J", "mb", "mn1", "mn2", "ct_tc", "cr_hc", "eta", "kr_tc"}
"""Parameters that may be zero without the joint losing its meaning."""

Draw = Callable[[st.SearchStrategy[Any]], Any]


@dataclass
class Drawn:
    """An assembly, and where it is asked.

    Parameters
    ----------
    description : dict
        Plain SI values; files by the names of `archives`.
    archives : dict of str to dict
        M, K, C, D and the table of DOFs of imported parts, and of measured ones (`tested` is true).
    nodes : dict of str to list of str
        Labels of the nodes of each part.
    theta : (n, n_params) array
    outputs, inputs : list of (part, label, direction)
    by_position : bool
        Whether the description names nodes by their positions.
    """

    description: dict[str, Any]
    archives: dict[str, dict[str, Any]]
    nodes: dict[str, list[str]]
    theta: np.ndarray = field(default_factory=lambda: np.empty((1, 0)))
    outputs: list[tuple[str, str, str]] = field(default_factory=list)
    inputs: list[tuple[str, str, str]] = field(default_factory=list)
    by_position: bool = False

    @property
    def response(self) -> tuple[str, str, str]:
        """Part, label and direction."""
        response = self.description["response"]
        return response["at"], response["position"], response["direction"]

    @property
    def tested(self) -> bool:
        """Whether a part is known by its receptance only."""
        return any(archive["tested"] for archive in self.archives.values())

    def written(self, folder: Path, frequency: np.ndarray, position: Mapping[tuple[str, str], float]) -> dict[str, Any]:
        """Write the files and return the description that names them there, its nodes by label or by position."""
        description = copy.deepcopy(self.description)
        if self.by_position:
            response = description["response"]
            response["position"] = position[response["at"], response["position"]]
            for joint in description.get("joints", {}).values():
                for end in joint["connect"].values():
                    end["at"] = [position[end["to"], label] for label in end["at"]]
        for section in description["substructures"].values():
            if "file" in section:
                archive = self.archives[section["file"]]
                section["file"] = str(folder / section["file"])
                arrays = {key: value for key, value in archive.items() if key != "tested"}
                np.savez(section["file"], **(_receptance(arrays, frequency) if archive["tested"] else arrays))
        return description


def _receptance(arrays: Mapping[str, Any], frequency: np.ndarray) -> dict[str, Any]:
    """What a test of the part would give at the DOFs of its table."""
    omega = 2 * np.pi * frequency[:, np.newaxis, np.newaxis]
    H = np.linalg.inv(arrays["K"] - omega**2 * arrays["M"] + 1j * (arrays["D"] + omega * arrays["C"]))
    rows = np.array(arrays["rows"]) - 1
    table = {name: arrays[name] for name in ("nodes", "directions", "positions")}
    return {"frequency": frequency, "receptance": H[:, rows[:, np.newaxis], rows], **table}


def _fraction(draw: Draw) -> float:
    return draw(st.integers(0, _THOUSANDTHS)) / _THOUSANDTHS


def _between(draw: Draw, low: float, high: float, scale: str = "linear") -> float:
    return _at(_fraction(draw), low, high, scale)


def _at(fraction: float, low: float, high: float, scale: str) -> float:
    if scale == "log" and low > 0:
        return float(min(max(low * (high / low) ** fraction, low), high))
    return float(min(max(low + fraction * (high - low), low), high))


@st.composite
def drawn_assemblies(draw: Draw) -> Drawn:
    """One to six parts, a tree of joints over those that move, and up to three joints anywhere."""
    count = draw(st.integers(1, _MOST_PARTS))
    drawn = Drawn({"dovetail": 1, "name": "random", "frequency": _frequency(draw), "substructures": {}}, {}, {})
    joints: dict[str, Any] = {}
    moving: list[str] = []
    budget = draw(st.integers(0, _MOST_UNKNOWN))
    for number in range(count):
        name = f"p{number}"
        models = (
            ["timoshenko_beam"] * 5 + ["lumped"] * 2 + ["matrices"] * 2 + ["measured"] + ["ground"] * 2 * bool(moving)
        )
        model = draw(st.sampled_from(models))
        _part(draw, name, model, drawn)
        if moving:
            budget -= _joint(draw, f"j{len(joints)}", joints, draw(st.sampled_from(moving)), name, drawn, budget)
        if model != "ground":
            moving.append(name)
    for _ in range(draw(st.integers(0, 3))):
        one, other = draw(st.sampled_from(moving)), draw(st.sampled_from(list(drawn.nodes)))
        budget -= _joint(draw, f"j{len(joints)}", joints, one, other, drawn, budget)
    if joints:
        drawn.description["joints"] = joints
    part, node, direction = _point(draw, moving, drawn)
    quantity = draw(st.sampled_from(["receptance", "mobility", "accelerance"]))
    drawn.description["response"] = {"at": part, "position": node, "direction": direction, "quantity": quantity}
    drawn.outputs = [_point(draw, moving, drawn) for _ in range(draw(st.integers(1, 2)))]
    drawn.inputs = [_point(draw, moving, drawn) for _ in range(draw(st.integers(1, 2)))]
    drawn.theta, drawn.by_position = _theta(draw, joints), draw(st.booleans())
    return drawn


def _frequency(draw: Draw) -> dict[str, Any]:
    start = _between(draw, 1.0, 5000.0, "log")
    return {"start": start, "stop": _between(draw, start + 1.0, 20000.0), "lines": draw(st.integers(2, 6))}


def _point(draw: Draw, moving: list[str], drawn: Drawn) -> tuple[str, str, str]:
    part = draw(st.sampled_from(moving))
    return part, draw(st.sampled_from(drawn.nodes[part])), draw(st.sampled_from(["x", "x", "rz"]))


# -- parts -------------------------------------------------------------------------------------------------------------


def _part(draw: Draw, name: str, model: str, drawn: Drawn) -> None:
    section: dict[str, Any] = {"model": model}
    if model == "timoshenko_beam":
        section |= {"material": _material(draw), "sections": _sections(draw)}
        elements = sum(piece["elements"] for piece in section["sections"])
        labels = [f"n{i + 1}" for i in range(elements + 1)]
    elif model == "lumped":
        section["masses"] = [_mass(draw, i) for i in range(draw(st.integers(1, 3)))]
        labels = [f"m{i + 1}" for i in range(len(section["masses"]))]
    elif model == "ground":
        section["positions"] = [0.01 * i for i in range(draw(st.integers(1, 3)))]
        labels = [f"g{i + 1}" for i in range(len(section["positions"]))]
    else:
        section["file"] = f"{name}.npz"
        archive = _archive(draw, tested=model == "measured")
        drawn.archives[section["file"]] = archive
        labels = list(dict.fromkeys(archive["nodes"]))
        if model == "matrices":
            section |= _reading(draw, archive)
    if draw(st.sampled_from([False, False, True])):
        section["reversed"] = True
    drawn.description["substructures"][name], drawn.nodes[name] = section, labels


def _material(draw: Draw) -> dict[str, float]:
    return {
        "young": _between(draw, 1e9, 6e11, "log"),
        "density": _between(draw, 900.0, 2e4, "log"),
        "poisson": _between(draw, 0.0, 0.49),
        "loss_factor": draw(st.sampled_from([0.0, 0.003, 0.05])),
    }


def _sections(draw: Draw) -> list[dict[str, Any]]:
    sections = []
    for _ in range(draw(st.integers(1, 3))):
        most = draw(st.sampled_from([3, 3, 3, 3, 3, 3, 3, 34]))
        piece: dict[str, Any] = {"elements": draw(st.integers(most // 2 if most > 3 else 1, most))}
        piece["length"] = piece["elements"] * _between(draw, 5e-3, 60e-3, "log")
        outer = _between(draw, 5e-3, 80e-3, "log")
        shape = draw(st.sampled_from(["solid", "hollow", "taper", "rectangle"]))
        if shape == "rectangle":
            piece |= {"width": outer, "height": _between(draw, 4e-3, 50e-3)}
        else:
            piece["outer"] = outer
        if shape in ("hollow", "taper"):
            piece["inner"] = outer * _between(draw, 0.0, 0.9)
        if shape == "taper":
            piece["outer_end"] = outer * _between(draw, 0.95, 1.5)
        sections.append(piece)
    return sections


def _mass(draw: Draw, number: int) -> dict[str, float]:
    mass = {"position": 0.02 * number, "mass": _between(draw, 1e-2, 10.0, "log")}
    if draw(st.sampled_from([True, True, True, False])):
        mass["inertia"] = _between(draw, 1e-6, 1e-2, "log")
    elif draw(st.sampled_from([True, False, False])):
        mass["mass"] = 0.0
    return mass


def _archive(draw: Draw, *, tested: bool) -> dict[str, Any]:
    """Springs of random strength between DOFs and to a frame, masses, proportional and other damping; a table of DOFs.

    A tested part stands on a frame and is damped, so that its receptance can be inverted.
    """
    size = draw(st.sampled_from([1, 2, 3, 4, 5, 6])) if tested or draw(st.sampled_from([1, 1, 1, 0])) else 66
    random = np.random.default_rng(draw(st.integers(0, 2**20)))
    between = np.eye(size) - np.eye(size, k=1)
    between = between[: size - 1] if not tested and draw(st.booleans()) else between
    if size > 1:
        between = np.concatenate([between, random.integers(-1, 2, (2, size)) * random.random((2, 1))])
    K = between.T @ (10.0 ** random.uniform(5, 8, (len(between), 1)) * between)
    coupling = np.eye(size) + 0.1 * np.eye(size, k=1)
    M = coupling.T @ (10.0 ** random.uniform(-2, 0.5, (size, 1)) * coupling)
    dashpots = random.integers(-1, 2, (1, size))
    C = dashpots.T @ dashpots * 10.0 ** random.uniform(0, 3)
    D = 0.02 * K if tested else 10.0 ** random.uniform(2, 4) * dashpots.T @ dashpots
    rows = random.permutation(size)[: random.integers(1, min(size, 6) + 1)] + 1
    nodes = [f"q{1 + i // 2}" for i in range(len(rows))]
    directions = [("x", "rz")[i % 2] for i in range(len(rows))]
    if draw(st.booleans()):  # displacements alone
        nodes, directions = [f"q{1 + i}" for i in range(len(rows))], ["x"] * len(rows)
    positions = [0.03 * int(node[1:]) for node in nodes]
    table = {"nodes": nodes, "directions": directions, "positions": positions, "rows": rows.tolist()}
    return {"M": M, "K": K, "C": C, "D": D, **table, "tested": tested}


def _reading(draw: Draw, archive: dict[str, Any]) -> dict[str, Any]:
    """Options for a file in other units and with other names of the directions."""
    options: dict[str, Any] = {"tolerance": 0.0}
    if draw(st.booleans()):
        options["units"] = {"length": 1e-3, "mass": 1e3, "stiffness": 1e3}
        archive |= {"M": archive["M"] * 1e-3, "K": archive["K"] * 1e-3, "C": archive["C"] * 1e-3}
        archive |= {"D": archive["D"] * 1e-3, "positions": [1e3 * position for position in archive["positions"]]}
    if draw(st.booleans()):
        archive["directions"] = [{"x": "uy", "rz": "ry"}[direction] for direction in archive["directions"]]
        options["displacement"] = "uy"
        if "ry" in archive["directions"]:
            options["rotation"] = "-ry"
    if draw(st.booleans()):
        del archive["D"]
        options["loss_factor"] = _between(draw, 0.0, 0.1)
    return options


# -- joints ------------------------------------------------------------------------------------------------------------


def _joint(draw: Draw, name: str, joints: dict[str, Any], one: str, other: str, drawn: Drawn, budget: int) -> int:
    """Enter a joint between two parts, and return how many unknowns it has."""
    room = {part: _room(drawn, part) for part in (one, other)}
    most = min(room.values()) if one != other else room[one] // 2
    if most == 0:
        return 0
    weights = {
        "spring_damper": 4,
        "bearing": 2,
        "bolted": 2,
        "interference_fit": 2,
        "collet": 2,
        "rigid": 3,
        "rubber": 1,
    }
    models = [model for model, weight in weights.items() if most >= _FEWEST_NODES.get(model, 1) for _ in range(weight)]
    if most >= 3:
        models.append("tripod")
    model = draw(st.sampled_from(models))
    section = {"model": model, **_options(draw, model, most)}
    nodes = {port: section.get("nodes", _FEWEST_NODES.get(model, 1)) for port in _PORTS[model]}
    if model == "tripod":
        nodes = {"top": 1, "feet": 2, "absorber": 1}
    parts = dict(zip(nodes, [*draw(st.permutations([one, other])), one], strict=False))
    section["connect"] = _attached(draw, nodes, parts, drawn)
    section["parameters"], unknown = _known(draw, section, budget)
    joints[name] = section
    return unknown


def _room(drawn: Drawn, part: str) -> int:
    """Nodes that a joint can take; the ground's are taken any number of times."""
    held = drawn.description["substructures"][part]["model"] == "ground"
    return 100 if held else len(drawn.nodes[part])


def _options(draw: Draw, model: str, most: int) -> dict[str, Any]:
    count = draw(st.integers(_FEWEST_NODES.get(model, 1), max(min(most, 4), _FEWEST_NODES.get(model, 1))))
    if model == "spring_damper" or model == "rigid":
        return {"nodes": count, "direction": draw(st.sampled_from(["x", "rz", "both", "both"]))}
    if model == "bolted":
        options: dict[str, Any] = {"nodes": count, "bolt_mass": draw(st.booleans())}
        if draw(st.booleans()):
            options["preload"] = {"force": 6e3, "reference": 1e4, "exponent": _between(draw, 0.0, 2.0)}
        return options
    if model == "interference_fit":
        pressure = draw(st.sampled_from(["uniform", "linear"]))
        return {"nodes": count, "length": _between(draw, 5e-3, 0.1), "pressure": pressure}
    if model == "collet":
        options = {"material": _material(draw)}
        return options if draw(st.booleans()) else {**options, "segment": 7e-3, "elements_per_segment": 2}
    return {}


def _attached(draw: Draw, nodes: Mapping[str, int], parts: Mapping[str, str], drawn: Drawn) -> dict[str, Any]:
    """Nodes of each port, none of them twice unless on the ground."""
    unused = {part: draw(st.permutations(drawn.nodes[part])) for part in dict.fromkeys(parts.values())}
    connect = {}
    for port, part in parts.items():
        if drawn.description["substructures"][part]["model"] == "ground":
            places = [draw(st.sampled_from(drawn.nodes[part])) for _ in range(nodes[port])]
        else:
            places, unused[part] = unused[part][: nodes[port]], unused[part][nodes[port] :]
        connect[port] = {"to": part, "at": list(places)}
    return connect


def _known(draw: Draw, section: Mapping[str, Any], budget: int) -> tuple[dict[str, Any], int]:
    """What is said of each parameter: nothing, a range, or a value; and how many are unknown."""
    said: dict[str, Any] = {}
    unknown = 0
    for name in joint_parameters(section):
        low, high, scale = PARAMETERS[section["model"]][name]
        way = draw(st.sampled_from(["nothing", "range", "from zero", "value", "zero"]))
        if unknown >= budget and way in ("nothing", "range", "from zero"):
            way = "value"
        if way in ("from zero", "zero") and (name not in _MAY_VANISH or section["model"] == "rubber"):
            way = "range" if unknown < budget else "value"
        unknown += way not in ("value", "zero")
        if way == "value":
            said[name] = {"value": _between(draw, low, high, scale)}
        elif way == "zero":
            said[name] = {"value": 0.0}
        elif way == "from zero":
            said[name] = {"range": [0.0, high], "scale": "linear"}
        elif way == "range":
            middle = _at(0.4, low, high, scale)
            said[name] = {
                "range": [_between(draw, low, middle, scale), _between(draw, _at(0.5, low, high, scale), high)]
            }
            said[name]["scale"] = scale if draw(st.booleans()) or low < 0 else "linear"
    return said, unknown


def _theta(draw: Draw, joints: Mapping[str, Any]) -> np.ndarray:
    """Some vectors of the unknown parameters, anywhere in their ranges."""
    vectors = []
    for _ in range(draw(st.integers(1, 2))):
        vector = []
        for joint in joints.values():
            for name in joint_parameters(joint):
                said = joint["parameters"].get(name, {})
                low, high, scale = PARAMETERS[joint["model"]][name]
                if "value" not in said:
                    low, high = said.get("range", (low, high))
                    vector.append(_between(draw, low, high, said.get("scale", scale)))
        vectors.append(vector)
    return np.array(vectors)
