"""How far a part stands out of its joint: its free end longer or shorter, joint and response at their distances."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.assembly import Description
from dovetail.errors import DovetailError
from dovetail.interfaces import StructuralMatrices, SubstructureModel

__all__ = ["Overhang", "overhangs"]

_SAME = 1e-9


@dataclass(frozen=True)
class Overhang:
    """The free end of a part that a joint holds.

    Parameters
    ----------
    part, joint : str
    length : float
        From the joint's nearest node to the end [m].
    shortest : float
        What of it stays as it is, between the end and a response [m].
    first, last : int
        Nodes between which the part is longer or shorter; what lies between the end and a response stays as it is.
    end : float
        Position of the end [m].
    """

    part: str
    joint: str
    length: float
    shortest: float
    first: int
    last: int
    end: float

    def changed(self, model: SubstructureModel, length: float) -> SubstructureModel:
        """Return the part with another length [m] beyond the joint, above the shortest, and as many nodes."""
        by = (length - self.shortest) / (self.length - self.shortest)
        return _stretched(model, self.first, self.last, by)


def overhangs(description: Description, most_nodes: int) -> Iterator[Overhang]:
    """Yield the free ends of all parts that joints hold and that are described by sections.

    Parameters
    ----------
    description : Description
    most_nodes : int
        Of a part; larger ones take too long.
    """
    for name, part in description.substructures.items():
        held = {node: joint for joint, nodes in _attached(description, name) for node in nodes}
        if not held or len(part.nodes) > most_nodes or not _has_sections(part):
            continue
        measured = [response.node for response in description.responses if response.substructure == name]
        positions, last = [node.position for node in part.nodes], len(part.nodes) - 1
        low, high = min(held), max(held)
        below = max((node for node in measured if node < low), default=0)
        above = min((node for node in measured if node > high), default=last)
        if below < low and _divides(part, below, low):
            length, shortest = positions[low] - positions[0], positions[below] - positions[0]
            yield Overhang(name, held[low], length, shortest, below, low, positions[0])
        if above > high and _divides(part, high, above):
            length, shortest = positions[last] - positions[high], positions[last] - positions[above]
            yield Overhang(name, held[high], length, shortest, high, above, positions[last])


def _attached(description: Description, part: str) -> Iterator[tuple[str, tuple[int, ...]]]:
    for joint, described in description.joints.items():
        for attached in described.connection.attachments:
            if attached.substructure == part:
                yield joint, tuple(attached.nodes)


def _has_sections(part: SubstructureModel) -> bool:
    sections = getattr(part.config, "sections", None)
    return isinstance(sections, tuple) and all(
        hasattr(section, "length") and hasattr(section, "elements") for section in sections
    )


def _divides(part: SubstructureModel, first: int, last: int) -> bool:
    """Say whether sections can be divided at two nodes without another change; those of a taper cannot."""
    try:
        divided = _stretched(part, first, last, 1.0)
    except DovetailError:
        return False
    if len(divided.nodes) != len(part.nodes):
        return False
    own, other = part.matrices(), divided.matrices()
    if not (isinstance(own, StructuralMatrices) and isinstance(other, StructuralMatrices)):
        return False
    return _same(own.M, other.M) and _same(own.K, other.K)


def _same(one: NDArray[np.float64], other: NDArray[np.float64]) -> bool:
    """Say whether two symmetric matrices are the same, on the scale of their DOFs."""
    size = np.sqrt(np.abs(np.diag(one)))
    return bool(np.all(np.abs(one - other) <= _SAME * np.outer(size, size)))


def _stretched(part: SubstructureModel, first: int, last: int, by: float) -> SubstructureModel:
    """Return a part whose elements between two nodes are longer by a factor."""
    sections: list[Any] = []
    start = 0
    for section in part.config.sections:
        end = start + section.elements
        cuts = sorted({start, end, *(node for node in (first, last) if start < node < end)})
        for near, far in pairwise(cuts):
            factor = by if first <= near < last else 1.0
            length = factor * section.length * (far - near) / section.elements
            sections.append(section.model_copy(update={"length": length, "elements": far - near}))
        start = end
    return type(part)(part.config.model_copy(update={"sections": tuple(sections)}))
