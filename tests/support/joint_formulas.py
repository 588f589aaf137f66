"""Elements of each joint from its formulas; no code of Dovetail is used.

Ports are lists of nodes, a node a pair (DOF of x, DOF of rz); values of parameters may be complex, for a complex step.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from support.element_formulas import Element, beam_element, inertia, round_section, spring

Ports = Mapping[str, Sequence[tuple[int, int]]]
_X, _RZ = 0, 1
_AXES = {"x": (_X,), "rz": (_RZ,), "both": (_X, _RZ)}


def _facing(ports: Ports) -> list[tuple[Any, Any]]:
    first, second = ports.values()
    return list(zip(first, second, strict=True))


def spring_damper(section, value, ports: Ports, inner, frequency) -> list[Element]:
    """k, c in x and kr, cr in rz between facing nodes, each node with all of it."""
    names = {_X: ("k", "c"), _RZ: ("kr", "cr")}
    return [
        spring(one[axis], other[axis], *(value[name] for name in names[axis]))
        for one, other in _facing(ports)
        for axis in _AXES[section.get("direction", "both")]
    ]


def bearing(section, value, ports: Ports, inner, frequency) -> list[Element]:
    """Springs and dampers in radius and tilt; the ring's m and J go with the shaft."""
    ((shaft, housing),) = _facing(ports)
    return [
        spring(shaft[_X], housing[_X], value["k"], value["c"]),
        spring(shaft[_RZ], housing[_RZ], value["kr"], value["cr"]),
        inertia(shaft[_X], value["m"]),
        inertia(shaft[_RZ], value["J"]),
    ]


def bolted(section, value, ports: Ports, inner, frequency) -> list[Element]:
    """A layer with kt and kr times (F / F0)^n; half of the bolt's mass on x of each part, at the middle of the lap."""
    preload = section.get("preload")
    tight = (preload["force"] / preload["reference"]) ** preload["exponent"] if preload else 1.0
    elements, nodes = [], _facing(ports)
    for one, other in nodes:
        elements.append(spring(one[_X], other[_X], tight * value["kt"], value["ct"]))
        elements.append(spring(one[_RZ], other[_RZ], tight * value["kr"], value["cr"]))
    if section.get("bolt_mass"):
        count = len(nodes)
        middle = [count // 2] if count % 2 else [count // 2 - 1, count // 2]
        elements += [inertia(side[_X], value["mb"] / 2 / len(middle)) for i in middle for side in nodes[i]]
    return elements


def interference_fit(section, value, ports: Ports, inner, frequency) -> list[Element]:
    """k (1 + g s) and kr (1 + g s) per length, s from -1 to 1; each node has the length nearest to it."""
    nodes = _facing(ports)
    interval, elements = section["length"] / (len(nodes) - 1), []
    for i, (one, other) in enumerate(nodes):
        tributary = interval / 2 if i in (0, len(nodes) - 1) else interval
        share = tributary * (1 + value.get("g", 0.0) * (2 * i / (len(nodes) - 1) - 1))
        elements.append(spring(one[_X], other[_X], share * value["k"], tributary * value["c"]))
        elements.append(spring(one[_RZ], other[_RZ], share * value["kr"], tributary * value["cr"]))
    return elements


def collet(section, value, ports: Ports, inner, frequency) -> list[Element]:
    """Twelve parameters (Eq. 9; section 4.1): four beam segments, nodes c1 to c5, D = eta K of the collet's material.

    Tool nodes meet c1, c2, c3 and holder nodes c3, c4, c5; the nut's masses are on x of c1 and c2.
    """
    per_segment = section.get("elements_per_segment", 1)
    nodes = list(zip(inner[0::2], inner[1::2], strict=True))
    tube = round_section(value["Dc"], value["dc"], section["material"]["poisson"])
    length = section.get("segment", 10e-3) / per_segment
    elements = [beam_element((*one, *other), length, tube, section["material"]) for one, other in pairwise(nodes)]
    c = nodes[::per_segment]
    elements += [inertia(c[0][_X], value["mn1"]), inertia(c[1][_X], value["mn2"])]
    for layer, met in (("tool", c[:3]), ("holder", c[2:])):
        suffix = {"tool": "tc", "holder": "hc"}[layer]
        for part, own in zip(ports[layer], met, strict=True):
            elements.append(spring(part[_X], own[_X], value[f"kt_{suffix}"], value[f"ct_{suffix}"]))
            elements.append(spring(part[_RZ], own[_RZ], value[f"kr_{suffix}"], value[f"cr_{suffix}"]))
    return elements


def rigid(section, value, ports: Ports, inner, frequency) -> list[Element]:
    """Nothing but merged DOFs."""
    return []


def tripod(section, value, ports: Ports, inner, frequency) -> list[Element]:
    """Struts hub.x - cos(phi) foot.x - 20 mm sin(phi) foot.rz; hub, spring, mass, spring and damper, absorber."""
    hub, mass = inner
    along = np.array([1.0, -np.cos(value["phi"]), -0.02 * np.sin(value["phi"])])
    strut = value["k"] * np.outer(along, along)
    return [
        *(Element((hub, *foot), K=strut, D=value["eta"] * strut) for foot in ports["feet"]),
        spring(hub, mass, value["k"]),
        spring(mass, ports["absorber"][0][_X], value["k"], value["c"]),
        inertia(mass, value["m"]),
    ]


def rubber(section, value, ports: Ports, inner, frequency) -> list[Element]:
    """k (1 + g (i f / f0)^alpha), with i^alpha = cos(pi alpha / 2) + i sin(pi alpha / 2): K and D of each frequency."""
    ((one, other),) = _facing(ports)
    growth = value["g"] * (frequency / 100.0) ** value["alpha"]
    real = value["k"] * (1 + growth * np.cos(np.pi * value["alpha"] / 2))
    loss = value["k"] * growth * np.sin(np.pi * value["alpha"] / 2)
    return [
        spring(one[_X], inner[0], 2 * real, loss=2 * loss),
        spring(inner[0], other[_X], 2 * real, loss=2 * loss),
        spring(one[_RZ], other[_RZ], 1e-4 * real, loss=1e-4 * loss),
        inertia(inner[0], value["m"]),
    ]


JOINTS = {
    joint.__name__: joint for joint in (spring_damper, bearing, bolted, interference_fit, collet, rigid, tripod, rubber)
}


def inner_dofs(section: Mapping[str, Any]) -> int:
    """Number of DOFs that belong to the joint alone."""
    beam_nodes = 4 * section.get("elements_per_segment", 1) + 1
    return {"collet": 2 * beam_nodes, "tripod": 2, "rubber": 1}.get(section["model"], 0)


def merged(section: Mapping[str, Any], ports: Ports, inner: Sequence[int], *, rigid: bool) -> list[tuple[int, int]]:
    """Pairs of DOFs that are one; `rigid` says whether the joint's contacts are rigid."""
    model = section["model"]
    if model == "tripod":
        pairs = [(ports["top"][0][_X], inner[0])]
        first_foot, absorber = ports["feet"][0][_X], ports["absorber"][0][_X]
        return [*pairs, (ports["top"][0][_X], first_foot), (absorber, inner[1])] if rigid else pairs
    if model == "collet":
        c = list(zip(inner[0::2], inner[1::2], strict=True))[:: section.get("elements_per_segment", 1)]
        nodes = [*zip(ports["tool"], c[:3], strict=True), *zip(ports["holder"], c[2:], strict=True)]
    else:
        nodes = _facing(ports)
    if not rigid and model != "rigid":
        return []
    axes = _AXES[section.get("direction", "both")]
    return [(one[axis], other[axis]) for one, other in nodes for axis in axes]


PARAMETERS: dict[str, dict[str, tuple[float, float, str]]] = {
    "spring_damper": {
        "k": (1e4, 1e10, "log"),
        "c": (1.0, 1e4, "log"),
        "kr": (1e2, 1e7, "log"),
        "cr": (1e-3, 1e2, "log"),
    },
    "bearing": {
        "k": (1e6, 1e10, "log"),
        "kr": (1e2, 1e7, "log"),
        "c": (1.0, 1e5, "log"),
        "cr": (1e-3, 1e3, "log"),
        "m": (0.01, 1.0, "linear"),
        "J": (1e-6, 1e-3, "log"),
    },
    "bolted": {
        "kt": (1e6, 1e10, "log"),
        "kr": (1e2, 1e7, "log"),
        "ct": (0.1, 1e4, "log"),
        "cr": (1e-4, 1e2, "log"),
        "mb": (1e-3, 0.5, "linear"),
    },
    "interference_fit": {
        "k": (1e8, 1e12, "log"),
        "kr": (1e4, 1e8, "log"),
        "c": (1e1, 1e6, "log"),
        "cr": (1e-3, 1e3, "log"),
        "g": (-0.9, 0.9, "linear"),
    },
    "collet": {
        "Dc": (26e-3, 40e-3, "linear"),
        "dc": (10e-3, 18e-3, "linear"),
        "mn1": (0.02, 0.20, "linear"),
        "mn2": (0.02, 0.20, "linear"),
        "kt_tc": (1e8, 2e9, "log"),
        "kr_tc": (2e3, 6e4, "log"),
        "ct_tc": (10.0, 1000.0, "log"),
        "cr_tc": (0.01, 5.0, "log"),
        "kt_hc": (3e8, 5e9, "log"),
        "kr_hc": (5e4, 2e6, "log"),
        "ct_hc": (10.0, 1000.0, "log"),
        "cr_hc": (0.01, 5.0, "log"),
    },
    "rigid": {},
    "tripod": {
        "k": (1e5, 1e9, "log"),
        "phi": (0.1, 1.4, "linear"),
        "eta": (0.0, 0.2, "linear"),
        "c": (1.0, 1e4, "log"),
        "m": (1e-3, 1.0, "log"),
    },
    "rubber": {
        "k": (1e5, 1e8, "log"),
        "g": (0.02, 1.0, "log"),
        "alpha": (0.1, 0.9, "linear"),
        "m": (1e-3, 0.1, "log"),
    },
}
"""Parameters of each joint in their order: lower and upper end and scale, as `dovetail describe` prints them."""


def joint_parameters(section: Mapping[str, Any]) -> list[str]:
    """Names of a joint's parameters in their order, by its options."""
    names = list(PARAMETERS[section["model"]])
    left_out = {
        "spring_damper": {"x": ("kr", "cr"), "rz": ("k", "c")}.get(section.get("direction", "both"), ()),
        "bolted": () if section.get("bolt_mass") else ("mb",),
        "interference_fit": () if section.get("pressure") == "linear" else ("g",),
    }.get(section["model"], ())
    return [name for name in names if name not in left_out]
