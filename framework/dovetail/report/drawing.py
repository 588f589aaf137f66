"""A drawing of an assembly: a section of its parts along their axis, with nodes, joints, forces and motions."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from dovetail.assembly import Assembly
from dovetail.description import Description, Place
from dovetail.description.placed_parts import direction_text
from dovetail.errors import DovetailError, Fault, PluginError, listing
from dovetail.interfaces import SubstructureModel, plugin_errors
from dovetail.plain_text import terminal_text
from dovetail.report.figures import INK, LINES, OCHRE, WIDTH, figure_of, new_figure, set_title, style_axes, width_of
from dovetail.report.space_drawing import lies_in_space, space_figure, space_shape
from dovetail.synthesis import Attachment

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_LEAST, _MOST = 0.9, 3.5
"""Limits in inches across the axis for all rows: thinner drawings are stretched, thicker reduced."""
_STRETCHES = (1, 2, 3, 4, 5, 10, 20, 30, 50, 100)
_SYMBOL, _GAP, _ARROW, _BESIDE, _LINE, _CHARACTER = 0.13, 0.5, 0.32, 0.07, 0.22, 0.085
"""Inches: half a box, gap between rows, arrow, distance of force and motion, line of text, width of a character."""
_CLOSE = 1.05
"""Largest ratio of a part's diameter to the bore around it; above 1, since tapers are drawn in steps."""
_PARTS, _JOINT, _FORCE = (LINES[0], LINES[2], OCHRE, LINES[4], LINES[6]), LINES[1], LINES[3]


@dataclass
class _Part:
    """A part on the page [mm], with its origin at `start` along the common axis and its axis at `y`, in a row.

    Its own axis runs along the common one (`sense` 1) or, if it is reversed, against it (-1).
    """

    model: SubstructureModel
    colour: str
    start: float
    sense: float
    pieces: Sequence[tuple[float, float, float, float]]
    row: int = 0
    y: float = 0.0

    def at(self, nodes: Iterable[int] | None = None) -> list[float]:
        """Return the positions of some or all nodes along the axis."""
        chosen = range(len(self.model.nodes)) if nodes is None else nodes
        return [self.start + self.sense * 1e3 * self.model.nodes[node].position for node in chosen]

    @property
    def ends(self) -> tuple[float, float]:
        """Start and end of the part along the axis."""
        along = [*self.at(), *(end for piece in self.pieces for end in piece[:2])]
        return min(along), max(along)

    def radii(self, along: float) -> tuple[float, float]:
        """Return the outer and the inner radius at a position; 0 if unknown."""
        near = [piece for piece in self.pieces if piece[0] - 1e-6 <= along <= piece[1] + 1e-6]
        return max((p[2] / 2 for p in near), default=0.0), max((p[3] / 2 for p in near), default=0.0)

    def node(self, along: float) -> float:
        """Return the position of a node across the axis: in the wall of a tube, else on the axis."""
        outer, inner = self.radii(along)
        return self.y + ((outer + inner) / 2 if inner else 0.0)

    def fits(self, other: _Part, room: float) -> bool:
        """Return whether two parts can share a row, one after the other or one entirely inside the other."""
        (start, end), (first, last) = self.ends, other.ends
        gap = (0.0 if self.pieces and other.pieces else room) - 1e-6
        if start >= last + gap or first >= end + gap:
            return True
        meeting = [(p, q) for p in self.pieces for q in other.pieces if min(p[1], q[1]) - max(p[0], q[0]) > 1e-6]
        inside = [(p[2] <= _CLOSE * q[3], q[2] <= _CLOSE * p[3]) for p, q in meeting]
        return any(all(pairs) for pairs in zip(*inside, strict=True))


@dataclass
class _Label:
    along: float
    y: float
    text: str
    colour: str
    up: bool = True

    @property
    def width(self) -> float:
        """Width of the text in inches, with some margin."""
        return _CHARACTER * (len(self.text) + 1)


def drawing_text(assembly: Assembly) -> str:
    """Return a description of a drawing in words, for screen readers."""
    description = assembly.description
    described = listing(f"{name} ({part.name})" for name, part in description.substructures.items())
    joints = [
        f"{name} ({joint.model.name}), {' to '.join(end.substructure for end in joint.attachments)}"
        for name, joint in ((name, entry.connection) for name, entry in description.joints.items())
    ]
    at = "; ".join(description.response_labels)
    return f"Drawing of {assembly.name}. Parts: {described}. Joints: {'; '.join(joints) or 'none'}. Response: {at}."


def assembly_figure(assembly: Assembly, ax: Axes | None = None) -> Figure:
    """Draw an assembly as described in `dovetail.plot_assembly`."""
    if lies_in_space(assembly.description):
        return space_figure(assembly, ax)
    description = assembly.description
    drawn = _parts(description)
    low, high = min(part.ends[0] for part in drawn.values()), max(part.ends[1] for part in drawn.values())
    room = max(width_of(ax) - 1.0, 1.0)
    rows = _rows(drawn, 3.0 * _SYMBOL * ((high - low) or 1.0) / room)
    thick = [max((piece[2] for part in row for piece in part.pieces), default=0.0) for row in rows]
    along = min(room / ((high - low) or 1.0), _MOST / (sum(thick) or 1.0))  # inches to a millimetre
    stretch = next((s for s in _STRETCHES if not sum(thick) or s * along * sum(thick) >= _LEAST), _STRETCHES[-1])
    page = _Page(along, along * stretch, ax)
    for row, thickness in zip(rows, thick, strict=True):
        page.add_row(row, thickness / 2)
    for name, part in drawn.items():
        page.draw_part(name, part, up=part.row == 0 or part.row < len(rows) - 1)
    for name, joint in description.joints.items():
        page.draw_joint(name, drawn, joint.connection.attachments)
    for response in description.responses:
        called = f" ({response.name})" if len(description.responses) > 1 else ""
        page.draw_arrow(drawn, response.force or response, f"force{called}", _FORCE, -_BESIDE)
        page.draw_arrow(drawn, response, f"{response.quantity}{called}", INK, _BESIDE)
    page.finish(low, high, f"Position, from the origin of {next(iter(drawn))} [mm]" if high > low else "")
    above = page.figure if ax is None else ax
    set_title(above, assembly.name, _note(drawn, stretch if any(thick) else 0, len(rows)))
    return page.figure


def _parts(description: Description) -> dict[str, _Part]:
    """Return the parts, moved along the axis so that each joint connects nodes at the same position."""
    substructures, starts = description.substructures, dict[str, float]()
    reversed_parts = {name for name, placement in description.placements.items() if placement.reversed}
    sense = {name: -1.0 if name in reversed_parts else 1.0 for name in substructures}
    ports = [
        {
            part: sense[part] * np.mean([substructures[part].nodes[n].position for n in nodes]).item()
            for part, nodes in ((end.substructure, end.nodes) for end in ends)
        }
        for ends in (joint.connection.attachments for joint in description.joints.values())
    ]
    for name in substructures:
        starts.setdefault(name, 0.0)
        for joint in ports * len(ports):  # each pass places one more at least, if any can be placed
            known = next((starts[part] + at for part, at in joint.items() if part in starts), None)
            starts = starts if known is None else {part: known - at for part, at in joint.items()} | starts
    drawn = {}
    for number, (name, model) in enumerate(substructures.items()):
        with plugin_errors(model, f"substructure '{name}' ({model.name})"):
            outline = list(model.outline)
            try:
                pieces = np.reshape(outline, (-1, 4)).astype(np.float64)
            except (TypeError, ValueError):
                remedy = "Give (start, stop, outer, inner) of each section."
                where, problem = f"substructure '{name}' ({model.name})", f"its outline is {outline!r:.60}."
                raise PluginError(Fault(where, problem, remedy=remedy)) from None
        if sense[name] < 0:
            pieces = np.column_stack([-pieces[:, 1], -pieces[:, 0], pieces[:, 2:]])[::-1]
        placed = 1e3 * (pieces + np.array([1.0, 1.0, 0.0, 0.0]) * starts[name])
        drawn[name] = _Part(model, _PARTS[number % len(_PARTS)], 1e3 * starts[name], sense[name], placed.tolist())
    return drawn


def _rows(drawn: Mapping[str, _Part], room: float) -> list[list[_Part]]:
    """Put each part into the first row where it fits, first those with an outline, last the ground."""
    rows: list[list[_Part]] = []
    for part in sorted(drawn.values(), key=lambda part: (not part.pieces, part.model.grounded)):
        part.row = next((n for n, row in enumerate(rows) if all(part.fits(other, room) for other in row)), len(rows))
        rows += [[]] * (part.row == len(rows))
        rows[part.row] = [*rows[part.row], part]
    return rows


def _note(drawn: Mapping[str, _Part], stretch: int, rows: int) -> str:
    scale = "True proportions." if stretch == 1 else f"Stretched {stretch} times across the axis."
    said = [f"Section along the axis. {scale}" if stretch else "No part gives its outline: not to scale."]
    said += ["What would overlap is drawn side by side."] * (rows > 1)
    said += ["Boxes: parts without an outline."] * (stretch > 0 and not all(part.pieces for part in drawn.values()))
    said += ["Hatched: does not move."] * any(part.model.grounded for part in drawn.values())
    return " ".join([*said, "Dots: nodes. Diamonds: joints."])


def mode_shapes(assembly: Assembly, theta: ArrayLike, count: int) -> list[dict[str, Any]]:
    """Return the motion of the parts' nodes in the lowest elastic modes, as plain values.

    Parameters
    ----------
    assembly : Assembly
    theta : (n_params,) array
        SI.
    count : int

    Returns
    -------
    list of dict
        ``frequency`` [Hz] and ``damping`` ratio, and for each part that moves its ``name``, the nodes' positions
        ``along`` the common axis [mm] and their motion ``across`` it, of which the largest is 1: that of the moment at
        which the nodes move most. In space as `space_shape` returns them. Empty if a part has no matrices.
    """
    try:
        modes = assembly.modes(theta, count)
    except DovetailError:
        return []
    in_space = lies_in_space(assembly.description)
    drawn, shapes = {} if in_space else _parts(assembly.description), []
    for mode in modes:
        frequency, damping = round(mode.natural_frequency, 2), round(mode.damping_ratio, 6)
        if in_space:
            in_three = space_shape(assembly.description, mode)
            shapes.append({"frequency": frequency, "damping": damping, "parts": in_three})
            continue
        moved = np.concatenate([shape[:, 0] for shape in mode.shapes.values()])
        turn = np.exp(-0.5j * np.angle(np.sum(moved**2)))
        across = {name: (turn * shape[:, 0]).real for name, shape in mode.shapes.items() if name in drawn}
        across = {name: values for name, values in across.items() if not drawn[name].model.grounded}
        largest = max((values[np.argmax(np.abs(values))] for values in across.values()), key=abs)
        scaled = {name: np.round(values / (largest or 1.0), 4) for name, values in across.items()}
        parts = [
            {"name": name, "along": np.round(drawn[name].at(), 2).tolist(), "across": values.tolist()}
            for name, values in scaled.items()
        ]
        shapes.append({"frequency": frequency, "damping": damping, "parts": parts})
    return shapes


@dataclass
class _Page:
    """Axes in millimetres, which grow downwards row by row; `along` and `across` are inches per millimetre.

    They are `ax`, or those of a new figure.
    """

    along: float
    across: float
    ax: Axes | None = None
    floor: float = 0.0
    labels: list[_Label] = field(default_factory=list)

    def __post_init__(self) -> None:
        if self.ax is None:
            self.figure = new_figure(1.0)
            self.figure.set_layout_engine("compressed")  # axes of a given aspect take no more room than they need
        else:
            self.figure = figure_of(self.ax)
        self.axes: Axes = self.figure.subplots() if self.ax is None else self.ax

    def add_row(self, row: Sequence[_Part], radius: float) -> None:
        """Place the axis of the parts of a row below all previous rows."""
        half = max(radius, _SYMBOL / self.across)
        for part in row:
            part.y = self.floor - half - (_GAP / self.across if part.row else 0.0)
        self.floor = row[0].y - half

    def draw_part(self, name: str, part: _Part, *, up: bool) -> None:
        """Draw a part as a section, or as a box around its nodes, with its name."""
        style: dict[str, Any] = {
            "fill": True,
            "facecolor": f"{part.colour}38",
            "edgecolor": part.colour,
            "linewidth": 0.9,
        }
        if part.pieces:
            start, _, outer, inner = np.array(part.pieces).T
            edges = np.append(start, part.pieces[-1][1])
            self.axes.stairs(
                part.y + outer / 2, edges, baseline=part.y + np.where(inner > 0, inner, -outer) / 2, **style
            )
            if inner.any():
                lower = np.where(inner > 0, part.y - inner / 2, np.nan)
                self.axes.stairs(lower, edges, baseline=part.y - outer / 2, **style)
        else:
            (low, high), wide, tall = part.ends, _SYMBOL / self.along, _SYMBOL / self.across
            x, y = [low - wide, high + wide, high + wide, low - wide], [part.y - tall] * 2 + [part.y + tall] * 2
            self.axes.fill(x, y, **style, hatch="////" if part.model.grounded else None)
        at = part.at()
        self.axes.plot(at, [part.node(place) for place in at], "o", color=part.colour, markersize=2.8)
        middle = sum(part.ends) / 2
        self.labels.append(_Label(middle, part.node(middle), name, part.colour, up))

    def draw_joint(self, name: str, drawn: Mapping[str, _Part], ends: Sequence[Attachment]) -> None:
        """Draw lines between the nodes that a joint connects, with a diamond in the middle."""
        rows = [drawn[end.substructure].row for end in ends]
        ports = [
            [self._facing(drawn[end.substructure], at, rows) for at in drawn[end.substructure].at(end.nodes)]
            for end in ends
        ]
        are_equal = len({len(port) for port in ports}) == 1
        groups = list(zip(*ports, strict=True)) if are_equal else [[point for port in ports for point in port]]
        middles = [np.mean(group, axis=0) for group in groups]
        for group, middle in zip(groups, middles, strict=True):
            for point in group:
                self.axes.plot(*zip(point, middle, strict=True), color=_JOINT, linewidth=1.2, zorder=3)
        self.axes.plot(*np.transpose(middles), "D", color=_JOINT, markersize=4, zorder=3.5)
        x, y = middles[len(middles) // 2]
        self.labels.append(_Label(float(x), float(y), name, _JOINT))

    def _facing(self, part: _Part, along: float, rows: Sequence[int]) -> tuple[float, float]:
        """Return the position of a node, or of the surface there that faces the joint's parts in other rows."""
        if min(rows) == max(rows):
            return along, part.node(along)
        outer = part.radii(along)[0] if part.pieces else _SYMBOL / self.across
        return along, part.y + (outer if part.row > min(rows) else -outer)

    def draw_arrow(self, drawn: Mapping[str, _Part], place: Place, text: str, colour: str, aside: float) -> None:
        """Draw an arrow for a force or a motion, from the surface at a node, with its label."""
        part = drawn[place.substructure]
        (at,) = part.at([place.node])
        x, y = at + aside / self.along, part.y + (part.radii(at)[0] if part.pieces else _SYMBOL / self.across)
        style = {"arrowstyle": "-|>", "color": colour, "linewidth": 1.6, "shrinkA": 0, "shrinkB": 0}
        tip, tail = (x, y + _ARROW / self.across), (x, y)
        if place.rotation:
            tip, tail, style["connectionstyle"] = (
                (at - 2 * aside / self.along, y),
                (at + 2 * aside / self.along, y),
                "arc3,rad=1.2",
            )
        self.axes.annotate("", tip, tail, arrowprops=style, zorder=4)
        self.labels.append(_Label(x, y + _ARROW / self.across, f"{text}, {direction_text(place.direction)}", colour))

    def finish(self, low: float, high: float, name: str) -> None:
        """Write the labels above and below the parts, and set the size of the page."""
        middle, half = (low + high) / 2, (width_of(self.ax) / 2 - 0.3) / self.along
        ends = []
        for up in (True, False):
            labels = sorted((label for label in self.labels if label.up is up), key=lambda label: label.along)
            sign, edge = (1.0, 0.0) if up else (-1.0, self.floor)
            edge = sign * max(sign * y for y in (edge, *(label.y for label in labels)))
            lines = max(1, int(np.ceil(sum(label.width for label in labels) / (2 * half * self.along))))
            for line in reversed(range(lines)):  # a nearer line hides what leads to one behind it
                y = edge + sign * (0.14 + _LINE * line) / self.across
                self._write(labels[line::lines], y, middle - half, middle + half)
            ends.append(edge + sign * ((0.14 + _LINE * lines) if labels else 0.05) / self.across)
        self.axes.set(
            xlim=(middle - half, middle + half), ylim=ends[::-1], xlabel=name, aspect=self.across / self.along
        )
        if self.ax is None:
            self.figure.set_size_inches(WIDTH, (ends[0] - ends[1]) * self.across + 1.4)
        style_axes(self.axes)
        self.axes.grid(visible=False)
        self.axes.yaxis.set_visible(False)
        self.axes.xaxis.set_visible(bool(name))
        for side in ("left", "bottom") if not name else ("left",):
            self.axes.spines[side].set_visible(False)

    def _write(self, labels: Sequence[_Label], y: float, first: float, last: float) -> None:
        """Write labels in one line, moved so that none covers another, each with a leader to its object."""
        widths = np.array([label.width / self.along for label in labels])
        x = np.array([label.along for label in labels])
        for _ in range(200):
            overlap = np.maximum((widths[1:] + widths[:-1]) / 2 - np.diff(x), 0.0) / 2
            x = x + np.append(0.0, overlap) - np.append(overlap, 0.0)
            x = np.clip(x, first + widths / 2, last - widths / 2)
        for label, place in zip(labels, x, strict=True):
            leader = {"arrowstyle": "-", "color": label.colour, "linewidth": 0.6, "shrinkA": 0, "shrinkB": 0}
            self.axes.annotate(
                terminal_text(label.text),
                (label.along, label.y),
                (place, y),
                arrowprops=leader,
                color=label.colour,
                fontsize=9.5,
                ha="center",
                va="bottom" if label.up else "top",
                parse_math=False,
                bbox={"boxstyle": "square,pad=0.1", "facecolor": "white", "edgecolor": "none"},
                zorder=5,
            )
