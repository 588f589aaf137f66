"""Nodes and elements of each substructure of a description, from published formulas; no code of Dovetail is used."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from support.element_formulas import Element, beam_element, inertia, rectangular_section, round_section

NewDofs = Callable[[int], list[int]]
"""Returns that many new full DOFs."""


@dataclass(frozen=True)
class Part:
    """Nodes of a substructure with their full DOFs, and its elements."""

    nodes: dict[str, tuple[int, int]]
    positions: dict[str, float]
    elements: list[Element]
    held: bool = False


def part_of(section: Mapping[str, Any], archives: Mapping[str, Mapping[str, Any]], new: NewDofs) -> Part:
    """Return the part of a section; `archives` holds what its file holds.

    A reversed part is seen from its other end: s becomes -s, and so rz = dx/ds becomes -rz with x as before.
    """
    part = _forwards(section, archives, new)
    if not section.get("reversed"):
        return part
    turned = {dofs[1] for dofs in part.nodes.values()}
    return replace(part, elements=[_mirrored(element, turned) for element in part.elements])


def _mirrored(element: Element, turned: set[int]) -> Element:
    """Return an element with the opposite sign of some of its DOFs."""
    signs = np.array([-1.0 if dof in turned else 1.0 for dof in element.dofs])
    both = np.outer(signs, signs)
    return Element(element.dofs, element.M * both, element.K * both, element.C * both, element.D * both)


def _forwards(section: Mapping[str, Any], archives: Mapping[str, Mapping[str, Any]], new: NewDofs) -> Part:
    model = section["model"]
    if model == "timoshenko_beam":
        return _beam(section, new)
    if model == "lumped":
        nodes = {f"m{i + 1}": tuple(new(2)) for i in range(len(section["masses"]))}
        masses = list(zip(nodes.values(), section["masses"], strict=True))
        elements = [inertia(dofs[0], mass["mass"]) for dofs, mass in masses]
        elements += [inertia(dofs[1], mass["inertia"]) for dofs, mass in masses if "inertia" in mass]
        positions = dict(zip(nodes, (mass["position"] for mass in section["masses"]), strict=True))
        return Part(nodes, positions, elements)
    if model == "ground":
        nodes = {f"g{i + 1}": tuple(new(2)) for i in range(len(section["positions"]))}
        return Part(nodes, dict(zip(nodes, section["positions"], strict=True)), [], held=True)
    return _imported(section, archives[section["file"]], new)


def _beam(section: Mapping[str, Any], new: NewDofs) -> Part:
    """A chain of elements; those of a taper have the diameters at their middle."""
    material, position = section["material"], 0.0
    nodes, positions, elements = {"n1": tuple(new(2))}, {"n1": 0.0}, []
    for piece in section["sections"]:
        length = piece["length"] / piece["elements"]
        for number in range(piece["elements"]):
            middle = (number + 0.5) / piece["elements"]
            before = nodes[f"n{len(nodes)}"]
            position += length
            label = f"n{len(nodes) + 1}"
            nodes[label], positions[label] = tuple(new(2)), position
            shape = _cross_section(piece, middle, material["poisson"])
            elements.append(beam_element((*before, *nodes[label]), length, shape, material))
    return Part(nodes, positions, elements)


def _imported(section: Mapping[str, Any], archive: Mapping[str, Any], new: NewDofs) -> Part:
    """Matrices of a file in the file's units; what the table does not name as x or rz is an inner DOF."""
    units = {"length": 1.0, "mass": 1.0, "stiffness": 1.0} | section.get("units", {})
    words = {0: section.get("displacement", "x"), 1: section.get("rotation", "rz")}
    size = len(archive["K"])
    dofs, factor = np.full(size, -1), np.ones(size)
    nodes: dict[str, tuple[int, int]] = {}
    positions: dict[str, float] = {}
    table = zip(archive["nodes"], archive["directions"], archive["positions"], archive["rows"], strict=True)
    for node, direction, position, row in table:
        for axis, word in words.items():
            if direction == word.lstrip("-"):
                x, rz = nodes.setdefault(str(node), tuple(new(2)))
                positions[str(node)] = position * units["length"]
                dofs[row - 1] = (x, rz)[axis]
                factor[row - 1] = (-1.0 if word.startswith("-") else 1.0) * (units["length"] if axis else 1.0)
    inner = np.flatnonzero(dofs < 0)
    dofs[inner] = new(len(inner))
    both = np.outer(factor, factor)
    M, K, C, D = (np.asarray(archive.get(name, 0.0)) * both for name in "MKCD")
    loss = section.get("loss_factor", 0.0) * K
    matrices = units["mass"] * M, units["stiffness"] * K, units["stiffness"] * C, units["stiffness"] * (D + loss)
    return Part(nodes, positions, [Element(dofs.tolist(), *matrices)])


def _cross_section(piece: Mapping[str, Any], along: float, poisson: float) -> tuple[float, float, float]:
    """Area, second moment and shear coefficient at a fraction of a section's length."""
    if "width" in piece:
        return rectangular_section(piece["width"], piece["height"], poisson)
    outer, inner = piece["outer"], piece.get("inner", 0.0)
    outer += along * (piece.get("outer_end", outer) - outer)
    return round_section(outer, inner + along * (piece.get("inner_end", inner) - inner), poisson)
