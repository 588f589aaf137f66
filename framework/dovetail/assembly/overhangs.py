"""Free ends of substructures that joints hold, which may protrude by more or less than described."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.description import Description
from dovetail.errors import DovetailError
from dovetail.interfaces import StructuralMatrices, SubstructureModel

_ROUNDING = 1e-9
"""Difference of the matrices of a divided and of the whole substructure up to which the two are the same."""


@dataclass(frozen=True)
class Overhang:
    """The free end of a substructure that a joint holds.

    Parameters
    ----------
    substructure, joint : str
    length : float
        From the joint's nearest node to the end [m].
    unchanged : float
        Length between the end and the farthest response on it [m], which stays as it is.
    first, last : int
        Nodes between which the substructure is lengthened or shortened.
    end : float
        Position of the end [m].
    """

    substructure: str
    joint: str
    length: float
    unchanged: float
    first: int
    last: int
    end: float

    def lengthen(self, model: SubstructureModel, length: float) -> SubstructureModel:
        """Return the substructure with another overhang [m], longer than `unchanged`, and as many nodes."""
        factor = (length - self.unchanged) / (self.length - self.unchanged)
        return _stretch(model, self.first, self.last, factor)


def find_overhangs(description: Description, most_nodes: int) -> Iterator[Overhang]:
    """Yield the free ends of all substructures that joints hold and that are described by sections.

    Parameters
    ----------
    description : Description
    most_nodes : int
        Of a substructure; larger ones take too long.
    """
    for name, model in description.known_parts.items():
        held = {node: joint for joint, nodes in _attachments(description, name) for node in nodes}
        if not held or len(model.nodes) > most_nodes or not _has_sections(model):
            continue
        measured = [response.node for response in description.responses if response.substructure == name]
        positions, last = [node.position for node in model.nodes], len(model.nodes) - 1
        low, high = min(held), max(held)
        below = max((node for node in measured if node < low), default=0)
        above = min((node for node in measured if node > high), default=last)
        if below < low and _can_divide(model, below, low):
            length, unchanged = positions[low] - positions[0], positions[below] - positions[0]
            yield Overhang(name, held[low], length, unchanged, below, low, positions[0])
        if above > high and _can_divide(model, high, above):
            length, unchanged = positions[last] - positions[high], positions[last] - positions[above]
            yield Overhang(name, held[high], length, unchanged, high, above, positions[last])


def _attachments(description: Description, substructure: str) -> Iterator[tuple[str, tuple[int, ...]]]:
    for name, joint in description.joints.items():
        for attachment in joint.connection.attachments:
            if attachment.substructure == substructure:
                yield name, tuple(attachment.nodes)


def _has_sections(model: SubstructureModel) -> bool:
    sections = getattr(model.config, "sections", None)
    return isinstance(sections, tuple) and all(
        hasattr(section, "length") and hasattr(section, "elements") for section in sections
    )


def _can_divide(model: SubstructureModel, first: int, last: int) -> bool:
    """Return whether sections can be divided at two nodes and nothing else changes; those of a taper cannot."""
    try:
        divided = _stretch(model, first, last, 1.0)
    except DovetailError:
        return False
    if len(divided.nodes) != len(model.nodes):
        return False
    matrices, divided_matrices = model.matrices(), divided.matrices()
    if not (isinstance(matrices, StructuralMatrices) and isinstance(divided_matrices, StructuralMatrices)):
        return False
    return _are_equal(matrices.M, divided_matrices.M) and _are_equal(matrices.K, divided_matrices.K)


def _are_equal(matrix: NDArray[np.float64], other: NDArray[np.float64]) -> bool:
    """Return whether two symmetric matrices are equal up to rounding, each entry on the scale of its DOFs."""
    scale = np.sqrt(np.abs(np.diag(matrix)))
    return bool(np.all(np.abs(matrix - other) <= _ROUNDING * np.outer(scale, scale)))


def _stretch(model: SubstructureModel, first: int, last: int, factor: float) -> SubstructureModel:
    """Return a substructure whose elements between two nodes are longer by a factor."""
    sections: list[Any] = []
    start = 0
    for section in model.config.sections:
        end = start + section.elements
        cuts = sorted({start, end, *(node for node in (first, last) if start < node < end)})
        for near, far in pairwise(cuts):
            length = section.length * (far - near) / section.elements * (factor if first <= near < last else 1.0)
            sections.append(section.model_copy(update={"length": length, "elements": far - near}))
        start = end
    return type(model)(model.config.model_copy(update={"sections": tuple(sections)}))
