"""Draws every joint and substructure that ships with Dovetail, for docs/models.md: ``python docs/make_drawings.py``.

Ports, parameters, nodes and numbers of DOFs are those of the models themselves. Each drawing has its own paper, light
or dark as the reader's system asks, so that it can be read on any page.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from html import escape
from pathlib import Path

from dovetail import JointModel, SubstructureModel
from dovetail_plugins.joints.bearing import Bearing
from dovetail_plugins.joints.bolted import Bolted
from dovetail_plugins.joints.bushing import Bushing
from dovetail_plugins.joints.collet import Collet
from dovetail_plugins.joints.interference_fit import InterferenceFit
from dovetail_plugins.joints.rigid import BallJoint, Hinge, Rigid, RigidLink
from dovetail_plugins.joints.spring_damper import SpringDamper
from dovetail_plugins.joints.strut import Strut
from dovetail_plugins.substructures.ground import Ground
from dovetail_plugins.substructures.lumped import Lumped
from dovetail_plugins.substructures.rigid_body import RigidBody
from dovetail_plugins.substructures.spatial_beam import SpatialBeam
from dovetail_plugins.substructures.timoshenko_beam import TimoshenkoBeam

FOLDER = Path(__file__).with_name("drawings")

STYLE = """
:root { --paper: #ffffff; --ink: #1c2733; --soft: #5a6672; --a: #dbe8f5; --b: #f6e3d3; --c: #dff0e2 }
@media (prefers-color-scheme: dark) {
  :root { --paper: #1b1f24; --ink: #e6ebf0; --soft: #a3afba; --a: #24405c; --b: #5a3a22; --c: #24472c }
}
text { font: 13px system-ui, "DejaVu Sans", sans-serif; fill: var(--ink) }
.small { font-size: 11.5px; fill: var(--soft) } .name { font-weight: 600 }
.paper { fill: var(--paper) } .a { fill: var(--a) } .b { fill: var(--b) } .c { fill: var(--c) }
.line, .a, .b, .c { stroke: var(--ink); stroke-width: 1.2 } .line { fill: none } .bold { stroke-width: 2.2 }
.axis { stroke: var(--soft); stroke-width: 1; stroke-dasharray: 12 4 2 4 } .hatch { stroke: var(--soft) }
.node { fill: var(--ink) } .open { fill: var(--paper); stroke: var(--ink); stroke-width: 1.4 }
"""

TOOL_AT, HOLDER_AT = (80, 90, 100), (0, 10, 20)
"""Where the tool and the holder of the reference assembly meet their collet [mm]."""


@dataclass
class Sheet:
    """A drawing of so many units across and down, with what a screen reader says of it."""

    width: float
    height: float
    title: str
    parts: list[str] = field(default_factory=list)

    def add(self, element: str) -> None:
        """Add an element."""
        self.parts.append(element)

    def rectangle(self, kind: str, x: float, y: float, width: float, height: float) -> None:
        """Draw a part as a box of one of the kinds of `STYLE`."""
        self.add(f'<rect class="{kind}" x="{x:g}" y="{y:g}" width="{width:g}" height="{height:g}"/>')

    def path(self, kind: str, data: str) -> None:
        """Draw a line."""
        self.add(f'<path class="{kind}" d="{data}"/>')

    def text(self, x: float, y: float, words: str, kind: str = "", anchor: str = "middle") -> None:
        """Write a line of text."""
        chosen = (f' class="{kind}"' if kind else "") + ("" if anchor == "start" else f' text-anchor="{anchor}"')
        self.add(f'<text x="{x:g}" y="{y:g}"{chosen}>{escape(words)}</text>')

    def node(self, x: float, y: float, label: str = "", below: bool = True, numbers: str = "") -> None:
        """Draw a node with its label, and the numbers of its DOFs in small type."""
        self.add(f'<circle class="node" cx="{x:g}" cy="{y:g}" r="4.5"/>')
        step = 17 if below else -10
        if label:
            self.text(x, y + step, label, "name")
        if numbers:
            self.text(x, y + step + (14 if below else -14), numbers, "small")

    def spring(self, x: float, top: float, bottom: float) -> None:
        """Draw a spring between two heights."""
        start, stop = top + 0.2 * (bottom - top), bottom - 0.2 * (bottom - top)
        turns = 6
        zigzag = "".join(
            f"L{x + (7 if turn % 2 else -7):g} {start + (turn + 0.5) * (stop - start) / turns:.4g}"
            for turn in range(turns)
        )
        self.path("line", f"M{x:g} {top:g}V{start:.4g}{zigzag}L{x:g} {stop:.4g}V{bottom:g}")

    def damper(self, x: float, top: float, bottom: float) -> None:
        """Draw a damper between two heights."""
        middle = (top + bottom) / 2
        self.path("line", f"M{x:g} {top:g}V{middle - 2:g}M{x - 5:g} {middle - 2:g}h10")
        self.path(
            "line", f"M{x - 8:g} {middle - 10:g}V{middle + 9:g}h16V{middle - 10:g}M{x:g} {middle + 9:g}V{bottom:g}"
        )

    def spiral(self, x: float, top: float, bottom: float) -> None:
        """Draw a spring in rotation between two heights."""
        middle = (top + bottom) / 2
        turn = "a3 3 0 0 1 6 0a5 5 0 0 1-10 0a7 7 0 0 1 14 0a9 9 0 0 1-18 0"
        self.path("line", f"M{x:g} {top:g}V{middle:g}M{x - 1:g} {middle:g}{turn}M{x - 5:g} {middle + 7:g}V{bottom:g}")

    def contact(self, x: float, top: float, bottom: float, axes: str = "both") -> None:
        """Draw what lies between two facing nodes: spring and damper in x, spiral in rz, from bar to bar."""
        high, low = top + 13, bottom - 13
        reach = {"x": 13, "rz": 6, "both": 26}[axes]
        bars = f"M{x:g} {top:g}V{high:g}M{x - reach:g} {high:g}H{x + reach:g}"
        self.path("line", f"{bars}M{x - reach:g} {low:g}H{x + reach:g}M{x:g} {low:g}V{bottom:g}")
        if axes != "rz":
            shift = -24 if axes == "both" else -11
            self.spring(x + shift, high, low)
            self.damper(x + shift + 23, high, low)
        if axes != "x":
            self.spiral(x + (23 if axes == "both" else 0), high, low)

    def directions(self, x: float, y: float) -> None:
        """Draw the two DOFs of each node."""
        self.path("line bold", f"M{x:g} {y:g}v-32m-4.5 8l4.5-8l4.5 8")
        self.text(x - 9, y - 22, "x", "name")
        self.path("line bold", f"M{x + 14:g} {y - 2:g}a15 15 0 0 0 0-24m2 9l-2-9l9 0")
        self.text(x + 33, y - 10, "rz", "name")
        self.path("axis", f"M{x:g} {y:g}h44")
        self.text(x + 54, y + 4, "s", "small")

    def directions_in_space(self, x: float, y: float) -> None:
        """Draw the axes of a part whose nodes move in all directions."""
        self.path("line bold", f"M{x:g} {y:g}v-32m-4.5 8l4.5-8l4.5 8M{x:g} {y:g}l-20 16m9-1l-9 1l3-8")
        self.text(x + 6, y - 26, "x", "name", "start")
        self.text(x - 24, y + 18, "z", "name", "end")
        self.path("line bold", f"M{x:g} {y:g}h-32m8-4.5l-8 4.5l8 4.5")
        self.text(x - 30, y - 8, "y", "name", "end")
        self.path("axis", f"M{x:g} {y:g}h34")
        self.text(x + 44, y + 4, "s", "small")

    def ground(self, x: float, y: float) -> None:
        """Draw what does not move, below a point."""
        self.path("line", f"M{x - 26:g} {y:g}h52")
        self.path("hatch", "".join(f"M{x - 20 + 10 * step:g} {y:g}l-8 9" for step in range(5)))

    def svg(self) -> str:
        """Return the file."""
        body = "\n".join(self.parts)
        return (
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {self.width:g} {self.height:g}" '
            f'width="{self.width:g}" height="{self.height:g}" role="img">\n<title>{escape(self.title)}</title>\n'
            f'<style>{STYLE}</style>\n<rect class="paper" width="100%" height="100%" rx="8"/>\n{body}\n</svg>\n'
        )


def joint_dofs(joint: JointModel, internal: Sequence[str] = ()) -> list[tuple[str, dict[str, int]]]:
    """Return each node of a joint in the order of its local DOFs, with their numbers by direction.

    Inner nodes, named in `internal`, have x and rz.
    """
    names = [
        f"{port.name} {node}" if port.nodes > 1 else port.name
        for port in joint.ports
        for node in range(1, port.nodes + 1)
    ]
    directions = [*joint.node_dofs.directions, *[("x", "rz")] * len(internal)]
    numbers = iter(range(joint.size))
    return [
        (name, {direction: next(numbers) for direction in each})
        for name, each in zip([*names, *internal], directions, strict=True)
    ]


def _numbers(joint: JointModel | SubstructureModel, index: int) -> str:
    dofs = joint.node_dofs.at_node(index)
    return f"DOFs {dofs[0]}, {dofs[1]}" if len(dofs) == 2 else f"DOFs {dofs[0]} to {dofs[-1]}"


def draw_collet(collet: Collet) -> Sheet:
    """Draw a half section: tool on the axis, collet around it, holder outside, pulled apart across the axis."""
    sheet = Sheet(
        800,
        506,
        "Collet joint, half section pulled apart: tool nodes meet c1, c2 and c3, holder nodes meet c3, c4 and c5, each "
        "by springs and dampers; nut masses mn1 and mn2 on c1 and c2.",
    )
    across = [200 + 112 * node for node in range(5)]
    holder, sleeve, tool = 82.0, 254.0, 424.0
    sheet.rectangle("b", across[2] - 48, 16, 790 - across[2] + 48, holder - 16)
    sheet.text(780, 54, "holder", "name", "end")
    sheet.rectangle("a", 20, tool, across[2] + 22, 66)
    sheet.text(30, tool + 36, "tool", "name", "start")
    sheet.path("axis", f"M12 {tool + 66}H790")
    sheet.text(788, tool + 60, "axis", "small", "end")
    sheet.rectangle("c", across[0], sleeve - 20, across[4] - across[0], 40)
    for index, x in enumerate(across):
        sheet.node(x, sleeve)
        sheet.text(x + (9 if index < 4 else -9), sleeve - 3, f"c{index + 1}", "name", "start" if index < 4 else "end")
        words = f"{12 + 2 * index}, {13 + 2 * index}"
        sheet.text(x + (9 if index < 4 else -9), sleeve + 12, words, "small", "start" if index < 4 else "end")
    for port, nodes, y in (("holder", across[2:], holder), ("tool", across[:3], tool)):
        places = HOLDER_AT if port == "holder" else TOOL_AT
        for index, (x, at) in enumerate(zip(nodes, places, strict=True)):
            rows = (f"{port} {index + 1}", f"{at} mm", _numbers(collet, index if port == "tool" else 3 + index))
            for row, words in enumerate(rows):
                top = y + 20 if port == "tool" else y - 44
                sheet.text(x, top + 15 * row, words, "" if row == 1 else ("name", "", "small")[row])
            sheet.node(x, y)
            sheet.contact(x, *((sleeve + 20, y) if port == "tool" else (y, sleeve - 20)))
    for index, x in enumerate(across[:2]):
        sheet.path("line bold", f"M{x} {sleeve - 20}V164")
        sheet.rectangle("c", x - 28, 130, 56, 34)
        sheet.text(x, 152, f"mn{index + 1}", "name")
    sheet.text((across[0] + across[1]) / 2, 114, "nut (in x only)", "small")
    sheet.text(across[4] + 14, sleeve + 4, "collet: Dc, dc", "", "start")
    for x, y, layer in ((across[4] + 46, 148, "hc"), (across[2] + 46, 332, "tc")):
        for row, words in enumerate((f"kt_{layer}, ct_{layer}: x", f"kr_{layer}, cr_{layer}: rz", "at each pair")):
            sheet.text(x, y + 18 * row, words, "small" if row == 2 else "", "start")
    sheet.directions(50, 300)
    return sheet


def draw_facing(joint: JointModel, what: str, labels: Sequence[str], axes: str = "both") -> Sheet:
    """Draw two parts whose facing nodes meet, the first port below."""
    ports, nodes = joint.ports, joint.ports[0].nodes
    spacing = 120 if nodes > 1 else 0
    width = (380 if nodes == 1 else 460) + spacing * (nodes - 1)
    first = 150.0
    pairs = "a pair of nodes meets" if nodes == 1 else f"{nodes} pairs of nodes meet"
    sheet = Sheet(width, 262, f"{what}: {pairs} through {', '.join(labels)}.")
    upper, lower = 76.0, 208.0
    across = [first + spacing * index for index in range(nodes)]
    sheet.rectangle("b", across[0] - 40, upper - 36, width - across[0] + 20, 36)
    sheet.rectangle("a", 20, lower, across[-1] + 20, 36)
    sheet.text(width - 28, upper - 14, ports[1].name, "name", "end")
    sheet.text(30, lower + 22, ports[0].name, "name", "start")
    for index, x in enumerate(across):
        for number, y, row in ((index, lower, 18), (nodes + index, upper, -8)):
            sheet.node(x, y)
            label, _ = joint_dofs(joint)[number]
            sheet.text(x, y + row + (0 if row > 0 else -14), label if nodes > 1 else "", "name")
            sheet.text(
                x, y + row + (14 if row > 0 and nodes > 1 else 4 if row > 0 else 0), _numbers(joint, number), "small"
            )
        if axes != "rigid":
            sheet.contact(x, upper + 4, lower - 4, axes)
        else:
            sheet.path("line bold", f"M{x - 4} {upper}V{lower}M{x + 4} {upper}V{lower}")
    for row, words in enumerate(labels):
        sheet.text(
            across[-1] + (44 if axes != "rigid" else 20),
            (upper + lower) / 2 - 9 * (len(labels) - 1) + 18 * row + 4,
            words,
            "",
            "start",
        )
    sheet.directions(46, 150)
    return sheet


def draw_bearing(bearing: Bearing) -> Sheet:
    """Draw a bearing: the ring's mass and inertia go with the shaft."""
    sheet = draw_facing(bearing, "Bearing", ("k, c: x", "kr, cr: rz"))
    sheet.rectangle("c", 80, 182, 44, 26)
    sheet.text(102, 200, "m, J", "name")
    sheet.path("line bold", "M124 208H150")
    return sheet


def draw_bolted(bolted: Bolted) -> Sheet:
    """Draw a lap: the bolt goes through its middle."""
    sheet = draw_facing(bolted, "Bolted lap", ("kt, ct: x", "kr, cr: rz", "at each pair"))
    for y in (40, 244):
        sheet.rectangle("c", 246, y - (14 if y < 100 else 0), 48, 14)
    sheet.text(302, 36, "mb/2", "name", "start")
    sheet.text(302, 257, "mb/2", "name", "start")
    return sheet


def draw_interference(fit: InterferenceFit) -> Sheet:
    """Draw a shaft in a hub, stretched across the axis."""
    return draw_facing(fit, "Interference fit", ("k, c: x", "kr, cr: rz", "per unit length"))


def draw_rigid(rigid: Rigid) -> Sheet:
    """Draw nodes that are one."""
    return draw_facing(
        rigid,
        "Rigid joint",
        ("facing nodes are one", "in x and rz"),
        "rigid",
    )


def draw_spring_damper(joint: SpringDamper) -> Sheet:
    """Draw spring and damper between two nodes."""
    return draw_facing(joint, "Spring and damper", ("k, c: x", "kr, cr: rz"))


def draw_bushing(bushing: Bushing) -> Sheet:
    """Draw springs and dampers in six directions between two nodes."""
    sheet = draw_facing(bushing, "Bushing", ("k_x, c_x", "...", "k_rz, c_rz"))
    return sheet


def draw_strut(strut: Strut) -> Sheet:
    """Draw a spring and a damper along the line between two nodes."""
    return draw_facing(strut, "Strut", ("k, c: along", "the line between", "the nodes"))


def draw_ball_joint(joint: BallJoint) -> Sheet:
    """Draw two nodes that share their displacements."""
    return draw_facing(joint, "Ball joint", ("the nodes share", "x, y and z"), "rigid")


def draw_hinge(hinge: Hinge) -> Sheet:
    """Draw two nodes that share all but a rotation."""
    return draw_facing(hinge, "Hinge", ("the nodes share", "all but rz"), "rigid")


def draw_rigid_link(link: RigidLink) -> Sheet:
    """Draw two distant nodes that move as points of one rigid body."""
    return draw_facing(link, "Rigid link", ("a rigid arm", "leads from a to b"), "rigid")


def draw_beam(beam: TimoshenkoBeam | SpatialBeam) -> Sheet:
    """Draw a stepped, hollow and tapered beam with its elements and nodes."""
    in_space = isinstance(beam, SpatialBeam)
    what = "Beam in space" if in_space else "Timoshenko beam"
    sheet = Sheet(790, 256, f"{what}: sections one behind the other, divided into elements with nodes n1, n2, ...")
    scale, left, middle = 4600.0, 130.0, 130.0
    for start, stop, outer, inner in beam.outline:
        x, width = left + scale * start, scale * (stop - start)
        high, hole = scale * outer / 2 * 0.55, scale * inner / 2 * 0.55
        for top, height in (
            ((middle - high, high - hole), (middle + hole, high - hole)) if hole else ((middle - high, 2 * high),)
        ):
            sheet.rectangle("a", x, top, width, height)
    ends = [left + scale * node.position for node in beam.nodes]
    sheet.path("axis", f"M{ends[0] - 30:g} {middle}H{ends[-1] + 60:g}")
    sheet.text(ends[-1] + 72, middle + 4, "s", "small")
    for index, (x, node) in enumerate(zip(ends, beam.nodes, strict=True)):
        sheet.node(x, middle)
        sheet.text(x, middle + 78, node.label, "name")
        sheet.text(x, middle + 93, f"{1e3 * node.position:g} mm", "small")
        sheet.text(x, middle + 108, _numbers(beam, index).removeprefix("DOFs "), "small")
    sheet.text(ends[0] - 24, middle + 108, "DOFs", "small", "end")
    sheet.text((ends[0] + ends[3]) / 2, 44, "sections.0: outer, inner", "")
    sheet.text((ends[3] + ends[6]) / 2, 44, "sections.1: outer to outer_end", "")
    if in_space:
        sheet.directions_in_space(60, 96)
    else:
        sheet.directions(34, 90)
    return sheet


def draw_rigid_body(body: RigidBody) -> Sheet:
    """Draw a body with its centre of mass and its nodes."""
    sheet = Sheet(560, 216, "Rigid body: its first node carries the others; mass and inertia about the centre of mass.")
    sheet.path("a", "M170 70C200 30 420 30 470 84S490 214 320 208S140 130 170 70Z")
    sheet.add('<circle class="open" cx="320" cy="112" r="6"/>')
    sheet.text(320, 100, "center: mass, inertia, products", "small")
    for number, (node, (x, y)) in enumerate(zip(body.nodes, ((200, 90), (430, 80), (400, 150)), strict=True)):
        sheet.path("hatch", f"M200 90L{x} {y}")
        sheet.node(x, y)
        sheet.text(x, y + 18, node.label, "name")
        sheet.text(x, y + 32, _numbers(body, 0) if number == 0 else "carried", "small")
    sheet.directions_in_space(70, 120)
    return sheet


def draw_lumped(lumped: Lumped) -> Sheet:
    """Draw masses that nothing connects."""
    sheet = Sheet(460, 182, "Lumped masses m1 and m2 with x and rz; nothing connects them but joints.")
    for index, node in enumerate(lumped.nodes):
        x = 190 + 150 * index
        sheet.rectangle("a", x - 46, 70, 92, 56)
        sheet.node(x, 98)
        sheet.text(x, 146, node.label, "name")
        sheet.text(x, 162, f"DOFs {2 * index}, {2 * index + 1}", "small")
        sheet.text(x, 56, "mass, inertia")
    sheet.directions(46, 130)
    return sheet


def draw_ground(ground: Ground) -> Sheet:
    """Draw points that are held."""
    sheet = Sheet(460, 150, "Ground: points g1 and g2 that do not move.")
    for index, node in enumerate(ground.nodes):
        x = 190 + 150 * index
        sheet.node(x, 80)
        sheet.path("line bold", f"M{x} 80V100")
        sheet.ground(x, 100)
        sheet.text(x, 64, node.label, "name")
        sheet.text(x, 132, f"{1e3 * node.position:g} mm", "small")
    sheet.directions(46, 110)
    return sheet


def draw_matrices() -> Sheet:
    """Draw a mesh of which two nodes can be reached."""
    sheet = Sheet(
        620, 228, "Imported matrices: a mesh; the nodes of the table can be reached, all other DOFs are inner ones."
    )
    sheet.path("a", "M150 60L250 36L400 52L520 96L500 176L380 204L230 196L140 150Z")
    inner = [
        (210, 92),
        (290, 80),
        (370, 96),
        (440, 124),
        (250, 142),
        (330, 136),
        (400, 160),
        (200, 160),
        (320, 182),
        (460, 164),
    ]
    links = [
        (0, 1),
        (1, 2),
        (2, 3),
        (0, 4),
        (1, 5),
        (2, 5),
        (2, 6),
        (4, 5),
        (5, 6),
        (4, 7),
        (5, 8),
        (6, 9),
        (3, 9),
        (8, 6),
        (4, 8),
        (0, 7),
    ]
    sheet.path("hatch", "".join(f"M{inner[a][0]} {inner[a][1]}L{inner[b][0]} {inner[b][1]}" for a, b in links))
    for x, y in inner:
        sheet.add(f'<circle class="open" cx="{x}" cy="{y}" r="3.5"/>')
    for x, y, link, words in ((145, 105, 0, "node 17"), (512, 136, 3, "node 1042")):
        sheet.path("hatch", f"M{x} {y}L{inner[link][0]} {inner[link][1]}")
        sheet.node(x, y)
        sheet.text(x + (-10 if x < 300 else 10), y + 4, words, "name", "end" if x < 300 else "start")
    sheet.directions(46, 200)
    return sheet


def draw_measured() -> Sheet:
    """Draw a part of which only FRFs are known."""
    sheet = Sheet(560, 176, "Measured part: only its receptance H at nodes is known, nothing of its inside.")
    sheet.rectangle("b", 150, 50, 390, 96)
    sheet.text(380, 94, "H(f), receptance between its nodes", "name")
    sheet.text(380, 114, "nothing is known of the inside", "small")
    sheet.node(150, 98)
    sheet.text(160, 90, "x, rz", "", "start")
    sheet.text(160, 118, "DOFs 0, 1", "small", "start")
    sheet.directions(46, 130)
    return sheet


CAPTIONS = {
    "collet": "Half of a section along the axis, pulled apart. Local DOFs are numbered, x then rz; positions are those "
    "of the reference assembly. The middle node c3 belongs to both layers.",
    "bolted": "Half of the mass mb sits on each side, at the node in the middle (of an even number: at the two in the "
    "middle).",
    "interference_fit": "Each pair of nodes stands for the length nearest to it; `length` goes from the first pair to "
    "the last. With `pressure: linear` the stiffness is k (1 + g s), s from -1 at the first pair to 1 at the last.",
    "bearing": "m and J, the inner ring's mass and rotary inertia, sit on the shaft's node. With `motion: space` it "
    "also acts in y and z and about x.",
    "spring_damper": "With `direction: x` only k and c are there, with `direction: rz` only kr and cr.",
    "rigid": "With `direction: x` facing nodes share the displacement alone, as in a hinge; with `direction: rz` the "
    "rotation.",
    "bushing": "In each of its `directions` a spring and a damper; they may be along `axes` of the joint's own.",
    "strut": "Its nodes lie apart in space.",
    "rigid_link": "Its nodes lie apart in space. With `direction: [x, y, z]` b is free to turn.",
    "ball_joint": "All rotations are free.",
    "hinge": "About z, or the `axis` of its section.",
    "spatial_beam": "Positions run along -y, or where `place` says. The DOFs of a node are x, y, z, rx, ry and rz.",
    "rigid_body": "The first node carries the others, which have no DOFs of their own.",
    "timoshenko_beam": "A tapered section becomes uniform elements, each with the diameters at its middle.",
    "lumped": "Without `inertia` a rotation is free of effort.",
    "ground": "What is joined to such a point by `rigid` is held.",
    "matrices": "Filled: nodes that the table of DOFs names, with x and rz. Open: inner DOFs, which are condensed.",
    "measured": "As `dovetail spindle` writes it: one point with x and rz. In space, and for virtual points, a node "
    "moves in the directions that were measured.",
}
"""What is said below a drawing."""

STEEL = {"young": 200e9, "density": 7850.0}


def _example(model: type, **options: object) -> JointModel | SubstructureModel:
    return model(model.Config(**options))


def examples() -> dict[str, JointModel | SubstructureModel]:
    """Return the joints and parts that are drawn; those with all their parameters."""
    tube = {"length": 0.06, "outer": 0.04, "inner": 0.02, "elements": 3}
    taper = {"length": 0.06, "outer": 0.04, "outer_end": 0.024, "elements": 3}
    return {
        "collet": _example(Collet, material=STEEL),
        "bolted": _example(Bolted, nodes=3, bolt_mass=True),
        "interference_fit": _example(InterferenceFit, length=0.04, nodes=3, pressure="linear"),
        "bearing": _example(Bearing),
        "spring_damper": _example(SpringDamper),
        "bushing": _example(Bushing),
        "strut": _example(Strut),
        "rigid_link": _example(RigidLink),
        "rigid": _example(Rigid),
        "ball_joint": _example(BallJoint),
        "hinge": _example(Hinge),
        "spatial_beam": _example(SpatialBeam, material=STEEL, sections=[tube, taper]),
        "timoshenko_beam": _example(TimoshenkoBeam, material=STEEL, sections=[tube, taper]),
        "rigid_body": _example(
            RigidBody,
            mass=2.0,
            inertia=(3e-3, 3e-3, 3e-3),
            nodes={"foot": (0.0, 0.0, 0.0), "left": (0.0, 0.1, 0.0), "right": (0.0, 0.0, 0.1)},
        ),
        "lumped": _example(Lumped, masses=[{"mass": 1.0}, {"mass": 1.0, "inertia": 1e-4, "position": 0.01}]),
        "ground": _example(Ground, positions=[0.0, 0.1]),
    }


def drawings() -> dict[str, str]:
    """Return every drawing as SVG, by its model's name."""
    shown = examples()
    drawn: Iterable[tuple[str, Callable[..., Sheet]]] = (
        ("collet", draw_collet),
        ("bolted", draw_bolted),
        ("interference_fit", draw_interference),
        ("bearing", draw_bearing),
        ("spring_damper", draw_spring_damper),
        ("bushing", draw_bushing),
        ("strut", draw_strut),
        ("rigid_link", draw_rigid_link),
        ("rigid", draw_rigid),
        ("ball_joint", draw_ball_joint),
        ("hinge", draw_hinge),
        ("spatial_beam", draw_beam),
        ("timoshenko_beam", draw_beam),
        ("rigid_body", draw_rigid_body),
        ("lumped", draw_lumped),
        ("ground", draw_ground),
    )
    sheets = {name: draw(shown[name]) for name, draw in drawn}
    sheets |= {"matrices": draw_matrices(), "measured": draw_measured()}
    return {name: sheet.svg() for name, sheet in sheets.items()}


if __name__ == "__main__":
    FOLDER.mkdir(exist_ok=True)
    for name, text in drawings().items():
        (FOLDER / f"{name}.svg").write_text(text, encoding="utf-8")
