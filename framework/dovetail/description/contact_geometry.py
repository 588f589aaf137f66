"""Whether the cross-sections of the parts that a joint connects can lie where its model has them.

They are known of parts that give their `section_at`; along a layer those halfway between two nodes count.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from dovetail.description.changed_joint import axes_of
from dovetail.description.joint_sides import Side, mm
from dovetail.errors import Fault, PluginError
from dovetail.interfaces import JointModel, SectionOutline, plugin_errors

_ROUGH = 0.02
"""Share of the thinner part by which sizes that are rounded or measured may contradict each other."""
_ACROSS = 0.1
"""Cosine of the angle up to which a direction is across the axis of a part."""


def face_faults(model: JointModel, sides: Mapping[str, Side]) -> Iterator[str]:
    """Yield how two parts overlap of which a joint has the faces meet at its nodes.

    Parameters
    ----------
    model : JointModel
    sides : mapping of str to Side
        By the names of the ports.
    """
    for side, other, spans in _faces(model, sides):
        overlap = spans[:, :, 1].min(axis=0) - spans[:, :, 0].max(axis=0)
        place = int(np.argmax(overlap - _allowed(spans)))
        if overlap[place] > _allowed(spans)[place]:
            yield f"{_across_faces(side, other, spans[:, place])}: they overlap by {mm(overlap[place])}."


def contact_warnings(model: JointModel, sides: Mapping[str, Side]) -> Iterator[str]:
    """Yield what looks wrong with the cross-sections of the parts of a joint, a sentence or two each.

    Parameters
    ----------
    model : JointModel
    sides : mapping of str to Side
    """
    for side, other, spans in _faces(model, sides):
        yield from _faces_apart(model, side, other, spans)
    for inside, around, diameter in model.nested_ports:
        yield from _not_nested(sides[inside], sides[around], diameter)
    if not (model.faces_meet or model.nested_ports or model.spans_a_distance):
        for first, second in model.facing_ports:
            yield from _in_one_place(sides[first], sides[second])


def _faces(model: JointModel, sides: Mapping[str, Side]) -> Iterator[tuple[Side, Side, NDArray[np.float64]]]:
    """Yield the sides whose faces meet, and from where to where each reaches across them, (2, n, 2) [m]."""
    if not model.faces_meet:
        return
    for first, second in model.facing_ports:
        found = [_spans(sides[name], axes_of(model)[:, 0]) for name in (first, second)]
        if found[0] is not None and found[1] is not None and sides[first].part != sides[second].part:
            yield sides[first], sides[second], np.stack([found[0], found[1]])


def _faces_apart(model: JointModel, side: Side, other: Side, spans: NDArray[np.float64]) -> Iterator[str]:
    """Yield that the nodes do not lie on the faces, or that the faces lie next to each other."""
    upper = np.argmax(spans.sum(axis=2), axis=0)
    places = np.arange(spans.shape[1])
    distance = np.maximum(np.abs(spans[upper, places, 0]), np.abs(spans[1 - upper, places, 1]))
    place = int(np.argmax(distance - _allowed(spans)))
    if distance[place] > _allowed(spans)[place]:
        yield (
            f"its nodes do not lie on the faces of the parts. {_across_faces(side, other, spans[:, place])}. The "
            f"contact of '{model.name}' acts at the nodes."
        )
    aside = np.cross(axes_of(model)[:, 0], _axis(side))
    first, second = (_spans(one, aside / (np.linalg.norm(aside) or 1.0)) for one in (side, other))
    if first is None or second is None or not _parallel(side, other):
        return
    gap = max(first[:, 0].max() - second[:, 1].min(), second[:, 0].max() - first[:, 1].min())
    if gap >= 0.0:
        yield f"the faces of '{side.part}' and '{other.part}' do not meet: the parts lie next to each other."


def _not_nested(inside: Side, around: Side, diameter: float | None) -> Iterator[str]:
    """Yield how a part cannot lie in the bore of another, or their contact not between them."""
    pairs = _section_pairs(inside, around)
    if not pairs or not all(one.is_round and hub.is_round for one, hub in pairs) or not _parallel(inside, around):
        return
    shaft, hub = max(pairs, key=lambda pair: pair[0].height - pair[1].bore)
    slack = _ROUGH * shaft.height
    thickness, width = np.mean([(one.height, hub.bore) for one, hub in pairs], axis=0)
    if not hub.bore and len(pairs) > 1:
        yield (
            f"'{around.part}' has no bore where '{inside.part}' is in it, so that the mass and the stiffness there "
            "count twice. Give its sections an 'inner' diameter."
        )
    elif hub.bore and shaft.height > hub.bore + slack:
        yield f"'{inside.part}', of {mm(shaft.height)}, is thicker than the bore of '{around.part}', of {mm(hub.bore)}."
    elif diameter is not None and not thickness - slack <= diameter <= width + slack:
        yield (
            f"its contact has a diameter of {mm(diameter)}, which is not between those of '{inside.part}', "
            f"{mm(thickness)}, and of the bore of '{around.part}', {mm(width)}."
        )
    for side, section in ((inside, shaft), (around, hub)):
        off = float(np.hypot(*section.center))
        if off > slack:
            yield f"the centroid of '{side.part}' is {mm(off)} away from the nodes, which lie on the axis of the joint."


def _in_one_place(side: Side, other: Side) -> Iterator[str]:
    """Yield that two parts that lie along each other in space overlap where they are joined."""
    if not side.in_space or side.part == other.part or len(side.nodes) < 2 or not _parallel(side, other):
        return
    depths = list[NDArray[np.float64]]()
    for direction in (_rotation(side)[:, 0], _rotation(side)[:, 2]):
        found = [_spans(one, direction) for one in (side, other)]
        if found[0] is None or found[1] is None:
            return
        spans = np.stack([found[0], found[1]])
        depths.append(spans[:, :, 1].min(axis=0) - spans[:, :, 0].max(axis=0) - _allowed(spans))
    nested = any(
        min(pair, key=_height).height <= max(pair, key=_height).bore * (1.0 + _ROUGH)
        for pair in _section_pairs(side, other)
    )
    if np.min(depths, axis=0).max() > 0.0 and not nested:
        yield (
            f"'{side.part}' and '{other.part}' overlap in space where it joins them, so that mass and stiffness there "
            "count twice. Are their places right, and the 'offset' of their sections?"
        )


def _spans(side: Side, direction: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """Return from where to where a part reaches from its nodes along a direction of the assembly, (n, 2) [m]."""
    own, sections = _rotation(side).T @ direction, _sections(side)
    if not sections or abs(own[1]) > _ACROSS:
        return None
    return np.array([section.bounds(own) for section in sections])


def _sections(side: Side) -> Sequence[SectionOutline]:
    """Return the cross-sections between the nodes, or at the node; none if one is not known."""
    at = side.positions
    places = (at[1:] + at[:-1]) / 2.0 if len(at) > 1 else at
    with plugin_errors(side.model, f"substructure '{side.part}' ({side.model.name})"):
        sections = [side.model.section_at(float(place)) for place in places]
        if strange := [one for one in sections if one is not None and not isinstance(one, SectionOutline)]:
            problem = f"its section_at returns {strange[0]!r:.60}."
            raise PluginError(
                Fault(f"substructure '{side.part}' ({side.model.name})", problem, "a SectionOutline, or None")
            )
    known = [section for section in sections if section is not None]
    return known if len(known) == len(sections) else []


def _rotation(side: Side) -> NDArray[np.float64]:
    return np.eye(3) if side.placement is None else side.placement.rotation


def _axis(side: Side) -> NDArray[np.float64]:
    return -_rotation(side)[:, 1]


def _section_pairs(side: Side, other: Side) -> list[tuple[SectionOutline, SectionOutline]]:
    """Return the cross-sections of two parts at the places where they face each other; none if one is not known."""
    return list(zip(_sections(side), _sections(other), strict=False))


def _height(section: SectionOutline) -> float:
    return section.height


def _parallel(side: Side, other: Side) -> bool:
    return abs(float(_axis(side) @ _axis(other))) > 1.0 - _ROUGH


def _allowed(spans: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the contradictions of sizes (n,) that their rounding may be [m]."""
    return np.asarray(_ROUGH * np.ptp(spans, axis=2).min(axis=0))


def _across_faces(side: Side, other: Side, spans: NDArray[np.float64]) -> str:
    reaches = [
        f"'{one.part}' reaches from {mm(low)} to {mm(high)}"
        for one, (low, high) in zip((side, other), spans, strict=True)
    ]
    return f"Along x of the joint, across its faces, {reaches[0]} from the nodes and {reaches[1]}"
