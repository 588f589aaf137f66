"""A drawing of an assembly in space: its parts as lines between their nodes, seen from above and from one side."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from dovetail.assembly import Assembly, VibrationMode
from dovetail.description import Description, Place
from dovetail.description.joint_sides import has_points
from dovetail.description.placed_parts import direction_text
from dovetail.interfaces import DIRECTIONS, PLANAR, SubstructureModel
from dovetail.plain_text import terminal_text
from dovetail.report.figures import INK, LINES, MUTED, OCHRE, figure_of, new_figure, set_title

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_PARTS, _JOINT, _FORCE = (LINES[0], LINES[2], OCHRE, LINES[4], LINES[6]), LINES[1], LINES[3]
_AZIMUTH, _ELEVATION = np.radians([-55.0, 25.0])
_ARROW, _AXES = 0.14, 0.12
"""Length of an arrow and of the axes, over the size of the assembly."""
_HEIGHT = 4.2
"""Of a figure [inches]."""


def lies_in_space(description: Description) -> bool:
    """Return whether parts have places in space, or move in other directions than those of a plane."""
    if any(placement.in_space for placement in description.placements.values()):
        return True
    parts = [part for part in description.substructures.values() if not part.grounded]
    return any(node.directions != PLANAR or node.point is not None for part in parts for node in part.nodes)


def part_lines(part: SubstructureModel) -> list[tuple[int, int]]:
    """Return pairs of nodes between which a part is drawn: along a beam, and from the node that carries others."""
    carried = [(node.carrier, number) for number, node in enumerate(part.nodes) if node.carrier is not None]
    if carried or not len(part.outline):
        return carried
    order = np.argsort([node.position for node in part.nodes], kind="stable").tolist()
    return list(pairwise(order))


@dataclass(frozen=True, eq=False)
class _View:
    """The assembly as it is seen: the page's axes in space, and the scale."""

    right: NDArray[np.float64]
    up: NDArray[np.float64]
    size: float

    @staticmethod
    def of(points: NDArray[np.float64]) -> _View:
        right = np.array([-np.sin(_AZIMUTH), np.cos(_AZIMUTH), 0.0])
        towards = np.array([np.cos(_ELEVATION) * np.cos(_AZIMUTH), np.cos(_ELEVATION) * np.sin(_AZIMUTH), 0.0])
        towards[2] = np.sin(_ELEVATION)
        size = float(np.linalg.norm(np.ptp(points, axis=0))) or 1.0
        return _View(right, np.cross(towards, right), size)

    def on_page(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return points (n, 3) on the page (n, 2)."""
        return np.asarray(points @ np.column_stack([self.right, self.up]))


def space_figure(assembly: Assembly, ax: Axes | None = None) -> Figure:
    """Draw an assembly in space, with forces and motions as arrows along their directions.

    Parameters
    ----------
    assembly : Assembly
    ax : matplotlib axes, optional
        To draw on; a new figure by default.
    """
    description = assembly.description
    by_name = description.placed_parts
    points = {name: 1e3 * np.array([node.coordinates for node in part.nodes]) for name, part in by_name.items()}
    view = _View.of(np.concatenate([points[name] for name, part in by_name.items() if not part.grounded]))
    axes: Axes = new_figure(_HEIGHT).subplots() if ax is None else ax
    moving = [name for name, part in by_name.items() if not part.grounded]
    for number, name in enumerate(moving):
        _draw_part(axes, name, by_name[name], view.on_page(points[name]), _PARTS[number % len(_PARTS)])
    for name, entry in description.joints.items():
        _draw_joint(axes, name, description, entry.connection.attachments, points, view)
    for place, text, is_motion in _arrows(description):
        _draw_arrow(axes, place, text, points, view, is_motion=is_motion)
    _draw_axes(axes, view.on_page(np.concatenate(list(points.values()))), view)
    axes.set_aspect("equal")
    axes.set_axis_off()
    axes.margins(0.12)
    figure = figure_of(axes)
    set_title(figure if ax is None else ax, assembly.name, "Dots: nodes. Diamonds: joints. Triangles: held.")
    return figure


def _arrows(description: Description) -> list[tuple[Place, str, bool]]:
    """Return the place of each force and of each motion, its label, and whether it is a motion; forces come first.

    Responses with the same force share its arrow.
    """
    several = len(description.responses) > 1
    forces: dict[tuple[Any, ...], tuple[Place, list[str]]] = {}
    motions: list[tuple[Place, str, bool]] = []
    for response in description.responses:
        called = f" ({response.name})" if several else ""
        if response.force is not None:
            key = response.force.substructure, response.force.node, response.force.direction
            forces.setdefault(key, (response.force, []))[1].append(response.name)
        both = "" if response.force else "force and "
        motions.append((response, f"{both}{response.quantity}{called}", True))
    pushed = [(place, f"force ({', '.join(names)})" if several else "force", False) for place, names in forces.values()]
    return [*pushed, *motions]


def _draw_part(axes: Axes, name: str, part: SubstructureModel, at: NDArray[np.float64], colour: str) -> None:
    for pair in part_lines(part):
        axes.plot(*at[list(pair)].T, color=colour, linewidth=3.5, alpha=0.6, solid_capstyle="round")
    axes.plot(*at.T, "o", color=colour, markersize=3)
    middle = at[len(at) // 2]
    _write(axes, middle, name, colour, (8, -10))


def _draw_joint(
    axes: Axes,
    name: str,
    description: Description,
    attachments: Sequence[Any],
    points: dict[str, NDArray[np.float64]],
    view: _View,
) -> None:
    """Draw the nodes that a joint connects, and a line between those that lie apart, as of a strut.

    A ground without points is where the part is that it holds.
    """
    free = [end for end in attachments if not description.substructures[end.substructure].grounded]
    held = len(free) < len(attachments)
    for end in free:
        at = view.on_page(points[end.substructure][list(end.nodes)])
        axes.plot(*at.T, "^" if held else "D", color=_JOINT, markersize=7 if held else 5, zorder=3)
    known = [end for end in attachments if has_points(description.substructures[end.substructure])]
    if len(known) == 2:
        ends = view.on_page(np.array([points[end.substructure][end.nodes[0]] for end in known]))
        axes.plot(*ends.T, color=_JOINT, linewidth=1.5, linestyle="--", zorder=3)
    if free:
        _write(axes, view.on_page(points[free[0].substructure][[free[0].nodes[0]]])[0], name, _JOINT, (-8, 8))


def _draw_arrow(
    axes: Axes,
    place: Place,
    text: str,
    points: dict[str, NDArray[np.float64]],
    view: _View,
    *,
    is_motion: bool = False,
) -> None:
    """Draw an arrow that ends at a node, for a force, or begins there, for a motion, with its label if it has one."""
    colour = INK if is_motion else _FORCE
    named = place.direction
    direction = np.eye(3)[DIRECTIONS.index(named) % 3] if isinstance(named, str) else np.asarray(named, dtype=float)
    way = view.on_page(_ARROW * view.size * direction[np.newaxis])[0]
    at = view.on_page(points[place.substructure][[place.node]])[0]
    tail, tip = (at, at + way) if is_motion else (at - way, at)
    shape = "-|>" if not place.rotation else "-|>,head_length=0.6"
    style = {"arrowstyle": shape, "color": colour, "linewidth": 1.6, "shrinkA": 0, "shrinkB": 0 if is_motion else 3}
    axes.annotate("", tip, tail, arrowprops=style, zorder=4)
    axes.plot(*np.array([tail, tip]).T, alpha=0.0)  # the arrow is part of what is shown
    about = "about" if place.rotation else "along"
    said = direction_text(place.direction).removeprefix("r")
    if text and is_motion:
        _write(axes, tip, f"{text} {about} {said}", colour, (6, 6))
    elif text:
        _write(axes, tail, f"{text} {about} {said}", colour, (-6, 14), "right")


def _draw_axes(axes: Axes, shown: NDArray[np.float64], view: _View) -> None:
    corner = shown.min(axis=0) - 0.12 * view.size
    for axis, name in enumerate("xyz"):
        tip = corner + view.on_page(_AXES * view.size * np.eye(3)[[axis]])[0]
        axes.annotate("", tip, corner, arrowprops={"arrowstyle": "->", "color": MUTED, "shrinkA": 0, "shrinkB": 0})
        axes.plot(*np.array([corner, tip]).T, alpha=0.0)
        _write(axes, tip, name, MUTED, (2, 2))


def _write(
    axes: Axes, at: NDArray[np.float64], text: str, colour: str, aside: tuple[int, int], end: str = "left"
) -> None:
    axes.annotate(
        terminal_text(text),
        (at[0], at[1]),
        aside,
        textcoords="offset points",
        color=colour,
        ha=end,
        fontsize=9,
        zorder=5,
        parse_math=False,
    )


def space_shape(description: Description, mode: VibrationMode) -> list[dict[str, Any]]:
    """Return a mode's motion as plain values, for each part that moves.

    Parameters
    ----------
    description : Description
    mode : VibrationMode

    Returns
    -------
    list of dict
        ``name``, the nodes' ``points`` [mm], ``lines`` between them as pairs of their numbers, and their ``motion`` in
        space, of which the longest is 1, at the moment at which the nodes move most.
    """
    moving = {name: part for name, part in description.placed_parts.items() if not part.grounded}
    motions = {name: _displacements(part, mode.shapes[name].ravel()) for name, part in moving.items()}
    every = np.concatenate(list(motions.values()))
    turn = np.exp(-0.5j * np.angle(np.sum(every**2)))
    longest = float(np.linalg.norm((turn * every).real, axis=1).max()) or 1.0
    return [
        {
            "name": name,
            "points": np.round(1e3 * np.array([node.coordinates for node in part.nodes]), 2).tolist(),
            "lines": part_lines(part),
            "motion": np.round((turn * motions[name]).real / longest, 4).tolist(),
        }
        for name, part in moving.items()
    ]


def _displacements(part: SubstructureModel, shape: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Return the displacements (n, 3) of the nodes of a part along x, y and z."""
    dofs, moved = part.node_dofs, np.zeros((len(part.nodes), 3), dtype=np.complex128)
    for number, node in enumerate(part.nodes):
        for axis, direction in enumerate(DIRECTIONS[:3]):
            if direction in node.directions:
                moved[number, axis] = sum(weight * shape[dof] for weight, dof in dofs.terms(number, {direction: 1.0}))
    return moved
