"""The points of a response and a force as files name them: ``3+x``, ``tool:5-y``, or in words, ``tool, 20 mm, x``."""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from dovetail.measurement.quantity_words import word_set
from dovetail.units import to_si

DOF = re.compile(r"(?:([^\s:]{1,10}):)?(\d{1,9})(?:([+-]?)(rx|ry|rz|x|y|z))?", re.IGNORECASE)
"""The name of a DOF: substructure, node, sense and direction; only the node is required."""
_NAME_LENGTH = 10
"""Characters of a substructure's name that a universal file keeps."""
_ROUNDING, _SMALLEST_DISTANCE = 0.01, 2e-4
"""Relative and absolute [m] difference of two positions that are the same, since texts give few digits."""
_TOKEN = re.compile(r"(?<![\w.,])\d+(?:[.,]\d+)?\s*(?:mm|cm|m|um|in|inch)\b|[^\W_]+")
_LENGTH = re.compile(r"\d+(?:[.,]\d+)?\s*(?:mm|cm|m|um|in|inch)")
_NODE_AND_AXIS = re.compile(r"(?<![\w.])(\d{1,9})\s?:?([+-]?)(rx|ry|rz|x|y|z)(?!\w)")
_NODE_WORD = re.compile(r"(?:node|point|pt|dof|knoten|punkt|no|nr)\W*(\d{1,9})(?![\w.,]*\d)")
_AXES = word_set("x y z rx ry rz")
_ROTATIONS = word_set("rotation rotational angular rotary moment torque")
_NODE_WORDS = word_set("node point pt dof knoten punkt no nr")
_FILLING = _NODE_WORDS | word_set(
    "at on of in to the an a location position place direction dir axis along end side free tip left right top bottom"
    " front back middle center centre face surface sensor accelerometer hammer impact force response excitation laser"
    " vibrometer shaker impedance head load cell mini measured excited part body component substructure reference input"
    " output frf drive driving number id plus minus"
)
"""Words around the name of a point that name no other."""


@dataclass(frozen=True)
class ModelDof:
    """A DOF at which an FRF is used.

    Parameters
    ----------
    place : str
        Its point in words, such as ``"tool, 10 mm"``. The same point has the same words.
    rotation : bool
        Whether it is a rotation or a moment instead of a displacement or a force.
    part : str
        Its substructure; empty if the point is of the only one.
    label : str
        The node's label.
    labels : tuple of str
        Labels of all nodes of the part.
    position : float, optional
        m along the part.
    direction : str
        Its direction, if nodes of the model move along several axes: ``"y"``, ``"-y"`` or ``"(0.6, 0.8, 0)"``.
    """

    place: str
    rotation: bool = False
    part: str = ""
    label: str = ""
    labels: tuple[str, ...] = ()
    position: float | None = None
    direction: str = ""

    @property
    def axis(self) -> str:
        """The axis along which it is; empty if it is along none, or not known."""
        return "" if self.is_skew else self.direction.removeprefix("-")

    @property
    def is_skew(self) -> bool:
        """Whether it is along no axis of the model."""
        return self.direction.startswith("(")


class GivenDof(NamedTuple):
    """A DOF as a file gives it, in lower case; what it leaves open is empty.

    Parameters
    ----------
    text : str
        As the file has it.
    part, node, axis : str
        The axis is ``"r"`` for a rotation about an axis that is not given.
    named : tuple of str
        The model's parts that it names.
    label : str
        The label of a node of the model that it names in words.
    position : float or None
        m along the part.
    is_certain : bool
        Whether each of its words is understood; others may be prose, such as ``clamp above the tool``.
    """

    text: str
    part: str = ""
    node: str = ""
    axis: str = ""
    named: tuple[str, ...] = ()
    label: str = ""
    position: float | None = None
    is_certain: bool = True

    @property
    def is_rotation(self) -> bool:
        """Whether it is a rotation or a moment."""
        return self.axis.startswith("r")

    def same_node(self, other: GivenDof) -> bool:
        """Return whether both are certainly the same node."""
        parts_agree = not self.part or not other.part or self.part == other.part
        return bool(self.node) and self.node == other.node and parts_agree

    def other_node(self, other: GivenDof) -> bool:
        """Return whether both are certainly different nodes."""
        return bool(self.node and other.node) and not self.same_node(other)

    def other_direction(self, other: GivenDof) -> bool:
        """Return whether both are certainly along different axes, or along one in opposite senses."""
        if not (self.is_certain and other.is_certain) or {"", "r"} & {self.axis, other.axis}:
            return False
        return self.axis != other.axis or are_opposite(self.text, other.text)

    def is_other_part(self, used: ModelDof) -> bool:
        """Return whether it names only other parts than the one at which the FRF is used."""
        return bool(self.named and used.part and used.part not in self.named)

    def is_other_axis(self, used: ModelDof) -> bool:
        """Return whether words name a part of a planar model, which moves along x, and another axis."""
        in_words = not DOF.fullmatch("".join(self.text.split()))
        return used.part in self.named and self.axis in ("y", "z") and not used.direction and in_words

    def is_other_label(self, used: ModelDof) -> bool:
        """Return whether it is another node of the model than the one at which the FRF is used.

        Numbers are compared with the model's labels only if the substructure is named too, or where the description
        gives the labels to measured points.
        """
        if self.label:
            return used.label in used.labels and self.label != used.label
        is_comparable = used.part in self.named if used.part else True
        return is_comparable and {self.node, used.label} <= {*used.labels} and self.node != used.label

    def is_elsewhere(self, used: ModelDof) -> bool:
        """Return whether it is at another position along the part than the one at which the FRF is used."""
        if self.position is None or used.position is None or used.part not in self.named:
            return False
        return not math.isclose(self.position, used.position, rel_tol=_ROUNDING, abs_tol=_SMALLEST_DISTANCE)


def axes_disagree(one: tuple[GivenDof, ModelDof], other: tuple[GivenDof, ModelDof]) -> bool:
    """Return whether one direction of the model has two in the files, or two directions of the model have one."""
    (first, first_dof), (second, second_dof) = one, other
    is_comparable = first_dof.rotation == second_dof.rotation and not {"", "r"} & {first.axis, second.axis}
    is_comparable = is_comparable and not (first_dof.is_skew or second_dof.is_skew)
    return is_comparable and (first.axis == second.axis) != (first_dof.axis == second_dof.axis)


def are_opposite(response: str, force: str) -> bool:
    """Return whether the names of two DOFs have opposite senses, as ``3+x`` and ``1-x`` have."""
    matches = DOF.fullmatch(response), DOF.fullmatch(force)
    return all(matches) and [match[3] == "-" for match in matches if match].count(True) == 1


def read_dof(
    text: str, substructures: Collection[str] = (), labels: Sequence[str] = (), nouns: Collection[str] = ()
) -> GivenDof | None:
    """Return the DOF that a text names, or None if it names none.

    Parameters
    ----------
    text : str
    substructures : collection of str
        Names of the model's parts; as the keys of a mapping to whether each of them moves. Only words can name one that
        does not: as a prefix of a number, such a name may be that of the measured structure.
    labels : sequence of str
        Labels of the nodes of the part at which the FRF is used.
    nouns : collection of str
        Further words that may stand next to a name, such as ``"mass"``.
    """
    moving = _moving(substructures)
    match = DOF.fullmatch("".join(text.split()))
    if match:
        part, axis = (match[1] or "").lower(), (match[4] or "").lower()
        named = tuple(name for name in moving if part and name.lower()[:_NAME_LENGTH] == part)
        return GivenDof(text, part, str(int(match[2])), axis, named) if int(match[2]) else None
    dof = _in_words(text, tuple(substructures), labels, nouns)
    if dof is not None and dof.position is not None and not dof.named and len(moving) == 1:
        return dof._replace(named=moving)
    return dof


def _moving(substructures: Collection[str]) -> tuple[str, ...]:
    if isinstance(substructures, Mapping):
        return tuple(name for name, moves in substructures.items() if moves)
    return tuple(substructures)


def _in_words(text: str, names: Sequence[str], labels: Sequence[str], nouns: Collection[str]) -> GivenDof | None:
    plain = text.lower().replace("_", " ")
    node, axis, position = "", "", None
    if match := _NODE_AND_AXIS.search(plain):
        node, axis = str(int(match[1])), match[3]
        plain = plain.replace(match[0], " ", 1)
    elif match := _NODE_WORD.search(plain):
        node = str(int(match[1]))
        plain = plain.replace(match[0], " ", 1)
    words = _TOKEN.findall(plain)
    named, words = _take(words, names)
    marked, words = _take(words, [label for label in labels if not label.isdigit() and label.lower() not in _AXES])
    axes = [word for word in words if word in _AXES]
    lengths = [match for word in words if (match := _LENGTH.fullmatch(word))]
    if len(lengths) == 1:
        position = to_si(lengths[0][0].replace(",", "."), "m")
    turning = [word for word in words if word in _ROTATIONS]
    other = _AXES | _FILLING | _ROTATIONS | {*nouns}
    rest = [word for word in words if word not in other and not _LENGTH.fullmatch(word)]
    axis = axis or (axes[0] if len(axes) == 1 else "")
    if axis and len(rest) == 1 and not (named or node or marked):  # a name that only the laboratory knows
        node, rest = rest[0], []
    unclear = len(lengths) > 1 or len(axes) > 1 or len(marked) > 1
    if not (named or node or axes or axis or marked or lengths or turning):
        return None
    return GivenDof(
        text,
        named[0].lower()[:_NAME_LENGTH] if len(named) == 1 else "",
        node if node.strip("0") else "",
        axis or ("r" if turning else ""),
        tuple(named),
        marked[0] if len(marked) == 1 else "",
        position,
        not rest and not unclear,
    )


def _take(words: list[str], names: Sequence[str]) -> tuple[list[str], list[str]]:
    """Return the names that occur in a list of words, in the order of the names' lengths, and the other words."""
    taken, rest = list[str](), list(words)
    split = {name: _TOKEN.findall(name.lower().replace("_", " ")) for name in names}
    for name, own in sorted(split.items(), key=lambda item: -len(item[1])):
        for start in range(len(rest) - len(own) + 1) if own else ():
            if rest[start : start + len(own)] == own:
                taken.append(name)
                rest[start : start + len(own)] = ["a"]
                break
    return taken, rest
