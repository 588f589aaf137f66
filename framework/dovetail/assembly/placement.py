"""Where joints place the parts of an assembly along its axis, and what looks wrong with it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from dovetail.assembly.model import Assembly
from dovetail.description.changed_joint import axes_of
from dovetail.description.checked import Description, JointEntry
from dovetail.description.contact_geometry import contact_warnings, face_faults
from dovetail.description.facing import facing_faults
from dovetail.description.joint_sides import Side, declared_gap, has_positions, sides_of
from dovetail.description.unknown_parts import UnknownPart
from dovetail.interfaces import JointModel, SubstructureModel
from dovetail.synthesis.joint_evaluation import depends_on_frequency, joint_matrices
from dovetail.units import format_quantity

_SLIGHT = 1e-3
"""Share of a part's length within which a joint is at its end."""


def placement_warnings(assembly: Assembly) -> Iterator[str]:
    """Yield what looks wrong with where joints place parts, or could not be compared.

    Parameters
    ----------
    assembly : Assembly
        Facing nodes that have positions lie at the same places in the middle of the ranges.

    Yields
    ------
    str
        Nodes without positions; two parts that extend from their joint to the same side, as they do if one of them is
        described from its other end; two joints of the same parts that place them differently; and unknown lengths
        that move nodes away from those that they face.
    """
    description = assembly.description
    pairs: dict[tuple[str, str], list[tuple[str, float]]] = {}
    for name, joint in description.joints.items():
        sides = sides_of(joint.connection, description.substructures, description.placements)
        yield from _without_positions(name, joint.connection.model, sides)
        yield from (f"joints.{name}: {warning}" for warning in contact_warnings(joint.connection.model, sides))
        for first, second in joint.connection.model.facing_ports:
            side, other = sides[first], sides[second]
            if side.in_space:  # their points were compared
                yield from _twisted(name, side)
                yield from _twisted(name, other)
                yield from _across_the_axis(name, joint.connection.model, side)
                continue
            if side.part != other.part and has_positions(side.model) and has_positions(other.model):
                offset = float(np.mean(side.along) - np.mean(other.along)) + declared_gap(side, other)
                parts = sorted([side.part, other.part])
                pairs.setdefault((parts[0], parts[1]), []).append((name, offset if parts[0] == side.part else -offset))
                if len(side.nodes) > 1 or _holds_rotations(name, joint):
                    yield from _on_one_side(name, side, other)
    for (part, other_part), offsets in pairs.items():
        yield from _placed_differently(description, part, other_part, offsets)
    yield from _moved_away(assembly)


def _moved_away(assembly: Assembly) -> Iterator[str]:
    """Yield a warning about unknown lengths that move nodes or faces of a joint, once a joint."""
    description, warned = assembly.description, set[str]()
    for column, parameter in enumerate(assembly.parameters):
        if parameter.unit != "m":
            continue
        for end in (0.0, 1.0):
            fraction = np.full(len(assembly.parameters), 0.5)
            fraction[column] = end
            moved = _parts_at(assembly, fraction)
            for name, joint in description.joints.items():
                sides = sides_of(joint.connection, {**description.substructures, **moved}, description.placements)
                problem = _moved_sides(joint.connection.model, sides)
                if problem and name not in warned:
                    warned.add(name)
                    value = format_quantity(parameter.lower if end == 0.0 else parameter.upper, "m")
                    yield f"joints.{name}: with {parameter.name} at {value} {problem}"


def _moved_sides(model: JointModel, sides: dict[str, Side]) -> str:
    """Return what is wrong with the nodes or the faces of a joint once a part has other lengths, or an empty text."""
    for _, problem, _ in facing_faults(model, sides):
        return f"{problem} Give the length within the joint a section of its own that is known."
    for problem in face_faults(model, sides):
        return f"{problem} Give the sections within the joint known sizes, or a smaller range."
    return ""


def _parts_at(assembly: Assembly, fraction: NDArray[np.float64]) -> dict[str, SubstructureModel]:
    """Return the parts with unknown options for fractions of the ranges (n_params,), by their names."""
    values, moved = assembly.by_joint(assembly.from_unit(fraction)), dict[str, SubstructureModel]()
    for name, entry in assembly.description.unknown_parts.items():
        model = entry.connection.model
        if isinstance(model, UnknownPart) and name in values:
            options = dict(zip([p.name for p in model.parameters], values[name].tolist(), strict=True))
            with suppress(ValueError):  # options that the part cannot have are refused elsewhere
                moved[name] = model.made_with(options)
    return moved


def _without_positions(name: str, model: JointModel, sides: dict[str, Side]) -> Iterator[str]:
    """Yield a warning about nodes of which nothing shows whether they lie where the joint needs them."""
    faced = {port for pair in model.facing_ports for port in pair}
    for port, side in sides.items():
        compared = not side.in_space and (port in faced or side.port.positions is not None)
        if compared and len(side.nodes) > 1 and not side.model.grounded and not has_positions(side.model):
            labels = ", ".join(f"'{side.model.nodes[node].label}'" for node in side.nodes[:4])
            more = ", ..." if len(side.nodes) > 4 else ""
            yield (
                f"joints.{name}: the nodes of '{side.part}' have no positions that differ, so that nothing shows "
                f"whether its nodes {labels}{more} lie where they have to, in this order. Give them positions."
            )


def _twisted(name: str, side: Side) -> Iterator[str]:
    """Yield a warning about a joint that acts in a displacement and about the axis of a part, not about its bending."""
    axes = [direction for direction in side.port.directions if direction.startswith("r")]
    points = side.all_points
    if len(axes) != 1 or len(axes) == len(side.port.directions) or side.model.grounded or len(points) < 2:
        return
    lengths = np.ptp(points, axis=0)
    across = np.delete(lengths, "xyz".index(axes[0][1]))
    if lengths.max() > 0.0 and across.max() <= _SLIGHT * lengths.max():
        yield (
            f"joints.{name}: of the rotations of '{side.part}' it acts in {axes[0]} only, the torsion of that part, "
            "which does not resist its bending. If that is not meant, give the joint 'axes' of its own."
        )


def _across_the_axis(name: str, model: JointModel, side: Side) -> Iterator[str]:
    """Yield a warning about a bar that does not run along the axis of a joint at one of its nodes, as of a bearing."""
    points = side.all_points - side.all_points.mean(axis=0)
    if not model.nodes_along or len(side.nodes) > 1 or side.model.grounded or len(points) < 2:
        return
    lengths = np.linalg.svd(points, compute_uv=False)
    along = ["xyz".index(axis) for axis in model.nodes_along]
    off = np.linalg.norm(np.delete(points @ axes_of(model), along, axis=1))
    if lengths[1:].max(initial=0.0) <= _SLIGHT * lengths[0] and off > _SLIGHT * lengths[0]:
        axes = " and ".join(model.nodes_along)
        yield (
            f"joints.{name}: '{side.part}' does not run along {axes} of the joint, the axis of '{model.name}'. "
            "Turn the joint with 'axes', such as 'axes: {y: x, x: z}' for one along x."
        )


def _on_one_side(name: str, side: Side, other: Side) -> Iterator[str]:
    """Yield a warning about two parts that both end at their joint and extend to the same side of it."""
    reaches = [_reach(side), _reach(other)]
    extends = [tuple(length > _SLIGHT * sum(reach) for length in reach) for reach in reaches]
    if extends[0] != extends[1] or sum(extends[0]) != 1:
        return
    overlap = min(max(reach) for reach in reaches)
    yield (
        f"joints.{name}: '{side.part}' and '{other.part}' extend from it to the same side and lie next to each other "
        f"over {format_quantity(overlap, 'm')}. If '{other.part}' extends the other way, it is described from its "
        "other end: write 'reversed: true' into its section, and list its nodes in the other order."
    )


def _reach(side: Side) -> tuple[float, float]:
    """Return how far a part extends from its joint [m], against the assembly's axis and along it."""
    nodes = np.array([node.position for node in side.model.nodes]) * (-1.0 if side.reversed else 1.0)
    return float(np.min(side.along) - np.min(nodes)), float(np.max(nodes) - np.max(side.along))


def _holds_rotations(name: str, joint: JointEntry) -> bool:
    """Return whether a joint couples rotations of its parts, which have another sign if one of them is reversed."""
    model = joint.connection.model
    rotations = np.flatnonzero(model.node_dofs.rotations)
    if any(dof in rotations for pair in model.merged_dofs for dof in pair):
        return True
    if depends_on_frequency(model):
        return True
    middle = [joint.fixed.get(p.name, float(p.from_unit(np.array(0.5)))) for p in joint.parameters]
    matrices = joint_matrices(name, model, np.array([middle], dtype=np.float64)).sets[0]
    return any(bool(getattr(matrices, letter)[0, rotations, :].any()) for letter in "KCD")


def _placed_differently(
    description: Description, part: str, other: str, offsets: list[tuple[str, float]]
) -> Iterator[str]:
    """Yield a warning about joints between the same two parts that place one at different positions of the other."""
    lengths = [
        float(np.ptp([node.position for node in description.substructures[name].nodes])) for name in (part, other)
    ]
    for (first, offset), (second, other_offset) in combinations(offsets, 2):
        distance = abs(offset - other_offset)
        if distance > 1e-9 + _SLIGHT * min(lengths):
            yield (
                f"joints.{second}: its nodes place '{other}' {format_quantity(distance, 'm')} away along '{part}' from "
                f"where the joint '{first}' places it. Are all positions right, and is neither part described from "
                "its other end?"
            )
            return
