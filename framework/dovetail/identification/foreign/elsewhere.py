"""A measurement at another point than described, or on parts of another size."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from dovetail.assembly import Assembly
from dovetail.errors import DovetailError
from dovetail.frf import Frf
from dovetail.identification.foreign.changes import Change
from dovetail.identification.foreign.coarse import distance

__all__ = ["at_other_points", "of_other_sizes"]

_CLOSEST = 2
_AS_CLOSE = 1.1
"""Over the least distance, up to which the second is looked into too."""
_SIZES = (-0.2, -0.1, -0.05, 0.05, 0.1, 0.2)
"""Logarithms of the ratio of another size to the one described."""


def at_other_points(assembly: Assembly, target: Frf) -> tuple[tuple[Assembly, str], ...]:
    """Return the assembly measured where it comes nearest to the measurement, and in words where that is."""
    found = [(distance(other, target), words, other) for other, words in _points(assembly)]
    found.sort(key=lambda one: one[0])
    return tuple((other, words) for apart, words, other in found[:_CLOSEST] if apart < _AS_CLOSE * found[0][0])


def _points(assembly: Assembly) -> Iterator[tuple[Assembly, str]]:
    description = assembly.description
    response = description.response
    inside = {
        (attached.substructure, node)
        for joint in description.joints.values()
        for attached in joint.connection.attachments
        for node in attached.nodes
    }
    for name, part in description.substructures.items():
        for index, node in enumerate(part.nodes):
            if (name, index) in inside or (name, index) == (response.substructure, response.node):
                continue
            elsewhere = replace(response, substructure=name, node=index)
            words = f"it were measured on the {name} at {1e3 * node.position:.4g} mm"
            yield Assembly(replace(description, responses=(elsewhere,))), words


def of_other_sizes(possible: Sequence[Change], target: Frf) -> tuple[tuple[Change, float], ...]:
    """Return the changes of parts, and by how much, with which the assembly comes nearest to the measurement."""
    found = []
    for change in possible:
        for amount in _SIZES:
            try:
                found.append((distance(change.altered(amount), target), change, amount))
            except (DovetailError, np.linalg.LinAlgError):
                continue
    return tuple((change, amount) for _, change, amount in sorted(found, key=lambda one: one[0])[:_CLOSEST])
