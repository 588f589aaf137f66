"""Whether the nodes that a joint brings together can lie at the same places: their order, their sense, their spacing.

Each part counts positions from an origin of its own, so differences of positions are compared. The axis of a reversed
part runs against that of the assembly. If a part has a place in space, all have one, and facing nodes meet there.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from dovetail.description.changed_joint import axes_of
from dovetail.description.contact_geometry import face_faults
from dovetail.description.joint_sides import Side, declared_gap, has_positions, mm
from dovetail.documents.fault_list import FaultList
from dovetail.documents.tree import Path
from dovetail.interfaces import JointModel
from dovetail.units import format_point

_ROUNDING = 1e-3
"""Difference of two distances, over the span of the port, that positions rounded to three digits may have."""
_SMALL = 1e-6
"""Distance of two points in space, over the extent of the larger part, that their rounded digits may have."""
_LEAST = 1e-9
"""Difference [m] of two positions that is due to binary fractions."""


def check_facing(path: Path, model: JointModel, sides: Mapping[str, Side], faults: FaultList) -> None:
    """Report nodes of a joint that cannot lie where those are that they face, or where the joint's model has them.

    Parts whose faces meet at their nodes must not overlap either.

    Parameters
    ----------
    path : Path
        Of the joint's section.
    model : JointModel
    sides : mapping of str to Side
        By the names of the ports.
    faults : FaultList
    """
    found = list(facing_faults(model, sides))
    for port, problem, remedy in found:
        faults.add((*path, "connect", port, "at"), problem, remedy=remedy)
    for problem in face_faults(model, sides) if not found else ():
        remedy = (
            "Put the parts on the two sides of their nodes, those of a 'spatial_beam' by the 'offset' of its sections, "
            "or turn x of the joint across the faces with 'axes'."
        )
        faults.add(path, problem, remedy=remedy)


def facing_faults(model: JointModel, sides: Mapping[str, Side]) -> Iterator[tuple[str, str, str]]:
    """Yield the port, the problem and the remedy of each fault that `check_facing` reports.

    Parameters
    ----------
    model : JointModel
    sides : mapping of str to Side
    """
    comparable = {name: side for name, side in sides.items() if len(side.nodes) > 1 and has_positions(side.model)}
    facing = [pair for pair in model.facing_ports if sides[pair[0]].part != sides[pair[1]].part]  # a ring may close
    faced = {name for pair in facing for name in pair}
    refused, reported = set[str](), set[tuple[str, bytes]]()
    for name, side in comparable.items():
        declared = side.port.positions
        problem, remedy = _off_axes(model, side)
        if not problem and (declared or name in faced):
            problem, remedy = _disorder(side)
        if declared and not problem:
            problem, remedy = _against_model(model, side, np.array(declared))
        same = remedy, np.diff(side.positions).round(9).tobytes()
        if problem and same not in reported:  # a wrong length in the joint's section makes both sides wrong
            yield name, problem, remedy
        refused |= {name} if problem else set()
        reported |= {same} if problem else set()
    for first, second in (*facing, *_declared_pairs(model)):
        if sides[first].in_space:
            if not refused and (problem := _describe_offset(model, sides[first], sides[second])):
                refused.add(second)
                yield second, problem, "Correct the places of the parts, or list the nodes that face each other."
        elif {first, second} <= comparable.keys() - refused:
            problem, remedy = _mismatch(comparable[first], comparable[second])
            if problem:
                refused.add(second)
                yield second, problem, remedy


def _declared_pairs(model: JointModel) -> list[tuple[str, str]]:
    """Return pairs of ports that the joint's model places on its own axis, so that their nodes run the same way."""
    declared = [port.name for port in model.ports if port.positions is not None and port.nodes > 1]
    return [(declared[0], name) for name in declared[1:]]


def _disorder(side: Side) -> tuple[str, str]:
    """Return what is wrong with the order of a port's nodes, and the remedy; two empty texts if nothing is."""
    steps = np.diff(side.along) * (side.sense or 1.0)
    back = np.flatnonzero(steps < -_tolerance(side.along))
    if not back.size:
        return "", ""
    first = int(back[0])
    before, after = (mm(side.positions[node]) for node in (first, first + 1))
    problem = f"the nodes of '{side.part}' are not in order along the part: {after} comes after {before}."
    return problem, f"List them in the order in which they lie on '{side.part}'."


def _against_model(model: JointModel, side: Side, declared: NDArray[np.float64]) -> tuple[str, str]:
    """Return how a port's nodes lie otherwise than in the joint's model, and the remedy."""
    if model.internal_dofs and side.sense < 0:  # rotations of the joint's own nodes are counted along its axis
        ends = f"from {mm(declared[0])} to {mm(declared[-1])}"
        problem = (
            f"the nodes of '{side.part}' run {side.ends}, against the axis of the joint model '{model.name}', on which "
            f"they lie {ends}."
        )
        return problem, _remedy(side)
    found, expected = np.abs(side.along - side.along[0]), declared - declared[0]
    node = int(np.argmax(np.abs(found - expected)))
    if abs(found[node] - expected[node]) <= _tolerance(expected):
        return "", ""
    problem = (
        f"the node of '{side.part}' at {mm(side.positions[node])} is {mm(found[node])} from the first one, at "
        f"{mm(side.positions[0])}; in the joint model '{model.name}' it is {mm(expected[node])} from it."
    )
    return problem, f"Correct the positions, or the lengths among the options of '{model.name}'."


def _mismatch(side: Side, other: Side) -> tuple[str, str]:
    """Return how the nodes of another port cannot lie where those are that they face, and the remedy."""
    if side.sense * other.sense < 0:
        problem = (
            f"the nodes of '{other.part}' run {other.ends}, and those of '{side.part}' that they face {side.ends}, "
            f"which is the other way{_because(side, other)}."
        )
        return problem, _remedy(other)
    if side.port.positions is not None and other.port.positions is not None:
        return "", ""  # each was compared with the joint's model
    found, expected = (np.abs(one.along - one.along[0]) for one in (other, side))
    node = int(np.argmax(np.abs(found - expected)))
    if abs(found[node] - expected[node]) <= _tolerance(expected):
        return "", ""
    problem = (
        f"the node of '{other.part}' at {mm(other.positions[node])} is {mm(found[node])} from the first one, at "
        f"{mm(other.positions[0])}; the node of '{side.part}' that it faces, at {mm(side.positions[node])}, is "
        f"{mm(expected[node])} from the first one there, at {mm(side.positions[0])}."
    )
    return problem, "Facing nodes lie at the same places of the assembly: list nodes with equal distances."


def _describe_offset(model: JointModel, side: Side, other: Side) -> str:
    """Return how two nodes that face each other lie at different points of the assembly, or an empty text."""
    if not side.has_points or not other.has_points:
        return ""
    gaps = other.points - side.points
    axes, along = axes_of(model), declared_gap(side, other)
    between = gaps[0] if model.spans_a_distance else -axes[:, 1] * along
    distances = np.linalg.norm(gaps - between, axis=1)
    node = int(np.argmax(distances))
    limit = _LEAST + _SMALL * max(float(np.ptp(one.all_points, axis=0).max()) for one in (side, other))
    shifted = between - axes[:, 0] * (axes[:, 0] @ between) if model.spans_a_distance else np.zeros(3)
    if distances[node] > limit:
        offset = f"it is {mm(distances[node])} away"
        if along:
            offset += f" from where '{model.name}' has it, {mm(along)} further along"
        if model.spans_a_distance:
            offset = f"the way between them differs by {mm(distances[node])} from that of the first pair"
    elif np.linalg.norm(shifted) > limit:
        offset = f"not opposite to it: it is {mm(float(np.linalg.norm(shifted)))} away along the faces"
    else:
        return ""
    return (
        f"the node of '{other.part}' at {format_point(other.points[node])} faces that of '{side.part}' at "
        f"{format_point(side.points[node])}, but {offset}."
    )


def _off_axes(model: JointModel, side: Side) -> tuple[str, str]:
    """Return how a port's nodes lie off those axes of the joint along which its model has them, and the remedy."""
    if not side.in_space or not model.nodes_along or not side.has_points:
        return "", ""
    steps = (side.points - side.points[0]) @ axes_of(model)
    along = ["xyz".index(name) for name in model.nodes_along]
    off = np.linalg.norm(np.delete(steps, along, axis=1), axis=1)
    node = int(np.argmax(off))
    if off[node] <= _LEAST + _ROUNDING * float(np.abs(steps).max()):
        return "", ""
    first, last = (format_point(side.points[at]) for at in (0, node))
    problem = (
        f"the nodes of '{side.part}' at {first} and {last} do not lie along {' and '.join(model.nodes_along)} of the "
        f"joint, as in the joint model '{model.name}'."
    )
    return problem, "Turn the joint to its nodes with 'axes', or correct the places of the parts."


def _because(*sides: Side) -> str:
    names = sorted({f"'{side.part}'" for side in sides if side.reversed})
    return f", as {' and '.join(names)} {'is' if len(names) == 1 else 'are'} reversed" if names else ""


def _remedy(side: Side) -> str:
    if side.axis is not None:
        return "Turn the joint with 'axes', so that its nodes run along -y of it, or list them in the other order."
    if side.reversed:
        return (
            f"'{side.part}' is reversed: list its nodes in the order in which they lie along the assembly, or remove "
            "'reversed' from its section."
        )
    return (
        f"If '{side.part}' is described from its other end, write 'reversed: true' into its section; if not, list its "
        "nodes in the other order."
    )


def _tolerance(along: NDArray[np.float64]) -> float:
    return _LEAST + _ROUNDING * float(np.ptp(along))
